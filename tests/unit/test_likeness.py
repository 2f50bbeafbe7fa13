"""A place that counts as the goal has to look like the goal picture."""

import dataclasses

import numpy as np
import pytest
from textured_wall import Wall, texture

from dfvs_core.camera import CameraModel
from dfvs_core.correspondence import FlowField
from dfvs_core.goal import Goal, GoalSidecar, Mount
from dfvs_core.likeness import PATIENCE_NS, likeness
from dfvs_core.matching.classical import ClassicalMatcher
from dfvs_core.pipeline import Pipeline
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame

PERIOD_NS = 40_000_000
STILL = Motion(0, 0.0, 0.0, 0.0, np.zeros(3), np.zeros(3), 0.0)


class Counting(ClassicalMatcher):
    """Counts searches by nothing."""

    def __init__(self):
        super().__init__()
        self.searches = self.passed_over = 0

    def match(self, current, other, guess=None, *, besides=()):
        self.searches += guess is None
        self.passed_over += len(besides)
        return super().match(current, other, guess, besides=besides)


@pytest.fixture(scope="module")
def goal():
    return Wall(texture(np.random.default_rng(21))).picture()


@pytest.fixture(scope="module")
def elsewhere(goal):
    """Another place with the same window: all that fits is there, and stands where it should."""
    view = Wall(texture(np.random.default_rng(22))).picture()
    view[40:200, 70:250] = goal[40:200, 70:250]
    return view


def pipeline_for(goal, matcher, **settings):
    height, width = goal.shape[:2]
    camera = CameraModel.from_horizontal_fov(width, height, 1.3)
    sidecar = GoalSidecar(camera)
    task = ServoTask(ServoConfig(depth="constant", **settings), camera, sidecar, Mount())
    return Pipeline(task, matcher, Goal(goal, sidecar), lambda: 0)


def fly(pipeline, views, engaged=True):
    """Reports of views, 25 a second, of a vehicle at rest."""
    reports = []
    for k, view in enumerate(views):
        motion = dataclasses.replace(STILL, t_ns=k * PERIOD_NS)
        reports.append(pipeline.process(Frame(view, k * PERIOD_NS, k), motion, engaged).report)
    return reports


def test_at_the_goal_it_is_reached(goal):
    reports = fly(pipeline_for(goal, Counting()), [goal] * 40)
    assert all(report.healthy for report in reports)
    assert reports[-1].reached


def test_another_place_with_the_same_window_is_never_reached_and_a_mistake_in_a_second(
    goal, elsewhere
):
    matcher = Counting()
    reports = fly(pipeline_for(goal, matcher), [elsewhere] * 60)
    assert not any(report.reached for report in reports)
    wrong = [k for k, report in enumerate(reports) if not report.healthy]
    assert wrong[0] == pytest.approx(PATIENCE_NS / PERIOD_NS, abs=1)
    assert "look like" in reports[wrong[0]].reason
    assert reports[wrong[0]].velocity == (0.0, 0.0, 0.0, 0.0)
    assert matcher.searches == 1 + len(wrong)  # after each mistake from scratch


def test_another_place_above_the_same_floor_is_never_reached(goal):
    """A floor whose pattern repeats fits wherever a tile is above another."""
    view = Wall(texture(np.random.default_rng(22))).picture()
    view[55:] = goal[55:]
    reports = fly(pipeline_for(goal, Counting()), [view] * 60)
    assert not any(report.reached for report in reports)
    assert not all(report.healthy for report in reports)


def test_without_the_watch_it_would_have_been_reached(goal, elsewhere):
    """So the two tests above do show what keeps it from that."""
    reports = fly(pipeline_for(goal, Counting(), min_likeness=0.0), [elsewhere] * 40)
    assert reports[-1].reached


