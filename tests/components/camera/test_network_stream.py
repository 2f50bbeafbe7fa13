"""A network stream, served by a real server that goes away and comes back."""

import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from waiting import until

from dfvs_core.messages.image import encode_jpeg
from dfvs_service.camera.feed import LiveFeed
from dfvs_service.camera.sources.source import SourceOptions, open_source
from dfvs_service.camera.sources.spec import parse_source

PERIOD_S = 0.03


class MjpegHandler(BaseHTTPRequestHandler):
    """Serves a motion JPEG, each picture brighter than the one before."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        level = 0
        while not self.server.ended.is_set():
            level = (level + 5) % 250
            jpeg = encode_jpeg(np.full((48, 64, 3), level, np.uint8))
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            try:
                self.wfile.write(head.encode() + jpeg + b"\r\n")
            except OSError:
                return
            time.sleep(PERIOD_S)

    def log_message(self, *_words):
        pass


@contextmanager
def served(port=0):
    """A running server, and its port."""
    server = ThreadingHTTPServer(("127.0.0.1", port), MjpegHandler)
    server.ended = threading.Event()
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.ended.set()
        server.shutdown()
        server.server_close()
        thread.join(5.0)


def shots(feed, count):
    taken, deadline = [], time.monotonic() + 20.0
    while len(taken) < count and time.monotonic() < deadline:
        shot = feed.receive(0.2)
        if shot is not None:
            taken.append(shot)
    return taken


@pytest.fixture
def lines():
    return []


def test_a_stream_is_read_lost_and_read_again(lines):
    with served() as port:
        spec = parse_source(f"http://127.0.0.1:{port}/camera.mjpg")
        options = SourceOptions(latency_ns=40_000_000)
        feed = LiveFeed(lambda: open_source(spec, options), lines.append, retry_s=0.1)
        first = shots(feed, 5)
        assert len(first) == 5
        assert {shot.image.shape for shot in first} == {(48, 64, 3)}
        # Its time is that of arrival less the latency that was measured.
        assert time.monotonic_ns() - first[-1].t_capture_ns > 40_000_000
        times = [shot.t_capture_ns for shot in first]
        assert times == sorted(set(times))
    assert until(lambda: feed.receive(0.1) is None and lines, 20.0)
    assert "no more images" in lines[0]
    assert "trying again" in lines[0]
    with served(port):
        assert shots(feed, 3)
        feed.close()
    assert "the source is back" in lines
