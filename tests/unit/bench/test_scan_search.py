"""When the searching camera servos, when it turns, and what it follows, with scripted pipelines."""

import math

import numpy as np
import pytest

from dfvs_bench.methods.dfvs import MAX_SPEED_M_S, MAX_TURN_RAD_S
from dfvs_bench.methods.method import FRAME_PERIOD_S, Decision, GoalObservation, Observation
from dfvs_bench.methods.panorama import OUTER_RING_RAD, ring
from dfvs_bench.methods.scan_search import ScanSearchMethod
from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, se3_log
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import ImageFeatures

CAMERA = CameraModel.from_horizontal_fov(160, 120, math.radians(90))
SHAPE = (CAMERA.height, CAMERA.width)
IMAGE = np.random.default_rng(3).integers(0, 256, (*SHAPE, 3)).astype(np.uint8)
DEPTH = DepthMap(np.ones(SHAPE, np.float32), np.ones(SHAPE, np.float32))


class World:
    """A camera, a matcher that sees something in given directions, and pipelines by script."""

    def __init__(self, seen, pipelines):
        self.T = make_pose(np.eye(3), np.array([1.0, 2.0, -1.5]))
        self.seen = seen
        """Which of the ring's directions show something, and how far the goal picture is shifted
        there, px: directions of one shift need not agree, those of two cannot."""
        self.pipelines = list(pipelines)
        self.begun_at, self.looked = [], 0
        goal = GoalObservation(CAMERA, IMAGE, DEPTH)
        self.method = ScanSearchMethod(self.make, goal, self)

    def make(self):
        return Scripted(self, self.pipelines.pop(0))

    def encode(self, image):
        return ImageFeatures(SHAPE)

    def match(self, current, other, *, excluded=()):
        shift = self.seen.get(self.looked)
        self.looked += 1
        sure = np.zeros(SHAPE, np.float32)
        if shift is not None:
            sure[:, : CAMERA.width - shift] = 1.0
        return FlowField(np.full((*SHAPE, 2), (shift or 0, 0), np.float32), sure)

    def fly(self):
        """Decisions until the method ends."""
        made = []
        for k in range(200):
            decision = self.method.decide(Observation(k, IMAGE, DEPTH, self.T))
            made.append(decision)
            if decision.done or decision.lost:
                break
            self.T = self.T @ decision.T_current_next
        return made


class Scripted:
    """A pipeline that goes ahead by 0.4 m a frame, and then says what it is told to."""

    def __init__(self, world, script):
        self.world = world
        self.script = list(script)
        self.is_false_goal = False

    def decide(self, observation):
        if not hasattr(self, "begun"):
            self.begun = True
            self.world.begun_at.append(observation.T_world_camera)
        word = self.script.pop(0)
        self.is_false_goal = word == "mistaken"
        way = make_pose(np.eye(3), np.array([0.0, 0.0, 0.4 if word == "go" else 0.0]))
        lost = "lost" if word == "lost" else ""
        return Decision(way, 1.0, done=word == "done", lost=lost)


def directions(world):
    """Of the ring, where each pipeline began; None elsewhere."""
    first = world.begun_at[0]
    found = []
    for T in world.begun_at:
        at = [k for k, R in enumerate(ring()) if np.allclose(T[:3, :3], first[:3, :3] @ R)]
        found.append(at[0] if at and np.allclose(T[:3, 3], first[:3, 3]) else None)
    return found


def test_what_sees_its_goal_is_left_alone():
    world = World({}, [["go", "go", "done"]])
    made = world.fly()
    assert [decision.done for decision in made] == [False, False, True]
    assert world.looked == 0


def test_it_matches_around_from_where_it_began_and_follows_the_best_look():
    world = World({6: 0}, [["go", "go", "lost"], ["go", "done"]])
    made = world.fly()
    assert made[-1].done
    assert world.looked == 9
    assert directions(world) == [0, 6]


def test_every_motion_keeps_the_free_camera_s_limits():
    world = World({6: 0}, [["go"] * 30 + ["lost"], ["done"]])
    twists = np.array([se3_log(decision.T_current_next) for decision in world.fly()])
    assert np.linalg.norm(twists[:, :3], axis=1).max() <= MAX_SPEED_M_S * FRAME_PERIOD_S + 1e-9
    assert np.linalg.norm(twists[:, 3:], axis=1).max() <= MAX_TURN_RAD_S * FRAME_PERIOD_S + 1e-9


def test_a_wrong_place_is_left_for_another_one():
    world = World({0: 0, 5: 20}, [["go", "mistaken"], ["done"]])
    assert world.fly()[-1].done
    assert directions(world) == [0, 5]


@pytest.mark.parametrize("word", ["lost", "mistaken"])
def test_matches_are_tried_one_after_the_other_until_none_is_left(word):
    world = World({2: 0, 6: 20}, [["go", word], ["go", word], [word]])
    made = world.fly()
    assert made[-1].lost == "the goal is not seen in any direction"
    assert directions(world) == [0, 2, 6]
    assert world.looked == 9 + 8


def test_it_matches_further_around_where_nothing_is_left_to_follow():
    world = World({2: 0, 12: 0}, [["go", "lost"], ["go", "lost"], ["go", "done"]])
    assert world.fly()[-1].done
    assert directions(world) == [0, 2, None]
    ahead, last = world.begun_at[0][:3, 2], world.begun_at[2][:3, 2]
    assert np.arccos(ahead @ last) == pytest.approx(OUTER_RING_RAD)
    assert world.looked == 9 + 8
