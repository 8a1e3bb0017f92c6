"""A robot: the reduced biped for step planning, and the jointed legs."""

import hashlib
from dataclasses import dataclass

from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.reduced_biped import ReducedBiped


@dataclass(frozen=True)
class Robot:
    """One robot in two models: reduced to five links, and joint by joint.

    Two robots are equal if all their numbers are equal, whatever file they came from.
    """

    reduced: ReducedBiped
    legs: LegModel
    boxes: bool
    """True if `legs` follows from `reduced`, False if it was read from a file."""

    @property
    def name(self) -> str:
        """Name of the robot in its file."""
        return self.reduced.name

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers of the robot, as stored in a gait library."""
        own = "" if self.boxes else self.legs.fingerprint
        numbers = f"{self.reduced.digits}{own}"
        return hashlib.sha256(numbers.encode()).hexdigest()[:16]
