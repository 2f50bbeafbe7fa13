"""``dfvs-sim goal``: the image to fly to, and the sidecar that says how it was taken."""

import argparse
from pathlib import Path
from typing import Any

from dfvs_common.command_line import require_file
from dfvs_common.goal_file import write_goal
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import R_BODY_FORWARD_CAMERA, euler_from_rotation
from dfvs_core.messages.goal import GoalSidecar
from dfvs_sim.options import (
    add_camera_options,
    add_scene_option,
    camera_from,
    parse_camera_pose,
    parse_numbers,
    renderer_from,
)
from dfvs_sim.viewpoints.poses import look_at

_DESCRIPTION = """Render a goal image and write it with its sidecar (goal.png, goal.json).

Say where the camera is in one of two ways:

  --pose X,Y,Z,YAW   level, in the world frame, NED with the scene file's origin: metres north,
                     east and down (so Z is negative above the origin), and the heading in
                     degrees (0 north, 90 east). North is -z of the file, east +x, down -y.
  --eye, --look-at   two points in the scene file's own axes, as any glTF viewer shows them:
                     x right, y up, z towards the viewer, in metres. Look at a point of the same
                     height for a level image: a multirotor cannot hold any other.

Values that begin with a minus sign need the equals sign: --pose=-1,0,-1.3,90"""

_EPILOG = """examples:
  dfvs-sim goal --pose 0.5,-1,-1.3,40 --out goal.png
  dfvs-sim goal --pose=-1,0,-1.3,90 --size 640x480 --antialias --out goal.png
  dfvs-sim goal --scene my_room.glb --eye 4.9,1.1,-2.2 --look-at 1,1.1,-1.2 --out goal.png
"""


def add_parser(subparsers: Any) -> None:
    """Add ``goal`` to the subcommands of ``dfvs-sim``."""
    parser = subparsers.add_parser(
        "goal",
        help="render a goal image with its sidecar",
        description=_DESCRIPTION,
        epilog=_EPILOG,
    )
    add_scene_option(parser)
    add_camera_options(parser)
    add = parser.add_argument
    add("--pose", metavar="X,Y,Z,YAW", help="level camera pose: NED in m, heading in degrees")
    add("--eye", metavar="X,Y,Z", help="camera position in the scene file's axes, m")
    add("--look-at", metavar="X,Y,Z", help="point in the middle of the image, same axes")
    add("--out", type=Path, required=True, metavar="FILE", help="image to write (.png)")
    add("--antialias", action="store_true", help="four samples a pixel, as an optic would")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Render and write; exit code 0."""
    require_file("--out", args.out, ".png")
    T_world_camera = _pose(args)
    camera = camera_from(args)
    renderer = renderer_from(args)
    view = renderer.render(camera, T_world_camera, antialias=args.antialias)
    if not (view.depth_m > 0).any():
        raise ConfigError("the camera sees nothing of the scene", "a pose inside the scene")
    sidecar = _sidecar(camera, T_world_camera)
    write_goal(args.out, view.image, sidecar)
    print(f"wrote {args.out} and {args.out.with_suffix('.json')}")
    return 0


def _sidecar(camera: CameraModel, T_world_camera: FloatArray) -> GoalSidecar:
    """Sidecar of a camera that looks straight ahead from its vehicle."""
    roll, pitch, _ = euler_from_rotation(T_world_camera[:3, :3] @ R_BODY_FORWARD_CAMERA.T)
    pose = tuple(float(v) for v in T_world_camera.reshape(-1))
    return GoalSidecar(camera, roll_rad=roll + 0.0, pitch_rad=pitch + 0.0, pose_camera=pose)


def _pose(args: argparse.Namespace) -> FloatArray:
    """Camera pose (4, 4) from the command line."""
    by_points = args.eye is not None or args.look_at is not None
    if (args.pose is not None) == by_points:
        raise ConfigError(
            "the camera pose is not clear", "either --pose, or --eye together with --look-at"
        )
    if args.pose is not None:
        return parse_camera_pose(args.pose, "--pose")
    if args.eye is None or args.look_at is None:
        missing = "--eye" if args.eye is None else "--look-at"
        raise ConfigError(f"{missing} is missing", "--eye and --look-at together")
    expected = "X,Y,Z in m, in the scene file's axes"
    eye = parse_numbers(args.eye, "--eye", 3, expected)
    return look_at(eye, parse_numbers(args.look_at, "--look-at", 3, expected))
