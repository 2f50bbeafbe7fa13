"""``dfvs-bench relocalise``: pairs of wide baseline, judged by the pose that follows."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dfvs_bench.basin.cells import ROTATIONS_DEG, Cell
from dfvs_bench.basin.drawing import DrawnTask, DrawRequest
from dfvs_bench.basin.environments import Environment, environments_in
from dfvs_bench.options import check_names
from dfvs_bench.relocalisation.relocalise import (
    STAGES,
    Relocalisation,
    RelocalisationJob,
    draw_starts,
    relocalise,
    summarise,
    without,
)
from dfvs_bench.trials.executor import TrialExecutor
from dfvs_bench.trials.provenance import made_with
from dfvs_common.command_line import require_file, require_range
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_models import DEFAULT_MATCHER
from dfvs_models.catalog import load_matcher
from dfvs_sim.options import camera_from, write_json
from dfvs_sim.scene.glb import load_glb

TRANSLATIONS_M = (1.2, 2.0, 2.8, 4.0)
"""Of the starts, the largest displacement of three axes."""

_DRAWN_WIDTH_PX = 320
_MOST_TRIALS = 10_000
_EPILOG = """examples:
  dfvs-bench relocalise room_a.glb room_b.glb --trials 100 --json relocalise.json
  dfvs-bench relocalise hall.glb --bundle dfvs-flow classical --camera 320x240 1280x720
  dfvs-bench relocalise hall.glb --without turns scales

Starts lie 1.2 to 4 m from the goal, turned by 20/20/40 or 30/30/50 degrees, in free space, and see
a fifth of the goal or more. A match is right if the pose that follows from it with true depth is
within 15 % of the distance and 5 degrees; none, if the service would refuse it. Times are those
of one pair with the goal prepared, on --threads threads: measure with one worker. Three further
views lead to each goal and are tracked: their median time, and the median error of the last pose
by true depth, over the depth of the view. With several cameras each is a row of its own.

The JSON is {matchers: {NAME: {pairs, right, wrong, none, mean_ms, p95_ms, max_ms, tracked_p50_ms,
final_error, final_error_deg, final_none, by_translation, by_rotation, by_overlap}}, ...}.
"""
_COLUMNS = (
    f"{'matcher':<24}{'pairs':>6}{'right':>7}{'wrong':>7}{'none':>7}{'mean':>9}{'most':>9}"
    f"{'tracked':>10}{'error':>9}"
)


def add_parser(subparsers: Any) -> None:
    """Add ``relocalise`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "relocalise",
        help="pairs of wide baseline: right, wrong or none, and the time",
        description="Match single pairs of wide baseline in any scenes, without a prior, and "
        "judge each by the pose that follows with true depth.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("scene", type=Path, nargs="+", metavar="SCENE.glb")
    add("--bundle", nargs="+", default=[DEFAULT_MATCHER], metavar="NAME", help="matchers")
    add("--trials", type=int, default=100, metavar="N", help="pairs in all (default: 100)")
    add("--seed", type=int, default=0, metavar="S", help="draws goals and starts (default: 0)")
    add("--camera", nargs="+", default=["640x480"], metavar="WxH", help="default: 640x480")
    add("--working-width", type=int, default=320, metavar="PX", help="default: 320")
    add("--fov", type=float, default=75.0, metavar="DEG", help="horizontal field of view")
    add("--threads", type=int, default=2, metavar="N", help="for each matcher (default: 2)")
    add("--workers", type=int, default=1, metavar="N", help="processes (default: 1)")
    add("--without", nargs="+", default=[], metavar="STAGE", help=f"of {', '.join(STAGES)}")
    add("--json", type=Path, metavar="FILE", help="write the figures")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure, print a line a matcher, and write; exit code 0."""
    _check(args)
    cameras = {
        size: camera_from(argparse.Namespace(size=size, fov=args.fov), "--camera")
        for size in args.camera
    }
    for scene in args.scene:
        load_glb(scene)
    check_names(args.scene)
    config = replace(without(args.without), working_width_px=args.working_width)
    executor = TrialExecutor(args.workers)
    matchers = list(dict.fromkeys(args.bundle))
    for name in matchers:
        load_matcher(name, args.threads, config=config)  # refuses at once what cannot be used
    drawn = {size: _draw(args, camera, executor) for size, camera in cameras.items()}
    jobs = [
        RelocalisationJob(label, name, place, tasks, args.threads, config)
        for name in matchers
        for size in cameras
        for label in [f"{name} {size}" if len(cameras) > 1 else name]
        for place, tasks in drawn[size]
    ]
    found: list[Relocalisation] = []
    for part in executor.finished(relocalise, jobs):
        found += part
        log(f"{len(found)} of {sum(len(job.tasks) for job in jobs)} pairs")
    figures = summarise(found)
    print(_COLUMNS)
    for label in dict.fromkeys(job.name for job in jobs):
        print(_line(label, figures[label]))
    if args.json is not None:
        document = {
            "matchers": figures,
            "scenes": [str(s) for s in args.scene],
            "seed": args.seed,
            "camera": " ".join(cameras),
            "fov_deg": args.fov,
            "without": args.without,
            "working_width_px": args.working_width,
            "made_with": made_with(),
        }
        write_json(args.json, document)
    return 0


def _check(args: argparse.Namespace) -> None:
    require_range(args, 1, _MOST_TRIALS, "trials")
    require_range(args, 1, 64, "threads")
    require_range(args, 64, 1920, "working_width")
    require_range(args, 0, None, "seed")
    require_file("--json", args.json)


def _draw(
    args: argparse.Namespace, camera: CameraModel, executor: TrialExecutor
) -> list[tuple[Environment, tuple[DrawnTask, ...]]]:
    """Starts in each scene, spread evenly; they do not depend on the camera's size."""
    height = round(_DRAWN_WIDTH_PX * camera.height / camera.width)
    cells = tuple(Cell(t, r) for r in ROTATIONS_DEG[1:] for t in TRANSLATIONS_M)
    each, rest = divmod(args.trials, len(args.scene))
    small = camera.scaled(_DRAWN_WIDTH_PX, height)
    places = [replace(place, camera=small) for place in environments_in(args.scene)]
    requests = [
        (DrawRequest(place, cells, -(-args.trials // len(cells)), args.seed), each + (k < rest))
        for k, place in enumerate(places)
    ]
    drawn = dict(executor.finished(_draw_one, [request for request in requests if request[1]]))
    found = [(replace(p, camera=camera), drawn[p.name]) for p in places if drawn.get(p.name)]
    if not found:
        raise ConfigError("no start was found in any scene", "larger scenes with free space")
    return found


def _draw_one(request: tuple[DrawRequest, int]) -> tuple[str, tuple[DrawnTask, ...]]:
    return request[0].environment.name, draw_starts(*request)


def _line(name: str, figures: dict[str, Any]) -> str:
    counts = [f"{figures[v] / figures['pairs']:.0%}" for v in ("right", "wrong", "none")]
    times: Sequence[str] = [f"{figures[t]:.0f} ms" for t in ("mean_ms", "max_ms")]
    shares = "".join(f"{c:>7}" for c in counts)
    tracked = f"{figures['tracked_p50_ms']:.1f} ms"
    error = "-" if figures["final_error"] is None else f"{figures['final_error']:.3%}"
    line = f"{name:<24}{figures['pairs']:>6}{shares}{times[0]:>9}{times[1]:>9}"
    return f"{line}{tracked:>10}{error:>9}"
