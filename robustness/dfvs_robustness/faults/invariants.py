"""The gate's invariants, judged from all records of a run of the service.

What the vehicle received is held against what the gate's log says, what the camera sent, and
what the core decides when the gate's journal is replayed.
"""

import bisect
import itertools
import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dfvs_core.errors import WireError
from dfvs_core.gate.config import GateTiming
from dfvs_core.gate.limits import BodyVelocity, VelocityLimits
from dfvs_core.gate.replay import replay
from dfvs_core.gate.states import ENGAGED, TRANSITIONS, GateState
from dfvs_robustness.harness.environment import LATE_NS
from dfvs_robustness.harness.records import MODE_REPORTS, Event, Run, is_ours, moves
from dfvs_robustness.slew import least_time_s
from dfvs_sim.vehicle.px4 import STEP_NS

MS = 1_000_000
S = GateState

_LIMITS = VelocityLimits()
_ROUNDING = 1e-6
"""Of float32 on the wire."""
_SLEW_WINDOW_NS = 1000 * MS
"""Changes of velocity within this time are judged as a whole, so that the jitter counts once."""
_JITTER_NS = GateTiming().slew_step_ns + LATE_NS
"""A setpoint that is stamped late seems to be followed too fast. The gate may be held up before it
sends it, after which one change uses up ``slew_step_ns`` at most; what is later than ``LATE_NS``
beside the vehicle is in its record."""
_REDUCED_M_S, _RESPONSE_NS = 0.1, 1000 * MS
_GAP_NS = 150 * MS
_CAPTURE_NS = 300 * MS
_FAULT_NS = 100 * MS
_TAKEOVER_NS = 50 * MS
_FRAME, _MASK = 8, 0x5C7
_BY_VISION = (S.SERVO, S.DONE)
"""States in which setpoints may be other than zero: the matrix's goals are held by vision."""
_FLOWN = (S.HOLD, *_BY_VISION)
"""States in which the vehicle is the gate's, and OFFBOARD confirmed."""
_ALLOWED_COMMANDS = frozenset({511, 512, 520})
"""Message intervals, single messages and capabilities: what MAVSDK and the gate ask for."""


@dataclass(frozen=True, slots=True)
class Violation:
    """An invariant that did not hold, when, and how."""

    invariant: str
    t_ns: int
    text: str


class _Timeline:
    """The gate's state at any time, and since when."""

    def __init__(self, transitions: Sequence[Event]) -> None:
        self.times: list[int] = [t["t_ns"] for t in transitions]
        self._states = [S.IDLE, *(GateState(t["target"]) for t in transitions)]

    def at(self, t_ns: int) -> GateState:
        return self._states[bisect.bisect_right(self.times, t_ns)]

    def since(self, t_ns: int) -> int:
        i = bisect.bisect_right(self.times, t_ns)
        return self.times[i - 1] if i else 0


def check(run: Run) -> list[Violation]:
    """Judge a run by every invariant."""
    ours = [e for e in run.events if is_ours(e)]
    setpoints = [e for e in ours if e["kind"] == "setpoint"]
    timeline = _Timeline(run.transitions)
    return [
        *_limits(setpoints),
        *_slew(setpoints, _in_time(setpoints, run)),
        *_reduced_speed(setpoints, timeline, run),
        *_only_by_vision(_in_time(setpoints, run), timeline),
        *_rhythm(setpoints, timeline, run),
        *_freshness(_in_time(setpoints, run), run.frames),
        *_takeovers(ours, timeline),
        *_one_commander(setpoints),
        *_replayed(run.journal),
        *_no_arming(ours),
        *_logged(run.transitions),
    ]


def _in_time(setpoints: Sequence[Event], run: Run) -> list[Event]:
    """Those whose time of arrival is right: while the vehicle stood still they queued up."""
    stalls = [
        (e["t_ns"] - e["by_ns"] - STEP_NS, e["t_ns"])
        for e in run.events
        if e["kind"] == "world_late"
    ]
    return [s for s in setpoints if not any(a <= s["t_ns"] <= b for a, b in stalls)]


