import threading

from dfvs_service.mailbox import Mailbox


def test_the_newest_item_wins_and_the_others_are_counted():
    box = Mailbox()
    for burst in range(10):
        for k in range(30):
            box.put((burst, k))
        assert box.get(0.0) == (burst, 29)
        assert box.get(0.0) is None
    assert box.dropped == 10 * 29


def test_whoever_waits_is_woken():
    box, taken = Mailbox(), []
    thread = threading.Thread(target=lambda: taken.append(box.get(5.0)))
    thread.start()
    box.put("frame")
    thread.join(30.0)
    assert taken == ["frame"]
