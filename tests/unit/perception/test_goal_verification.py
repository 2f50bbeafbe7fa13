"""Goal verification: a view that counts as the goal has to match the goal image."""

import dataclasses

import numpy as np
import pytest
from repeated_shelves import shelves
from still_pipeline import pipeline, servo_result
from textured_wall import Wall, texture

from dfvs_core.matching.classical import classical_matcher
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.elsewhere import SiftImage, match_elsewhere
from dfvs_core.messages.frame import Frame
from dfvs_core.messages.goal import Goal
from dfvs_core.perception.goal_verification import GoalVerifier, matched_texture_ratio
from dfvs_core.perception.vehicle_history import Motion
from dfvs_core.servo.exchange import Status

PER_SECOND = 8
PERIOD_NS = 10**9 // PER_SECOND
SIZE = (240, 320)


def lasting(seconds, view):
    """Views of so long a time, a period apart."""
    return [view] * round(seconds * PER_SECOND)


def still(confidence=0.0):
    """Flow of a view that stands where the goal is; its confidence is a number, or (H, W)."""
    sure = np.broadcast_to(np.asarray(confidence, np.float32), SIZE)
    return FlowField(np.zeros((*SIZE, 2), np.float32), sure.copy())


def verifier_of(goal, least=0.7):
    return GoalVerifier(SiftImage(goal, MatchingConfig()), least)


class Counting:
    """The classical matcher; counts relocalisations and the flows that they exclude."""

    def __init__(self):
        self._matcher = classical_matcher()
        self.encode, self.track = self._matcher.encode, self._matcher.track
        self.relocalisations = self.excluded = 0

    def match(self, current, other, *, excluded=()):
        self.relocalisations += 1
        self.excluded += len(excluded)
        return self._matcher.match(current, other, excluded=excluded)


@pytest.fixture(scope="module")
def goal():
    return Wall(texture(np.random.default_rng(21))).picture()


@pytest.fixture(scope="module")
def elsewhere(goal):
    """Another place with the same window: all that fits is there, and stands where it should."""
    view = Wall(texture(np.random.default_rng(22))).picture()
    view[40:200, 70:250] = goal[40:200, 70:250]
    return view


@dataclasses.dataclass
class FalseGoal:
    """Flight in which another place is taken for the goal: a report and the progress a frame."""

    matcher: Counting
    reports: list
    progress: list


@pytest.fixture(scope="module")
def false_goal(goal, elsewhere):
    """Two rejections, a second apart."""
    matcher, reports, progress = Counting(), [], []
    flight = flight_to(goal, matcher)
    for k, view in enumerate(lasting(2.4, elsewhere)):
        reports += fly(flight, [view], first=k)
        progress.append(flight._state.monitor.stop.progress)
    return FalseGoal(matcher, reports, progress)


def flight_to(goal, matcher=None, **settings):
    return pipeline(goal, matcher or Counting(), depth="constant", **settings)


def fly(flight, views, engaged=True, first=0):
    """Reports of views, a period apart, of a vehicle at rest."""
    reports = []
    for k, view in enumerate(views, first):
        motion = dataclasses.replace(Motion.at_rest(0.0, 0.0), t_ns=k * PERIOD_NS)
        reports.append(flight.process_frame(Frame(view, k * PERIOD_NS, k), motion, engaged).report)
    return reports


def test_at_the_goal_it_is_reached(goal):
    reports = fly(flight_to(goal), lasting(1.6, goal))
    assert all(report.healthy for report in reports)
    assert reports[-1].reached


def test_another_place_with_the_same_window_is_never_reached_and_false_after_a_second(false_goal):
    reports = false_goal.reports
    assert not any(report.reached for report in reports)
    wrong = [k for k, report in enumerate(reports) if not report.healthy]
    assert wrong[0] == PER_SECOND
    assert "look like" in reports[wrong[0]].reason
    assert reports[wrong[0]].velocity == (0.0, 0.0, 0.0, 0.0)
    # Nothing is tracked after a rejection.
    followed = sum(not report.healthy for report in reports[:-1])
    assert false_goal.matcher.relocalisations == 1 + followed


def test_another_place_above_the_same_floor_is_never_reached(goal):
    """A floor whose pattern repeats fits wherever a tile is above another."""
    view = Wall(texture(np.random.default_rng(22))).picture()
    view[55:] = goal[55:]
    reports = fly(flight_to(goal), lasting(2.4, view))
    assert not any(report.reached for report in reports)
    assert not all(report.healthy for report in reports)


def test_without_verification_it_would_have_been_reached(goal, elsewhere):
    """So the two tests above do show what keeps it from that."""
    reports = fly(flight_to(goal, min_matched_texture=0.0), lasting(1.6, elsewhere))
    assert reports[-1].reached


def test_somebody_who_walks_through_the_view_delays_and_nothing_more(goal, elsewhere):
    before, passing, after = lasting(0.4, goal), lasting(0.8, elsewhere), lasting(1.2, goal)
    reports = fly(flight_to(goal), [*before, *passing, *after])
    assert all(report.healthy for report in reports)
    assert not any(report.reached for report in reports[len(before) : -len(after)])
    assert reports[-1].reached


