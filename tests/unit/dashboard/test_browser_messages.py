import json
import struct

import pytest

from dfvs_core.messages.goal_command import GoalCommand
from dfvs_service.dashboard.client_session import commanded_goal, read_message


def with_picture(header, picture=b"jpeg", length=None):
    words = json.dumps(header).encode()
    return struct.pack("<I", len(words) if length is None else length) + words + picture


def test_text_is_a_json_object():
    assert read_message('{"type": "ping"}', None) == {"type": "ping"}


@pytest.mark.parametrize("text", ["", "[]", "3", "{", "null", "[" * 90_000])
def test_other_text_is_an_empty_message(text):
    assert read_message(text, None) == {}


def test_a_picture_comes_with_what_is_said_of_it():
    message = read_message(None, with_picture({"command": "goal", "sidecar": "{}"}))
    assert message["command"] == "goal"
    assert commanded_goal(message) == GoalCommand(b"jpeg", "{}")


@pytest.mark.parametrize(
    "data", [b"", b"abc", with_picture({}, length=1 << 31), struct.pack("<I", 1) + b"["]
)
def test_bytes_that_hold_no_header_are_an_empty_message(data):
    assert read_message(None, data) == {}


def test_a_picture_cannot_be_smuggled_in_by_text():
    message = read_message('{"image": "abc"}', None)
    assert commanded_goal(message) is None


def test_a_sidecar_that_is_no_text_is_left_out():
    message = read_message(None, with_picture({"sidecar": [1]}))
    assert commanded_goal(message) == GoalCommand(b"jpeg", "")
