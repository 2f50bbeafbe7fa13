import pytest

from dfvs_core.errors import ConfigError, WireError
from dfvs_core.messages.ros2 import (
    IMAGE,
    Ros2Attachment,
    Ros2Node,
    Ros2Topic,
    decode_attachment,
    vehicle_namespace,
)

HASH = "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"
TOPIC = Ros2Topic("/drone1/camera/image_raw", IMAGE, domain=5)


def test_keys_are_those_of_rmw_zenoh_and_of_the_bridge():
    dds = "sensor_msgs::msg::dds_::Image_"
    assert TOPIC.key("rmw") == f"5/drone1/camera/image_raw/{dds}/*"
    assert TOPIC.key("rmw", HASH) == f"5/drone1/camera/image_raw/{dds}/{HASH}"
    assert TOPIC.key("bridge") == "drone1/camera/image_raw"


@pytest.mark.parametrize("name", ["", "/", "a//b", "a/", "a b", "a/*", "**", "1a", "a/$x", "a#"])
def test_names_that_are_no_topic_are_refused(name):
    with pytest.raises(ConfigError, match="ROS 2 topic"):
        Ros2Topic(name, IMAGE)


def test_the_attachment_is_33_bytes_as_rmw_zenoh_lays_them_out():
    gid = bytes(range(16))
    data = Ros2Attachment(7, 1_700_000_000_000_000_001, gid).encode()
    assert data.hex() == (
        "0700000000000000"  # sequence number
        "01002a36fe9c9717"  # time in ns
        "10"  # length of the id
        "000102030405060708090a0b0c0d0e0f"
    )
    assert decode_attachment(data) == Ros2Attachment(7, 1_700_000_000_000_000_001, gid)


@pytest.mark.parametrize("data", [b"", bytes(32), bytes(34), bytes(33)])
def test_other_attachments_are_refused(data):
    with pytest.raises(WireError, match="ROS 2 attachment"):
        decode_attachment(data)


def test_tokens_announce_node_and_publisher_as_rmw_zenoh_does():
    node = Ros2Node("aac3178e146ba6f1fc6e6a4085e77f21", "dfvs_drone1", domain=2)
    prefix = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0"
    assert node.token() == f"{prefix}/0/NN/%/%/dfvs_drone1"
    assert node.publisher_token(TOPIC, HASH, 10) == (
        f"{prefix}/10/MP/%/%/dfvs_drone1/%drone1%camera%image_raw/"
        f"sensor_msgs::msg::dds_::Image_/{HASH}/::,10:,:,:,,"
    )


def test_a_dash_in_a_vehicle_s_name_is_an_underscore_in_ros_2():
    assert vehicle_namespace("drone-7_a") == "drone_7_a"
