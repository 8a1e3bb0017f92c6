"""A robot: the reduced biped for step planning, and the jointed legs."""

import hashlib
import json
from dataclasses import dataclass, replace

import numpy as np

from gaitchain.errors import GaitchainError
from gaitchain.messages import Array
from gaitchain.robot.identified import Identified
from gaitchain.robot.leg_model import DECIMALS, LegModel
from gaitchain.robot.reduced_biped import ReducedBiped


@dataclass(frozen=True)
class Robot:
    """One robot in two models: reduced to five links, and joint by joint.

    Two robots are equal if all their numbers are equal, whatever file they came from.
    """

    reduced: ReducedBiped
    legs: LegModel
    boxes: bool
    """Whether `legs` follows from `reduced`, so that boxes are simulated, and was not
    read from a file or identified; see `of_boxes`."""
    identified: Identified | None = None
    """How this one differs from its file, if that was identified; `legs` has it."""
    servo_gain: float = 1.0
    """Part of its file's servo stiffness and damping that it walks with; `legs` has it.
    """
    of_file: "Robot | None" = None
    """The robot as it is in its file, if it walks otherwise."""

    @property
    def name(self) -> str:
        """Name of the robot in its file."""
        return self.reduced.name

    @property
    def in_file(self) -> "Robot":
        """The robot as it is in its file, with the servo gains of the file."""
        return self if self.of_file is None else self.of_file

    @property
    def of_boxes(self) -> bool:
        """Whether it is a robot of boxes in its file, also where it was identified.

        How it walks follows from that: its steps were trained for the file's robot.
        """
        return self.in_file.boxes

    @property
    def nominal(self) -> "Robot":
        """The robot of the file, with the servo gains that this one walks with."""
        return self.in_file.with_servo_gain(self.servo_gain)

    def with_servo_gain(self, part: float) -> "Robot":
        """Return the robot with a part of its file's servo stiffness and damping.

        Args:
            part: of the file's; the joints' own damping stays as it is.
        """
        own, found = self.in_file, self.identified
        robot = own
        if part != 1.0:
            legs = own.legs.with_servos(part, part)
            robot = replace(own, legs=legs, servo_gain=part, of_file=own)
        return robot if found is None else robot.as_identified(found)

    def as_identified(self, found: Identified) -> "Robot":
        """Return the robot of this file with what was identified of it.

        Stiffness, damping, dry friction and the trunk's mass and CoM are those of the
        legs then; walker and simulator take the rest from `identified`.
        """
        part = self.servo_gain * found.gain
        servos = self.in_file.legs.with_servos(part, part * found.damping)
        dry = found.dry_friction * servos.torque_limit
        legs = replace(
            servos,
            friction_loss=servos.friction_loss + dry,
            trunk_mass=servos.trunk_mass * found.trunk_mass,
            trunk_com=servos.trunk_com + found.com,
            trunk_inertia=servos.trunk_inertia * found.trunk_mass,
        )
        return Robot(
            self.reduced, legs, False, found, self.servo_gain, of_file=self.in_file
        )

    def with_ranges(self, lower: Array, upper: Array) -> "Robot":
        """Return the robot with its joints' ranges narrowed to given ones.

        Args:
            lower: (2 n,) lower ends, as servos have them [rad].
            upper: (2 n,) upper ends [rad].
        """
        low, high = (
            np.maximum(self.legs.lower, lower),
            np.minimum(self.legs.upper, upper),
        )
        return replace(self, legs=replace(self.legs, lower=low, upper=high))

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers of the robot, as stored in a gait library."""
        own = "" if self.boxes else self.legs.fingerprint
        digits = self.reduced.digits(None if self.boxes else DECIMALS)
        if self.servo_gain != 1.0:
            own += f"servo gain {self.servo_gain!r}"
        if self.identified is not None:
            own += json.dumps(self.identified.facts(), sort_keys=True)
        numbers = f"{digits}{own}"
        return hashlib.sha256(numbers.encode()).hexdigest()[:16]


def given_robot(robot: object, kind: type[GaitchainError]) -> Robot:
    """Return what was given as a robot.

    Args:
        robot: what was given.
        kind: the error to raise.

    Raises:
        GaitchainError: of that kind, where it is none.
    """
    if isinstance(robot, Robot):
        return robot
    raise kind(
        f"{robot!r:.80} is no robot; give a Robot, as load_robot returns, or a "
        "library's, library.robot"
    )
