"""``dfvs-dashboard``: watch flights in a browser."""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from dfvs_common.command_line import program_parser
from dfvs_common.extras import require_package
from dfvs_common.lifecycle import EXIT_OK, handle_ending_signals, run_command
from dfvs_core.messages.goal_command import MAX_SIDECAR_BYTES
from dfvs_core.messages.zenoh_settings import MAX_MESSAGE_BYTES
from dfvs_service.dashboard.settings import dashboard_settings
from dfvs_service.settings.key_file import create_key

DEFAULT_PORT = 8470
MAX_CONNECTIONS = 128

_EXAMPLE = """\
examples:
  dfvs-dashboard                                     beside the service, on this machine
  dfvs-dashboard --connect tcp/127.0.0.1:7447 --connect tcp/127.0.0.1:7448
  dfvs-dashboard new-token --token-file operator.token
  dfvs-dashboard --operator-token operator.token --command-key my.key
  dfvs-dashboard --host 0.0.0.0 --name drone1.local --cert c.pem --key k.pem \\
      --viewer-token viewer.token                    for phones in the same network

exit code: 0 ended by a signal, 2 cannot run
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    is_new_token = words[:1] == ["new-token"]
    return run_command(lambda: _new_token(words[1:]) if is_new_token else _serve(words))


def _new_token(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="dfvs-dashboard new-token",
        description="Make a fresh token for viewers or operators, in a file of mode 0600.",
        epilog="example: dfvs-dashboard new-token --token-file operator.token",
    )
    parser.add_argument("--token-file", type=Path, required=True, metavar="FILE")
    path = parser.parse_args(words).token_file
    create_key(path)
    print(f"wrote {path}; give it to dfvs-dashboard, and its content to who may sign in")
    return EXIT_OK


def make_parser() -> argparse.ArgumentParser:
    """Options of the command that serves the page."""
    parser = program_parser(
        "dfvs-dashboard",
        "Serve a page that shows what the drone sees and does. Nothing is loaded from "
        "the internet, and nothing is commanded without a token and a key.",
        _EXAMPLE,
    )
    add, many = parser.add_argument, "may be repeated"
    add("--config", type=Path, metavar="FILE", help="the service's settings: its zenoh section")
    add("--connect", action="append", metavar="ENDPOINT", help=f"Zenoh endpoint; {many}")
    add("--host", default="127.0.0.1", help="address to listen on (default: 127.0.0.1)")
    add("--port", type=int, default=DEFAULT_PORT, help=f"(default: {DEFAULT_PORT})")
    add("--name", action="append", default=[], help=f"host name that browsers use; {many}")
    add("--cert", type=Path, metavar="PEM", help="TLS certificate chain")
    add("--key", type=Path, metavar="PEM", help="its private key")
    add("--viewer-token", type=Path, metavar="FILE", help="token that viewers need")
    add("--operator-token", type=Path, metavar="FILE", help="token of those who may send commands")
    add("--command-key", type=Path, metavar="FILE", help="key that signs the commands")
    return parser


def _serve(words: Sequence[str]) -> int:
    arguments = make_parser().parse_args(words)
    for name in ("starlette", "uvicorn", "websockets"):
        require_package("dfvs-dashboard needs", name, "dashboard")
    import uvicorn

    from dfvs_service.dashboard.app import Dashboard, make_app

    settings = dashboard_settings(arguments)
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    config = uvicorn.Config(
        make_app(Dashboard(settings)),
        host=arguments.host,
        port=arguments.port,
        ws="websockets-sansio",
        ws_max_size=MAX_MESSAGE_BYTES + MAX_SIDECAR_BYTES,
        ws_per_message_deflate=False,  # images do not get smaller, only later
        ssl_certfile=arguments.cert,
        ssl_keyfile=arguments.key,
        log_level="warning",
        server_header=False,
        proxy_headers=False,
        limit_concurrency=MAX_CONNECTIONS,
        timeout_graceful_shutdown=1,
    )
    name = arguments.name[0] if arguments.name else arguments.host
    print(f"dashboard at {settings.address.scheme}://{name}:{arguments.port}/", flush=True)
    server = uvicorn.Server(config)

    def stop(_signal: int, _frame: FrameType | None) -> None:
        server.should_exit = True

    handle_ending_signals(stop)  # SIGHUP: the others are the server's own while it runs
    server.run()
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
