"""Goals in a row, from frames of a box whose flow is known exactly."""

from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest
from at_once import AtOnce
from box_sight import CAMERA, CLOCK, MS, KnowingMatcher, picture

from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_core.perception.goal_tracker import TrackingState
from dfvs_core.perception.keyframes import HORIZON_NS
from dfvs_core.servo.exchange import Status
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import Clocks, build_frame_processor, servo_task
from dfvs_service.perception.frame_processor import unhealthy_report
from dfvs_service.perception.route_follower import RouteFollower
from dfvs_service.settings.config import load_config


class CountingMatcher(KnowingMatcher):
    """Counts relocalisations."""

    relocalisations = 0

    def match(self, current, other, *, excluded=()):
        self.relocalisations += 1
        return super().match(current, other, excluded=excluded)


class Rig:
    """Perception on a route, with clock and vehicle in hand; 40 degrees from goal to goal."""

    def __init__(self, yaws=(40.0, 80.0, 120.0)):
        overrides = {"route.near_deg": 10.0}
        sidecar = GoalSidecar(CAMERA)
        self.config, _ = load_config(None, overrides).with_camera((96, 72), sidecar)
        self.goals = [Goal(picture(yaw), sidecar) for yaw in yaws]
        self.now_ns = 5_000 * MS
        clocks = Clocks(CLOCK, lambda: self.now_ns, lambda: self.now_ns)
        self.matcher = CountingMatcher()
        self.eye = build_frame_processor(self.config, self.goals[0], self.matcher, clocks)
        self.pipeline = self.eye.pipeline
        self.route = RouteFollower(self.config, self.goals, AtOnce())
        self.state = "SERVO"
        self.seq = 0

    def frame(self, yaw_deg):
        """One frame from a heading, 100 ms after the last; the report for the gate."""
        self.now_ns += 100 * MS
        self.seq += 1
        vehicle = VehicleState(self.now_ns, 0, 0, np.radians(yaw_deg), (0,) * 3, (0,) * 3)
        self.eye.on_gate_status(GateStatus(self.state, "", vehicle))
        image = picture(yaw_deg)
        image[1, 1] = self.seq % 251  # a picture that never changes is a frozen camera's
        payload, attachment = encode_frame(
            Frame(image, self.now_ns, self.seq), PixelFormat.RGB8, CLOCK
        )
        glance = self.eye.process(RawSample(payload, attachment, self.now_ns))
        report = self.route.amend(glance.report, glance.frame_result)
        if glance.frame_result is not None:
            self.last = glance.frame_result
            self.route.follow(
                glance.frame_result,
                self.now_ns,
                engaged=self.eye.servoing,
                paused=self.eye.paused,
            )
            self.route.go_on(self.pipeline, self.now_ns)
        return report

    def stay(self, yaw_deg, seconds):
        return [self.frame(yaw_deg) for _ in range(round(10 * seconds))]

    def next_goal(self):
        """Task and view of the second goal, after a second before it."""
        self.stay(35.0, 1)
        return servo_task(self.config, self.goals[1]), self.pipeline.prepare(self.goals[1])


def test_goals_are_passed_one_by_one_and_only_the_last_is_reached():
    rig = Rig()
    rig.stay(5.0, 2)
    assert rig.route.index == 0
    reports = rig.stay(40.0, 2)
    assert rig.route.index == 1
    assert reports[0].error_rad < 0.01
    assert {report.goals_left for report in reports} == {2, 1}
    reports += rig.stay(80.0, 2)
    assert rig.route.index == 2
    assert all(report.healthy for report in reports)
    last = rig.stay(120.0, 2)[-1]
    assert (last.reached, last.goals_left) == (True, 0)


def test_a_goal_on_the_way_that_the_vehicle_stays_at_is_within_tolerance():
    """Its error need not fall; the gate knows that another one follows."""
    report = Rig((40.0, 180.0)).stay(40.0, 3)[-1]
    assert (report.reached, report.goals_left) == (True, 1)


def test_a_frame_of_a_route_under_way_names_the_goal_and_how_to_begin_anew():
    rig = Rig()
    rig.state = "READY"
    assert "of the route's" not in rig.stay(170.0, 1)[-1].reason
    good = rig.stay(40.0, 2)[-1]
    place = "goal 2 of the route's 3; a new start of the service begins at the first"
    assert (good.healthy, good.reason) == (True, place)
    refused = rig.stay(170.0, 2)[-1]
    assert not refused.healthy
    assert refused.reason.endswith(f" ({place})")


def test_a_fault_that_is_not_the_goals_names_no_goal():
    rig = Rig()
    rig.state = "READY"
    rig.stay(40.0, 2)
    assert rig.route.index == 1
    fault = unhealthy_report(0, 0, "no camera frame on dfvs/drone1/camera for 0.25 s")
    assert rig.route.amend(fault).reason == fault.reason


def test_a_frame_that_coasts_does_not_begin_the_patience_with_the_next_goal_anew():
    rig = Rig(yaws=(40.0, 170.0))  # the second is not in sight from the first
    rig.stay(40.0, 1)
    before = rig.route._state
    assert before.near_ns
    refused = replace(rig.last.result, status=Status.NO_OVERLAP)
    coasting = replace(rig.last, tracking=TrackingState.COASTING, result=refused)
    rig.route.follow(coasting, rig.now_ns, engaged=True)
    assert rig.route._state == before
    lost = replace(coasting, tracking=TrackingState.LOST)
    rig.route.follow(lost, rig.now_ns, engaged=True)
    assert rig.route._state.near_ns is None


