"""HTTP server of metrics from Zenoh telemetry."""

import os
import time
from functools import partial

from prometheus_client import CollectorRegistry, start_http_server

from dfvs_common.lifecycle import stop_event
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_core.messages.topics import Topics
from dfvs_service.command import operators_zenoh
from dfvs_service.live.metrics import FlightMetrics
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.zenoh_session import open_persistently, require_usable_files, subscribe_json

_STREAMS = ("state", "servo", "timing")
_CONNECT_PAUSE_S = 0.5
_NICENESS = 10


def serve_metrics(config: ServiceConfig, address: str, port: int) -> None:
    """Serve until SIGTERM or Ctrl-C, whether or not the service is there.

    Raises ConfigError if the address cannot be served on, or a certificate's file cannot be used.
    """
    require_usable_files(config.zenoh)
    os.nice(_NICENESS)
    stopped = stop_event()
    registry = CollectorRegistry()
    metrics = FlightMetrics(config.vehicle.name, registry, time.monotonic_ns)
    try:
        server, thread = start_http_server(port, address, registry)
    except (OSError, OverflowError) as error:
        raise ConfigError(
            f"cannot serve on {address}:{port} ({error})",
            "an address of this machine and a free port",
            "try --address or --port",
        ) from error
    log(f"serving http://{address}:{server.server_port}/metrics")
    section, topics = operators_zenoh(config.zenoh), Topics(config.vehicle.name)
    session = open_persistently(section, stopped.is_set, log, _CONNECT_PAUSE_S)
    if session is not None:
        with session:
            # Subscriptions last as long as they are kept.
            _kept = [
                subscribe_json(session, topics.telemetry(name), partial(metrics.on_document, name))
                for name in _STREAMS
            ]
            stopped.wait()
    server.shutdown()
    server.server_close()
    thread.join(1.0)
