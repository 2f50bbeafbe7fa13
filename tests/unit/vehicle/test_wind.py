"""Wind: a steady part and gusts, drawn from the seed."""

import math

import numpy as np
import pytest
from vehicle_in_hand import hovering

from dfvs_sim.dynamics.wind import STRENGTHS, Wind, WindGrade

DT_S = 0.004


def blowing(grade: WindGrade, seed: int, north_m_s: float = 0.0) -> Wind:
    return Wind(STRENGTHS[grade], north_m_s, 0.0, np.random.default_rng(seed))


@pytest.mark.parametrize("north_m_s", [0.0, 1.5])
def test_calm_air_and_a_steady_wind_alone_have_no_gusts(north_m_s: float) -> None:
    wind = blowing(WindGrade.CALM, 0, north_m_s)
    assert {wind.step(DT_S) for _ in range(100)} == {(north_m_s, 0.0)}


@pytest.mark.parametrize("grade", [WindGrade.BREEZE, WindGrade.WINDY])
def test_speed_and_gusts_have_the_sizes_of_the_grade(grade: WindGrade) -> None:
    wind, strength = blowing(grade, 1), STRENGTHS[grade]
    v = np.array([wind.step(0.1) for _ in range(100_000)])
    # 10 000 s are over 600 correlation times: 3 sigma are 12 % of a deviation
    assert v.std(axis=0) == pytest.approx((strength.gust_m_s,) * 2, rel=0.12)
    assert math.hypot(*v.mean(axis=0)) == pytest.approx(strength.steady_m_s, rel=0.05)


def test_the_seed_draws_the_direction() -> None:
    directions = {math.atan2(*blowing(WindGrade.WINDY, seed).step(DT_S)) for seed in (0, 0, 1)}
    assert len(directions) == 2


def test_a_vehicle_in_hold_leans_against_the_wind() -> None:
    vehicle = hovering(wind=WindGrade.WINDY)
    assert math.hypot(vehicle.body.wind_north_m_s, vehicle.body.wind_east_m_s) > 1.0
    assert math.hypot(vehicle.body.roll_rad, vehicle.body.pitch_rad) > 0.05
    assert math.hypot(vehicle.body.north_m, vehicle.body.east_m) < 2.0
