"""The dashboard's server as a process, spoken to as a browser would speak to it."""

import asyncio
import contextlib
import json
import ssl
import struct
import time

import pytest
from dashboard_server import Server
from loopback import free_endpoint
from self_signed import self_signed
from telemetry_vehicle import TelemetryVehicle
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from dfvs_service.settings.key_file import load_key

PATIENCE_S = 60.0


class Browser:
    """One connection; gathers news until something is told.

    It does not greet where ``token`` is None. An event loop carries it: the library's blocking
    client reads and writes one TLS connection on two threads, which OpenSSL does not allow.
    """

    def __init__(self, server, token="", **headers):
        page = server.url.rstrip("/")
        origin = headers.get("origin", page)
        address = page.replace("http", "ws", 1) + "/live"
        self.news = {}
        self.pictures = {}
        with contextlib.ExitStack() as opening:
            self.loop = opening.enter_context(asyncio.Runner())
            self.socket = self.wait(connect(address, origin=origin, proxy=None, ssl=server.tls))
            opening.callback(lambda: self.wait(self.socket.close()))
            if token is not None:
                self.say(type="hello", token=token)
            self.closing = opening.pop_all()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.closing.close()

    def wait(self, work, patience_s=PATIENCE_S):
        return self.loop.run(asyncio.wait_for(work, patience_s))

    def say(self, **message):
        self.send(json.dumps(message))

    def send(self, text):
        self.wait(self.socket.send(text))

    def hear_until(self, accept, patience_s=PATIENCE_S):
        """Take messages in until ``accept(news)``."""
        deadline = time.monotonic() + patience_s
        while not accept(self.news):
            self.take(self.wait(self.socket.recv(), max(deadline - time.monotonic(), 0.01)))
        return self.news

    def take(self, message):
        if isinstance(message, str):
            self.news |= json.loads(message)
            return
        kind, t_ms = struct.unpack("<Bd", message[:9])
        self.pictures.setdefault(kind, []).append((t_ms, message[9:]))
        if kind == 1:
            self.say(type="seen")

    def see_more_views(self):
        seen = len(self.pictures.get(1, []))
        self.hear_until(lambda _: len(self.pictures.get(1, [])) > seen + 3)

    def watch(self, vehicle):
        self.hear_until(lambda news: vehicle in [v["name"] for v in news.get("vehicles", [])])
        self.say(type="watch", vehicle=vehicle)
        return self.hear_until(lambda news: news.get("watching") == vehicle and "state" in news)


def test_a_browser_is_told_state_results_and_pictures_of_the_vehicle_it_watches(server, field):
    with Browser(server) as browser:
        news = browser.watch("swift")
        assert news["welcome"]["role"] == "viewer"
        assert news["state"]["mode"] == "OFFBOARD"
        assert "challenge" not in news["state"]
        browser.hear_until(
            lambda news: (
                {"servo", "path", "timing", "link", "settings"} <= news.keys()
                and browser.pictures.keys() == {1, 2, 3}
                and len(browser.pictures[1]) > 10
            )
        )
        t_ms, jpeg = browser.pictures[1][-1]
        assert jpeg.startswith(b"\xff\xd8")
        assert abs(time.time() * 1e3 - t_ms) < 2000
        assert browser.news["link"]["is_foreign_clock"] is False


def test_vehicles_of_several_endpoints_stand_in_one_list(server, field):
    with Browser(server) as browser:
        assert browser.watch("heron")["state"]["accepts_commands"] is False
        assert browser.watch("swift")["state"]["accepts_commands"] is True


def test_of_two_vehicles_of_one_name_one_is_shown_and_commanded_with_a_warning(field):
    endpoint = free_endpoint()
    words = ("--operator-token", str(field.token_file), "--command-key", str(field.key_file))
    key = load_key(field.key_file)
    with (
        TelemetryVehicle(endpoint, "swift", key) as other,
        Server([field.endpoints[0], endpoint], words) as server,
        Browser(server, field.token) as browser,
    ):
        field.swift.enter("READY", "checks passed")
        other.enter("READY", "the other one")
        browser.watch("swift")
        browser.hear_until(lambda news: "zenoh" in news and news["zenoh"]["warnings"])
        is_other = browser.news["state"]["cause"] == "the other one"
        shown, hidden = (other, field.swift) if is_other else (field.swift, other)
        given = len(shown.orders), len(hidden.orders)
        browser.say(type="command", command="abort", vehicle="swift")
        browser.hear_until(lambda news: "answers" in news)
        browser.hear_until(lambda news: news["state"]["state"] == "ABORT")
        assert (len(shown.orders), len(hidden.orders)) == (given[0] + 1, given[1])
        hidden.enter("DONE", "goal reached")
        shown.is_paused = True
        later = time.monotonic() + 3.0
        browser.hear_until(lambda _: time.monotonic() > later)
        assert browser.news["state"]["state"] == "ABORT"


