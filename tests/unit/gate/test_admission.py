"""Admission of commands: limited in rate and size, and not believed."""

import contextlib

import pytest
from signed_commands import signed

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.admission import COMMAND_RATE, GOAL_RATE, CommandAdmission
from dfvs_core.gate.commands.command import MAX_COMMAND_BYTES
from dfvs_core.gate.events import Action
from dfvs_core.messages.goal_command import GoalCommand, goal_digest
from dfvs_core.messages.link import MAX_DATAGRAM_BYTES, to_datagram

S = 1_000_000_000


def goal(number=0):
    data = GoalCommand(b"image %d" % number).to_bytes()
    return data, signed(b"k" * 32, "drone1", Action.GOAL, "c", goal_digest(data))


def admitted(admit, times_ns):
    """How many of the calls at these times are admitted."""
    count = 0
    for t_ns in times_ns:
        with contextlib.suppress(WireError):
            admit(t_ns)
            count += 1
    return count


def test_a_command_is_admitted_untouched():
    assert CommandAdmission(0).admit_command(b"for the gate", 0).payload == "for the gate"


@pytest.mark.parametrize("payload", [b" " * (MAX_COMMAND_BYTES + 1), b"\0" * MAX_COMMAND_BYTES])
def test_a_command_that_does_not_fit_into_a_datagram_is_refused(payload):
    with pytest.raises(WireError, match="a command of"):
        CommandAdmission(0).admit_command(payload, 0)


def test_an_admitted_command_of_other_bytes_fits():
    message = CommandAdmission(0).admit_command(b"\xff" * 300, 0)
    assert len(to_datagram(message)) <= MAX_DATAGRAM_BYTES


def test_a_flood_of_commands_is_cut_to_the_rate():
    admission = CommandAdmission(0)
    count = admitted(lambda t: admission.admit_command(b"x", t), range(0, 5 * S, S // 1000))
    most = COMMAND_RATE.burst + 5 * COMMAND_RATE.per_s
    assert most - 1 <= count <= most


def test_a_flood_of_goals_is_cut_to_the_rate():
    admission = CommandAdmission(0)
    count = admitted(lambda t: admission.admit_goal(*goal(), t), range(0, 5 * S, S // 10))
    most = GOAL_RATE.burst + 5 * GOAL_RATE.per_s
    assert most - 1 <= count <= most


def test_a_goal_is_admitted_with_the_command_that_names_it():
    data, command = goal()
    digest, message = CommandAdmission(0).admit_goal(data, command, 0)
    assert digest == goal_digest(data)
    assert message.payload.encode() == command


def test_a_goal_of_another_command_is_refused():
    with pytest.raises(WireError, match="not the one"):
        CommandAdmission(0).admit_goal(goal(1)[0], goal(2)[1], 0)