def test_somebody_who_walks_through_the_view_delays_and_nothing_more(goal, elsewhere):
    passing = int(0.8 * PATIENCE_NS / PERIOD_NS)
    reports = fly(pipeline_for(goal, Counting()), [goal] * 5 + [elsewhere] * passing + [goal] * 30)
    assert all(report.healthy for report in reports)
    assert not any(report.reached for report in reports[5 : 5 + passing])
    assert reports[-1].reached


def test_a_goal_that_was_hidden_for_seconds_is_found_again(goal, elsewhere):
    """By then its place counts as a wrong one, and is passed over in every other search."""
    hidden = int(2.6 * PATIENCE_NS / PERIOD_NS)
    reports = fly(pipeline_for(goal, Counting()), [goal] * 5 + [elsewhere] * hidden + [goal] * 30)
    assert sum("look like" in report.reason for report in reports) == 2
    assert reports[-1].reached


@pytest.mark.parametrize("engaged", [True, False])
def test_only_a_place_that_was_flown_to_is_passed_over(goal, elsewhere, engaged):
    """Before a flight somebody may stand in front of the goal for as long as they like."""
    matcher = Counting()
    reports = fly(pipeline_for(goal, matcher), [elsewhere] * 60, engaged)
    assert sum("look like" in report.reason for report in reports) >= 2
    assert bool(matcher.passed_over) == engaged


def test_progress_is_asked_for_anew_after_a_mistake(goal, elsewhere):
    """At the wrong place the error was nothing: no way to another one would count as progress."""
    pipeline = pipeline_for(goal, Counting())
    reports = fly(pipeline, [elsewhere] * 80)
    last = max(k for k, report in enumerate(reports) if "look like" in report.reason)
    pipeline = pipeline_for(goal, Counting())
    fly(pipeline, [elsewhere] * (last + 1))
    assert pipeline._state.stop.progress is None


def test_the_next_goal_is_not_blamed_for_the_last_one(goal, elsewhere):
    pipeline = pipeline_for(goal, Counting())
    fly(pipeline, [elsewhere] * 20)
    pipeline.aim(pipeline._task, pipeline.prepare(Goal(elsewhere, pipeline._task.goal)))
    assert all(report.healthy for report in fly(pipeline, [elsewhere] * 30))


def test_noise_of_a_camera_in_the_dark_is_no_texture_that_has_to_match():
    rng = np.random.default_rng(5)
    view = np.full((240, 320, 3), 60.0)
    view[60:180, 80:240] = 40.0 + 80.0 * (np.indices((120, 160)).sum(axis=0)[..., None] // 12 % 2)
    noisy = np.clip(view + rng.normal(0.0, 8.0, view.shape), 0, 255).astype(np.uint8)
    flow, sure = np.zeros((240, 320, 2), np.float32), np.zeros((240, 320), np.float32)
    sure[56:184, 76:244] = 1.0
    assert likeness(noisy, FlowField(flow, sure)) > 0.9


def test_likeness_asks_only_for_what_has_texture():
    view = np.full((240, 320, 3), 120, np.uint8)
    view[80:160, 100:220] = np.random.default_rng(0).integers(0, 255, (80, 120, 3), np.uint8)
    flow, sure = np.zeros((240, 320, 2), np.float32), np.zeros((240, 320), np.float32)
    assert likeness(view, FlowField(flow, sure)) == 0.0
    sure[70:170, 90:230] = 1.0
    assert likeness(view, FlowField(flow, sure)) > 0.95
    plain = np.full_like(view, 120)
    assert likeness(plain, FlowField(flow, np.zeros_like(sure))) == 1.0


@pytest.mark.parametrize(("engaged", "searches"), [(False, 2), (True, 1)])
def test_a_scant_first_look_is_looked_at_again_unless_the_vehicle_flies(goal, engaged, searches):
    view = Wall(texture(np.random.default_rng(22))).picture()
    view[60:160, 90:220] = goal[60:160, 90:220]
    matcher = Counting()
    pipeline = pipeline_for(goal, matcher)
    assert pipeline.process(Frame(view, 0, 0), STILL, engaged).report.healthy
    pipeline.digest()
    assert matcher.searches == searches
