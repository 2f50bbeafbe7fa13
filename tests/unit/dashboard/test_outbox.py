import asyncio
import json
import struct

import pytest

from dfvs_service.dashboard.outbox import (
    MAX_ROWS,
    MAX_UNSEEN,
    ImageKind,
    Outbox,
    encode_image_message,
)


def take(outbox):
    """What would be sent now; fails if nothing would."""
    return asyncio.run(asyncio.wait_for(outbox.next(), 0.5))


def is_silent(outbox):
    async def wait():
        await asyncio.wait_for(outbox.next(), 0.05)

    try:
        asyncio.run(wait())
    except TimeoutError:
        return True
    return False


def test_the_newest_of_each_kind_is_sent_once():
    outbox = Outbox()
    outbox.offer({"state": "1", "link": "2"})
    outbox.offer({"state": "3"})
    text, pictures = take(outbox)
    assert json.loads(text) == {"state": 3, "link": 2}
    assert pictures == []
    assert is_silent(outbox)


def test_rows_are_gathered_in_order_and_the_oldest_go():
    outbox = Outbox()
    outbox.append("servo", ["0"])
    outbox.append("servo", [str(i) for i in range(1, MAX_ROWS + 1)])
    rows = json.loads(take(outbox)[0])["servo"]
    assert rows == list(range(1, MAX_ROWS + 1))


def test_a_newer_view_takes_the_place_of_one_that_waits():
    outbox = Outbox()
    for picture in (b"old", b"new"):
        outbox.show(ImageKind.VIEW, picture)
    assert take(outbox) == (None, [b"new"])
    assert outbox.overtaken == 1


def test_views_wait_until_earlier_ones_are_confirmed_and_other_news_do_not():
    outbox = Outbox()
    for i in range(MAX_UNSEEN):
        outbox.show(ImageKind.VIEW, bytes([i]))
        assert take(outbox)[1] == [bytes([i])]
    outbox.show(ImageKind.VIEW, b"waits")
    assert is_silent(outbox)
    outbox.offer({"state": "1"})
    outbox.show(ImageKind.FLOW, b"flow")
    assert take(outbox) == ('{"state":1}', [b"flow"])
    outbox.confirm()
    assert take(outbox)[1] == [b"waits"]


def test_a_browser_that_turns_away_is_sent_nothing_old():
    outbox = Outbox()
    outbox.offer({"state": "1"})
    outbox.append("servo", ["1"])
    outbox.show(ImageKind.VIEW, b"x")
    outbox.forget()
    assert is_silent(outbox)


def test_what_is_for_the_browser_itself_is_sent_whatever_it_turns_to():
    outbox = Outbox()
    outbox.offer({"state": "1", "pong": "2"})
    outbox.append("answers", ["3"])
    outbox.forget()
    assert take(outbox) == ('{"pong":2,"answers":[3]}', [])


def test_confirmations_that_nothing_was_sent_for_earn_no_credit():
    outbox = Outbox()
    for _ in range(50):
        outbox.confirm()
    for i in range(MAX_UNSEEN):
        outbox.show(ImageKind.VIEW, bytes([i]))
        take(outbox)
    outbox.show(ImageKind.VIEW, b"waits")
    assert is_silent(outbox)


@pytest.mark.parametrize(
    ("kind", "number"), [(ImageKind.VIEW, 1), (ImageKind.GOAL, 2), (ImageKind.FLOW, 3)]
)
def test_a_picture_message_is_kind_time_and_data(kind, number):
    message = encode_image_message(kind, 1234.5, b"jpeg")
    assert struct.unpack("<Bd", message[:9]) == (number, 1234.5)
    assert message[9:] == b"jpeg"