def test_a_goal_that_was_hidden_for_seconds_is_found_again(goal, elsewhere):
    """By then it counts as a false goal, and is excluded from every other relocalisation."""
    views = [*lasting(0.4, goal), *lasting(2.6, elsewhere), *lasting(1.2, goal)]
    reports = fly(flight_to(goal), views)
    assert len(rejections(reports)) == 2
    assert reports[-1].reached


def rejections(reports):
    """Indices of the frames that were rejected as a false goal."""
    return [k for k, report in enumerate(reports) if "look like" in report.reason]


def test_a_false_goal_that_was_flown_to_is_excluded(false_goal):
    assert len(rejections(false_goal.reports)) >= 2
    assert false_goal.matcher.excluded


def test_progress_is_asked_for_anew_after_a_false_goal(false_goal):
    """Its error was nothing: no motion towards another one would count as progress."""
    last = rejections(false_goal.reports)[-1]
    assert any(false_goal.progress[:last])
    assert false_goal.progress[last] is None


def test_the_next_goal_is_not_blamed_for_the_last_one(goal, elsewhere):
    flight = flight_to(goal)
    fly(flight, lasting(0.8, elsewhere))
    flight.set_goal(flight._task, flight.prepare(Goal(elsewhere, flight._task.goal)))
    assert all(report.healthy for report in fly(flight, lasting(1.2, elsewhere)))


def test_a_goal_that_was_not_flown_to_is_not_excluded_for_a_flight_to_the_last_one(goal, elsewhere):
    matcher = Counting()
    flight = flight_to(goal, matcher)
    before = fly(flight, lasting(0.4, goal))
    flight.set_goal(flight._task, flight.prepare(Goal(goal, flight._task.goal)))
    reports = fly(flight, lasting(2.4, elsewhere), engaged=False, first=len(before))
    assert len(rejections(reports)) >= 2
    assert not matcher.excluded


