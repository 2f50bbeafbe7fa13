"""The telemetry thread over real Zenoh: what nobody looks at is not made."""

import threading

import pytest
from loopback import free_endpoint
from waiting import until

from dfvs_core.messages.topics import Topics
from dfvs_service.command import operators_zenoh
from dfvs_service.settings.config import load_config
from dfvs_service.telemetry import Note, Telemetry
from dfvs_service.zenoh_session import open_session

TOPICS = Topics("watched")


@pytest.fixture
def zenoh_config():
    return load_config(None, {"zenoh.listen": [free_endpoint()]}).zenoh


def test_flow_and_preview_are_made_only_while_somebody_looks(zenoh_config):
    made, heard = [], threading.Event()

    def make():
        made.append(1)
        return Note(b"grid")

    with open_session(zenoh_config) as session:
        telemetry = Telemetry(session, TOPICS, print, lambda *_: True)
        for stream in ("flow", "preview"):
            telemetry.offer(stream, make)
        told = threading.Event()
        telemetry.offer("servo", lambda: told.set() or Note(b"{}"))
        assert told.wait(30.0)  # made though nobody looks: it costs nothing
        assert not made
        with open_session(operators_zenoh(zenoh_config)) as viewer:
            subscriber = viewer.declare_subscriber(TOPICS.telemetry("flow"), lambda _: heard.set())
            assert until(lambda: telemetry.offer("flow", make) or heard.is_set())
            subscriber.undeclare()
        telemetry.close()
    assert made


def test_the_black_box_gets_its_streams_and_what_is_told_once_also_when_it_comes_late(zenoh_config):
    kept, is_there = [], threading.Event()

    def keep(stream, payload):
        if is_there.is_set():
            kept.append((stream, payload))
        return is_there.is_set()

    def offer(stream, payload):
        """Wait until it was made: the newest note of a stream replaces one that waits."""
        made = threading.Event()
        telemetry.offer(stream, lambda: made.set() or Note(payload))
        assert made.wait(30.0)

    heard = []
    with open_session(zenoh_config) as session:
        telemetry = Telemetry(session, TOPICS, print, keep)
        with open_session(operators_zenoh(zenoh_config)) as viewer:
            key = TOPICS.telemetry("*")
            subscriber = viewer.declare_subscriber(key, lambda s: heard.append(str(s.key_expr)))
            for stream in ("goal", "build", "state"):
                offer(stream, b"early")
            is_there.set()
            for stream in ("config", "thumbnail"):
                offer(stream, b"late")
            assert until(lambda: offer("servo", b"late") or TOPICS.telemetry("servo") in heard)
            subscriber.undeclare()
        telemetry.close()
    late = {(stream, b"late") for stream in ("servo", "thumbnail")}
    assert set(kept) == {("goal", b"early"), ("build", b"early")} | late
    published = {key.rpartition("/")[2] for key in heard}
    assert not {"thumbnail", "build"} & published


def test_the_black_box_gets_the_reduced_copy_of_what_is_too_large_for_it(zenoh_config):
    kept = []
    with open_session(zenoh_config) as session:
        telemetry = Telemetry(session, TOPICS, print, lambda *record: kept.append(record) or True)
        telemetry.offer("goal", lambda: Note(b"large", kept=b"small"))
        telemetry.close()
    assert kept == [("goal", b"small")]
