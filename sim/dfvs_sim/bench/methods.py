"""The methods that the benchmark compares, by name."""

from __future__ import annotations

from collections.abc import Sequence

from dfvs_core.depth.network import DepthEstimator
from dfvs_core.errors import ConfigError
from dfvs_core.matching.matcher import Matcher
from dfvs_core.servo.config import BY_NETWORK, DepthChoice
from dfvs_sim.bench import photometric, pnp, published, searching, sift
from dfvs_sim.bench.method import GoalSight, MethodKind
from dfvs_sim.bench.ours import ControlledCamera, LateDrive, PipelineMethod, bench_config
from dfvs_sim.vehicle.estimate_errors import EstimateGrade

_OURS_ITERATIONS = 300


def _ours(depth: DepthChoice, summary: str) -> MethodKind:
    config = bench_config(depth)
    return MethodKind(
        lambda goal, matcher, network: PipelineMethod(config, goal, matcher, network),
        summary,
        _OURS_ITERATIONS,
        depth,
    )


def _late(depth: DepthChoice, grade: EstimateGrade = EstimateGrade.PERFECT) -> MethodKind:
    config = bench_config(depth, response_s=LateDrive.RESPONSE_S)
    estimate = "" if grade is EstimateGrade.PERFECT else f", odometry of grade {grade.value}"
    return MethodKind(
        lambda goal, matcher, network: PipelineMethod(
            config, goal, matcher, network, ControlledCamera(LateDrive(), grade)
        ),
        f"{depth}-depth on a camera that answers as late as a PX4 vehicle{estimate}",
        _OURS_ITERATIONS,
        depth,
    )


def _searching(summary: str) -> MethodKind:
    config = bench_config("motion")

    def make(
        goal: GoalSight, matcher: Matcher, _network: DepthEstimator | None
    ) -> searching.SearchingMethod:
        return searching.SearchingMethod(
            lambda: PipelineMethod(config, goal, matcher), goal, matcher
        )

    return MethodKind(make, summary, searching.ITERATIONS)


METHODS: dict[str, MethodKind] = {
    "true-depth": _ours("given", "the product's law with the true depth"),
    "motion-depth": _ours("motion", "the product as it flies: depth from its own motion"),
    "motion-depth-late": _late("motion"),
    "motion-depth-late-medium": _late("motion", EstimateGrade.MEDIUM),
    "motion-depth-search": _searching("motion-depth that looks around where it finds no goal"),
    "network-depth": _ours("network", "the product's law with a network's depth of the goal image"),
    "fused-depth": _ours("fused", "the same, fused with the depth from its own motion"),
    "fused-depth-late": _late("fused"),
    "fused-depth-late-medium": _late("fused", EstimateGrade.MEDIUM),
    "flow-depth": _ours("flow", "the product's law with the paper's depth from flow"),
    "flow-depth-late": _late("flow"),
    "flow-depth-late-medium": _late("flow", EstimateGrade.MEDIUM),
    "constant-depth": _ours("constant", "the product's law with 3 m everywhere"),
    "published": MethodKind(
        lambda goal, matcher, _: published.PublishedMethod(goal, matcher),
        "the law of the paper's published code, with its flow-depth",
        published.ITERATIONS,
    ),
    "photometric": MethodKind(
        lambda goal, *_: photometric.PhotometricMethod(goal),
        "photometric visual servoing with the true depth at the goal",
        photometric.ITERATIONS,
    ),
    "sift": MethodKind(
        lambda goal, *_: sift.SiftMethod(goal),
        "classical image-based servoing on SIFT points with the true depth",
        sift.ITERATIONS,
    ),
    "pnp": MethodKind(
        lambda goal, matcher, _: pnp.PnpMethod(goal, matcher),
        "position-based servoing: perspective-n-point on flow and the true depth",
        pnp.ITERATIONS,
    ),
}
"""Methods by name, ours first."""

DEFAULT_METHODS = tuple(METHODS)
"""All: ours, ours under a vehicle's delay, the published law (slow) and the others' methods."""


def chosen_methods(names: Sequence[str] | None) -> dict[str, MethodKind]:
    """Methods by their names; the default ones where nobody names any.

    Raises
    ------
    ConfigError
        If there is no such method.
    """
    for name in names or ():
        if name not in METHODS:
            raise ConfigError(f"there is no method {name!r}", f"one of {', '.join(METHODS)}")
    return {name: METHODS[name] for name in dict.fromkeys(names or DEFAULT_METHODS)}


def without_network(names: Sequence[str]) -> list[str]:
    """Names of those methods that need no depth network."""
    return [name for name in names if METHODS[name].depth not in BY_NETWORK]
