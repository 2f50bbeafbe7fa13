"""The methods that the benchmark compares, by name."""

from collections.abc import Callable, Mapping, Sequence

from dfvs_bench.methods import photometric, pnp, pose_regression, published, scan_search, sift
from dfvs_bench.methods.dfvs import ControlledCamera, LateDrive, PipelineMethod, bench_config
from dfvs_bench.methods.method import MethodKind
from dfvs_core.errors import ConfigError
from dfvs_core.servo.config import DepthChoice
from dfvs_models.catalog import bundle_folder
from dfvs_sim.dynamics.estimate_errors import EstimateGrade

_DFVS_ITERATIONS = 300


def _dfvs(
    depth: DepthChoice,
    summary: str,
    response_s: float = 0.0,
    camera: Callable[[], ControlledCamera] = ControlledCamera,
) -> MethodKind:
    config = bench_config(depth, response_s)
    return MethodKind(
        lambda goal, matcher, networks: PipelineMethod(
            config, goal, matcher, networks.depth, camera()
        ),
        summary,
        _DFVS_ITERATIONS,
        depth,
    )


def _late(depth: DepthChoice, grade: EstimateGrade = EstimateGrade.PERFECT) -> MethodKind:
    estimate = "" if grade is EstimateGrade.PERFECT else f", odometry of grade {grade.value}"
    return _dfvs(
        depth,
        f"{depth}-depth on a camera that answers as late as a PX4 vehicle{estimate}",
        LateDrive.RESPONSE_S,
        lambda: ControlledCamera(LateDrive(), grade),
    )


def _regression(name: str, summary: str) -> MethodKind:
    return MethodKind(
        lambda goal, _matcher, networks: pose_regression.PoseRegressionMethod(goal, networks.pose),
        summary,
        pose_regression.ITERATIONS,
        pose=name,
    )


METHODS: dict[str, MethodKind] = {
    "true-depth": _dfvs("given", "the product's law with the true depth"),
    "motion-depth": _dfvs("motion", "the product as it flies: depth from its own motion"),
    "motion-depth-late": _late("motion"),
    "motion-depth-late-medium": _late("motion", EstimateGrade.MEDIUM),
    "motion-depth-search": MethodKind(
        lambda goal, matcher, _: scan_search.ScanSearchMethod(
            lambda: PipelineMethod(bench_config("motion"), goal, matcher), goal, matcher
        ),
        "motion-depth that looks around where it finds no goal",
        scan_search.ITERATIONS,
    ),
    "network-depth": _dfvs("network", "the product's law with a network's depth of the goal image"),
    "fused-depth": _dfvs("fused", "the same, fused with the depth from its own motion"),
    "fused-depth-late": _late("fused"),
    "fused-depth-late-medium": _late("fused", EstimateGrade.MEDIUM),
    "flow-depth": _dfvs("flow", "the product's law with the paper's depth from flow"),
    "flow-depth-late": _late("flow"),
    "flow-depth-late-medium": _late("flow", EstimateGrade.MEDIUM),
    "constant-depth": _dfvs("constant", "the product's law with 3 m everywhere"),
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
    "saxena": _regression(
        "saxena",
        "position-based servoing on a pose that a network regresses, after Saxena et al., scaled by"
        " the true depth at the goal",
    ),
    "bateux": _regression("bateux", "the same after Bateux et al."),
}
"""Methods by name, ours first."""

DEFAULT_METHODS = tuple(METHODS)
"""All: ours, ours under a vehicle's delay, the published law (slow) and the others' methods."""

POSE_NETWORKS = tuple(dict.fromkeys(kind.pose for kind in METHODS.values() if kind.pose))
"""Names of the networks that regress poses."""


def chosen_methods(names: Sequence[str]) -> dict[str, MethodKind]:
    """Methods by their names.

    Raises
    ------
    ConfigError
        If there is no such method.
    """
    for name in names:
        if name not in METHODS:
            raise ConfigError(f"there is no method {name!r}", f"one of {', '.join(METHODS)}")
    return {name: METHODS[name] for name in dict.fromkeys(names)}


def with_bundles(names: Sequence[str], bundles: Mapping[str, str]) -> list[str]:
    """Names of those methods whose network has a bundle; ``bundles`` by ``MethodKind.network``."""
    needed = {name: METHODS[name].network for name in names}
    return [n for n, need in needed.items() if not need or bundle_folder(bundles[need]).is_dir()]
