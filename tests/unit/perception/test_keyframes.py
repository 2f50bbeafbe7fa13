"""Keyframes: which frames are kept, for how long, and what they hold."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from still_pipeline import pipeline
from textured_wall import Wall, texture

from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import ImageFeatures
from dfvs_core.messages.frame import Frame
from dfvs_core.perception.keyframes import (
    HORIZON_NS,
    LEAST_INTERVAL_NS,
    LONGEST_INTERVAL_NS,
    MOST_KEYFRAMES,
    Keyframe,
    Keyframes,
)
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.exchange import ServoInputs, ServoState, Status

NO_FLOW = FlowField(np.zeros((0, 0, 2), np.float32), np.zeros((0, 0), np.float32))
DEPTH_M = 3.0


def place(x, yaw=0.0):
    return make_pose(so3_exp(np.array([0.0, yaw, 0.0])), np.array([x, 0.0, 0.0]))


def frame(t_ns, T_world_camera):
    inputs = ServoInputs(t_ns, t_ns, NO_FLOW, np.zeros(4))
    return Keyframe(ImageFeatures((0, 0)), T_world_camera, inputs, ServoState())


def kept(frames):
    keyframes = Keyframes()
    for each in frames:
        keyframes.add(each, DEPTH_M)
    return keyframes


def times(keyframes, frames):
    return [f.t_capture_ns for f in frames if keyframes.find(f.t_capture_ns) is not None]


@given(
    st.lists(st.integers(1_000_000, 700_000_000), min_size=1, max_size=150),
    st.floats(0.0, 5.0),
    st.floats(0.0, 3.0),
)
def test_keyframes_are_spaced_recent_and_few_at_any_frame_rate_and_speed(periods, speed, turn):
    """Whatever the frames: bounded memory, and a keyframe that is nearly as new as the last."""
    t_ns = np.cumsum(periods)
    frames = [frame(int(t), place(speed * t * 1e-9, turn * t * 1e-9)) for t in t_ns]
    keyframes = kept(frames)
    found = times(keyframes, frames)
    assert len(found) == len(keyframes) <= MOST_KEYFRAMES
    assert all(np.diff(found) >= LEAST_INTERVAL_NS)
    assert t_ns[-1] - found[0] <= HORIZON_NS
    assert t_ns[-1] - found[-1] < LONGEST_INTERVAL_NS
    assert keyframes.find().t_capture_ns == found[-1]


def test_a_view_that_changes_gives_keyframes_at_the_least_interval_and_one_that_does_not_fewer():
    t_ns = [k * 20_000_000 for k in range(51)]
    moving = [frame(t, place(t * 1e-9)) for t in t_ns]
    turning = [frame(t, place(0.0, 0.5 * t * 1e-9)) for t in t_ns]
    still = [frame(t, place(0.0)) for t in t_ns]
    assert [len(kept(frames)) for frames in (moving, turning, still)] == [11, 11, 4]


def chosen(poses, T_world_camera, least_m=0.0):
    frames = [frame(k * LONGEST_INTERVAL_NS, T) for k, T in enumerate(poses)]
    found = kept(frames).for_depth(T_world_camera, DEPTH_M, least_m)
    return None if found is None else frames.index(found)


def test_the_newest_frame_with_enough_baseline_is_chosen():
    poses = [place(0.0), place(0.05), place(0.1), place(0.28)]
    assert chosen(poses, place(0.3)) == 2


def test_the_longest_baseline_serves_where_none_suffices():
    poses = [place(0.0), place(0.02), place(0.05)]
    assert chosen(poses, place(0.06)) == 0


@pytest.mark.parametrize(("least_m", "index"), [(0.15, 2), (0.25, 1), (0.9, 0)])
def test_a_longer_baseline_is_taken_where_it_is_asked_for(least_m, index):
    """Where none is as long, the longest."""
    poses = [place(0.0), place(0.05), place(0.1), place(0.28)]
    assert chosen(poses, place(0.3), least_m) == index


def test_frames_too_near_or_too_turned_are_not_used():
    assert chosen([place(0.0)], place(0.001)) is None
    assert chosen([place(0.0, yaw=0.6)], place(0.5)) is None


class Encoding:
    """The classical matcher; encodes each image at once, as a relocalisation does."""

    def __init__(self):
        self._matcher = classical_matcher()
        self.match, self.track = self._matcher.match, self._matcher.track
        self.prepared = []

    def encode(self, image):
        self.prepared.append(self._matcher.encode(image))
        assert len(self.prepared[-1].features.points) > 0
        return self.prepared[-1]


def test_only_the_goal_and_the_newest_frame_hold_features(rng):
    picture, matcher = Wall(texture(rng)).picture(), Encoding()
    perception = pipeline(picture, matcher, depth="constant")
    for k in range(4):
        t_ns = k * LONGEST_INTERVAL_NS
        perception.process_frame(Frame(picture, t_ns, k), Motion.at_rest(0.0, 0.0), engaged=True)
    assert len(perception._keyframes) == 4
    assert [each._features is not None for each in matcher.prepared] == [
        True,
        False,
        False,
        False,
        True,
    ]


class Broken:
    """The classical matcher, whose second match with the goal is not finite."""

    def __init__(self):
        self._matcher = classical_matcher()
        self.encode, self.match = self._matcher.encode, self._matcher.match

    def track(self, current, other, predicted):
        return FlowField(np.full_like(predicted.flow, np.nan), predicted.confidence)


def test_a_frame_whose_flow_is_not_finite_is_not_what_the_next_one_is_compared_with(rng):
    picture = Wall(texture(rng)).picture()
    perception = pipeline(picture, Broken(), depth="constant")
    found = []
    for k in range(2):
        motion = replace(Motion.at_rest(0.0, 0.0), t_ns=k * LEAST_INTERVAL_NS)
        frame = Frame(picture, motion.t_ns, k)
        found.append(perception.process_frame(frame, motion, engaged=True).result.status)
    assert found == [Status.OK, Status.NOT_FINITE]
    assert perception._last.inputs.t_capture_ns == perception._state.last.t_capture_ns == 0
