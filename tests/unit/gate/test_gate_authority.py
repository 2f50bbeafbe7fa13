"""Signed orders: authentic, for this vehicle, fresh, and once."""

import itertools
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from signed_commands import signed

from dfvs_core.errors import WireError
from dfvs_core.gate.commands.authority import MAX_ANSWERS, ROTATION_NS, Authority, AuthorityAnswer
from dfvs_core.gate.commands.command import (
    COMMAND_FORMAT,
    MAX_COMMAND_BYTES,
    decode_command,
    request_id,
)
from dfvs_core.gate.config import S
from dfvs_core.gate.events import Action

KEY, OTHER_KEY = b"k" * 32, b"K" * 32
DIGEST = "0123456789abcdef" * 4
TOO_OLD = "rejected: its challenge was used or is too old"
WRONG_KEY = "wrong signature, use the key of this vehicle (gate.command_key_file)"
START_NS = 5_000_000_000


def authority(key=KEY):
    numbers = itertools.count()
    return Authority(key, "drone1", lambda: f"challenge{next(numbers)}", START_NS)


def order(challenge, action=Action.ENGAGE, vehicle="drone1", key=KEY):
    argument = DIGEST if action is Action.GOAL else ""
    return signed(key, vehicle, action, challenge, argument)


def altered(data, **changes):
    """The same command with other fields, under the old signature."""
    document = json.loads(data)
    envelope = {name: changes.pop(name) for name in ("mac", "format") if name in changes}
    command = {**document["command"], **changes}
    return json.dumps({**document, **envelope, "command": command}).encode()


@pytest.mark.parametrize("action", list(Action))
def test_an_authentic_order_is_accepted(action):
    gate = authority()
    verdict = gate.evaluate(order(gate.challenge(START_NS), action), START_NS)
    assert verdict.action is action
    assert verdict.text == f"accepted: {action}"
    assert verdict.argument == (DIGEST if action is Action.GOAL else "")


def test_an_order_is_obeyed_once_and_answered_each_time_it_arrives():
    gate = authority()
    data = order(gate.challenge(START_NS))
    first = gate.evaluate(data, START_NS)
    second = gate.evaluate(data, START_NS + 100 * ROTATION_NS)
    assert first == AuthorityAnswer(Action.ENGAGE, "accepted: engage", request=request_id(data))
    assert second == AuthorityAnswer(None, first.text, request=first.request, is_repeated=True)


def test_another_command_with_a_used_challenge_is_rejected():
    gate = authority()
    challenge = gate.challenge(START_NS)
    gate.evaluate(order(challenge), START_NS)
    verdict = gate.evaluate(order(challenge), START_NS)
    assert verdict.action is None
    assert verdict.text == TOO_OLD


def test_every_answer_is_for_the_bytes_that_were_sent():
    gate = authority()
    data = order(gate.challenge(START_NS))
    forged = altered(data, action="abort")
    for sent in (b"", forged, data, forged):
        verdict = gate.evaluate(sent, START_NS)
        assert verdict.request == request_id(sent)
        assert verdict.text.startswith("accepted: " if sent is data else "rejected: ")
    assert len({request_id(data), request_id(forged), request_id(b"")}) == 3


def test_the_answer_that_the_state_machine_gave_is_the_one_that_is_repeated():
    gate = authority()
    data = order(gate.challenge(START_NS))
    request = gate.evaluate(data, START_NS).request
    gate.record(request, "rejected: not now")
    assert gate.evaluate(data, START_NS).text == "rejected: not now"


def test_the_oldest_answers_are_forgotten_and_their_commands_are_rejected():
    gate = authority()
    sent = []
    for _ in range(MAX_ANSWERS + 1):
        sent.append(order(gate.challenge(START_NS)))
        gate.evaluate(sent[-1], START_NS)
    assert gate.evaluate(sent[0], START_NS).text.startswith("rejected: its challenge was used")
    assert all(gate.evaluate(data, START_NS).is_repeated for data in sent[1:])


def test_a_used_challenge_is_replaced_at_once():
    gate = authority()
    first = gate.challenge(START_NS)
    gate.evaluate(order(first), START_NS)
    second = gate.challenge(START_NS)
    assert second != first
    assert gate.evaluate(order(second, Action.ABORT), START_NS).action is Action.ABORT


def test_the_challenge_of_the_last_period_is_accepted_once():
    gate = authority()
    old = gate.challenge(START_NS)
    later = START_NS + ROTATION_NS
    assert gate.challenge(later) != old
    assert gate.evaluate(order(old), later).action is Action.ENGAGE
    assert gate.evaluate(order(old), later).text == TOO_OLD


def test_a_challenge_lives_ten_seconds_from_when_it_was_drawn():
    gate = authority()
    used_ns = START_NS + 9 * S
    gate.evaluate(order(gate.challenge(used_ns)), used_ns)
    fresh = gate.challenge(used_ns)
    assert gate.challenge(used_ns + 10 * S - 1) == fresh
    assert gate.challenge(used_ns + 10 * S) != fresh


def test_after_any_accepted_order_no_older_challenge_counts():
    gate = authority()
    old = gate.challenge(START_NS)
    later = START_NS + ROTATION_NS
    gate.evaluate(order(gate.challenge(later)), later)
    assert gate.evaluate(order(old), later).action is None


