"""``dfvs-ros2``: publish the service's telemetry as ROS 2 messages."""

import argparse
import contextlib
import logging
import sys
from collections.abc import Sequence

from dfvs_common.command_line import program_parser
from dfvs_common.lifecycle import EXIT_OK, run_command, stop_event
from dfvs_common.progress import log
from dfvs_core.messages.ros2 import Ros2Link, vehicle_namespace
from dfvs_service.settings.options import add_settings_options, settings_from

_EPILOG = """\
examples:
  dfvs-ros2 --link rmw --config service.toml      ros2 topic echo /drone1/dfvs/setpoint
  dfvs-ros2 --link bridge --ros tcp/127.0.0.1:7448

It needs the extra 'ros' (pip install 'dfvs[ros]'), but no ROS. Exit code: 0 ended, 2 cannot run.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Relay until interrupted; returns the exit code."""
    arguments = _parser().parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="%(name)s: %(message)s")
    return run_command(lambda: _relay(arguments))


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        "dfvs-ros2",
        "Publish the service's telemetry as ROS 2 messages: the setpoint as "
        "TwistStamped, state and figures as DiagnosticArray, the preview as CompressedImage.",
        _EPILOG,
    )
    add_settings_options(parser)
    parser.add_argument(
        "--link",
        choices=("rmw", "bridge"),
        default="rmw",
        help="how ROS 2 comes to Zenoh: rmw_zenoh (default) or zenoh-bridge-ros2dds",
    )
    parser.add_argument(
        "--ros",
        metavar="ENDPOINT",
        help="Zenoh endpoint of ROS 2's router or bridge, where it is not the service's router",
    )
    return parser


def _relay(arguments: argparse.Namespace) -> int:
    stop, config = stop_event(), settings_from(arguments)
    # rosbags and Zenoh take their time to load, and rosbags is an extra.
    from dfvs_common.ros2 import typestore
    from dfvs_service.command import operators_zenoh
    from dfvs_service.ros2.relay import Relay
    from dfvs_service.zenoh_session import open_persistently

    vehicle_namespace(config.vehicle.name)
    typestore()
    ros_zenoh = None if arguments.ros is None else operators_zenoh(config.zenoh, arguments.ros)
    # All of this is refused before any link is waited for.
    link: Ros2Link = arguments.link
    with contextlib.ExitStack() as stack:
        service = open_persistently(operators_zenoh(config.zenoh), stop.is_set, _log)
        if service is None:
            return EXIT_OK
        ros = stack.enter_context(service)
        if ros_zenoh is not None:
            other = open_persistently(ros_zenoh, stop.is_set, _log)
            if other is None:
                return EXIT_OK
            ros = stack.enter_context(other)
        relay = Relay(config.vehicle.name, (service, ros), link, config.camera.ros2.domain)
        names = ", ".join(f"/{publisher.topic.plain}" for publisher in relay.publishers)
        log(f"publishing {names}")
        stop.wait()
    return EXIT_OK


def _log(line: str) -> None:
    log(f"ros2: {line}")


if __name__ == "__main__":
    sys.exit(main())
