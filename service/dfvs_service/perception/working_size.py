"""Working size of a flight: the largest at which tracking a frame fits a time budget.

It is chosen before the flight and among its settings, so that a replay does not measure anew.
"""

import statistics
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_core.matching.matcher import Matcher
from dfvs_core.matching.staged import StagedMatcher
from dfvs_core.messages.goal import Goal
from dfvs_service.settings.config import ServiceConfig

WORKING_WIDTHS_PX = (192, 256, 320, 400, 480, 640)
"""Candidates for ``MatchingConfig.working_width_px``."""
_FRAMES, _SHIFT_PX = 5, 4


def with_working_size(
    config: ServiceConfig, goal: Goal, matcher: Matcher, tick: Callable[[], int]
) -> ServiceConfig:
    """Settings with a working width: theirs, or the largest that ``flow.tracking_ms`` allows.

    A matcher without a working size, such as a ``pair`` network, needs none.
    """
    if config.flow.working_width_px > 0 or not isinstance(matcher, StagedMatcher):
        return config
    width_px = choose_working_width(goal.image, round(config.flow.tracking_ms * 1e6), tick)
    return replace(config, flow=replace(config.flow, working_width_px=width_px))


def choose_working_width(image: ImageArray, budget_ns: int, tick: Callable[[], int]) -> int:
    """Largest working width at which a tracked frame fits the budget, else the smallest, px.

    ``image`` (H, W, 3) uint8 is of the camera's size, such as the goal image; no size above it is a
    candidate. ``budget_ns`` is the time that a tracked frame may take, and ``tick`` gives monotonic
    ns.
    """
    size = (image.shape[0], image.shape[1])
    chosen = WORKING_WIDTHS_PX[0]
    for width_px in WORKING_WIDTHS_PX[1:]:
        sizes = [MatchingConfig(working_width_px=w).working_size(size) for w in (chosen, width_px)]
        if sizes[0] == sizes[1] or tracking_time(image, width_px, tick) > budget_ns:
            break
        chosen = width_px
    return chosen


def tracking_time(image: ImageArray, working_width_px: int, tick: Callable[[], int]) -> int:
    """Median time, ns, of tracking a shifted copy of an image (H, W, 3) uint8.

    Tracking uses no network, so it is the same for every matcher with a working size.
    """
    matcher = classical_matcher(MatchingConfig(working_width_px=working_width_px))
    goal, view = matcher.encode(image), np.roll(image, _SHIFT_PX, axis=1)
    still = FlowField(np.zeros((*goal.size, 2), np.float32), np.ones(goal.size, np.float32))
    durations_ns = []
    for _ in range(1 + _FRAMES):
        start_ns = tick()
        matcher.track(matcher.encode(view), goal, still)
        durations_ns.append(tick() - start_ns)
    return round(statistics.median(durations_ns[1:]))
