"""Work between frames: which of it is done after a frame, and when it is put off."""

import numpy as np
import pytest
from repeated_shelves import shelves
from still_pipeline import StillMatcher, pipeline, servo_result

from dfvs_core.gate.config import GateTiming
from dfvs_core.matching.correspondence import FlowField, confident_ratio
from dfvs_core.messages.frame import Frame
from dfvs_core.perception.frame_load import PATIENCE_NS, FrameLoad, Work
from dfvs_core.perception.pipeline import DEPTH_PERIOD_NS
from dfvs_core.perception.vehicle_history import Motion

MS = 1_000_000
START_NS = 10**9


class PartlySeen(StillMatcher):
    """Tracks what is predicted, of a goal in a part of the view; an extension finds all of it."""

    def __init__(self):
        super().__init__()
        self.share = 0.3

    def track(self, current, other, predicted):
        self.predictions.append(predicted)
        return FlowField(predicted.flow, predicted.confidence)

    def extend(self, current, other, known):
        self.extensions += 1
        still = np.zeros((*current.size, 2), np.float32)
        return FlowField(still, np.ones(current.size, np.float32))


def frames(
    perception, picture, now, ages_ns, rate_hz, seconds, aside_m_s=0.0, engaged_from=None, work_ns=0
):
    """Results of frames at a rate, each with the work after it.

    ``ages_ns`` are those at the servo step: from capture to arrival, and from there on. The vehicle
    is engaged from that frame on. Work takes ``work_ns``, and the next frame waits for its end.
    """
    transport_ns, processing_ns = ages_ns
    free_ns = 0
    for k in range(round(seconds * rate_hz)):
        t_ns = START_NS + round(k * 1e9 / rate_hz)
        t_arrival_ns = t_ns + transport_ns
        now[0] = max(t_arrival_ns, free_ns) + processing_ns
        aside = np.array([0.0, aside_m_s * k / rate_hz, 0.0])
        motion = Motion(t_ns, 0.0, 0.0, 0.0, np.zeros(3), aside, 0.0)
        frame = Frame(picture, t_ns, k, t_arrival_ns)
        engaged = engaged_from is not None and k >= engaged_from
        yield perception.process_frame(frame, motion, engaged)
        perception.work_between_frames()
        free_ns = now[0] + work_ns if perception._load.done is not None else 0


@pytest.fixture
def picture(rng):
    return rng.integers(0, 255, (120, 160, 3)).astype(np.uint8)


def is_extended(picture, ages_ns, rate_hz):
    """Whether a frame shows all of the goal within 4 s; the vehicle goes aside all the time."""
    now, settings = [0], {"depth": "motion", "min_matched_texture": 0.0}
    perception = pipeline(picture, PartlySeen(), lambda: now[0], **settings)
    found = frames(perception, picture, now, ages_ns, rate_hz, 4.0, aside_m_s=0.4)
    return any(confident_ratio(each.flow) > 0.9 for each in found)


@pytest.mark.parametrize(
    ("rate_hz", "age_ms"),
    [(5, 10), (5, 105), (10, 105), (15, 40), (15, 70), (30, 25), (30, 40), (60, 20)],
)
@pytest.mark.parametrize("by", ["transport", "processing"])
def test_more_of_the_goal_is_found_at_any_rate_and_age_of_the_frames(picture, rate_hz, age_ms, by):
    """Though depth is learnt meanwhile."""
    ages_ns = (age_ms * MS, 0) if by == "transport" else (0, age_ms * MS)
    assert is_extended(picture, ages_ns, rate_hz)


