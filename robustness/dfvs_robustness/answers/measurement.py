"""Answers to commands in every state of the gate, and the rate of the state, with busy cores."""

import json
import os
import time
from collections import deque
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from dfvs_core.gate.commands.command import request_id
from dfvs_core.gate.events import Action
from dfvs_core.gate.states import ENGAGED, GateState
from dfvs_robustness.harness.harness import Harness
from dfvs_robustness.harness.load import busy_cores
from dfvs_robustness.harness.service import HarnessError, wait_until
from dfvs_robustness.harness.setup import TEXTURE, Setup
from dfvs_robustness.harness.state_setup import FLOWN_OR_ENDED, end_flight, reach_state
from dfvs_sim.vehicle.modes import Mode

S = GateState
SEARCHING = Setup("dfvs-flow", ("telemetry.state_hz=10",))
"""The shipped model relocalises on every frame while the goal is out of view."""

ANSWER_MS = 500.0
LEAST_STATE_HZ, MOST_GAP_MS = 9.0, 300.0
_ANSWER_S, _AFTER_S = 3.0, 0.3
_BUSY_PER_CORE, _VISIT_S = 1, 60.0
_SETTLE_S = 0.2
_ATTEMPTS = 3
_WITHOUT_TRACK = ("lost", "searching")
_OUT_OF_VIEW = (S.PREFLIGHT, S.HOLD, S.ABORT, S.RELEASED)
_HOLDS_A_VISIT = {S.IDLE: 1000, S.PREFLIGHT: 7, S.READY: 3, S.HOLD: 2}
"""In IDLE an abort costs a restart; in HOLD the gate aborts after 3 s without the goal."""


@dataclass(frozen=True, slots=True)
class Try:
    """One command: its answer's delay (else the time waited), and what was wrong with it."""

    state: str
    action: str
    goal_in_view: bool
    answer_ms: float
    problem: str = ""


@dataclass(frozen=True, slots=True)
class StateRate:
    """Arrivals of the state at a subscriber while perception searches for the goal.

    ``frame_ms`` is the median time from capture to report of the frames that perception looked at,
    ``searched`` the share of them in which it had no track of the goal.
    """

    seconds: float
    rate_hz: float
    largest_gap_ms: float
    frame_ms: float
    searched: float


@dataclass(frozen=True, slots=True)
class AnswerTimes:
    """What one run measured; ``busy`` processes ran beside the service on ``cores`` cores."""

    tries: tuple[Try, ...]
    rate: StateRate
    busy: int
    cores: int

    @property
    def passed(self) -> bool:
        """Whether every command was answered once and truly, and all limits were kept."""
        times = [t.answer_ms for t in self.tries]
        return (
            not any(t.problem for t in self.tries)
            and float(np.percentile(times, 99, method="higher")) <= ANSWER_MS
            and self.rate.rate_hz >= LEAST_STATE_HZ
            and self.rate.largest_gap_ms <= MOST_GAP_MS
        )


class Commander:
    """Sends commands to a harness's service and takes the times of their answers."""

    def __init__(self, harness: Harness) -> None:
        self._harness = harness
        self._answers: list[tuple[str, str, int]] = []
        self._subscriber = harness.session.declare_subscriber(
            harness.topics.telemetry("answer"), self._on_answer
        )

    def attempt(self, action: Action, *, goal_in_view: bool) -> Try:
        """Give one command, and judge its answers by what the gate did."""
        harness = self._harness
        state, command = harness.state, harness.operator.signed(action)
        request, sent_ns = request_id(command), time.monotonic_ns()
        harness.operator.send(command)
        wait_until(lambda: bool(self._of(request)), _ANSWER_S, poll_s=0.02)
        time.sleep(_AFTER_S)
        answers = self._of(request)
        delay_ms = (answers[0][1] - sent_ns) / 1e6 if answers else 1e3 * _ANSWER_S
        states = (state, harness.state)
        problem = answer_problem(action, states, [text for text, _ in answers])
        if not problem and not self._obeyed(action, sent_ns):
            problem = f"the gate went to {harness.state} all the same"
        return Try(str(state), str(action), goal_in_view, delay_ms, problem)

    def _obeyed(self, action: Action, since_ns: int) -> bool:
        if action is Action.ABORT:
            return self._harness.state in (S.ABORT, S.RELEASED)
        targets = [change["target"] for change in self._harness.service.log.transitions(since_ns)]
        return S.SERVO not in targets and self._harness.state not in (S.SERVO, S.DONE)

    def _of(self, request: str) -> list[tuple[str, int]]:
        return [(text, t_ns) for name, text, t_ns in self._answers if name == request]

    def _on_answer(self, sample: zenoh.Sample) -> None:
        t_ns = time.monotonic_ns()
        document = json.loads(sample.payload.to_bytes())
        self._answers.append((document["request"], document["result"], t_ns))