def _limits(setpoints: Sequence[Event]) -> Iterator[Violation]:
    """I1: finite, within the limits, slew-limited, and in the one form that is meant."""
    for setpoint in setpoints:
        velocity, yaw_rate = setpoint["velocity"], setpoint["yaw_rate_rad_s"]
        if (setpoint["frame"], setpoint["mask"]) != (_FRAME, _MASK):
            yield Violation("I1", setpoint["t_ns"], "another kind of setpoint")
        if not _is_finite(setpoint):
            yield Violation("I1", setpoint["t_ns"], f"not finite: {velocity}, {yaw_rate}")
            return
        within = (
            math.hypot(*velocity[:2]) <= _LIMITS.horizontal_m_s + _ROUNDING
            and abs(velocity[2]) <= _LIMITS.vertical_m_s + _ROUNDING
            and abs(yaw_rate) <= _LIMITS.yaw_rad_s + _ROUNDING
        )
        if not within:
            yield Violation("I1", setpoint["t_ns"], f"too fast: {velocity}, {yaw_rate}")


def _slew(setpoints: Sequence[Event], in_time: Sequence[Event]) -> Iterator[Violation]:
    """I1: no faster change than the slew limits allow, but for a brake to zero."""
    timely = {s["t_ns"] for s in in_time}
    recent: deque[tuple[int, BodyVelocity]] = deque()
    for setpoint in filter(_is_finite, setpoints):
        t_ns = setpoint["t_ns"]
        forward, right, down = setpoint["velocity"]
        velocity = BodyVelocity(forward, right, down, setpoint["yaw_rate_rad_s"])
        if not moves(setpoint):
            recent.clear()
        if t_ns not in timely:
            continue
        while len(recent) > 1 and recent[0][0] < t_ns - _SLEW_WINDOW_NS:
            recent.popleft()
        for before_ns, before in recent:
            change_s = least_time_s(before, velocity, _LIMITS)
            if change_s > (t_ns - before_ns + _JITTER_NS) / 1e9:
                within_ms = (t_ns - before_ns) / MS
                text = f"changed in {within_ms:.0f} ms by what takes {change_s * 1e3:.0f} ms"
                yield Violation("I1", t_ns, text)
                break
        recent.append((t_ns, velocity))


def _is_finite(setpoint: Event) -> bool:
    """Whether the record holds numbers: what is not finite is written as a word."""
    return not any(isinstance(v, str) for v in (*setpoint["velocity"], setpoint["yaw_rate_rad_s"]))


def _reduced_speed(
    setpoints: Sequence[Event], timeline: _Timeline, run: Run
) -> Iterator[Violation]:
    """I1: at reduced speed until the initial-response check can have passed."""
    begins = [t["t_ns"] for t in run.transitions if t["source"] == S.ENGAGE and run.is_reduced]
    for setpoint in filter(moves, setpoints):
        since_ns = timeline.since(setpoint["t_ns"])
        finite = [v for v in setpoint["velocity"] if not isinstance(v, str)]
        speed = math.hypot(*finite)
        is_first = since_ns in begins and setpoint["t_ns"] - since_ns < _RESPONSE_NS
        if is_first and speed > _REDUCED_M_S + _ROUNDING:
            yield Violation("I1", setpoint["t_ns"], f"not at reduced speed, {speed:.3f} m/s")


def _only_by_vision(setpoints: Sequence[Event], timeline: _Timeline) -> Iterator[Violation]:
    """I2, and the second half of I4: not zero in SERVO and DONE alone, and 100 ms later nowhere."""
    for setpoint in filter(moves, setpoints):
        t_ns = setpoint["t_ns"]
        state = timeline.at(t_ns)
        if state in _BY_VISION:
            continue
        late_ns = t_ns - timeline.since(t_ns)
        if late_ns > _FAULT_NS:
            text = f"not zero in {state}, {late_ns / MS:.0f} ms after it was entered"
            yield Violation("I2", t_ns, text)


def _rhythm(setpoints: Sequence[Event], timeline: _Timeline, run: Run) -> Iterator[Violation]:
    """I3: no pause over 150 ms while engaged; not judged where the vehicle itself was late."""
    late = [e["t_ns"] for e in run.events if e["kind"] == "world_late"]
    for before, after in itertools.pairwise(setpoints):
        a_ns, b_ns = before["t_ns"], after["t_ns"]
        if run.disturbed_ns is not None and b_ns >= run.disturbed_ns:
            return
        if b_ns - a_ns <= _GAP_NS or any(a_ns < t <= b_ns + _GAP_NS for t in late):
            continue
        engaged = timeline.at(a_ns) in ENGAGED and timeline.at(b_ns) in ENGAGED
        if engaged and all(timeline.at(t) in ENGAGED for t in timeline.times if a_ns < t <= b_ns):
            text = f"pause of {(b_ns - a_ns) / MS:.0f} ms in {timeline.at(b_ns)}"
            yield Violation("I3", b_ns, text)