def test_noise_of_a_camera_in_the_dark_is_no_texture_that_has_to_match():
    rng = np.random.default_rng(5)
    view = np.full((240, 320, 3), 60.0)
    view[60:180, 80:240] = 40.0 + 80.0 * (np.indices((120, 160)).sum(axis=0)[..., None] // 12 % 2)
    noisy = np.clip(view + rng.normal(0.0, 8.0, view.shape), 0, 255).astype(np.uint8)
    sure = np.zeros(SIZE)
    sure[56:184, 76:244] = 1.0
    assert matched_texture_ratio(noisy, still(sure)) > 0.9


@pytest.fixture
def window():
    """An image with texture in its middle."""
    image = np.full((240, 320, 3), 120, np.uint8)
    image[80:160, 100:220] = np.random.default_rng(0).integers(0, 255, (80, 120, 3), np.uint8)
    return image


def test_only_texture_has_to_match(window):
    assert matched_texture_ratio(window, still()) == 0.0
    sure = np.zeros(SIZE)
    sure[70:170, 90:230] = 1.0
    assert matched_texture_ratio(window, still(sure)) > 0.95
    assert matched_texture_ratio(np.full_like(window, 120), still()) == 1.0


@pytest.mark.parametrize(("aside_px", "ratio"), [(1.0, 1.0), (8.0, 1.0), (10.0, 0.6)])
def test_texture_that_matches_in_another_place_does_not_count(aside_px, ratio):
    """Two fifths of the view are aside by more than three times the others' 2 px, and 3 px."""
    view = np.random.default_rng(0).integers(0, 255, (240, 320, 3), np.uint8)
    field = still(1.0)
    field.flow[..., 1] = 2.0
    field.flow[:96, :, 1] = aside_px
    found = matched_texture_ratio(view, field)
    assert found == pytest.approx(ratio, abs=0.01)


def servo(status=Status.OK, **changes):
    """Result at the goal."""
    at_the_goal = {"error_m": 0.01, "error_rad": 0.0, "reached": True}
    velocity = np.array([0.1, 0.0, 0.0, 0.2])
    return servo_result(**{"status": status, "velocity": velocity} | at_the_goal | changes)


def verified(result, view, goal, sure=0.0):
    """Result of a view that stands where the goal is, half a second after one like it."""
    verifier = verifier_of(goal)
    verifier.verify(result, view, still(sure), 0)
    return verifier.verify(result, view, still(sure), 500_000_000)


def test_a_doubtful_view_is_flown_and_has_not_reached_the_goal(window):
    result = verified(servo(), window, window)
    assert (result.status, result.reached) == (Status.OK, False)
    assert result.velocity[0] == 0.1


def test_a_view_that_matches_changes_nothing(window):
    result = servo()
    assert verified(result, window, window, sure=1.0) is result


def test_a_frame_that_the_servo_refused_keeps_its_status(window):
    refused = servo(Status.STUCK)
    assert verified(refused, window, window) is refused


def test_a_mismatch_before_frames_that_were_refused_is_no_longer_one(window):
    verifier = verifier_of(window)
    verifier.verify(servo(), window, still(), 0)
    verifier.verify(servo(Status.NO_OVERLAP), window, still(), 500_000_000)
    result = verifier.verify(servo(), window, still(), 1_200_000_000)
    assert (result.status, result.reached) == (Status.OK, False)


@pytest.mark.parametrize(
    ("depth_m", "sure", "reached"),
    [(0.11, 1.0, True), (0.11, 0.0, False), (0.09, 1.0, False)],
    ids=["matches", "does not match", "far"],
)
def test_beside_a_goal_that_a_wrong_scale_takes_for_reached_the_view_decides(
    window, depth_m, sure, reached
):
    """A centimetre, and yet 5 or 6 degrees of a scene that seems to be right before the camera."""
    result = servo(depth_m=depth_m)
    assert verified(result, window, window, sure).reached == reached


def test_a_view_with_swapped_channels_is_not_flown(window):
    tinted = (window * np.array([1.0, 0.7, 0.4])).astype(np.uint8)
    result = verified(servo(), tinted[..., ::-1], tinted, sure=1.0)
    assert (result.status, result.reached) == (Status.SWAPPED_CHANNELS, False)
    assert not result.velocity.any()


def arrival(view, goal, least=0.7):
    """Verifier, and the flow of a view that stands where the goal is, as far as it matches."""
    flow = still(np.abs(view.astype(np.float32) - goal).max(axis=2) < 10.0)
    assert 0.7 < matched_texture_ratio(view, flow) < 0.9
    return verifier_of(goal, least), flow


FALSE, TRUE = (2, 3, 4, 5), (1, 2, 3, 4)


def compared(verifier):
    """The verifier after all that it had to do between frames; it is little at a time."""
    assert sum(iter(verifier.compare, False)) <= 2
    return verifier


def test_the_shelf_beside_is_a_false_goal_once_it_is_compared():
    view, goal = shelves(*FALSE), shelves(*TRUE)
    verifier, flow = arrival(view, goal)
    for t_ns in (0, PERIOD_NS):  # and again where it is matched so again
        result = verifier.verify(servo(), view, flow, t_ns)
        assert (result.status, result.reached) == (Status.OK, False)
        result = compared(verifier).verify(servo(), view, flow, t_ns + 1)
        assert (result.status, result.reached) == (Status.FALSE_GOAL, False)
        assert not result.velocity.any()


def test_nothing_is_reached_until_it_was_compared():
    view, goal = shelves(*FALSE), shelves(*TRUE)
    verifier, flow = arrival(view, goal)
    for k in range(20):
        assert not verifier.verify(servo(), view, flow, k * PERIOD_NS).reached


def test_what_was_not_compared_before_the_vehicle_went_away_is_forgotten():
    view, goal = shelves(*FALSE), shelves(*TRUE)
    verifier, flow = arrival(view, goal)
    verifier.verify(servo(), view, flow, 0)
    far = servo(error_m=3.0, error_rad=1.0, reached=False)
    assert verifier.verify(far, view, flow, 0) is far
    assert not verifier.compare()


@pytest.mark.parametrize(("rows", "status"), [(5, Status.OK), (9, Status.FALSE_GOAL)])
def test_another_match_that_explains_next_to_nothing_of_the_view_is_none(rows, status, monkeypatch):
    """Of 240 rows 14 are open, and the other match explains 2 or 4 % of all texture."""
    view = np.random.default_rng(0).integers(0, 255, (240, 320, 3), np.uint8)
    row = np.arange(240)[:, None]
    monkeypatch.setattr(
        "dfvs_core.perception.goal_verification.match_elsewhere", lambda *_: still(row < rows)
    )
    verifier, flow = verifier_of(view), still(row >= 14)
    verifier.verify(servo(), view, flow, 0)
    assert compared(verifier).verify(servo(), view, flow, 1).status is status


def test_a_shelf_beside_is_left_alone_where_nothing_is_verified_or_nothing_reached():
    view, goal = shelves(*FALSE), shelves(*TRUE)
    verifier, flow = arrival(view, goal, least=0.0)
    assert verifier.verify(servo(), view, flow, 0).reached
    verifier, flow = arrival(view, goal)
    on_the_way = servo(reached=False)
    assert verifier.verify(on_the_way, view, flow, 0) is on_the_way
    assert not verifier.compare()


def test_a_goal_of_repeated_shelves_is_reached_though_something_new_hides_part_of_it(monkeypatch):
    goal = shelves(*TRUE)
    view = goal.copy()
    view[40:200, 120:180] = texture(np.random.default_rng(9))[:160, :60]
    searches = []
    monkeypatch.setattr(
        "dfvs_core.perception.goal_verification.match_elsewhere",
        lambda *images: searches.append(1) or match_elsewhere(*images),
    )
    verifier, flow = arrival(view, goal)
    far = servo(error_m=3.0, error_rad=1.0, reached=False)
    for arrivals in (1, 2):
        verifier.verify(servo(), view, flow, 0)
        compared(verifier)
        for result in (servo(), servo(), far):
            assert verifier.verify(result, view, flow, 0) is result
            assert not verifier.compare()
        assert len(searches) == arrivals  # once each
