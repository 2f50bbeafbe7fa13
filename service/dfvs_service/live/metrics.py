"""Prometheus metrics of a flight (latencies, rates, states, losses), and their HTTP server."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from prometheus_client import CollectorRegistry, Histogram, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from dfvs_common.lifecycle import stop_event
from dfvs_common.progress import log
from dfvs_core.errors import ConfigError
from dfvs_core.gate.states import GateState
from dfvs_core.messages.topics import Topics
from dfvs_service.command import operators_zenoh
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.zenoh_session import open_persistently, require_usable_files, subscribe_json

_STREAMS = ("state", "servo", "timing")
_CONNECT_PAUSE_S = 0.5

LATENCY_BUCKETS_S = (
    *(0.001, 0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.125, 0.15),
    *(0.2, 0.25, 0.3, 0.5, 1.0),
)
"""The gate flies by nothing older than 250 ms: that is where it has to be fine."""

_GAUGES = {
    "error_m": ("dfvs_error_meters", "Estimated distance to the goal."),
    "error_rad": ("dfvs_error_radians", "Estimated angle to the goal."),
    "overlap": ("dfvs_overlap_ratio", "Share of the view that shows the goal."),
    "inlier_share": ("dfvs_inlier_ratio", "Share of the correspondences that agree."),
    "depth_m": ("dfvs_depth_meters", "Median depth of the points used."),
    "condition": ("dfvs_condition", "Condition number of the normal equations."),
    "error_spread_m": (
        "dfvs_error_stddev_meters",
        "Standard deviation of the estimated distance to the goal.",
    ),
    "mean_error_m": ("dfvs_mean_error_meters", "Mean distance to the goal over the last second."),
    "mean_error_spread_m": (
        "dfvs_mean_error_stddev_meters",
        "Standard deviation about the mean distance over the last second.",
    ),
    "scale_spread": ("dfvs_scale_stddev_ratio", "Relative standard deviation of the metric scale."),
    "odometry_error_m_s": (
        "dfvs_odometry_error_meters_per_second",
        "Expected error of the odometry, standard deviation per axis.",
    ),
    "mounting_score": (
        "dfvs_mounting_score",
        "Test statistic of the camera's mounting, standard deviations; negative: wrong.",
    ),
}
_STATE_GAUGES = {
    "battery": ("dfvs_battery_ratio", "Charge of the vehicle's battery."),
    "heartbeat_age_s": ("dfvs_heartbeat_age_seconds", "Age of the autopilot's heartbeat."),
    "distance_m": ("dfvs_distance_meters", "Distance from where the vehicle was engaged."),
}
_COUNTERS = {
    "frames": ("dfvs_frames", "Frames that gave a result."),
    "refused": ("dfvs_frames_refused", "Frames that were not used, for whatever reason."),
    "overtaken": ("dfvs_frames_overtaken", "Frames that a newer one replaced unseen."),
}
_AXES = ("forward", "right", "down", "yaw")
_STATE = ("dfvs_gate_state", "1 for the state that the gate is in.", "state")
_ENTRIES = ("dfvs_gate_entries", "How often the gate came into a state.", "state")
_SETPOINT = ("dfvs_setpoint", "Last setpoint: m/s, yaw in rad/s.", "axis")
_VELOCITY_ERROR = (
    "dfvs_velocity_error_meters_per_second",
    "Estimated velocity minus the odometry's, body axes.",
    "axis",
)
_AGE = (
    "dfvs_telemetry_age_seconds",
    "Time since a stream was last heard: everything else here is as old.",
    "stream",
)
_UNREADABLE = {"unreadable": ("dfvs_telemetry_unreadable", "Telemetry that was not understood.")}
_Family = type[GaugeMetricFamily] | type[CounterMetricFamily]


class FlightMetrics:
    """Takes the service's telemetry documents, and gives metrics when it is asked.

    ``vehicle`` is a label of every metric, and ``tick`` gives monotonic time, ns.
    """

    def __init__(self, vehicle: str, registry: CollectorRegistry, tick: Callable[[], int]) -> None:
        self._vehicle = vehicle
        self._tick = tick
        self._lock = threading.Lock()
        self._documents: dict[str, Mapping[str, Any]] = {}
        self._received_ns: dict[str, int] = {}
        self._changes: dict[str, int] = {}
        self._unreadable = 0
        self._latency = Histogram(
            "dfvs_frame_stage_seconds",
            "Time that a frame's stages took; capture_to_report is all of them.",
            ("vehicle", "stage"),
            buckets=LATENCY_BUCKETS_S,
            registry=registry,
        )
        registry.register(self)

    def on_document(self, stream: str, document: object) -> None:
        """Take a document of the streams ``state``, ``servo`` or ``timing``, from any thread."""
        if not isinstance(document, Mapping):
            with self._lock:
                self._unreadable += 1
            return
        with self._lock:
            before = self._documents.get(stream, {})
            self._documents[stream] = document
            self._received_ns[stream] = self._tick()
            state = document.get("state")
            if stream == "state" and isinstance(state, str) and state != before.get("state"):
                self._changes[state] = self._changes.get(state, 0) + 1
        stages = document.get("stages_ms")
        if stream == "servo" and isinstance(stages, Mapping):
            for stage, duration in stages.items():
                if isinstance(duration, int | float):
                    self._latency.labels(self._vehicle, str(stage)).observe(duration * 1e-3)

    def collect(self) -> Iterator[Metric]:
        """Metrics of this moment, for Prometheus' client."""
        with self._lock:
            documents, received = dict(self._documents), dict(self._received_ns)
            changes, unreadable = dict(self._changes), self._unreadable
        servo, state = documents.get("servo", {}), documents.get("state", {})
        yield from self._numbers(GaugeMetricFamily, _GAUGES, servo)
        yield from self._numbers(GaugeMetricFamily, _STATE_GAUGES, state)
        yield from self._numbers(CounterMetricFamily, _COUNTERS, documents.get("timing", {}))
        is_in = {each.value: state.get("state") == each.value for each in GateState}
        yield self._by_label(GaugeMetricFamily, _STATE, is_in)
        setpoint = _by_axis(_AXES, state.get("setpoint"))
        yield self._by_label(GaugeMetricFamily, _SETPOINT, setpoint)
        velocity_error = _by_axis(_AXES[:3], servo.get("velocity_error"))
        yield self._by_label(GaugeMetricFamily, _VELOCITY_ERROR, velocity_error)
        yield self._by_label(CounterMetricFamily, _ENTRIES, changes)
        now_ns = self._tick()
        ages_s = {stream: (now_ns - t_ns) * 1e-9 for stream, t_ns in received.items()}
        yield self._by_label(GaugeMetricFamily, _AGE, ages_s)
        yield from self._numbers(CounterMetricFamily, _UNREADABLE, {"unreadable": unreadable})

    def _numbers(
        self, family: _Family, names: Mapping[str, tuple[str, str]], document: Mapping[str, Any]
    ) -> Iterator[Metric]:
        """A metric for every number that the document holds; unknown ones are left out."""
        for key, (name, text) in names.items():
            value = document.get(key)
            if isinstance(value, int | float):
                metric = family(name, text, labels=("vehicle",))
                metric.add_metric((self._vehicle,), value)
                yield metric

    def _by_label(
        self, family: _Family, described: tuple[str, str, str], values: Mapping[str, float]
    ) -> Metric:
        """Metric with a sample for every value of a label."""
        name, text, label = described
        metric = family(name, text, labels=("vehicle", label))
        for key, value in values.items():
            metric.add_metric((self._vehicle, key), value)
        return metric


def _by_axis(axes: Sequence[str], values: object) -> dict[str, float]:
    """Known values of some axes; ``values`` (4,) of the body, or unknown."""
    if not isinstance(values, list) or len(values) != len(_AXES):
        return {}
    pairs = zip(axes, values, strict=False)
    return {axis: value for axis, value in pairs if isinstance(value, int | float)}


def serve_metrics(config: ServiceConfig, address: str, port: int) -> None:
    """Serve until SIGTERM or Ctrl-C, whether or not the service is there.

    Raises
    ------
    ConfigError
        If the address cannot be served on, or a certificate's file cannot be used.
    """
    require_usable_files(config.zenoh)
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
