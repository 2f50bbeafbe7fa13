"""Telemetry from a real Zenoh session of the service to one of ROS 2."""

import contextlib
import json
import queue
import time

import numpy as np
import pytest
from loopback import free_endpoint, peer
from waiting import until

from dfvs_common.clock import local_clock
from dfvs_common.ros2 import decode, type_hash
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.ros2 import decode_attachment
from dfvs_core.messages.topics import Topics
from dfvs_service.ros2.relay import Relay

TOPICS = Topics("swift-2")
STATE = {"state": "SERVO", "cause": "", "setpoint": [0.1, 0.2, 0.3, 0.4]}
TWIST = "geometry_msgs/msg/TwistStamped"
PREVIEW = "sensor_msgs/msg/CompressedImage"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
KEYS = {
    TWIST: ("swift_2/dfvs/setpoint", "geometry_msgs::msg::dds_::TwistStamped_"),
    PREVIEW: ("swift_2/dfvs/preview/compressed", "sensor_msgs::msg::dds_::CompressedImage_"),
    DIAGNOSTICS: ("diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_"),
}
"""Topic of a message, and its type as DDS spells it."""


class Rig:
    """The service's side, the relay between, and ROS's side."""

    def __init__(self, link):
        ports = free_endpoint(), free_endpoint()
        self.service, self.ros = peer(listen=ports[:1]), peer(listen=ports[1:])
        self.arrived = queue.Queue()
        self.subscriber = self.ros.declare_subscriber("**", self.arrived.put)
        self.inner = peer(connect=ports[:1]), peer(connect=ports[1:])
        self.link, self.now_ns = link, 0
        self.relay = Relay(TOPICS.vehicle, self.inner, link, 3, lambda: self.now_ns)

    def key(self, type_name):
        """Key on which ROS listens for a message."""
        topic, dds = KEYS[type_name]
        return f"3/{topic}/{dds}/{type_hash(type_name)}" if self.link == "rmw" else topic

    def close(self):
        for session in (*self.inner, self.service, self.ros):
            session.close()

    def publish_until(self, stream, payload, key, attachment=None):
        """Publish until something arrives on a key: sessions take a moment to meet."""
        deadline = time.monotonic() + 30.0
        while time.monotonic() < deadline:
            self.service.put(TOPICS.telemetry(stream), payload, attachment=attachment)
            while not self.arrived.empty():
                sample = self.arrived.get()
                if str(sample.key_expr) == key:
                    return sample
            time.sleep(0.02)
        raise AssertionError(f"nothing on {key}")


@pytest.fixture(params=["rmw", "bridge"])
def rig(request):
    with contextlib.closing(Rig(request.param)) as made:
        yield made


def test_setpoints_reach_ros_under_the_keys_that_it_listens_on(rig):
    sample = rig.publish_until("state", json.dumps(STATE).encode(), rig.key(TWIST))
    message = decode(TWIST, sample.payload.to_bytes())
    assert message.twist.linear.y == -0.2
    age_ns = time.time_ns() - (message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
    assert 0 <= age_ns < 10 * 10**9
    if rig.link == "rmw":
        assert decode_attachment(sample.attachment.to_bytes()).seq >= 1
    else:
        assert sample.attachment is None


def test_bad_telemetry_is_left_out_and_the_next_one_sent(rig):
    for bad in (b"", b"[]", b'{"state": "SERVO"}', b'{"state": 1, "setpoint": [1]}', b"\xff"):
        rig.service.put(TOPICS.telemetry("state"), bad)
        rig.service.put(TOPICS.telemetry("preview"), bad, attachment=b"no header")
    state = json.dumps(STATE).encode()
    assert rig.publish_until("state", state, rig.key(DIAGNOSTICS)) is not None


def test_the_preview_keeps_its_time_of_capture(rig):
    picture = np.zeros((16, 16, 3), np.uint8)
    capture_ns = time.monotonic_ns() - 50_000_000
    jpeg, attachment = encode_frame(Frame(picture, capture_ns, 1), PixelFormat.JPEG, local_clock())
    sample = rig.publish_until("preview", jpeg, rig.key(PREVIEW), attachment)
    message = decode(PREVIEW, sample.payload.to_bytes())
    assert message.data.tobytes() == jpeg
    stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    assert abs(stamp_ns - (capture_ns + time.time_ns() - time.monotonic_ns())) < 100_000_000


def test_a_preview_of_another_machine_has_its_time_of_arrival(rig):
    picture = np.zeros((16, 16, 3), np.uint8)
    other_ns = time.monotonic_ns() + 10**15
    frame = Frame(picture, other_ns, 1)
    jpeg, attachment = encode_frame(frame, PixelFormat.JPEG, b"another machine!")
    sample = rig.publish_until("preview", jpeg, rig.key(PREVIEW), attachment)
    message = decode(PREVIEW, sample.payload.to_bytes())
    stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    assert 0 <= time.time_ns() - stamp_ns < 60 * 10**9


def test_figures_of_a_frame_are_left_out_once_they_are_old(rig):
    def status():
        sample = rig.publish_until("state", json.dumps(STATE).encode(), rig.key(DIAGNOSTICS))
        (only,) = decode(DIAGNOSTICS, sample.payload.to_bytes()).status
        return only.message, [value.key for value in only.values]

    def seen():
        rig.service.put(TOPICS.telemetry("servo"), b'{"error_m": 0.25}')
        return "error_m" in status()[1]

    def aged():
        rig.now_ns += 1_500_000_000  # once more where a document was still under way
        message, keys = status()
        return "error_m" not in keys and message == "SERVO (no figures of a frame for over 1 s)"

    assert until(seen)
    assert until(aged)
    assert until(seen)
    assert status()[0] == "SERVO"


def test_rmw_zenoh_finds_node_and_publishers_by_their_tokens():
    with contextlib.closing(Rig("rmw")) as rig:
        deadline, found = time.monotonic() + 30.0, []
        while len(found) < 4 and time.monotonic() < deadline:
            replies = rig.ros.liveliness().get("@ros2_lv/**")
            found = sorted(str(reply.ok.key_expr).split("/", 5)[5] for reply in replies)
        assert [token.split("/")[0] for token in found] == ["MP", "MP", "MP", "NN"]
        assert found[3] == "NN/%/%/dfvs_swift_2"
        assert any("%swift_2%dfvs%setpoint/geometry_msgs::msg::dds_" in token for token in found)
