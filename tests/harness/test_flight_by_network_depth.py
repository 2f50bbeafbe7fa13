"""Flights by the depth that a network gives of the goal image, in a room whose depth is known."""

import numpy as np
import pytest
from box_flight import ROOM, STATE_S, BoxFlight
from depth_bundle import bundle

from dfvs_core.depth.network import NetworkDepth
from dfvs_core.errors import ConfigError
from dfvs_core.messages.goal import Mount
from dfvs_models.depth import DepthNetwork
from dfvs_models.onnx_session import Execution

START_M = (-1.2, 0.4, 0.15)


def true_rho():
    """Inverse depth of the goal image at the network's resolution, 1/m."""
    return 1.0 / ROOM.depth(Mount().T_body_camera())[::2, ::2]


def network(rho, unit="1/m"):
    return DepthNetwork(bundle(rho, np.full(rho.shape, 0.15), unit), Execution(1))


def distorted():
    """Inverse depth with smooth errors of some 12 % that no scale takes away."""
    v, u = np.mgrid[0.0:1.0:60j, 0.0:1.0:80j]
    return true_rho() * np.exp(0.25 * np.sin(5.0 * u) * np.cos(4.0 * v))


def fly(depth, estimator, seconds=9.0, bias=0.0):
    """Fly to the goal with the law's own velocity."""
    flight = BoxFlight(START_M, depth=depth, network=estimator)
    velocity = np.zeros(3)
    for _ in range(round(seconds / STATE_S)):
        flight.step(velocity, error=(bias, 0.0, 0.0))
        if flight.looks:
            velocity = flight.looks[-1].outcome.result.velocity[:3]
    return flight


@pytest.mark.parametrize("depth", ["network", "fused"])
def test_metric_depth_gives_the_distance_from_the_first_frame_on(depth):
    flight = fly(depth, network(true_rho()), 2.0)
    ratios = np.array([look.ratio for look in flight.looks if look.distance_m > 0.3])
    np.testing.assert_allclose(ratios, 1.0, atol=0.06)


@pytest.mark.parametrize("depth", ["network", "fused"])
@pytest.mark.parametrize("unit", ["1/m", "relative"])
def test_the_goal_is_reached(depth, unit):
    flight = fly(depth, network(true_rho() * (1.0 if unit == "1/m" else 17.0), unit))
    assert flight.looks[-1].distance_m < 0.02


@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_a_metric_scale_that_is_wrong_is_corrected_by_motion(factor):
    """By two standard deviations of what the manifest states."""
    flight = fly("fused", network(factor * true_rho()), 6.0)
    first, last = flight.looks[0], [look for look in flight.looks if look.distance_m > 0.1][-1]
    assert first.ratio == pytest.approx(1.0 / factor, rel=0.05)
    assert abs(np.log(last.ratio)) < 0.5 * abs(np.log(first.ratio))
    assert flight.looks[-1].distance_m < 0.03


def test_the_scale_of_relative_depth_comes_from_motion():
    flight = fly("network", network(17.0 * true_rho(), "relative"), 3.0)
    looks = [look for look in flight.looks if look.distance_m > 0.2]
    assert looks[-1].ratio == pytest.approx(1.0, abs=0.15)
    assert looks[-1].outcome.result.uncertainty.scale < 0.3


def test_the_distance_does_not_jump_when_depth_from_motion_comes_in():
    """A jump would be a change of the distance that the vehicle did not fly."""
    flight = fly("fused", network(distorted()), 4.0)
    looks = [look for look in flight.looks if look.distance_m > 0.2]
    told = np.array([look.outcome.result.error_m for look in looks])
    true = np.array([look.distance_m for look in looks])
    unflown = np.abs(np.diff(told) - np.diff(true)) / true[1:]
    assert unflown.max() < 0.06


class ScaledDepth:
    """A relative network whose factor is another one for every image."""

    def __init__(self, *factors):
        self.factors = iter(factors)

    def estimate(self, image, camera):
        rho = next(self.factors) / ROOM.depth(Mount().T_body_camera()).astype(np.float32)
        return NetworkDepth(rho, np.full_like(rho, 0.15), "relative", None)


@pytest.mark.parametrize("depth", ["network", "fused"])
def test_another_goal_goes_on_with_the_scale_of_the_flight(depth):
    """Its image has a factor of its own, and the median depth that would be assumed is wrong."""
    flight = BoxFlight(START_M, depth=depth, network=ScaledDepth(1.0, 9.0))
    for _ in range(round(2.0 / STATE_S)):
        flight.step((0.3, -0.1, 0.0), error=np.zeros(3))
    before = flight.looks[-1]
    flight.go_on()
    for _ in range(round(0.3 / STATE_S)):
        flight.step((0.3, -0.1, 0.0), error=np.zeros(3))
    after = flight.looks[-1]
    assert before.ratio == pytest.approx(1.0, abs=0.15)  # the scale was learnt
    assert after.ratio == pytest.approx(before.ratio, rel=0.05)


def scatter(flight):
    """Median relative error of the structure, its scale apart."""
    ratio = flight.state.depth.rho / (1.0 / ROOM.depth(Mount().T_body_camera())[4::8, 4::8])
    return float(np.median(np.abs(ratio / np.median(ratio) - 1.0)))


def test_fusion_improves_the_structure_and_the_network_alone_stays():
    fused, alone = (fly(depth, network(distorted()), 5.0) for depth in ("fused", "network"))
    before = np.exp(np.log(distorted() / true_rho()))[2::4, 2::4]
    error = float(np.median(np.abs(before / np.median(before) - 1.0)))
    assert scatter(alone) == pytest.approx(error, rel=0.2)
    assert scatter(fused) < 0.7 * scatter(alone)


def test_a_flight_is_the_same_to_the_bit_the_second_time():
    first, second = (fly("fused", network(distorted()), 2.0) for _ in range(2))
    for one, other in zip(first.looks, second.looks, strict=True):
        np.testing.assert_array_equal(one.outcome.result.velocity, other.outcome.result.velocity)


def test_depth_by_a_network_is_refused_without_one():
    with pytest.raises(ConfigError, match="without a depth network"):
        BoxFlight(START_M, depth="fused")
