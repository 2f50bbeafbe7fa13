"""Perception, as a process, by a ROS 2 camera: both ways to Zenoh, with their own keys."""

import time

import pytest
from ros2_samples import compressed_message, image_message, info_message
from test_perception_process import CAMERA, Rig
from textured_wall import Wall, texture

from dfvs_common.ros2 import type_hash
from dfvs_core.messages.image import encode_jpeg
from dfvs_core.messages.ros2 import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE, Ros2Attachment, Ros2Topic

pytestmark = pytest.mark.real_time

LINKS = {
    "ros2-rmw": Ros2Topic("nose/image_raw", IMAGE),
    "ros2-bridge": Ros2Topic("nose/image_raw/compressed", COMPRESSED_IMAGE),
}


_STAMP_NS = 1_000_000_000
"""Two clocks are read one after the other, however busy the machine is."""


class Ros2Rig(Rig):
    """Perception that listens to ROS 2, and a camera that speaks it."""

    def __init__(self, folder, picture, source):
        self.topic, self.link = LINKS[source], source.removeprefix("ros2-")
        self.info = Ros2Topic("nose/camera_info", CAMERA_INFO)
        compressed = self.topic.type_name == COMPRESSED_IMAGE
        self.overrides = {
            "camera.source": source,
            "camera.ros2.topic": self.topic.name,
            "camera.ros2.compressed": compressed,
        }
        super().__init__(folder, picture)

    def put(self, topic, payload):
        attachment = Ros2Attachment(self.seq, time.time_ns(), bytes(16)).encode()
        key = topic.key(self.link, type_hash(topic.type_name))
        self.session.put(key, payload, attachment=attachment if self.link == "rmw" else None)

    def publish(self, image, t_ns):
        stamp_ns = time.time_ns() - (time.monotonic_ns() - t_ns)
        if self.topic.type_name == COMPRESSED_IMAGE:
            self.put(self.topic, compressed_message(encode_jpeg(image), stamp_ns=stamp_ns))
        else:
            padded = 320 * 3 + 64
            message = image_message(image[:, :, ::-1], "bgr8", step=padded, stamp_ns=stamp_ns)
            self.put(self.topic, message)


@pytest.mark.parametrize("source", sorted(LINKS))
def test_a_ros_2_camera_is_flown_by_like_our_own(tmp_path, rng, source):
    with Ros2Rig(tmp_path, Wall(texture(rng)).picture(), source) as rig:
        rig.report()
        began_ns = time.monotonic_ns()
        report = rig.shoot_until(rng, lambda r: r.healthy)
        assert report.error_m < 0.02
        assert began_ns - _STAMP_NS < report.t_capture_ns < time.monotonic_ns()
        rig.put(rig.topic, b"\x00\x01\x00\x00 no image")
        rig.report_where(lambda r: "are no ROS 2" in r.reason)
        wrong = [CAMERA.fx * 1.2, 0, 160, 0, CAMERA.fy * 1.2, 120, 0, 0, 1]
        rig.put(rig.info, info_message((320, 240), wrong))
        assert rig.shoot_until(rng, lambda r: r.reached).healthy
        warning = rig.process.stderr.readline().decode()
        while not warning.startswith("warning: "):
            warning = rig.process.stderr.readline().decode()
        assert "the announced focal length" in warning
