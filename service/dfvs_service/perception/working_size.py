"""Working size of a flight, settled before it: a replay does not measure anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from dfvs_core.goal import Goal
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.matcher import Matcher
from dfvs_core.matching.staged import StagedMatcher
from dfvs_core.perception.working_size import choose_working_width
from dfvs_service.config import ServiceConfig


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


def working_size_line(config: ServiceConfig, goal: Goal) -> str:
    """Line that tells the working size of a flight with settled settings."""
    matching = MatchingConfig(working_width_px=config.flow.working_width_px)
    height, width = matching.working_size(goal.image.shape[:2])
    return f"frames are matched at {width} x {height} px (flow.working_width_px)"
