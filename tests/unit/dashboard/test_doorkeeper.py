import asyncio

import pytest
from starlette.responses import PlainTextResponse

from dfvs_service.dashboard.address import PublicAddress
from dfvs_service.dashboard.origin_check import OriginCheckMiddleware

HERE = PublicAddress.of(("drone1.local",), 8470, secure=False)
OUR_HOST = ("host", "127.0.0.1:8470")
OUR_ORIGIN = ("origin", "http://127.0.0.1:8470")


async def hello(scope, receive, send):
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
    else:
        await PlainTextResponse("hello")(scope, receive, send)


def ask(*headers, kind="http", method="GET", address=HERE):
    """First message of the answer."""
    sent = []

    async def receive():
        return {"type": f"{kind}.connect"}

    async def send(message):
        sent.append(message)

    raw = [(name.encode(), value.encode()) for name, value in headers]
    scope = {"type": kind, "method": method, "path": "/", "headers": raw}
    asyncio.run(OriginCheckMiddleware(hello, address)(scope, receive, send))
    return sent[0]


@pytest.mark.parametrize(
    "host",
    [
        "drone1.local:8470",
        *("127.0.0.1:8470", "localhost:8470", "LocalHost:8470", "[::1]:8470"),
        *("localhost:8471", "127.0.0.1"),  # by an SSH tunnel
    ],
)
def test_our_own_names_are_served(host):
    assert ask(("host", host))["status"] == 200
    origin = ("origin", f"http://{host}")
    assert ask(("host", host), origin, kind="websocket")["type"] == "websocket.accept"


@pytest.mark.parametrize(
    "headers",
    [
        [],
        [("host", "evil.example:8470")],
        [("host", "evil:8470")],
        [("host", "drone1.local:8471")],
        [("host", "127.0.0.1:8470.evil.example")],
        [OUR_HOST, ("host", "evil.example")],
        [OUR_HOST, OUR_HOST],
        [OUR_HOST, ("origin", "http://evil.example")],
        [OUR_HOST, ("origin", "null")],
        [OUR_HOST, ("origin", "http://127.0.0.1:8471")],
        [OUR_HOST, ("origin", "http://localhost:8470")],
    ],
)
def test_other_hosts_and_origins_are_refused(headers):
    assert ask(*headers)["status"] == 403
    assert ask(*headers, kind="websocket")["type"] == "websocket.close"


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "PATCH"])
def test_nothing_but_reading_goes_by_http(method):
    assert ask(OUR_HOST, OUR_ORIGIN, method=method)["status"] == 403


def test_a_socket_is_opened_for_our_own_page_alone():
    assert ask(OUR_HOST, OUR_ORIGIN, kind="websocket")["type"] == "websocket.accept"
    assert ask(OUR_HOST, kind="websocket")["type"] == "websocket.close"
    https = ("origin", "https://127.0.0.1:8470")
    assert ask(OUR_HOST, https, kind="websocket")["type"] == "websocket.close"


@pytest.mark.parametrize("headers", [[OUR_HOST], [("host", "evil.example")]])
def test_every_answer_forbids_what_the_page_does_not_need(headers):
    answer = {name.decode(): value.decode() for name, value in ask(*headers)["headers"]}
    assert "default-src 'none'" in answer["content-security-policy"]
    assert "unsafe" not in answer["content-security-policy"]
    assert "frame-ancestors 'none'" in answer["content-security-policy"]
    assert answer["x-content-type-options"] == "nosniff"
    assert answer["cache-control"] == "no-store"


def test_the_usual_port_may_be_left_out():
    usual = PublicAddress.of(("drone1.local",), 443, secure=True)
    assert usual.hosts == {"drone1.local", "drone1.local:443"}
    assert ask(("host", "drone1.local"), address=usual)["status"] == 200
