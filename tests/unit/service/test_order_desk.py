"""Orders on their way through perception: bounded in size and number, and never believed."""

import pytest

from dfvs_core.errors import WireError
from dfvs_core.gate.events import Action
from dfvs_core.wire.command import MAX_COMMAND_BYTES, encode_command
from dfvs_core.wire.goal_order import GoalOrder, goal_digest
from dfvs_core.wire.link import MAX_DATAGRAM_BYTES, to_datagram
from dfvs_service.perception.order_desk import COMMAND_RATE, GOAL_RATE, MAX_KEPT_GOALS, OrderDesk

S = 1_000_000_000


def goal(number=0):
    data = GoalOrder(b"picture %d" % number).to_bytes()
    return data, encode_command(b"k" * 32, "drone1", Action.GOAL, "c", goal_digest(data))


def test_a_command_is_passed_on_untouched():
    assert OrderDesk(0).take_command(b"for the gate", 0).payload == "for the gate"


@pytest.mark.parametrize("payload", [b" " * (MAX_COMMAND_BYTES + 1), b"\0" * MAX_COMMAND_BYTES])
def test_what_would_not_fit_into_a_datagram_to_the_gate_is_dropped(payload):
    desk = OrderDesk(0)
    assert desk.take_command(payload, 0) is None
    assert desk.dropped == 1


def test_whatever_is_passed_on_fits():
    message = OrderDesk(0).take_command(b"\xff" * 600, 0)
    assert message is None or len(to_datagram(message)) <= MAX_DATAGRAM_BYTES


def test_a_flood_of_commands_is_cut_to_the_rate():
    desk = OrderDesk(0)
    passed = sum(desk.take_command(b"x", i * S // 1000) is not None for i in range(5000))
    most = COMMAND_RATE.burst + 5 * COMMAND_RATE.per_s
    assert most - 1 <= passed <= most
    assert desk.dropped == 5000 - passed


def test_a_goal_waits_unopened_for_the_gates_word():
    desk = OrderDesk(0)
    data, command = goal()
    assert desk.take_goal(data, command, 0).payload.encode() == command
    assert desk.hand_out(goal_digest(data)) == data
    with pytest.raises(WireError, match="not here"):
        desk.hand_out(goal_digest(data))


@pytest.mark.parametrize(
    ("data", "command"),
    [
        (goal(1)[0], goal(2)[1]),
        (goal()[0], b""),
        (goal()[0], encode_command(b"k" * 32, "drone1", Action.HOLD, "c")),
    ],
    ids=["another goal's", "none", "of another kind"],
)
def test_a_goal_whose_command_does_not_name_it_is_dropped(data, command):
    desk = OrderDesk(0)
    assert desk.take_goal(data, command, 0) is None
    assert desk.dropped == 1
    with pytest.raises(WireError):
        desk.hand_out(goal_digest(data))


def test_a_flood_of_goals_is_cut_and_holds_no_more_than_a_few():
    desk = OrderDesk(0)
    goals = [goal(i) for i in range(50)]
    taken = [g for i, g in enumerate(goals) if desk.take_goal(*g, i * S // 10)]
    most = GOAL_RATE.burst + 5 * GOAL_RATE.per_s
    assert most - 1 <= len(taken) <= most
    assert desk.dropped == 50 - len(taken)
    assert len(desk._goals) == MAX_KEPT_GOALS
    assert desk.hand_out(goal_digest(taken[-1][0])) == taken[-1][0]


def test_a_flood_does_not_fill_the_log(caplog):
    desk = OrderDesk(0)
    for _ in range(1000):
        desk.take_command(b"x" * 2000, 0)
    assert 1 <= len(caplog.records) <= 20
    assert "order dropped: " in caplog.text
