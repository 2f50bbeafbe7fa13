"""The Grafana dashboard in deploy/ asks for what ``dfvs-metrics`` serves."""

import json
import re
from pathlib import Path

import pytest
from prometheus_client import CollectorRegistry
from prometheus_client.exposition import generate_latest
from prometheus_client.parser import text_string_to_metric_families

from dfvs_core.gate.states import GateState
from dfvs_core.messages.link import GateStatus
from dfvs_core.messages.schema import dump
from dfvs_service.live.metrics import FlightMetrics
from dfvs_service.perception.telemetry.messages import timing_document

DASHBOARD = json.loads(
    (Path(__file__).parents[3] / "deploy" / "grafana_dashboard.json").read_text(encoding="utf-8")
)
SERVO = (
    *("error_m", "error_rad", "overlap", "inlier_share", "depth_m", "condition", "error_spread_m"),
    *("mean_error_m", "mean_error_spread_m", "scale_spread", "odometry_error_m_s"),
)
EXPRESSIONS = [t["expr"] for panel in DASHBOARD["panels"] for t in panel["targets"]]


@pytest.fixture(scope="module")
def served():
    """Labels of every sample that is served, by its name."""
    registry = CollectorRegistry()
    metrics = FlightMetrics("drone1", registry, lambda: 0)
    status = GateStatus("SERVO", "", None, battery=0.8, heartbeat_age_s=0.1, distance_m=1.0)
    metrics.on_document("state", dump(status))
    servo = dict.fromkeys(SERVO, 0.5) | {"stages_ms": {"capture_to_report": 60.0}}
    metrics.on_document("servo", servo | {"velocity_error": [0.0, 0.0, 0.0, 0.0]})
    counters = {"frames": 1, "refused": 0, "overtaken": 0}
    metrics.on_document("timing", json.loads(json.dumps(timing_document({}, 0, counters))))
    labels = {}
    for family in text_string_to_metric_families(generate_latest(registry).decode()):
        for sample in family.samples:
            labels.setdefault(sample.name, {}).update(sample.labels)
    return labels


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_every_expression_names_metrics_and_labels_that_are_served(expression, served):
    selectors = re.findall(r"(dfvs_\w+)\{([^}]*)\}", expression)
    assert len(selectors) == expression.count("dfvs_")
    for name, matchers in selectors:
        assert name in served
        for label in re.findall(r"(\w+)=", matchers):
            assert label in served[name]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_sums_keep_labels_that_are_served(expression, served):
    for by in re.findall(r"by \(([^)]*)\)", expression):
        (name, *_) = re.findall(r"dfvs_\w+", expression)
        assert set(by.split(", ")) <= served[name].keys()


def test_states_that_it_asks_for_exist():
    named = [re.findall(r'state=~"([^"]*)"', expression) for expression in EXPRESSIONS]
    states = {state for found in named for text in found for state in text.split("|")}
    assert states
    assert states <= {state.value for state in GateState}


def test_panels_neither_overlap_nor_leave_the_page():
    cells = set()
    for panel in DASHBOARD["panels"]:
        at = panel["gridPos"]
        assert at["x"] + at["w"] <= 24
        own = {
            (x, y)
            for x in range(at["x"], at["x"] + at["w"])
            for y in range(at["y"], at["y"] + at["h"])
        }
        assert not own & cells
        cells |= own


def test_its_vehicles_and_data_source_are_variables():
    variables = {v["name"]: v for v in DASHBOARD["templating"]["list"]}
    assert variables["vehicle"]["definition"] == "label_values(dfvs_gate_state, vehicle)"
    assert {p["datasource"]["uid"] for p in DASHBOARD["panels"]} == {"${datasource}"}
    assert variables["datasource"]["query"] == "prometheus"
