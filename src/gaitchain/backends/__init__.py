"""Backends that carry out joint targets: the simulator and a perfect mock."""

from typing import Protocol

from gaitchain.kinematics import Array
from gaitchain.messages import Sensors


class Backend(Protocol):
    """A robot, real or simulated, at the edge: four verbs.

    Simulated backends move their clock by one control period at each `write`.
    """

    def connect(self, position: Array) -> None:
        """Take hold of the robot, standing at these joint angles (2 n,) [rad]."""

    def read(self) -> Sensors:
        """Return the latest measurements."""

    def write(self, position: Array) -> None:
        """Send joint targets (2 n,) [rad] for one control period."""

    def close(self) -> None:
        """Let go of the robot."""