def test_a_browser_that_confirms_nothing_is_sent_no_further_views(server, field):
    with Browser(server) as browser:
        browser.watch("swift")
        browser.say = lambda **_: None
        browser.hear_until(lambda news: news.get("overtaken", 0) > 10)
        assert len(browser.pictures[1]) <= 3
        assert "servo" in browser.news


def test_only_an_operator_s_order_reaches_the_vehicle(server, field):
    given = len(field.swift.orders)
    with Browser(server) as browser:
        browser.watch("swift")
        browser.say(type="command", command="abort", vehicle="swift")
        answers = browser.hear_until(lambda news: "answers" in news)["answers"]
        assert answers[0]["accepted"] is False
        assert "may only look" in answers[0]["text"]
    with Browser(server, field.token) as browser:
        browser.watch("swift")
        assert browser.news["welcome"]["can_command"] is True
        browser.say(type="command", command="hold", vehicle="swift")
        answers = browser.hear_until(lambda news: "answers" in news)["answers"]
        assert answers[0]["text"] == "accepted: hold"
        browser.hear_until(lambda news: news["state"]["state"] == "HOLD")
    assert field.swift.orders[given:] == ["accepted: hold"]


@pytest.mark.parametrize("order", ["arm", "", "takeoff", None, {"a": 1}])
def test_orders_that_do_not_exist_go_nowhere(server, field, order):
    given = len(field.swift.orders)
    with Browser(server, field.token) as browser:
        browser.watch("swift")
        browser.say(type="command", command=order, vehicle="swift")
        answers = browser.hear_until(lambda news: "answers" in news)["answers"]
        assert answers[0]["accepted"] is False
    assert len(field.swift.orders) == given


def test_a_wrong_token_is_shown_the_door(server):
    with Browser(server, "x" * 40) as browser, pytest.raises(ConnectionClosed) as closed:
        browser.hear_until(lambda _: False)
    assert closed.value.rcvd.code == 4401


def test_connections_that_do_not_greet_are_few_and_hold_up_nobody_for_long(server, field):
    with contextlib.ExitStack() as silent:
        admitted = 0
        with contextlib.suppress(InvalidStatus):
            for _ in range(40):
                silent.enter_context(Browser(server, token=None))
                admitted += 1
        assert 1 < admitted < 20
        with pytest.raises(InvalidStatus) as refused:
            Browser(server)
        assert refused.value.response.status_code == 403
    with Browser(server) as browser:
        browser.watch("swift")


def test_a_greeting_that_is_too_long_is_refused_unread(server):
    with Browser(server, "x" * 10_000) as browser, pytest.raises(ConnectionClosed) as closed:
        browser.hear_until(lambda _: False)
    assert closed.value.rcvd.code == 1009


@pytest.mark.parametrize("origin", ["http://evil.example", "null", None])
def test_other_pages_cannot_connect(server, origin):
    with pytest.raises(InvalidStatus) as refused:
        Browser(server, origin=origin)
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("message", ["[]", "{", '{"type": "fly"}', "[" * 60_000, '"' * 3])
def test_messages_that_are_not_understood_end_that_connection_alone(server, field, message):
    with Browser(server) as other:
        other.watch("swift")
        with Browser(server) as browser:
            browser.hear_until(lambda news: "welcome" in news)
            browser.send(message)
            with pytest.raises(ConnectionClosed):
                browser.hear_until(lambda _: False)
        other.see_more_views()


def test_a_service_that_starts_later_and_again_is_found():
    endpoint = free_endpoint()
    with Server([endpoint]) as server, Browser(server) as browser:
        for cause in ("first", "second"):
            with TelemetryVehicle(endpoint, "late") as vehicle:
                vehicle.enter("READY", cause)
                browser.watch("late")
                browser.hear_until(lambda news, cause=cause: news["state"]["cause"] == cause)
                browser.see_more_views()


def test_a_signal_ends_it_in_order_though_pages_are_open(field):
    with Server(field.endpoints) as server, Browser(server) as browser:
        browser.watch("heron")
        server.process.terminate()
        assert server.process.wait(30.0) == 0


def test_beyond_this_machine_it_is_encrypted_and_shows_nothing_without_a_token(field, tmp_path):
    cert, key = self_signed(tmp_path)
    words = ["--host", "0.0.0.0", "--name", "127.0.0.1", "--cert", cert, "--key", key]
    words += ["--viewer-token", str(field.token_file)]
    context = ssl.create_default_context(cafile=cert)
    with Server(field.endpoints, tuple(words), tls=context) as server:
        with Browser(server) as browser, pytest.raises(ConnectionClosed) as closed:
            browser.hear_until(lambda news: "vehicles" in news)
        assert closed.value.rcvd.code == 4401
        assert browser.news == {}
        with Browser(server, field.token) as browser:
            assert browser.watch("swift")["welcome"]["can_command"] is False
