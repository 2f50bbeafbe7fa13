"""``dfvs-bench renderer``: how long a frame takes on this machine."""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.command_line import require_file, require_range
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.options import add_scene_option, write_json
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.viewpoints.poses import camera_pose
from dfvs_sim.viewpoints.sampling import floor_of

_SIZES = ((640, 480), (320, 240))
_FOV_RAD = float(np.radians(75.0))
_EYE_HEIGHT_M = 1.3
_EPILOG = """example:
  dfvs-bench renderer --scene my_room.glb --json renderer.json
"""


def add_parser(subparsers: Any) -> None:
    """Add ``renderer`` to the subcommands of ``dfvs-bench``."""
    parser = subparsers.add_parser(
        "renderer",
        help="time the renderer on this machine",
        description="Render a scene from many places at 640 x 480 and 320 x 240, with and without "
        "anti-aliasing, and print the time of a frame (colour and depth).",
        epilog=_EPILOG,
    )
    add_scene_option(parser)
    add = parser.add_argument
    add("--frames", type=int, default=60, metavar="N", help="frames of each kind")
    add("--seed", type=int, default=0, help="draws the camera poses")
    add("--json", type=Path, metavar="FILE", help="write the figures there as well")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure and print; exit code 0."""
    require_range(args, 2, 100_000, "frames")
    require_range(args, 0, None, "seed")
    require_file("--json", args.json)
    path = args.scene or builtin_room_path()
    renderer = Renderer(load_glb(path))
    poses = _poses(renderer, args.frames, np.random.default_rng(args.seed))
    rows = [
        {"width": width, "height": height, "antialias": antialias}
        | measure(
            renderer, CameraModel.from_horizontal_fov(width, height, _FOV_RAD), poses, antialias
        )
        for width, height in _SIZES
        for antialias in (False, True)
    ]
    print(f"{path}: {len(renderer.scene.triangles)} triangles, {args.frames} frames of each kind")
    print(f"{'size':>10}  {'antialias':>9}  {'median ms':>9}  {'p99 ms':>7}")
    for row in rows:
        size, smooth = f"{row['width']} x {row['height']}", "yes" if row["antialias"] else "no"
        print(f"{size:>10}  {smooth:>9}  {row['median_ms']:9.1f}  {row['p99_ms']:7.1f}")
    if args.json is not None:
        write_json(args.json, {"triangles": len(renderer.scene.triangles), "results": rows})
    return 0


def measure(
    renderer: Renderer, camera: CameraModel, poses: list[FloatArray], antialias: bool
) -> dict[str, float]:
    """Median and 99th percentile in ms of one frame, after one that compiles."""
    renderer.render(camera, poses[0], antialias)
    times_ms = []
    for pose in poses:
        began_ns = time.perf_counter_ns()
        renderer.render(camera, pose, antialias)
        times_ms.append((time.perf_counter_ns() - began_ns) * 1e-6)
    median, p99 = np.percentile(times_ms, [50.0, 99.0])
    return {"median_ms": round(float(median), 2), "p99_ms": round(float(p99), 2)}


def _poses(renderer: Renderer, count: int, rng: np.random.Generator) -> list[FloatArray]:
    """Level camera poses over the middle of the floor, in all directions."""
    floor_m, low, high = floor_of(renderer.scene)
    middle, reach = 0.5 * (low + high), 0.3 * (high - low)
    poses = []
    for _ in range(count):
        north, east = middle + reach * rng.uniform(-1.0, 1.0, 2)
        yaw_rad = float(rng.uniform(-np.pi, np.pi))
        poses.append(camera_pose((north, east, floor_m - _EYE_HEIGHT_M), yaw_rad))
    return poses
