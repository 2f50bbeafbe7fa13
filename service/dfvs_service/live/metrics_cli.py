"""``dfvs-metrics``: a running service's flight for Prometheus."""

import argparse
import sys
from collections.abc import Sequence

from dfvs_common.command_line import program_parser
from dfvs_common.extras import require_package
from dfvs_common.lifecycle import EXIT_OK, give_way_to_flights, run_command
from dfvs_service.settings.options import add_settings_options, settings_from

DEFAULT_PORT = 9464
LOOPBACK = "127.0.0.1"

_EXAMPLE = """\
examples, beside a running dfvs-service:
  dfvs-metrics
  curl http://127.0.0.1:9464/metrics
  dfvs-metrics --port 9500 --config service.toml

exit code: 0 ended by a signal, 2 cannot run
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    arguments = _parser().parse_args(argv)
    if argv is None:
        give_way_to_flights()
    return run_command(lambda: _serve(arguments))


def _parser() -> argparse.ArgumentParser:
    parser = program_parser(
        "dfvs-metrics",
        "Serve a running dfvs-service's latencies, rates, states and drops at "
        "/metrics, for Prometheus. Ends with Ctrl-C.",
        _EXAMPLE,
    )
    parser.add_argument("--port", type=int, default=DEFAULT_PORT, help="(default: 9464)")
    parser.add_argument(
        "--address", default=LOOPBACK, metavar="ADDR", help="to serve on (default: 127.0.0.1)"
    )
    add_settings_options(parser)
    return parser


def _serve(arguments: argparse.Namespace) -> int:
    require_package("dfvs-metrics needs", "prometheus_client", "metrics", "prometheus-client")
    config = settings_from(arguments)
    # Prometheus' client and Zenoh take their time to load.
    from dfvs_service.live.metrics import serve_metrics

    serve_metrics(config, arguments.address, arguments.port)
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
