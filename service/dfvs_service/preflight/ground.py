"""Checks without a connection: camera, goal, model, its speed, network."""

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dfvs_core.errors import DfvsError
from dfvs_core.gate.checks.preflight import Check
from dfvs_core.gate.config import MS, Engage, GateTiming
from dfvs_core.matching.matcher import Matcher, track_or_match
from dfvs_core.messages.goal import Goal
from dfvs_service.gate.serial_device import device_fault
from dfvs_service.perception.assembly import depth_network, flow_matcher, perception_files
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.key_file import load_key
from dfvs_service.settings.mavlink_url import MavlinkUrl

_FRAMES = 5
_SHIFT_PX = 4

MATCH_BUDGET_NS = GateTiming().frame_age_ns // 2
"""A frame's result comes after the work on the frame before and its own, and by then the image
must not be older than the gate accepts."""


def error_check(name: str, error: DfvsError) -> Check:
    """Line for an error: what was expected and what to do about it are its remedy."""
    expected = f"expected {error.expected}" if error.expected else ""
    remedy = "; ".join(part for part in (expected, error.remedy) if part)
    return Check(name, False, error.problem, remedy)


def model_check(config: ServiceConfig) -> tuple[Check, Matcher | None]:
    """Load the models, whose every file must have the SHA-256 of its manifest."""
    flow = config.flow
    start_ns = time.monotonic_ns()
    try:
        depth = depth_network(config)
        files = perception_files(config)
        matcher = flow_matcher(flow)
    except DfvsError as error:
        return error_check("model", error), None
    took_s = (time.monotonic_ns() - start_ns) * 1e-9
    hashes = f"{len(files)} files with the right SHA-256" if files else "part of this package"
    names = flow.model if depth is None else f"{flow.model} and {config.depth.model}"
    return Check("model", True, f"{names}, {hashes}, loaded in {took_s:.1f} s"), matcher


def speed_check(
    config: ServiceConfig, matcher: Matcher, goal: Goal, tick: Callable[[], int]
) -> Check:
    """Match the goal with a shifted copy of itself a few times, against the time there is."""
    view = np.roll(goal.image, _SHIFT_PX, axis=1)
    try:
        wanted = matcher.encode(goal.image)
        last, durations, size = None, [], ""
        for _ in range(1 + _FRAMES):
            start_ns = tick()
            last = track_or_match(matcher, matcher.encode(view), wanted, last)
            durations.append(tick() - start_ns)
            size = "{1} x {0} px".format(*last.confidence.shape)
    except DfvsError as error:
        return error_check("speed", error)
    first_ms, then_ms = durations[0] / MS, statistics.median(durations[1:]) / MS
    provider = config.flow.provider if config.flow.model != "classical" else "OpenCV"
    detail = (
        f"{provider}, {config.flow.threads} threads, {size}: first {first_ms:.0f} "
        f"ms, then {then_ms:.0f} ms a frame, {MATCH_BUDGET_NS / MS:.0f} allowed"
    )
    fast = then_ms * MS <= MATCH_BUDGET_NS
    remedy = "use smaller frames, a faster model (flow.model) or another flow.provider"
    return Check("speed", fast, detail, "" if fast else remedy)


def device_check(config: ServiceConfig) -> Check | None:
    """Line for a serial device that nobody can use; None for any other connection."""
    device = MavlinkUrl.parse(config.vehicle.mavlink).device
    fault = None if device is None else device_fault(device)
    return None if fault is None else error_check("mavlink", fault)


def command_check(config: ServiceConfig) -> Check:
    """Find the key of signed commands, where commands are accepted."""
    key_file = config.gate.command_key_file
    if not key_file:
        needed = config.gate.engage is Engage.COMMAND
        remedy = "make one: dfvs-service command new-key, and set gate.command_key_file"
        detail = "engage by command, but no key" if needed else "no key: no commands are accepted"
        return Check("commands", not needed, detail, remedy if needed else "")
    try:
        load_key(Path(key_file))
    except DfvsError as error:
        return error_check("commands", error)
    return Check("commands", True, f"signed with {key_file}")
