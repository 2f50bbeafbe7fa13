"""ROS 2 without ROS: cameras and telemetry in its messages, over Zenoh."""
