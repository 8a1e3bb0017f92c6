"""A robot: the reduced biped that steps are planned with, and its legs."""

import hashlib
from dataclasses import dataclass

from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.reduced_biped import ReducedBiped


@dataclass(frozen=True)
class Robot:
    """One robot, twice: reduced to five links, and joint by joint.

    Two robots are equal if all numbers of both are, wherever these came from.
    """

    reduced: ReducedBiped
    legs: LegModel
    boxes: bool
    """Whether the legs are the boxes that `reduced` describes, not those of a file."""

    @property
    def name(self) -> str:
        """What the robot's file calls it."""
        return self.reduced.name

    @property
    def fingerprint(self) -> str:
        """Hash of every number of the robot, as a gait library remembers it."""
        own = "" if self.boxes else self.legs.fingerprint
        numbers = f"{self.reduced.digits}{own}"
        return hashlib.sha256(numbers.encode()).hexdigest()[:16]
