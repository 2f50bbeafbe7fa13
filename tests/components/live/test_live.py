"""The live views as processes, fed over a real Zenoh."""

import asyncio
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import urllib.request

import numpy as np
import pytest
import websockets
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from recorded_flight import fly
from waiting import until

from dfvs_core.messages.topics import Topics
from dfvs_core.perception.flow_grid import FlowGrid, encode_flow_grid
from dfvs_service.live import foxglove_cli, metrics_cli
from dfvs_service.perception.record_publisher import RecordPublisher

TOPICS = Topics("bottled")
START_S = 30.0


class Running:
    """A command of ours that serves on a port of its own choosing."""

    def __init__(self, module, endpoint):
        words = ["--port", "0", "--vehicle", "bottled", "--set", f'zenoh.listen=["{endpoint}"]']
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *words], stderr=subprocess.PIPE, text=True
        )
        self.url = self._process.stderr.readline().split()[-1]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.send_signal(signal.SIGTERM)
        try:
            self.code = self._process.wait(START_S)
        finally:
            self._process.kill()
            self._process.communicate()


def test_metrics_are_scraped_over_http(service):
    session, endpoint = service
    with Running("dfvs_service.live.metrics_cli", endpoint) as metrics:
        assert metrics.url.startswith("http://127.0.0.1:")

        def answered():
            servo = {"error_m": 0.25, "stages_ms": {"capture_to_report": 61.0}}
            session.put(TOPICS.telemetry("servo"), json.dumps(servo))
            session.put(TOPICS.telemetry("state"), json.dumps({"state": "SERVO"}))
            session.put(TOPICS.telemetry("timing"), b"not JSON")
            with urllib.request.urlopen(metrics.url) as response:
                assert response.headers["Content-Type"].startswith("text/plain")
                text = response.read().decode()
            return {one for one in asked if re.search(one, text)}

        asked = (
            r"capture_to_report",
            r'dfvs_gate_state\{state="SERVO",vehicle="bottled"\} 1',
            r'dfvs_error_meters\{vehicle="bottled"\} 0.25',
            r'dfvs_telemetry_unreadable_total\{vehicle="bottled"\} [1-9]',
        )
        # The samples were put a moment ago, each on a key of its own.
        assert until(lambda: not set(asked) - answered(), START_S), answered()
    assert metrics.code == 0


async def look(url, pictures, topics_asked, topics, seen):
    """What Foxglove would see: the channels by topic, and messages of the camera."""
    async with websockets.connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as link:
        async with asyncio.timeout(START_S):
            while len(seen) < pictures or not topics_asked <= topics.keys():
                message = await link.recv()
                if isinstance(message, bytes):
                    seen.append(message)
                    continue
                document = json.loads(message)
                if document["op"] != "advertise":
                    continue
                for channel in document["channels"]:
                    topics[channel["topic"]] = channel
                    if channel["topic"] == "/camera/image":
                        asked = {"id": 1, "channelId": channel["id"]}
                        await link.send(json.dumps({"op": "subscribe", "subscriptions": [asked]}))


def test_foxglove_sees_the_flight_on_its_own_schemas(service):
    session, endpoint = service
    flight = fly(np.random.default_rng(3), frames=3)
    feed = RecordPublisher(session, TOPICS, print)
    topics, seen = {}, []
    with Running("dfvs_service.live.foxglove_cli", endpoint) as server:
        assert server.url.startswith("ws://127.0.0.1:")
        assert until(lambda: feed.wanted, START_S)
        feed.offer(*flight.events[0])

        async def show():
            wanted = {"/camera/flow", "/gate/log"}
            looking = asyncio.create_task(look(server.url, 2, wanted, topics, seen))
            grid = FlowGrid(np.ones((4, 6, 2), np.float32), np.ones((4, 6), np.float32), 40, 1, 0)
            while not looking.done():
                session.put(TOPICS.telemetry("flow"), encode_flow_grid(grid))
                for turn, payload in flight.events[1:]:
                    feed.offer(turn, payload)
                await asyncio.sleep(0.2)  # a busy server keeps up
            return looking.exception()

        assert asyncio.run(show()) is None, (sorted(topics), len(seen), feed.wanted)
    feed.close()
    assert topics["/camera/image"]["schemaName"] == "foxglove.CompressedImage"
    assert topics["/camera/flow"]["schemaName"] == "foxglove.ImageAnnotations"
    assert topics["/gate/log"]["schemaName"] == "foxglove.Log"
    assert topics["/vehicle/pose"]["schemaName"] == "foxglove.PoseInFrame"
    opcode, subscription, _ = struct.unpack_from("<BIQ", seen[0])
    assert (opcode, subscription) == (1, 1)
    picture = CompressedImage.FromString(seen[0][13:])
    assert picture.data in {payload for _, payload in flight.events[1:]}
    assert server.code == 0


@pytest.mark.parametrize("cli", [metrics_cli, foxglove_cli])
def test_a_port_that_is_taken_is_one_clear_line(cli, refused):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert f"127.0.0.1:{port}" in refused(cli.main, "--port", port)


def test_an_address_of_no_machine_is_one_clear_line(refused):
    assert "expected an address of this machine" in refused(
        metrics_cli.main, "--address", "192.0.2.1", "--port", "0"
    )
