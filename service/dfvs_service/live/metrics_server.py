"""HTTP server of metrics from Zenoh telemetry."""

import json
import os
import time

import zenoh
from prometheus_client import CollectorRegistry, start_http_server

from dfvs_common.lifecycle import stop_event
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_core.messages.topics import Topics
from dfvs_service.command import operators_zenoh
from dfvs_service.live.metrics import FlightMetrics
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.zenoh_session import open_persistently, require_usable_files

_STREAMS = ("state", "servo", "timing")
_CONNECT_PAUSE_S = 0.5
_NICENESS = 10


def serve_metrics(config: ServiceConfig, address: str, port: int) -> None:
    """Serve until SIGTERM or Ctrl-C, whether or not the service is there.

    Raises
    ------
    ConfigError
        If the address cannot be served on, or a certificate's file cannot be used.
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
            f"cannot serve on {address}:{port} ({error})", "a free port", "try --port"
        ) from error
    log(f"serving http://{address}:{server.server_port}/metrics")
    section = operators_zenoh(config.zenoh)
    session = open_persistently(section, stopped.is_set, log, _CONNECT_PAUSE_S)
    if session is not None:
        with session:
            _kept = _subscribe(session, Topics(config.vehicle.name), metrics)
            stopped.wait()
    server.shutdown()
    server.server_close()
    thread.join(1.0)


def _subscribe(session: zenoh.Session, topics: Topics, metrics: FlightMetrics) -> list[object]:
    """Subscriptions, which last as long as they are kept."""

    def subscribe(stream: str) -> object:
        def take(sample: zenoh.Sample) -> None:
            try:
                document = json.loads(sample.payload.to_bytes())
            except (ValueError, RecursionError):
                document = None
            metrics.on_document(stream, document)

        return session.declare_subscriber(topics.telemetry(stream), take)

    return [subscribe(stream) for stream in _STREAMS]
