"""ROS 2 interface over Zenoh, without a ROS installation."""
