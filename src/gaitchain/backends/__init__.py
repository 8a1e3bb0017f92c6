"""Backends that carry out joint targets: the simulator, servos, ROS 2, a mock."""
