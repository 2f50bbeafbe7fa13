"""The checker of the harness finds what is wrong with a record, and nothing in a good one."""

import dataclasses
import json
import math

import pytest
from gate_rehearsal import Rehearsal, auto_config, pilot_config

from dfvs_core.gate.config import OnDone
from dfvs_core.gate.limits import ZERO, BodyVelocity
from dfvs_core.gate.replay import encode_start, encode_step
from dfvs_core.gate.states import GateState
from dfvs_robustness.faults.invariants import check
from dfvs_robustness.harness.records import PILOT_COMPONENT, ROGUE_COMPONENT, Run, moves
from dfvs_service.settings.config import ServiceConfig

MS, S = 1_000_000, 1_000_000_000


class Recorded(Rehearsal):
    """A rehearsal of which all records are kept, as the harness would have them."""

    def __post_init__(self):
        super().__post_init__()
        self.events, self.log, self.frames = [], [], []
        self.journal = [encode_start(self.config, self.now_ns)]

    def heartbeat(self):
        beat = super().heartbeat()
        fields = {"mode": str(beat.mode), "armed": beat.armed}
        self.events.append({"t_ns": beat.t_ns, "kind": "heartbeat_sent", **fields})
        return beat

    def report(self, **changes):
        report = super().report(**changes)
        if report.report.healthy:
            self.frames.append(report.report.t_capture_ns)
        return report

    def send(self, events):
        output = super().send(events)
        self.journal.append(encode_step(self.now_ns, events, output))
        if (v := output.setpoint) is not None:
            self.events.append(setpoint(self.now_ns, v))
        if output.mode_request is not None:
            self.events.append(sent(self.now_ns, "mode_command", mode=str(output.mode_request)))
        for t in output.transitions:
            words = {"source": str(t.source), "target": str(t.target), "cause": str(t.cause)}
            self.log.append({"t_ns": t.t_ns, "kind": "transition", **words, "detail": t.detail})
        return output

    def until_a_takeover(self, folder):
        """Fly on for a second until a pilot takes over; the records of the whole flight."""
        self.run(1.0)
        self.beat(mode="POSITION")
        self.run(0.5)
        path = folder / "gate-inputs.jsonl"
        path.write_text("\n".join(self.journal) + "\n")
        return self, Run(self.events, self.log, self.frames, path)


def sent(t_ns, kind, **fields):
    return {"t_ns": t_ns, "kind": kind, "sysid": 1, "compid": 195, **fields}


def setpoint(t_ns, v, **changes):
    velocity = [v.forward_m_s, v.right_m_s, v.down_m_s]
    fields = {"frame": 8, "mask": 0x5C7, "velocity": velocity, "yaw_rate_rad_s": v.yaw_rad_s}
    return sent(t_ns, "setpoint", **fields) | changes


@pytest.fixture
def flight(tmp_path):
    """A flight that is held once and taken over in the end, with its records."""
    gate = Recorded(auto_config()).until(GateState.SERVO).run(2.0)
    gate.send([gate.report(healthy=False)])
    return gate.until(GateState.SERVO).until_a_takeover(tmp_path)


def found(run):
    return {v.invariant for v in check(run)}


def with_event(run, event):
    return dataclasses.replace(run, events=sorted([*run.events, event], key=lambda e: e["t_ns"]))


def state_ns(gate, state):
    return next(t["t_ns"] for t in gate.log if t["target"] == state)


def test_a_good_flight_violates_nothing(flight):
    gate, run = flight
    assert len(gate.events) > 200
    assert check(run) == []


def test_an_initial_motion_above_the_reduced_speed_is_found(flight):
    gate, run = flight
    i = next(i for i, e in enumerate(run.events) if e["t_ns"] > state_ns(gate, "SERVO") + 500 * MS)
    before = [e for e in run.events[: i + 1] if e["kind"] == "setpoint"]
    fast = {**before[-1], "velocity": [0.1, 0.0, 0.02]}
    assert found(with_event(run, fast)) == {"I1"}
    assert not found(dataclasses.replace(with_event(run, fast), is_reduced=False))


@pytest.mark.parametrize(
    "change",
    [
        {"velocity": [0.6, 0.0, 0.0]},
        {"velocity": [0.0, 0.0, -0.4]},
        {"yaw_rate_rad_s": 0.4},
        {"velocity": ["nan", 0.0, 0.0]},
        {"mask": 0},
        {"frame": 1},
        {"velocity": [-0.4, 0.0, 0.0]},  # within the limits, but a jump
    ],
)
def test_setpoints_beyond_the_limits_are_found(flight, change):
    gate, run = flight
    i = next(i for i, e in enumerate(run.events) if e["t_ns"] > state_ns(gate, "SERVO") + 900 * MS)
    i = next(j for j in range(i, len(run.events)) if run.events[j]["kind"] == "setpoint")
    events = [*run.events]
    events[i] = events[i] | change
    assert "I1" in found(dataclasses.replace(run, events=events))


