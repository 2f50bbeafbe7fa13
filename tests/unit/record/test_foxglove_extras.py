"""Flow overlay, path and log for Foxglove."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.matching.correspondence import FlowField
from dfvs_core.messages.link import GateStatus
from dfvs_core.perception.flow_grid import sample_flow
from dfvs_service.record.messages.foxglove import flow_annotations, log, path
from dfvs_service.record.messages.translation import FlightLog, FlownPath

STATUS = GateStatus("READY", "", None, since_ns=1)


def lines(flow, confidence, min_confidence=0.5):
    grid = sample_flow(FlowField(flow, confidence), seq=1, t_capture_ns=0)
    data = flow_annotations(2_000_000_000, grid, min_confidence)
    (drawn,) = ImageAnnotations.FromString(data).points
    assert drawn.timestamp.seconds == 2
    points = np.array([(p.x, p.y) for p in drawn.points]).reshape(-1, 2, 2)
    return points[:, 0], points[:, 1]


def test_lines_go_from_a_pixel_to_where_the_goal_shows_it():
    v, u = np.mgrid[0:120, 0:160] + 0.5
    flow = np.stack((0.25 * u, -0.125 * v), axis=-1).astype(np.float32)
    begins, ends = lines(flow, np.ones((120, 160), np.float32))
    assert len(begins) > 100
    assert ends == pytest.approx(begins * (1.25, 0.875), abs=0.05)


def test_what_is_not_confident_is_not_drawn():
    confidence = np.ones((120, 160), np.float32)
    confidence[:, :80] = 0.2
    begins, _ = lines(np.zeros((120, 160, 2), np.float32), confidence)
    assert begins[:, 0].min() > 80


def test_no_flow_is_no_line():
    begins, _ = lines(np.zeros((120, 160, 2), np.float32), np.zeros((120, 160), np.float32))
    assert len(begins) == 0


@given(st.lists(st.floats(0.0, 0.5), max_size=4000))
def test_a_path_stays_small_and_keeps_its_beginning_and_shape(steps):
    flown, at, all_of_it = FlownPath(), 0.0, [0.0]
    flown.add((0.0, 0.0, 0.0))
    for step in steps:
        at += step
        all_of_it.append(at)
        flown.add((at, 0.0, 0.0))
    kept = [north for north, _, _ in flown.positions_m]
    assert len(kept) <= 1000
    assert kept[0] == 0.0
    assert set(kept) <= set(all_of_it)
    assert all(b > a for a, b in itertools.pairwise(kept))


def test_a_path_of_any_length_ends_near_the_vehicle():
    flown = FlownPath()
    for i in range(50_000):
        flown.add((0.05 * i, 0.0, 0.0))
    assert len(flown.positions_m) <= 1000
    assert math.dist(flown.positions_m[-1], (0.05 * 49_999, 0.0, 0.0)) < 7.0


def test_a_path_is_in_the_frame_of_the_autopilot():
    message = PosesInFrame.FromString(path(0, [(1.0, 2.0, -3.0)]))
    assert message.frame_id == "ned"
    assert message.poses[0].position.z == -3.0


def told(*statuses):
    flight_log = FlightLog()
    return [entry for status in statuses for entry in flight_log.entries(status)]


def test_a_change_of_state_is_told_once_with_its_cause():
    hold = replace(STATUS, state="HOLD", cause="frame too old", since_ns=5)
    assert told(STATUS, STATUS, hold, replace(hold, t_ns=9)) == [
        ("INFO", "READY"),
        ("WARNING", "HOLD: frame too old"),
    ]


def test_a_state_that_is_entered_again_is_told_again():
    assert len(told(STATUS, replace(STATUS, since_ns=7))) == 2


def test_answers_and_warnings_are_told_once():
    warned = replace(STATUS, warnings=("hot",), command_count=1, command_result="accepted: hold")
    assert told(STATUS, warned, replace(warned, t_ns=3))[1:] == [
        ("INFO", "command accepted: hold"),
        ("WARNING", "hot"),
    ]


def test_an_abort_is_an_error():
    message = Log.FromString(log(0, "gate", told(replace(STATUS, state="ABORT", cause="x"))[0]))
    assert (message.level, message.name, message.message) == (Log.Level.ERROR, "gate", "ABORT: x")
