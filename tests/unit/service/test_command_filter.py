"""Commands on their way through the operator link: bounded in size and number, never believed."""

import os

import numpy as np
import pytest
from signed_commands import signed

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.admission import GOAL_RATE
from dfvs_core.gate.commands.command import MAX_COMMAND_BYTES
from dfvs_core.gate.events import Action
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.goal_command import GoalCommand, goal_digest
from dfvs_service.goal_store import MAX_KEPT_GOALS, GoalStore
from dfvs_service.operator_link.command_filter import CommandFilter
from dfvs_service.settings.config import load_config
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.parent import prepare_runtime

S = 1_000_000_000


def goal(number=0):
    data = GoalCommand(b"picture %d" % number).to_bytes()
    return data, signed(b"k" * 32, "drone1", Action.GOAL, "c", goal_digest(data))


@pytest.fixture
def store(tmp_path):
    return GoalStore(tmp_path / "goals")


@pytest.fixture
def desk(store):
    return CommandFilter(store, 0)


def test_a_command_is_passed_on_untouched(desk):
    assert desk.receive_command(b"for the gate", 0).payload == "for the gate"


@pytest.mark.parametrize("payload", [b" " * (MAX_COMMAND_BYTES + 1), b"\0" * MAX_COMMAND_BYTES])
def test_what_would_not_fit_into_a_datagram_to_the_gate_is_dropped(desk, payload):
    assert desk.receive_command(payload, 0) is None
    assert desk.dropped == 1


def test_a_goal_waits_unopened_for_the_gates_word(desk, store):
    data, command = goal()
    assert desk.receive_goal(data, command, 0).payload.encode() == command
    assert store.pop(goal_digest(data)) == data


@pytest.mark.parametrize(
    ("data", "command"),
    [
        (goal(1)[0], goal(2)[1]),
        (goal()[0], b""),
        (goal()[0], signed(b"k" * 32, "drone1", Action.HOLD, "c")),
    ],
    ids=["another goal's", "none", "of another kind"],
)
def test_a_goal_whose_command_does_not_name_it_is_dropped(desk, store, data, command):
    assert desk.receive_goal(data, command, 0) is None
    assert desk.dropped == 1
    with pytest.raises(WireError, match="not here"):
        store.pop(goal_digest(data))


def test_a_goal_that_cannot_be_kept_is_dropped(tmp_path, caplog):
    (tmp_path / "file").touch()
    desk = CommandFilter(GoalStore(tmp_path / "file"), 0)
    assert desk.receive_goal(*goal(), 0) is None
    assert "the goal cannot be kept" in caplog.text


def test_a_goal_that_was_damaged_on_its_way_is_none(store, tmp_path):
    data, _ = goal()
    store.keep(goal_digest(data), data)
    (tmp_path / "goals" / goal_digest(data)).write_bytes(data[:-1])
    with pytest.raises(WireError, match="not here"):
        store.pop(goal_digest(data))


def test_the_newest_goal_is_kept_though_the_wall_clock_steps_back(store, tmp_path):
    goals = [goal(i)[0] for i in range(MAX_KEPT_GOALS + 1)]
    for data in goals[:-1]:
        store.keep(goal_digest(data), data)
    for path in (tmp_path / "goals").iterdir():
        os.utime(path, (4e9, 4e9))  # written before the step: times that are still to come
    store.keep(goal_digest(goals[-1]), goals[-1])
    assert store.pop(goal_digest(goals[-1])) == goals[-1]
    with pytest.raises(WireError, match="not here"):
        store.pop(goal_digest(goals[0]))


def test_a_goal_that_comes_again_is_the_newest(store):
    goals = [goal(i)[0] for i in range(MAX_KEPT_GOALS + 1)]
    for data in (*goals[:-1], goals[0], goals[-1]):
        store.keep(goal_digest(data), data)
    assert store.pop(goal_digest(goals[0])) == goals[0]


def test_a_start_leaves_no_goals_of_an_earlier_service(tmp_path):
    runtime, config = RuntimeFolder(tmp_path), load_config(None, {})
    GoalStore(runtime.new_goals).keep("earlier", b"goal")
    sidecar = GoalSidecar(CameraModel.from_horizontal_fov(64, 48, 1.2))
    prepare_runtime(runtime, config, Goal(np.zeros((48, 64, 3), np.uint8), sidecar))
    assert not runtime.new_goals.exists()


def test_a_flood_of_goals_is_cut_and_holds_no_more_than_a_few(desk, store, tmp_path):
    goals = [goal(i) for i in range(50)]
    taken = [g for i, g in enumerate(goals) if desk.receive_goal(*g, i * S // 10)]
    most = GOAL_RATE.burst + 5 * GOAL_RATE.per_s
    assert most - 1 <= len(taken) <= most
    assert desk.dropped == 50 - len(taken)
    assert len(list((tmp_path / "goals").iterdir())) == MAX_KEPT_GOALS
    assert store.pop(goal_digest(taken[-1][0])) == taken[-1][0]


def test_a_flood_does_not_fill_the_log(desk, caplog):
    for _ in range(1000):
        desk.receive_command(b"x" * 2000, 0)
    assert 1 <= len(caplog.records) <= 20
    assert "command dropped: " in caplog.text
