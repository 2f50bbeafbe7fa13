"""The simulated quadrotor: its motion, PX4's logic, and its MAVLink face."""
