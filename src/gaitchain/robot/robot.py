"""A robot: the reduced biped for step planning, and the jointed legs."""

import hashlib
import json
from dataclasses import dataclass, replace

from gaitchain.robot.identified import Identified
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
    identified: Identified | None = None
    """How this one differs from its file, if that was identified; `legs` has it."""
    of_file: "Robot | None" = None
    """The robot as it is in its file, if it was identified."""

    @property
    def name(self) -> str:
        """Name of the robot in its file."""
        return self.reduced.name

    @property
    def nominal(self) -> "Robot":
        """The robot as it is in its file."""
        return self if self.of_file is None else self.of_file

    def as_identified(self, found: Identified) -> "Robot":
        """Return the robot of this file with what was identified of it.

        Stiffness, damping and the trunk's CoM are those of the legs then; walker and
        simulator take the rest from `identified`.
        """
        legs = self.nominal.legs
        servo = (legs.damping - legs.joint_damping) * found.gain * found.damping
        fitted = replace(
            legs,
            stiffness=legs.stiffness * found.gain,
            damping=legs.joint_damping + servo,
            trunk_com=legs.trunk_com + found.com,
        )
        return Robot(self.reduced, fitted, False, found, self.nominal)

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers of the robot, as stored in a gait library."""
        own = "" if self.boxes else self.legs.fingerprint
        if self.identified is not None:
            own += json.dumps(self.identified.facts(), sort_keys=True)
        numbers = f"{self.reduced.digits}{own}"
        return hashlib.sha256(numbers.encode()).hexdigest()[:16]