def _freshness(setpoints: Sequence[Event], frames: Sequence[int]) -> Iterator[Violation]:
    """I4: not zero only within 300 ms of the capture of a good frame."""
    for setpoint in filter(moves, setpoints):
        i = bisect.bisect_right(frames, setpoint["t_ns"])
        age_ns = setpoint["t_ns"] - (frames[i - 1] if i else 0)
        if age_ns > _CAPTURE_NS:
            text = f"moved {age_ns / MS:.0f} ms after the last good frame"
            yield Violation("I4", setpoint["t_ns"], text)


def _takeovers(events: Sequence[Event], timeline: _Timeline) -> Iterator[Violation]:
    """I5: after the message that tells of a takeover nothing, until the gate is engaged again.

    A message takes its time: a gate that aborts for a fault of its own in that moment, as of the
    very estimate for which the autopilot has left OFFBOARD, may request Hold before it receives it.
    """
    taken_ns: int | None = None
    for event in events:
        t_ns, state = event["t_ns"], timeline.at(event["t_ns"] - 1)
        is_late = taken_ns is not None and t_ns - taken_ns > _TAKEOVER_NS
        if event["kind"] in MODE_REPORTS:
            is_ours = event["mode"] == "OFFBOARD" and event.get("armed", True)
            if state in _FLOWN and not is_ours:
                taken_ns = t_ns if taken_ns is None else taken_ns
        elif taken_ns is not None and state in (S.PREFLIGHT, S.READY, S.ENGAGE):
            taken_ns = None
        elif taken_ns is not None and event["kind"] == "mode_command":
            if is_late or timeline.at(t_ns) is S.RELEASED:
                yield Violation("I5", t_ns, f"asked for {event['mode']} after a takeover")
        elif taken_ns is not None and event["kind"] == "setpoint" and is_late:
            late_ms = (t_ns - taken_ns) / MS
            yield Violation("I5", t_ns, f"setpoint {late_ms:.0f} ms after a takeover")


def _one_commander(setpoints: Sequence[Event]) -> Iterator[Violation]:
    """I6: all setpoints come from one component."""
    senders = {(s["sysid"], s["compid"]) for s in setpoints}
    if len(senders) > 1:
        yield Violation("I6", setpoints[-1]["t_ns"], f"setpoints from {sorted(senders)}")


def _replayed(journal: Path) -> Iterator[Violation]:
    """I7: the journal's events and monotonic times alone lead to the same commands again."""
    try:
        with journal.open(encoding="utf-8") as lines:
            result = replay(lines)
    except FileNotFoundError:
        return
    except (WireError, UnicodeDecodeError) as error:
        yield Violation("I7", 0, f"the journal cannot be replayed: {error}")
        return
    if result.difference:
        yield Violation("I7", 0, result.difference)


def _no_arming(events: Sequence[Event]) -> Iterator[Violation]:
    """I8: nothing arms or takes off, and no mode is asked for but OFFBOARD and Hold."""
    for event in events:
        kind = event["kind"]
        if kind == "arm_command":
            yield Violation("I8", event["t_ns"], "an arming command")
        if kind == "mode_command" and event["mode"] not in ("OFFBOARD", "HOLD"):
            yield Violation("I8", event["t_ns"], f"asked for the mode {event['mode']}")
        if kind == "command" and event["command"] not in _ALLOWED_COMMANDS:
            yield Violation("I8", event["t_ns"], f"command {event['command']}")


def _logged(transitions: Sequence[Event]) -> Iterator[Violation]:
    """I9: every change of state follows from the one before, is allowed, and has its cause."""
    state = S.IDLE
    for change in transitions:
        source, target = GateState(change["source"]), GateState(change["target"])
        if source is not state:
            yield Violation("I9", change["t_ns"], f"{state} became {source} unlogged")
        if target not in TRANSITIONS[source]:
            yield Violation("I9", change["t_ns"], f"{source} to {target}")
        if not change["cause"]:
            yield Violation("I9", change["t_ns"], f"{source} to {target} without a cause")
        state = target
