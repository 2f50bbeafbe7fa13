"""A flight in Prometheus' terms."""

import pytest
from prometheus_client import CollectorRegistry
from prometheus_client.exposition import generate_latest
from prometheus_client.parser import text_string_to_metric_families

from dfvs_service.live.metrics import FlightMetrics

S = 1_000_000_000


class Board:
    def __init__(self):
        self.now_ns = 0
        self.registry = CollectorRegistry()
        self.metrics = FlightMetrics("drone1", self.registry, lambda: self.now_ns)

    def value(self, name, **labels):
        text = generate_latest(self.registry).decode()
        found = [
            sample.value
            for family in text_string_to_metric_families(text)
            for sample in family.samples
            if sample.name == name and labels.items() <= sample.labels.items()
        ]
        return found[0] if len(found) == 1 else found


@pytest.fixture
def board():
    return Board()


def test_every_frame_s_stages_are_counted_in_seconds(board):
    for duration_ms in (4.0, 6.0, 260.0):
        board.metrics.on_document("servo", {"stages_ms": {"match": duration_ms}})
    stage = {"stage": "match", "vehicle": "drone1"}
    assert board.value("dfvs_frame_stage_seconds_count", **stage) == 3
    assert board.value("dfvs_frame_stage_seconds_sum", **stage) == pytest.approx(0.27)
    assert board.value("dfvs_frame_stage_seconds_bucket", le="0.005", **stage) == 1
    assert board.value("dfvs_frame_stage_seconds_bucket", le="0.25", **stage) == 2


def test_exactly_one_state_is_one_and_entries_are_counted(board):
    for state in ("READY", "READY", "SERVO", "HOLD", "SERVO"):
        board.metrics.on_document("state", {"state": state})
    assert board.value("dfvs_gate_state", state="SERVO") == 1
    assert sum(board.value("dfvs_gate_state")) == 1
    assert board.value("dfvs_gate_entries_total", state="SERVO") == 2
    assert board.value("dfvs_gate_entries_total", state="READY") == 1


def test_frames_and_drops_are_counters(board):
    board.metrics.on_document("timing", {"frames": 90, "refused": 3, "overtaken": 2})
    assert board.value("dfvs_frames_total") == 90
    assert board.value("dfvs_frames_refused_total") == 3
    assert board.value("dfvs_frames_overtaken_total") == 2


def test_what_is_unknown_is_left_out_rather_than_zero(board):
    board.metrics.on_document(
        "state", {"state": "READY", "battery": None, "setpoint": [0.1, 0, 0, 0]}
    )
    board.metrics.on_document("servo", {"error_m": None, "error_rad": 0.2})
    assert board.value("dfvs_battery_ratio") == []
    assert board.value("dfvs_error_meters") == []
    assert board.value("dfvs_error_radians") == 0.2
    assert board.value("dfvs_setpoint", axis="forward") == 0.1


def test_uncertainty_is_told_where_it_is_known(board):
    known = {
        "error_spread_m": 0.02,
        "scale_spread": 0.1,
        "odometry_error_m_s": 0.03,
        "mean_error_m": 0.5,
        "mean_error_spread_m": 0.04,
        "mounting_score": -7.5,
        "velocity_error": [0.1, 0.2, 0.3, 0.0],
    }
    names = {
        "dfvs_error_stddev_meters": 0.02,
        "dfvs_scale_stddev_ratio": 0.1,
        "dfvs_odometry_error_meters_per_second": 0.03,
        "dfvs_mean_error_meters": 0.5,
        "dfvs_mean_error_stddev_meters": 0.04,
        "dfvs_mounting_score": -7.5,
        "dfvs_velocity_error_meters_per_second": [0.1, 0.2, 0.3],
    }
    board.metrics.on_document("servo", known)
    assert {name: board.value(name) for name in names} == names
    assert board.value("dfvs_velocity_error_meters_per_second", axis="down") == 0.3
    board.metrics.on_document("servo", dict.fromkeys(known))
    assert all(board.value(name) == [] for name in names)


def test_how_old_everything_is_can_be_seen(board):
    board.metrics.on_document("state", {"state": "READY"})
    board.now_ns = 7 * S
    assert board.value("dfvs_telemetry_age_seconds", stream="state") == 7


@pytest.mark.parametrize(
    "document",
    [
        None,
        3,
        [],
        "x",
        {},
        {"state": 3},
        {"state": {}},
        {"setpoint": "abcd"},
        {"setpoint": [None] * 4},
    ],
)
def test_telemetry_that_is_none_does_no_harm(board, document):
    for stream in ("state", "servo", "timing"):
        board.metrics.on_document(stream, document)
    assert board.value("dfvs_telemetry_unreadable_total") == (
        0 if isinstance(document, dict) else 3
    )
    board.metrics.on_document("servo", {"stages_ms": {"match": "soon", "servo": 3.0}})
    assert board.value("dfvs_frame_stage_seconds_count", stage="servo") == 1
