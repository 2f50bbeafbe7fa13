"""The servo document's channel of a recording: schema and content."""

import json

import pytest
from box_sight import CAMERA

from dfvs_core.messages.frame_record import FrameRecord, SessionHeader
from dfvs_core.messages.goal import GoalSidecar
from dfvs_core.messages.link import PerceptionReport
from dfvs_core.messages.schema import dump
from dfvs_core.servo.config import ServoConfig
from dfvs_service.record.messages.translation import Translation
from dfvs_service.settings.camera_section import CameraSection

REPORT = PerceptionReport(0, 0, (0.0,) * 4, False, False, False, "", 0.0, 0.0, 0.0)
KNOWN = {"error_m": 0.5, "error_spread_m": 0.02, "velocity_error": [0.01, 0.0, 0.0, 0.0]}
UNKNOWN = dict.fromkeys(KNOWN)


def servo_messages(*documents):
    settings = {"camera": dump(CameraSection()), "servo": dump(ServoConfig())}
    opening = SessionHeader("v", 0, 0, "", 0, {}, {}, settings, dump(GoalSidecar(CAMERA)))
    translation = Translation(opening)
    turns = [FrameRecord(i, 0, i, (), REPORT, servo=servo) for i, servo in enumerate(documents)]
    messages = [message for turn in turns for message in translation.record(turn, b"")]
    return [m for m in messages if m.channel.topic == "/perception/servo"]


@pytest.mark.parametrize("documents", [(KNOWN, UNKNOWN), (UNKNOWN, KNOWN)])
def test_the_schema_is_the_same_whether_the_first_frame_was_refused_or_not(documents):
    first, second = servo_messages(*documents)
    assert first.channel == second.channel
    properties = json.loads(first.channel.schema)["properties"]
    assert properties["error_spread_m"] == {"type": "number"}
    assert properties["velocity_error"] == {"type": "array", "items": {"type": "number"}}


def test_unknown_values_stay_null():
    (message,) = servo_messages(UNKNOWN)
    assert json.loads(message.data) == UNKNOWN


def test_documents_without_uncertainty_have_no_such_field():
    (message,) = servo_messages({"error_m": 0.5})
    assert list(json.loads(message.channel.schema)["properties"]) == ["error_m"]
