"""When a replay must be the same to the last bit, and when not."""

import dataclasses
import json

import pytest

from dfvs_core.messages.frame_record import SessionHeader
from dfvs_core.messages.schema import dump
from dfvs_service.replay.flight import reasons_to_differ
from dfvs_service.settings.config import load_config

BUILD = {"source": "aa" * 32, "numpy": "2.4.0", "processor": "one"}
MODEL = {"flow.onnx": "bb" * 32}
CONFIG = load_config(None, {"flow.model": "models/flow"})
SETTINGS = json.loads(json.dumps(dump(CONFIG)))
OPENING = SessionHeader("v", 0, 0, "", 0, BUILD, MODEL, SETTINGS, {})


def other(**flow):
    return dataclasses.replace(CONFIG, flow=dataclasses.replace(CONFIG.flow, **flow))


def test_nothing_changed_leaves_no_reason():
    assert reasons_to_differ(OPENING, CONFIG, MODEL, BUILD) == ()


def test_where_a_model_lies_does_not_matter_but_what_it_holds_does():
    assert reasons_to_differ(OPENING, other(model="/elsewhere/flow"), MODEL, BUILD) == ()
    assert reasons_to_differ(OPENING, CONFIG, {"flow.onnx": "cc" * 32}, BUILD) == (
        "the model's files are others",
    )


def test_the_depth_network_is_told_apart_from_the_matcher():
    with_depth = MODEL | {"depth/mono.onnx": "dd" * 32}
    reason = ("the depth network's files are others",)
    assert reasons_to_differ(OPENING, CONFIG, with_depth, BUILD) == reason
    flown = dataclasses.replace(OPENING, model=MODEL | {"depth/mono.onnx": "ee" * 32})
    assert reasons_to_differ(flown, CONFIG, with_depth, BUILD) == reason
    assert len(reasons_to_differ(flown, CONFIG, {"flow.onnx": "cc" * 32}, BUILD)) == 2


def test_the_same_files_used_in_another_way_are_another_matcher():
    assert reasons_to_differ(OPENING, other(model="hybrid:models/flow"), MODEL, BUILD)


@pytest.mark.parametrize(
    "changed", [{"numpy": "2.5.0"}, {"processor": "two"}, {"source": "dd" * 32}]
)
def test_another_build_is_named(changed):
    (reason,) = reasons_to_differ(OPENING, CONFIG, MODEL, BUILD | changed)
    ((name, value),) = changed.items()
    assert reason.startswith(f"{name} is {value[:20]}")


def test_what_perception_does_not_depend_on_is_no_reason():
    telemetry = dataclasses.replace(CONFIG.telemetry, preview_quality=11)
    config = dataclasses.replace(CONFIG, telemetry=telemetry)
    assert reasons_to_differ(OPENING, config, MODEL, BUILD) == ()
    assert reasons_to_differ(OPENING, other(threads=3), MODEL, BUILD) == (
        "the settings of [flow] are others",
    )