def answer_problem(action: Action, states: tuple[GateState, ...], answers: list[str]) -> str:
    """What is wrong with the answers; the command arrived in one of the states.

    Hold is refused where nothing is flown.
    """
    if len(answers) != 1:
        return f"{len(answers)} answers"
    refused = {action is Action.HOLD and state not in ENGAGED for state in states}
    is_refused = answers[0].startswith("rejected: ")
    is_true = (is_refused or answers[0] == f"accepted: {action}") and is_refused in refused
    return "" if is_true else f"answered {answers[0]!r}"


def measure_answers(
    harness: Harness, tries_per_state: int, report: Callable[[Try], None]
) -> tuple[Try, ...]:
    """Try hold and abort so often in every state, with every core busy.

    Raises
    ------
    HarnessError
        If a state cannot be reached.
    """
    commander = Commander(harness)
    tries: list[Try] = []
    for state in S:
        todo = deque(planned_actions(state, tries_per_state))
        failures = 0
        while todo:
            before = len(todo)
            try:
                _reach(harness, state)
                with busy_cores(_BUSY_PER_CORE, _VISIT_S):
                    time.sleep(_SETTLE_S)
                    while todo and harness.state is state:
                        view = state not in _OUT_OF_VIEW
                        tries.append(commander.attempt(todo[0], goal_in_view=view))
                        todo.popleft()
                        report(tries[-1])
            except HarnessError:
                harness.stop_service()
                failures += 1
            failures = failures if len(todo) == before else 0
            if failures == _ATTEMPTS:
                raise HarnessError(f"{state} cannot be reached")
    return tuple(tries)


def planned_actions(state: GateState, count: int) -> list[Action]:
    """Commands in the order in which they are tried: as many as a visit to the state allows."""
    holds = _HOLDS_A_VISIT.get(state, 1)
    actions = [Action.ABORT if i % (holds + 1) == holds else Action.HOLD for i in range(count)]
    if state is S.IDLE:
        actions[-1] = Action.ABORT
    return actions


def measure_state_rate(harness: Harness, seconds: float) -> StateRate:
    """Rate and largest gap of the state in PREFLIGHT, the goal out of view, every core busy.

    It takes so many seconds, or longer where perception's first report of a frame takes longer.

    Raises
    ------
    HarnessError
        If perception does not search.
    """
    arrivals: list[int] = []
    frames: list[dict[str, Any]] = []
    _reach(harness, S.PREFLIGHT)
    with busy_cores(_BUSY_PER_CORE, seconds + _VISIT_S):
        time.sleep(_SETTLE_S)
        subscriber = harness.session.declare_subscriber(
            harness.topics.telemetry("state"), lambda _: arrivals.append(time.monotonic_ns())
        )
        servo = harness.session.declare_subscriber(
            harness.topics.telemetry("servo"),
            lambda sample: frames.append(json.loads(sample.payload.to_bytes())),
        )
        time.sleep(seconds)
        wait_until(lambda: bool(frames), _VISIT_S)  # one search may take longer on a slow machine
        subscriber.undeclare()  # type: ignore[no-untyped-call]
        servo.undeclare()  # type: ignore[no-untyped-call]
    if len(arrivals) < 2 or not frames or harness.state is not S.PREFLIGHT:
        raise HarnessError(f"{len(arrivals)} states and {len(frames)} frames in {harness.state}")
    times_s = np.array(arrivals) / 1e9
    rate_hz = (len(times_s) - 1) / (times_s[-1] - times_s[0])
    return StateRate(
        float(times_s[-1] - times_s[0]),
        float(rate_hz),
        float(np.diff(times_s).max() * 1e3),
        float(np.median([frame["stages_ms"]["capture_to_report"] for frame in frames])),
        sum(frame["tracking"] in _WITHOUT_TRACK for frame in frames) / len(frames),
    )


def run_answers(
    folder: Path, tries_per_state: int, seconds: float, report: Callable[[Try], None]
) -> AnswerTimes:
    """Both measurements, each with a service of its own below the folder."""
    with closing(Harness(SEARCHING, folder / "rate", seed=0)) as harness:
        rate = measure_state_rate(harness, seconds)
    with closing(Harness(TEXTURE, folder / "answers", seed=0)) as harness:
        tries = measure_answers(harness, tries_per_state, report)
    cores = os.cpu_count() or 1
    return AnswerTimes(tries, rate, cores * _BUSY_PER_CORE, cores)


# --- ways to the states -------------------------------------------------------------------------


def _reach(harness: Harness, state: GateState) -> None:
    """Bring the gate to the state; in some of them the goal is out of view."""
    if state is S.IDLE:
        harness.start_service(silent_vehicle=True)
    elif state is S.PREFLIGHT:
        harness.repair()
        harness.ensure_service()
        harness.camera.lose_goal()
        if harness.state in FLOWN_OR_ENDED:
            end_flight(harness)
    elif state is S.ABORT:
        reach_state(harness, S.READY)
        harness.operator.command(Action.ABORT)
    elif state is S.RELEASED:
        reach_state(harness, S.SERVO)
        harness.environment.pilot_mode(Mode.HOLD)
    else:
        reach_state(harness, state)
    if state in _OUT_OF_VIEW:
        harness.camera.lose_goal()
    harness.await_state(state)
