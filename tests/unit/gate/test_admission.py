"""Admission of commands: limited in rate and size, and not believed."""

import pytest
from signed_commands import signed

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.admission import COMMAND_RATE, GOAL_RATE, CommandAdmission
from dfvs_core.gate.commands.command import MAX_COMMAND_BYTES
from dfvs_core.gate.events import Action
from dfvs_core.messages.goal_command import GoalCommand, goal_digest
from dfvs_core.messages.link import MAX_DATAGRAM_BYTES, ForwardedCommand, to_datagram

S = 1_000_000_000


def goal(number=0):
    data = GoalCommand(b"image %d" % number).to_bytes()
    return data, signed(b"k" * 32, "drone1", Action.GOAL, "c", goal_digest(data))


def test_a_command_is_admitted_untouched():
    assert CommandAdmission(0).admit_command(b"for the gate", 0).payload == "for the gate"


@pytest.mark.parametrize(
    ("payload", "words"),
    [
        (b" " * (MAX_COMMAND_BYTES + 1), f"a command of {MAX_COMMAND_BYTES + 1} bytes"),
        (b"\0" * MAX_COMMAND_BYTES, "a command of unprintable bytes"),
    ],
)
def test_a_command_that_does_not_fit_into_a_datagram_is_refused(payload, words):
    with pytest.raises(WireError) as refusal:
        CommandAdmission(0).admit_command(payload, 0)
    assert str(refusal.value) == words


def test_a_command_of_just_the_most_bytes_is_admitted():
    payload = b" " * MAX_COMMAND_BYTES
    assert CommandAdmission(0).admit_command(payload, 0).payload == payload.decode()


def test_a_command_that_just_fits_into_a_datagram_is_admitted():
    frame = len(to_datagram(ForwardedCommand("")))
    escaped = len(to_datagram(ForwardedCommand("\0"))) - frame
    zeros, rest = divmod(MAX_DATAGRAM_BYTES - frame, escaped)
    payload = b"\0" * zeros + b"x" * rest
    message = CommandAdmission(0).admit_command(payload, 0)
    assert len(to_datagram(message)) == MAX_DATAGRAM_BYTES
    with pytest.raises(WireError):
        CommandAdmission(0).admit_command(payload + b"x", 0)


def test_an_admitted_command_of_other_bytes_fits():
    message = CommandAdmission(0).admit_command(b"\xff" * 300, 0)
    assert len(to_datagram(message)) <= MAX_DATAGRAM_BYTES


@pytest.mark.parametrize(
    ("admit", "rate", "what"),
    [
        (lambda admission, t_ns: admission.admit_command(b"x", t_ns), COMMAND_RATE, "commands"),
        (lambda admission, t_ns: admission.admit_goal(*goal(), t_ns), GOAL_RATE, "goals"),
    ],
    ids=["commands", "goals"],
)
def test_a_flood_is_cut_to_the_rate_and_each_that_is_one_too_many_is_told_so(admit, rate, what):
    admission, count, refusals = CommandAdmission(0), 0, set()
    for t_ns in range(0, 5 * S, S // 100):
        try:
            admit(admission, t_ns)
            count += 1
        except WireError as error:
            refusals.add(str(error))
    most = rate.burst + 5 * rate.per_s
    assert most - 1 <= count <= most
    assert refusals == {f"too many {what} a second"}


def test_a_goal_is_admitted_with_the_command_that_names_it():
    data, command = goal()
    digest, message = CommandAdmission(0).admit_goal(data, command, 0)
    assert digest == goal_digest(data)
    assert message.payload.encode() == command


def test_a_goal_of_another_command_is_refused():
    with pytest.raises(WireError) as refusal:
        CommandAdmission(0).admit_goal(goal(1)[0], goal(2)[1], 0)
    assert str(refusal.value) == "the goal is not the one that its command names"
