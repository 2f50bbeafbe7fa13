"""The Foxglove layout in deploy/ names topics, fields and panel settings that exist."""

import json
import re
from pathlib import Path

import foxglove.layouts as fl
import numpy as np
import pytest
from recorded_flight import fly

from dfvs_core.gate.states import GateState
from dfvs_core.messages.frame_record import FrameRecord
from dfvs_core.perception.flow_grid import FlowGrid
from dfvs_service.record.messages.translation import Translation

LAYOUT = json.loads(
    (Path(__file__).parents[3] / "deploy" / "foxglove_layout.json").read_text(encoding="utf-8")
)
PANELS = LAYOUT["configById"]
# Panel types as layouts that are exported name them, with the schema of their settings.
CONFIGS = {
    "3D": fl.ThreeDeeConfig,
    "Image": fl.ImageConfig,
    "Plot": fl.PlotConfig,
    "StateTransitions": fl.StateTransitionsConfig,
    "RosOut": fl.LogConfig,
}
SERIES = {"Plot": fl.PlotSeries, "StateTransitions": fl.StateTransitionsSeries}
TOPIC = re.compile(r"/[a-z_/]+")


def kind(panel):
    return panel.split("!")[0]


def keys(model):
    return set(model()._to_dict())


@pytest.fixture(scope="module")
def channels():
    """Channels by topic, as a flight gives them."""
    flight = fly(np.random.default_rng(3), frames=3)
    translation = Translation(flight.opening)
    messages = list(translation.header(flight.events[0][1]))
    for turn, payload in flight.events[1:]:
        messages += translation.record(turn, payload)
    assert isinstance(turn, FrameRecord)
    grid = FlowGrid(np.zeros((2, 2, 2), np.float32), np.ones((2, 2), np.float32), 8, 1, 0)
    messages.append(translation.flow(grid))
    return {message.channel.topic: message.channel for message in messages}


def leaves(node):
    return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])


def topics(value):
    """Every string of a panel's settings that is a topic or begins with one."""
    if isinstance(value, dict):
        return [t for pair in value.items() for part in pair for t in topics(part)]
    if isinstance(value, list):
        return [t for part in value for t in topics(part)]
    return [value] if isinstance(value, str) and TOPIC.match(value) else []


def test_it_has_the_parts_of_an_exported_layout():
    assert LAYOUT.keys() == {
        *("configById", "globalVariables", "userNodes", "playbackConfig", "layout")
    }
    assert sorted(leaves(LAYOUT["layout"])) == sorted(PANELS)


@pytest.mark.parametrize("panel", PANELS)
def test_every_panel_is_of_a_known_type_and_has_settings_of_that_type(panel):
    config = dict(PANELS[panel])
    assert config.pop("foxglovePanelTitle")
    assert config.keys() <= keys(CONFIGS[kind(panel)])
    assert config.get("imageMode", {}).keys() <= keys(fl.ImageModeConfig)
    assert config.get("cameraState", {}).keys() <= keys(fl.ThreeDeeCameraState)
    for layer in config.get("layers", {}).values():
        assert layer.keys() <= keys(fl.BaseRendererGridLayerSettings)
    for series in config.get("paths", []):
        assert series.keys() <= keys(SERIES[kind(panel)])


@pytest.mark.parametrize("panel", PANELS)
def test_every_topic_and_field_exists(panel, channels):
    named = topics(PANELS[panel])
    assert named
    for text in named:
        topic, *fields = text.split(".")
        assert topic in channels, text
        if fields:
            schema = json.loads(channels[topic].schema)
            for field in fields:
                assert field in schema["properties"], text
                schema = schema["properties"][field]


def test_topics_have_the_schemas_that_their_panels_draw(channels):
    image, path = PANELS["Image!dfvs-camera"]["imageMode"], PANELS["3D!dfvs-path"]
    assert channels[image["imageTopic"]].schema_name == image["imageSchemaName"]
    (annotations,) = image["annotations"]
    assert channels[annotations].schema_name == "foxglove.ImageAnnotations"
    drawn = {topic: channels[topic].schema_name for topic in path["topics"]}
    assert sorted(drawn.values()) == ["foxglove.PoseInFrame", "foxglove.PosesInFrame"]
    log = PANELS["RosOut!dfvs-log"]["topicToRender"]
    assert channels[log].schema_name == "foxglove.Log"


def test_every_state_of_the_gate_has_a_colour():
    (gate, *_) = PANELS["StateTransitions!dfvs-state"]["paths"]
    told = {state["value"]: state["color"] for state in gate["customStates"]["states"]}
    assert told.keys() == {state.value for state in GateState}
    assert len(set(told.values())) == len(told)
