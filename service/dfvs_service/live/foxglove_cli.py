"""``dfvs-foxglove``: show a running service's flight in Foxglove."""

import argparse
import sys
import time
from collections.abc import Sequence

from dfvs_common.command_line import program_parser, require_range
from dfvs_common.extras import require_package
from dfvs_common.lifecycle import (
    EXIT_OK,
    give_way_to_flights,
    handle_ending_signals,
    run_command,
)
from dfvs_common.progress import log
from dfvs_core.messages.frame_record import SessionHeader
from dfvs_core.perception.flow_grid import FlowGrid
from dfvs_service.record.preparation import require_record_extra
from dfvs_service.settings.options import add_settings_options, settings_from

DEFAULT_PORT = 8765
_REPEAT_S = 1.0

_EXAMPLE = """\
example, beside a running dfvs-service:
  dfvs-foxglove
then in Foxglove: Open connection, Foxglove WebSocket, ws://127.0.0.1:8765
from another machine: ssh -L 8765:127.0.0.1:8765 drone
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = program_parser(
        "dfvs-foxglove",
        "Serve what a running dfvs-service sees, decides and sends to Foxglove, on "
        "127.0.0.1 only. Ends with Ctrl-C.",
        _EXAMPLE,
    )
    parser.add_argument("--port", type=int, default=DEFAULT_PORT, help="(default: 8765)")
    add_settings_options(parser)
    arguments = parser.parse_args(argv)
    if argv is None:
        give_way_to_flights()
    return run_command(lambda: _serve(arguments))


def _serve(arguments: argparse.Namespace) -> int:
    require_record_extra()
    require_package("dfvs-foxglove needs", "foxglove", "foxglove", "foxglove-sdk")
    require_range(arguments, 0, 65535, "port")
    config = settings_from(arguments)
    # Foxglove and Zenoh take their time to load.
    from dfvs_service.live.foxglove_server import LOOPBACK, FoxgloveServer
    from dfvs_service.record.follow import Follower
    from dfvs_service.record.messages.translation import Translation

    follower = Follower(config)
    server = FoxgloveServer(f"dfvs {config.vehicle.name}", arguments.port)
    log(f"serving ws://{LOOPBACK}:{server.port}")
    handle_ending_signals(follower.stop)
    translation: Translation | None = None
    image, repeat_s = b"", 0.0
    for events in follower.events():
        for message, payload in events:
            if isinstance(message, SessionHeader):
                translation, image, repeat_s = Translation(message), payload, 0.0
            elif translation is None:
                continue
            elif isinstance(message, FlowGrid):
                server.show([translation.flow(message)])
            else:
                server.show(translation.record(message, payload))
        # Whoever connects later sees the goal, too: Foxglove keeps nothing for them.
        if translation is not None and time.monotonic() >= repeat_s:
            repeat_s = time.monotonic() + _REPEAT_S
            server.show(translation.header(image, time.time_ns()))
    server.close()
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