@pytest.fixture
def still(tmp_path):
    """A stream of zeros before anything is engaged, with its records."""
    gate = Recorded(pilot_config()).until(GateState.READY).run(1.0)
    return gate, Run(gate.events, gate.log, gate.frames, tmp_path / "none.jsonl")


def ramp(t_ns, count, forward=0.0, yaw=0.0, stamps=lambda i: 20 * i):
    """Setpoints that change by so much each 20 ms, with stamps in ms."""
    return [
        setpoint(t_ns + stamps(i) * MS, BodyVelocity(min(forward * i, 0.5), 0.0, 0.0, yaw * i))
        for i in range(count)
    ]


def texts(run, ramped):
    events = [*run.events, *ramped]
    return [v.text for v in check(dataclasses.replace(run, events=events)) if "takes" in v.text]


@pytest.mark.parametrize("change", [{"forward": 0.05}, {"forward": 0.02}, {"yaw": 0.1}])
def test_a_change_that_is_faster_than_the_slew_limits_is_found(still, change):
    gate, run = still
    assert texts(run, ramp(gate.now_ns, 12, **change))


def test_a_turn_rate_in_one_step_is_found(still):
    gate, run = still
    turn = BodyVelocity(yaw_rad_s=math.radians(20))
    assert texts(run, [setpoint(gate.now_ns, ZERO), setpoint(gate.now_ns + 20 * MS, turn)])


def test_a_change_at_the_slew_limit_passes_with_stamps_that_jitter(still):
    gate, run = still
    ramped = ramp(gate.now_ns, 40, forward=0.01, stamps=lambda i: 160 if 3 <= i <= 8 else 20 * i)
    assert not texts(run, ramped)


def test_a_brake_is_no_change_too_fast_but_the_way_back_is(still):
    gate, run = still
    ramped = ramp(gate.now_ns, 40, forward=0.01)
    end_ns = ramped[-1]["t_ns"]
    brake = setpoint(end_ns + 20 * MS, ZERO)
    assert not texts(run, [*ramped, brake])
    again = setpoint(end_ns + 40 * MS, BodyVelocity(0.39))
    assert texts(run, [*ramped, brake, again])


def test_stamps_while_the_vehicle_stood_still_are_not_judged(still):
    gate, run = still
    ramped = ramp(gate.now_ns, 40, forward=0.01, stamps=lambda i: max(20 * i, 300))
    assert texts(run, ramped)
    stall = {"t_ns": gate.now_ns + 300 * MS, "kind": "world_late", "by_ns": 290 * MS}
    assert not texts(run, [*ramped, stall])


def test_motion_outside_of_servo_is_found_once_the_grace_is_over(flight):
    gate, run = flight
    hold_ns = state_ns(gate, "HOLD")
    moving = [0.02, 0.0, 0.0]
    soon, late = (setpoint(hold_ns + t * MS, ZERO, velocity=moving) for t in (99, 101))
    assert "I2" not in found(with_event(run, soon))
    assert "I2" in found(with_event(run, late))


@pytest.fixture
def stay(tmp_path):
    """A flight to the goal, which is held by vision until a takeover, with its records."""
    config = auto_config(on_done=OnDone.HOLD_VISUAL)
    gate = Recorded(config).until(GateState.SERVO).run(2.0)
    gate.changes, gate.asked = {"reached": True}, (0.02, 0.0, 0.0, 0.0)
    return gate.until(GateState.DONE).until_a_takeover(tmp_path)


def test_motion_at_a_goal_that_is_held_by_vision_violates_nothing(stay):
    gate, run = stay
    done_ns = state_ns(gate, "DONE")
    assert any(moves(e) for e in run.events if e["t_ns"] > done_ns and e["kind"] == "setpoint")
    assert found(run) == set()
    assert ServiceConfig().gate.on_done is OnDone.HOLD_VISUAL  # as the matrix flies


def test_talking_after_a_takeover_at_the_goal_is_found(stay):
    gate, run = stay
    taken_ns = state_ns(gate, "RELEASED")
    assert found(with_event(run, setpoint(taken_ns + 49 * MS, ZERO))) == set()
    assert found(with_event(run, setpoint(taken_ns + 51 * MS, ZERO))) == {"I5"}