@pytest.mark.parametrize("periods", [2, 3, 1000])
def test_an_older_challenge_is_too_old(periods):
    gate = authority()
    old = gate.challenge(START_NS)
    assert gate.evaluate(order(old), START_NS + periods * ROTATION_NS).action is None


def test_two_periods_one_by_one_make_a_challenge_too_old():
    gate = authority()
    old = gate.challenge(START_NS)
    gate.challenge(START_NS + ROTATION_NS)
    assert gate.evaluate(order(old), START_NS + 2 * ROTATION_NS).action is None


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"vehicle": "drone2"}, "command for another vehicle, 'drone2'"),
        ({"key": OTHER_KEY}, WRONG_KEY),
        ({"challenge": "challenge9"}, "its challenge was used or is too old"),
        ({"challenge": ""}, "its challenge was used or is too old"),
    ],
)
def test_what_is_not_for_us_is_rejected_with_its_reason(changes, reason):
    gate = authority()
    verdict = gate.evaluate(order(**{"challenge": gate.challenge(START_NS), **changes}), START_NS)
    assert (verdict.action, verdict.text) == (None, f"rejected: {reason}")


@pytest.mark.parametrize(
    ("field", "value"), [("action", "abort"), ("mac", "00"), ("mac", "\ud800"), ("mac", "")]
)
def test_a_changed_order_is_rejected_and_uses_nothing_up(field, value):
    gate = authority()
    data = order(gate.challenge(START_NS))
    changed = altered(data, **{field: value})
    assert gate.evaluate(changed, START_NS).text == f"rejected: {WRONG_KEY}"
    assert gate.evaluate(data, START_NS).action is Action.ENGAGE


def test_a_signed_order_for_one_goal_is_none_for_another():
    gate = authority()
    data = order(gate.challenge(START_NS), Action.GOAL)
    changed = altered(data, argument=DIGEST[::-1])
    assert gate.evaluate(changed, START_NS).text == f"rejected: {WRONG_KEY}"
    assert gate.evaluate(data, START_NS).argument == DIGEST


def test_without_a_key_nothing_is_accepted_and_no_challenge_is_shown():
    gate = authority(key=None)
    assert gate.challenge(START_NS) == ""
    for data in (order("challenge0", key=b""), b"x", b""):
        text = "rejected: no command key is configured"
        assert gate.evaluate(data, START_NS) == AuthorityAnswer(None, text, "", request_id(data))


@given(st.binary(max_size=200))
def test_garbage_is_rejected(data):
    assert authority().evaluate(data, START_NS).action is None


@pytest.mark.parametrize(
    "data",
    [
        b"[]",
        b"{}",
        b'{"vehicle": "drone1"}',
        b"[" * 1000,
        b" " * (MAX_COMMAND_BYTES + 1),
        altered(order("c"), action="arm"),
        altered(order("c"), extra=1),
        altered(order("c"), nonce="g" * 32),
        altered(order("c"), nonce="0" * 33),
        altered(order("c", Action.GOAL), argument=DIGEST.upper()),
    ],
)
def test_what_does_not_follow_the_format_is_an_error(data):
    with pytest.raises(WireError):
        decode_command(data)


TOO_LONG = order("c") + b" " * MAX_COMMAND_BYTES


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (TOO_LONG, f"command of {len(TOO_LONG)} bytes; expected at most 1024"),
        (
            altered(order("c"), format="dfvs-command-9"),
            f"command has format 'dfvs-command-9'; expected {COMMAND_FORMAT!r}",
        ),
        (
            altered(order("c"), nonce=""),
            "command without a nonce; expected 32 hexadecimal digits",
        ),
        (
            altered(order("c"), action="goal"),
            "command for a goal names none; expected the SHA-256 of a goal as its argument",
        ),
        (
            altered(order("c"), argument=DIGEST),
            "command 'engage' has an argument; expected none",
        ),
    ],
)
def test_an_error_of_the_format_says_what_is_wrong_and_what_was_expected(data, words):
    with pytest.raises(WireError) as refusal:
        decode_command(data)
    assert str(refusal.value) == words


def test_a_command_of_just_the_most_bytes_is_read():
    data = order("c")
    assert decode_command(data + b" " * (MAX_COMMAND_BYTES - len(data))).command.challenge == "c"


def test_the_id_of_a_command_has_32_digits():
    assert len(request_id(b"any")) == 32


def test_a_command_survives_the_wire():
    command = decode_command(order("abc", Action.HOLD)).command
    assert (command.vehicle, command.action, command.challenge) == ("drone1", Action.HOLD, "abc")


def test_the_last_challenge_counts_for_the_whole_next_period():
    gate = authority()
    old = gate.challenge(START_NS)
    now_ns = START_NS + ROTATION_NS + ROTATION_NS // 2
    assert gate.evaluate(order(old), now_ns).text == "accepted: engage"


def test_no_challenge_at_all_is_no_right_one_after_a_command_either():
    gate = authority()
    gate.evaluate(order(gate.challenge(START_NS)), START_NS)
    assert gate.evaluate(order(""), START_NS).text == TOO_OLD
