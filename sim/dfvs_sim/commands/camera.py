"""``dfvs-sim camera``: the mock camera alone, beside the stand-in or a real PX4."""

import argparse
import contextlib
import math
from typing import Any

import numpy as np
import zenoh

from dfvs_common.command_line import require_range
from dfvs_common.lifecycle import stop_event
from dfvs_common.progress import log
from dfvs_common.zenoh_session import open_session
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.poses import make_pose, rotation_from_euler
from dfvs_core.messages.frame import FORMAT_NAMES
from dfvs_core.messages.goal import Mount
from dfvs_core.messages.topics import Topics
from dfvs_sim.camera.mock import MockCamera, MockCameraConfig, Publish, zenoh_publisher
from dfvs_sim.camera.ros2 import Ros2Camera, Ros2CameraConfig
from dfvs_sim.ground.link import DEFAULT_URL, GroundLink
from dfvs_sim.ground.pose import PoseTracker
from dfvs_sim.ground.sharing import DEFAULT_PORT, LinkSharing
from dfvs_sim.options import (
    add_camera_options,
    add_scene_option,
    camera_from,
    parse_numbers,
    renderer_from,
)

_EPILOG = """examples:
  dfvs-sim camera --mavlink udpin://127.0.0.1:14550 --origin 0,-1,-0.2,40 --share 14551
  dfvs-sim camera --ros2 rmw --format raw
"""


def add_parser(subparsers: Any) -> None:
    """Add ``camera`` to the subcommands of ``dfvs-sim``."""
    parser = subparsers.add_parser(
        "camera",
        help="a camera that renders what the vehicle sees",
        description="Render what a vehicle sees and publish it over Zenoh. The pose comes from "
        "the vehicle's MAVLink telemetry, so it works beside a real PX4 as well.",
        epilog=_EPILOG,
    )
    add_scene_option(parser)
    add_camera_options(parser)
    add = parser.add_argument
    add("--mavlink", default=DEFAULT_URL, metavar="URL", help="ground-station link")
    add("--system-id", type=int, metavar="N", help="MAVLink system id of the vehicle")
    add(
        "--origin",
        default="0,-1,-0.2,40",
        metavar="X,Y,Z,YAW",
        help="where the autopilot's local origin lies in the scene (NED, m) and how it is turned "
        "(degrees); by default the simulated vehicle stands on the built-in room's floor, with "
        "its camera 12 cm above it (%(default)s)",
    )
    add(
        "--share",
        type=int,
        metavar="PORT",
        help="share the ground-station link with further ground stations, such as dfvs-sim pilot, "
        f"on this UDP port (usually {DEFAULT_PORT})",
    )
    add("--rate", type=float, default=20.0, metavar="HZ", help="frames a second")
    add("--format", choices=sorted(FORMAT_NAMES), default="jpeg", help="pixels on the wire")
    add("--noise", type=float, default=1.5, help="sensor noise, grey levels")
    add("--ros2", choices=("rmw", "bridge"), help="publish ROS 2 messages instead")
    add("--mount-pitch", type=float, default=0.0, metavar="DEG", help="camera pitch, up positive")
    add("--vehicle", default="drone1", help="vehicle name in the Zenoh keys")
    add(
        "--connect",
        default="tcp/127.0.0.1:7447",
        metavar="ENDPOINT",
        help="Zenoh endpoint of the service or a router",
    )
    add("--seed", type=int, default=0, help="seed of the noise")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Publish until interrupted; exit code 0."""
    require_range(args, 0.1, 240, "rate")
    require_range(args, 0, 255, "noise")
    require_range(args, 0, None, "seed")
    require_range(args, 1, 65535, "share")
    require_range(args, 1, 250, "system_id")
    mount = Mount(pitch_rad=math.radians(args.mount_pitch))
    T_scene_local = _origin(args.origin)
    config = MockCameraConfig(
        camera_from(args), args.rate, FORMAT_NAMES[args.format], noise=args.noise, seed=args.seed
    )
    renderer = renderer_from(args)
    with contextlib.ExitStack() as stack:
        link = stack.enter_context(GroundLink(args.mavlink, args.system_id))
        if args.share is not None:
            stack.enter_context(LinkSharing(link, args.share))
        session = stack.enter_context(open_session("peer", (args.connect,)))
        publish, key = _publisher(args, config, session)
        tracker = PoseTracker(link, log)
        log(f"camera: waiting for a vehicle on {args.mavlink}")
        tracker.start()
        poses = tracker.camera_poses(T_scene_local, mount.T_body_camera())
        log(f"camera: publishing on {key}")
        stop = stop_event()  # what waits until here is ended by the signal itself
        MockCamera(config, renderer, poses, publish).run(stop)
    return 0


def _publisher(
    args: argparse.Namespace, config: MockCameraConfig, session: zenoh.Session
) -> tuple[Publish, str]:
    """What publishes a frame, and on which key."""
    if args.ros2 is None:
        return zenoh_publisher(session, args.vehicle), Topics(args.vehicle).camera
    name = f"{args.vehicle}/camera"
    ros2 = Ros2CameraConfig(args.ros2, config.camera, config.pixel_format, name)
    return Ros2Camera(session, ros2).publish, ros2.image.key(args.ros2)


def _origin(text: str) -> FloatArray:
    x, y, z, yaw_deg = parse_numbers(text, "--origin", 4, "X,Y,Z,YAW in m and degrees")
    return make_pose(rotation_from_euler(0.0, 0.0, math.radians(yaw_deg)), np.array([x, y, z]))
