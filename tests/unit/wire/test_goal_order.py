import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.errors import WireError
from dfvs_core.messages.goal_command import MAX_SIDECAR_BYTES, GoalCommand, goal_digest
from dfvs_core.messages.zenoh_settings import MAX_MESSAGE_BYTES


@given(st.binary(max_size=100), st.text(max_size=100))
def test_a_goal_survives_the_wire(picture, sidecar):
    order = GoalCommand(picture, sidecar)
    assert GoalCommand.from_bytes(order.to_bytes()) == order


def test_the_digest_covers_picture_and_sidecar():
    data = GoalCommand(b"picture", "{}").to_bytes()
    assert goal_digest(data) == hashlib.sha256(data).hexdigest()
    assert goal_digest(GoalCommand(b"pictur", "e{}").to_bytes()) != goal_digest(data)


@pytest.mark.parametrize(
    "order",
    [GoalCommand(b" " * MAX_MESSAGE_BYTES), GoalCommand(b"", " " * (MAX_SIDECAR_BYTES + 1))],
)
def test_what_is_too_large_is_not_made(order):
    with pytest.raises(WireError, match="at most"):
        order.to_bytes()


@given(st.binary(max_size=60) | st.binary(max_size=60).map(lambda data: b"DFVG" + data))
def test_garbage_is_refused_or_read_whole(data):
    try:
        order = GoalCommand.from_bytes(data)
    except WireError:
        return
    assert order.to_bytes() == data


@pytest.mark.parametrize(
    "data", [b"", b"DFVG", b"DFVX\0\0\0\0", b"DFVG\xff\xff\xff\xff", b"DFVG\2\0\0\0\xff\xfe"]
)
def test_what_is_no_goal_is_refused(data):
    with pytest.raises(WireError):
        GoalCommand.from_bytes(data)
