"""``dfvs-sim vehicle``: what its options mean."""

import argparse

import pytest

from dfvs_core.errors import ConfigError
from dfvs_sim.commands.vehicle import add_options, config_from_args
from dfvs_sim.dynamics.estimate_errors import EstimateGrade
from dfvs_sim.dynamics.wind import WindGrade
from dfvs_sim.vehicle.motion.flight import VehicleConfig


def config(*words: str) -> VehicleConfig:
    parser = argparse.ArgumentParser()
    add_options(parser)
    return config_from_args(parser.parse_args(words)).vehicle


def test_without_options_the_estimate_is_the_truth_in_calm_air() -> None:
    assert config() == VehicleConfig()


def test_estimate_and_wind_take_names() -> None:
    chosen = config("--estimate", "medium", "--wind", "breeze")
    assert (chosen.estimate, chosen.wind) == (EstimateGrade.MEDIUM, WindGrade.BREEZE)


def test_wind_takes_a_velocity_as_well() -> None:
    chosen = config("--wind", "1.5,-2")
    assert (chosen.wind_north_m_s, chosen.wind_east_m_s) == (1.5, -2.0)
    assert chosen.wind is WindGrade.CALM


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--estimate", "good"), "perfect, low, medium, high"),
        (("--wind", "storm"), "calm, breeze, windy"),
        (("--wind", "1"), "two numbers"),
        (("--velocity-noise", "0.02"), "--estimate"),
        (("--position-drift", "0.02"), "--estimate"),
        (("--system-id", "300"), "1 to 250"),
        (("--companion-port", "0"), "1 to 65535"),
        (("--gcs-port", "65536"), "1 to 65535"),
        (("--companion-local-port", "-1"), "0 to 65535"),
        (("--gcs-local-port", "70000"), "0 to 65535"),
        (("--seed", "-1"), "0 or more"),
        (("--ready-after", "nan"), "0 or more"),
        (("--ground-z", "nan"), "-1000 to 1000"),
        *((("--start", start), "4 numbers") for start in ("1,2,3", "a,b,c,d", "0,0,0,nan")),
    ],
)
def test_what_cannot_be_read_is_refused_with_what_can(words: tuple[str, ...], told: str) -> None:
    with pytest.raises(ConfigError, match=words[0]) as error:
        config(*words)
    assert told in str(error.value)
