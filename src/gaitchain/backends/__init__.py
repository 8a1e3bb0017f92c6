"""Backends that execute joint targets: the simulator, servos, ROS 2, a mock."""