def test_a_next_goal_that_is_not_in_sight_is_lost_although_the_gate_holds_now_and_then():
    rig = Rig(yaws=(40.0, 170.0))  # the second is not in sight from the first
    for state, seconds in (("SERVO", 3), ("HOLD", 1.2), ("SERVO", 3), ("HOLD", 1.2)):
        rig.state = state
        assert not rig.stay(40.0, seconds)[-1].lost
    rig.state = "SERVO"
    assert rig.stay(40.0, 3)[-1].lost


def test_each_goal_is_flown_to_by_its_own_error():
    rig = Rig()
    rig.stay(40.0, 2)
    report = rig.frame(40.0)
    assert rig.route.index == 1
    assert report.error_rad == pytest.approx(np.radians(40.0), abs=0.02)
    assert report.velocity[3] > 0.1


def test_the_next_goal_is_tracked_on_from_its_preview():
    """A search at that moment would make a frame late in flight."""
    rig = Rig()
    while rig.route.index == 0:
        rig.frame(40.0)
    relocalisations = rig.matcher.relocalisations
    assert rig.frame(41.0).healthy
    assert rig.matcher.relocalisations == relocalisations


def test_a_next_goal_that_does_not_come_in_sight_ends_the_flight_with_the_reason():
    rig = Rig((40.0, 180.0))
    reports = rig.stay(40.0, 9)
    assert rig.route.index == 0
    assert not any(report.lost for report in reports[:75])
    assert reports[-1].lost
    assert not reports[-1].healthy
    assert reports[-1].reason == "goal 2 of the route's 2 does not come in sight"
    assert reports[-1].velocity == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("state", ["HOLD", "ENGAGE", "READY"])
def test_patience_with_the_next_goal_runs_in_servo_alone(state):
    """An operator may hold a flight for as long as they like."""
    rig = Rig((40.0, 180.0))
    rig.stay(40.0, 5)
    rig.state = state
    assert not any(report.lost for report in rig.stay(40.0, 10))


def test_one_goal_is_no_route():
    rig = Rig((40.0,))
    assert rig.stay(40.0, 2)[-1].reached
    assert rig.route.is_last


class Later(AtOnce):
    """Works only when it is told to."""

    def __init__(self):
        self.waiting = []

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        self.waiting.append((future, fn))
        return future

    def work(self):
        for future, fn in self.waiting:
            future.set_result(fn())
        self.waiting.clear()


def test_frames_do_not_wait_for_a_look_and_one_look_is_taken_at_a_time():
    rig, workers = Rig(), Later()
    rig.route = RouteFollower(rig.config, rig.goals, workers)
    reports = rig.stay(40.0, 1)[1:]  # the first frame comes before two states
    assert all(report.healthy for report in reports)
    assert len(workers.waiting) == 1
    for _ in range(2):
        workers.work()
        rig.stay(40.0, 0.4)
    assert rig.route.index == 1


def test_a_preview_is_the_same_whenever_it_is_worked_out():
    """A replay works it out when the goal changes, from the frame of that capture time."""
    rig = Rig()
    task, view = rig.next_goal()
    at_once = rig.pipeline.evaluate_next_goal(task, view)()
    for yaw in (37.0, 40.0, 43.0):
        rig.frame(yaw)
    later = rig.pipeline.evaluate_next_goal(task, view, at_once.observation.t_capture_ns)()
    for name in ("flow", "confidence"):
        first, second = (getattr(p.observation.flow, name) for p in (at_once, later))
        assert np.array_equal(first, second)
    assert np.array_equal(at_once.result.motion, later.result.motion)
    assert np.array_equal(at_once.observation.T_goal_current, later.observation.T_goal_current)


def test_a_preview_finds_the_keypoints_that_verification_needs_on_arrival():
    rig = Rig()
    task, view = rig.next_goal()
    assert view.image._features is None
    rig.pipeline.evaluate_next_goal(task, view)()
    assert view.image._features is not None


@pytest.mark.parametrize(("seconds", "used"), [(-0.4, True), (0.1, False)])
def test_an_observation_is_dropped_once_its_keyframe_is_not_kept(seconds, used):
    """No replay could recompute it."""
    rig = Rig()
    task, view = rig.next_goal()
    preview = rig.pipeline.evaluate_next_goal(task, view)()
    t_ns = preview.observation.t_capture_ns
    rig.stay(35.0, HORIZON_NS * 1e-9 + seconds)
    rig.pipeline.set_goal(task, view, preview.observation)
    assert rig.pipeline.observed_ns == (t_ns if used else None)
    assert (rig.pipeline.evaluate_next_goal(task, view, t_ns) is not None) == used


def test_a_goal_that_begins_with_a_search_has_no_observation():
    rig = Rig()
    task, view = rig.next_goal()
    observation = rig.pipeline.evaluate_next_goal(task, view)().observation
    rig.pipeline.set_goal(task, view, observation)
    assert rig.pipeline.observed_ns == observation.t_capture_ns
    rig.pipeline.set_goal(task, view)
    assert rig.pipeline.observed_ns is None


def test_a_preview_of_the_next_goal_changes_nothing():
    """A replay runs none but the last before a goal, and must give the same commands."""
    looking, plain = Rig((40.0, 180.0)), Rig((40.0, 180.0))
    plain.route.go_on = lambda *_: False
    previews = []
    evaluate = looking.pipeline.evaluate_next_goal
    looking.pipeline.evaluate_next_goal = lambda *words: previews.append(evaluate(*words))
    for yaw in np.linspace(30.0, 36.0, 90):
        assert looking.frame(yaw) == plain.frame(yaw)
    assert len(previews) > 3