def test_setpoints_that_queued_up_while_the_vehicle_stood_still_are_not_late(flight):
    gate, run = flight
    hold_ns = state_ns(gate, "HOLD")
    late = setpoint(hold_ns + 130 * MS, ZERO, velocity=[0.02, 0.0, 0.0])
    stall = {"t_ns": hold_ns + 131 * MS, "kind": "world_late", "by_ns": 60 * MS}
    assert "I2" not in found(with_event(with_event(run, late), stall))
    over = stall | {"t_ns": hold_ns + 125 * MS}
    assert "I2" in found(with_event(with_event(run, late), over))


def test_a_pause_while_engaged_is_found_unless_the_gate_was_broken(flight):
    gate, run = flight
    begin_ns = state_ns(gate, "SERVO") + 500 * MS
    events = [e for e in run.events if not begin_ns < e["t_ns"] < begin_ns + 160 * MS]
    paused = dataclasses.replace(run, events=events)
    assert found(paused) == {"I3"}
    assert found(dataclasses.replace(paused, disturbed_ns=begin_ns)) == set()
    late = {"t_ns": begin_ns + 165 * MS, "kind": "world_late", "by_ns": 120 * MS}
    assert found(with_event(paused, late)) == set()
    assert found(with_event(paused, late | {"t_ns": begin_ns - 20 * MS})) == {"I3"}


def test_flying_by_an_old_frame_is_found(flight):
    gate, run = flight
    begin_ns = state_ns(gate, "SERVO") + 500 * MS
    frames = [t for t in run.frames if not begin_ns < t < begin_ns + 400 * MS]
    assert found(dataclasses.replace(run, frames=frames)) == {"I4"}


def test_talking_after_a_takeover_is_found(flight):
    gate, run = flight
    taken_ns = state_ns(gate, "RELEASED")
    assert found(with_event(run, setpoint(taken_ns + 49 * MS, ZERO))) == set()
    assert found(with_event(run, setpoint(taken_ns + 51 * MS, ZERO))) == {"I5"}
    assert found(with_event(run, sent(taken_ns + 1, "mode_command", mode="HOLD"))) == {"I5"}


def test_an_abort_that_could_not_know_of_a_takeover_yet_is_none(flight):
    """It fell into the time that the message takes; 50 ms later the gate has to know."""
    gate, run = flight
    taken_ns = state_ns(gate, "RELEASED")
    log = [dict(t, target="ABORT") if t["target"] == "RELEASED" else t for t in run.transitions]
    run = dataclasses.replace(run, transitions=log)
    for after_ns, rules in ((49 * MS, set()), (51 * MS, {"I5"})):
        asked = sent(taken_ns + after_ns, "mode_command", mode="HOLD")
        assert found(with_event(run, asked)) & {"I5"} == rules


def test_a_second_sender_is_found_and_the_rogue_is_not_taken_for_one(flight):
    _, run = flight
    event = next(e for e in reversed(run.events) if e["kind"] == "setpoint")
    assert found(with_event(run, event | {"compid": 191})) == {"I6"}
    for compid in (ROGUE_COMPONENT, PILOT_COMPONENT):
        assert found(with_event(run, event | {"compid": compid, "mask": 1})) == set()


def test_a_journal_that_decides_otherwise_is_found(flight):
    _, run = flight
    text = run.journal.read_text()
    run.journal.write_text(
        text.replace('"healthy":false', '"healthy":true').replace(
            ',false,false,false,"",', ',true,false,false,"",'
        )
    )
    assert found(run) == {"I7"}
    run.journal.write_text("rubbish\n")
    assert found(run) == {"I7"}


@pytest.mark.parametrize(
    "event",
    [
        sent(0, "arm_command"),
        sent(0, "mode_command", mode="TAKEOFF"),
        sent(0, "command", command=22),
    ],
)
def test_arming_and_taking_off_are_found(flight, event):
    _, run = flight
    assert found(with_event(run, event | {"t_ns": run.events[0]["t_ns"]})) == {"I8"}


def test_a_transition_that_is_not_logged_or_not_allowed_or_without_cause_is_found(flight):
    _, run = flight
    assert "I9" in found(
        dataclasses.replace(run, transitions=run.transitions[:2] + run.transitions[3:])
    )
    for change in ({"target": "READY"}, {"cause": ""}):
        log = json.loads(json.dumps(run.transitions))
        log[-1] |= change
        assert "I9" in found(dataclasses.replace(run, transitions=log)), change