def learnt_at_ms(picture, ages_ns, rate_hz, engaged_from=None, work_ns=0):
    """Times of the frames before which depth was learnt, ms; the vehicle goes aside for 7 s."""
    now, matcher, times = [0], StillMatcher(), []
    perception = pipeline(picture, matcher, lambda: now[0], depth="motion")
    before = None
    flight = frames(perception, picture, now, ages_ns, rate_hz, 7.0, 0.4, engaged_from, work_ns)
    for frame in flight:
        # One is asked for in each frame from the second on; the rest came after the last frame.
        if before is not None and len(matcher.predictions) - before > 1:
            times.append(frame.frame.t_capture_ns // MS)
        before = len(matcher.predictions)
    return times


@pytest.mark.parametrize(
    ("transport_ms", "processing_ms", "is_put_off"),
    [
        (0, 30, False),
        (0, 34, True),  # more than the 33 ms from one frame to the next
        (60, 30, False),
        (60, 34, True),
        (139, 30, False),
    ],
)
def test_work_waits_for_processing_that_does_not_keep_up_and_not_for_transport(
    picture, transport_ms, processing_ms, is_put_off
):
    times_ms = learnt_at_ms(picture, (transport_ms * MS, processing_ms * MS), rate_hz=30)
    assert len(times_ms) > 2
    assert (np.diff(times_ms).min() >= PATIENCE_NS // MS) == is_put_off
    assert (np.diff(times_ms).max() <= 250) != is_put_off


@pytest.mark.parametrize(
    ("transport_ms", "rate_hz", "work_ms", "is_put_off"),
    [
        (0, 30, 0, False),
        (100, 30, 64, False),
        (100, 30, 66, True),  # the last reported frame is 225 ms old at the next servo step
        (0, 10, 164, False),
        (0, 10, 166, True),
    ],
)
def test_work_waits_where_the_last_one_delayed_a_frame_by_too_much(
    picture, transport_ms, rate_hz, work_ms, is_put_off
):
    ages_ns = (transport_ms * MS, 30 * MS)
    times_ms = learnt_at_ms(picture, ages_ns, rate_hz, work_ns=work_ms * MS)
    assert len(times_ms) > 2
    assert (np.diff(times_ms).min() >= PATIENCE_NS // MS) == is_put_off


PERIOD_NS = 50 * MS


@pytest.mark.parametrize(
    ("late_ns", "between_ns"),
    [(0, DEPTH_PERIOD_NS), (PERIOD_NS - 1, DEPTH_PERIOD_NS), (PERIOD_NS, PATIENCE_NS)],
)
def test_depth_waits_while_frames_come_later_than_from_one_to_the_next(
    picture, late_ns, between_ns
):
    """But not for ever."""
    times_ms = learnt_at_ms(picture, (0, late_ns), rate_hz=20)
    assert len(times_ms) > 2
    assert set(np.diff(times_ms)) == {between_ns // MS}


@pytest.mark.parametrize(("late_ns", "is_put_off"), [(25 * MS - 1, False), (25 * MS, True)])
def test_where_frames_are_lost_an_old_one_is_late_though_the_next_is_not_there(
    picture, late_ns, is_put_off
):
    """Every second frame of a camera was overtaken: the time between two is no measure then."""
    times_ms = learnt_at_ms(picture, (0, late_ns), rate_hz=5)
    assert len(times_ms) > 2
    assert (np.diff(times_ms).min() >= PATIENCE_NS // MS) == is_put_off


def test_a_held_vehicle_gets_the_second_of_good_data_though_work_makes_a_report_late(picture):
    """Work takes longer than a frame may be old."""
    times_ms = learnt_at_ms(picture, (0, 30 * MS), rate_hz=15, work_ns=GateTiming().frame_age_ns)
    late_ms = (GateTiming().frame_age_ns + 30 * MS) // MS
    assert len(times_ms) > 2
    assert np.diff(times_ms).min() - late_ms > GateTiming().good_data_ns // MS


def test_depth_and_more_of_the_goal_take_turns_though_frames_are_late(picture):
    now, matcher = [0], PartlySeen()
    matcher.extend = lambda *_: None
    settings = {"depth": "motion", "min_matched_texture": 0.0}
    perception, works = pipeline(picture, matcher, lambda: now[0], **settings), []
    for _ in frames(perception, picture, now, (0, 70 * MS), 15, 14.0, aside_m_s=0.4):
        works.append((perception._tracker.extended_ns, perception._depth_ns))
    extended, learnt = (set(times) for times in zip(*works, strict=True))
    assert len(extended) > 2
    assert len(learnt) > 2


def test_depth_is_learnt_from_the_first_motion_on(picture):
    """By images alone: there is nothing that a vehicle has to prove first."""
    on_time = learnt_at_ms(picture, (0, 0), rate_hz=20)
    assert learnt_at_ms(picture, (0, 0), rate_hz=20, engaged_from=20) == on_time


def test_a_comparison_on_arrival_that_is_begun_ends_after_the_next_frame(monkeypatch):
    """Though frames do not keep up: DONE waits for it."""
    goal, view = shelves(1, 2, 3, 4), shelves(2, 3, 4, 5)
    now, compared = [0], []
    monkeypatch.setattr(
        "dfvs_core.perception.goal_verification.match_elsewhere",
        lambda *_: compared.append(now[0]),
    )
    same = np.abs(view.astype(np.float32) - goal).max(axis=2) < 10.0
    still = np.zeros((*same.shape, 2), np.float32)
    matcher = StillMatcher(FlowField(still, same.astype(np.float32)))
    perception = pipeline(goal, matcher, lambda: now[0], depth="constant")
    reached = servo_result(error_m=0.01, error_rad=0.0, reached=True)
    monkeypatch.setattr(
        "dfvs_core.perception.pipeline.servo_step", lambda task, state, inputs: (reached, state)
    )
    begun_ns = None
    for _ in frames(perception, view, now, (0, 40 * MS), 30, 1.0):
        if begun_ns is None and perception._verifier.is_comparing:
            begun_ns = now[0]
    assert compared == [begun_ns]


def test_a_long_step_of_one_work_is_remembered_though_another_is_short():
    """An extension that takes longer than a frame may be old is put off, and depth is not."""
    load, extension, depth = FrameLoad(), Work(), Work()
    now_ms, done = 1000, []
    for k in range(100):
        captured_ms = max(1000 + 50 * k, now_ms)
        load.take(captured_ms * MS, captured_ms * MS, (captured_ms + 20) * MS)
        now_ms = captured_ms + 20
        work = extension if not load.must_wait(extension) else depth
        if not load.must_wait(work):
            load.note(work)
            done.append((captured_ms, work))
            now_ms += 300 if work is extension else 10
    extended = [t_ms for t_ms, work in done if work is extension]
    assert len(extended) > 1
    assert np.diff(extended).min() >= PATIENCE_NS // MS
    assert sum(work is depth for _, work in done) > 50
