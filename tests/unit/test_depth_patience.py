"""Learning depth gives way to frames that come late, but not for ever."""

import numpy as np
import pytest

from dfvs_core.camera import CameraModel
from dfvs_core.correspondence import FlowField
from dfvs_core.goal import Goal, GoalSidecar, Mount
from dfvs_core.matching.matcher import Prepared
from dfvs_core.pipeline import DEPTH_PATIENCE_NS, DEPTH_PERIOD_NS, Pipeline
from dfvs_core.servo.config import ServoConfig
from dfvs_core.servo.task import ServoTask
from dfvs_core.setting_out import SETTING_OUT_M, SETTING_OUT_NS
from dfvs_core.vehicle_history import Motion
from dfvs_core.wire.frame import Frame

MS = 1_000_000
PERIOD_NS = 50 * MS
SIZE = (120, 160)
MOUNT = Mount()


class StillMatcher:
    """Sees no motion, and counts what it is asked to track."""

    def __init__(self):
        self.tracked = 0

    def prepare(self, image):
        return Prepared(image.shape[:2])

    def match(self, current, other, guess=None, *, besides=()):
        return FlowField(np.zeros((*SIZE, 2), np.float32), np.ones(SIZE, np.float32))

    def track(self, current, other, guess):
        self.tracked += 1
        return self.match(current, other)


def learnt_at_ms(late_ns, seconds=3.0, let_go=10**9, mount=MOUNT, step_m=0.02):
    """Times of the frames after which depth was learnt, each looked at so late.

    The vehicle goes aside all the time, and is let go at the frame ``let_go``.
    """
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 255, (*SIZE, 3)).astype(np.uint8)
    camera = CameraModel.from_horizontal_fov(SIZE[1], SIZE[0], 1.3)
    sidecar, matcher, now = GoalSidecar(camera), StillMatcher(), [0]
    task = ServoTask(ServoConfig(depth="motion"), camera, sidecar, mount)
    pipeline = Pipeline(task, matcher, Goal(picture, sidecar), lambda: now[0])
    times_ms = []
    for k in range(int(seconds * 1e9 / PERIOD_NS)):
        t_ns = 10**9 + k * PERIOD_NS
        now[0] = t_ns + late_ns
        aside = np.array([0.0, step_m * k, 0.0])
        motion = Motion(t_ns, 0.0, 0.0, 0.0, np.zeros(3), aside, 0.0)
        pipeline.process(Frame(picture, t_ns, k), motion, engaged=k >= let_go)
        before = matcher.tracked
        pipeline.digest()
        if matcher.tracked > before:
            times_ms.append(t_ns // MS)
    return times_ms


@pytest.mark.parametrize(
    ("late_ns", "between_ns"),
    [
        (0, DEPTH_PERIOD_NS),
        (PERIOD_NS - 1, DEPTH_PERIOD_NS),
        (PERIOD_NS, DEPTH_PATIENCE_NS + PERIOD_NS),  # one frame's turn was the goal's
    ],
)
def test_depth_waits_while_frames_come_later_than_from_one_to_the_next(late_ns, between_ns):
    times_ms = learnt_at_ms(late_ns)
    assert len(times_ms) > 2
    assert set(np.diff(times_ms)) == {between_ns // MS}


@pytest.mark.parametrize(("let_go", "step_m"), [(20, 0.019), (40, 0.019), (20, 0.0015)])
def test_none_is_learnt_while_a_vehicle_sets_out(let_go, step_m):
    """Not on the first decimetre, but for three seconds at most."""
    times_ms = learnt_at_ms(0, seconds=8.0, let_go=let_go, step_m=step_m)
    first_ms = 1000 + let_go * PERIOD_NS // MS
    frames = min(np.ceil(SETTING_OUT_M / step_m), SETTING_OUT_NS / PERIOD_NS)
    until_ms = first_ms + frames * PERIOD_NS / MS
    assert not [t for t in times_ms if first_ms <= t < until_ms]
    after = [t for t in times_ms if t >= until_ms]
    assert after[0] == until_ms
    assert set(np.diff(after)) == {DEPTH_PERIOD_NS // MS}


def test_a_free_camera_has_nothing_to_prove():
    assert learnt_at_ms(0, let_go=20, mount=None) == learnt_at_ms(0, mount=None)
