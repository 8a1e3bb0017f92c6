"""What the online path carries from tick to tick: named tuples of numbers, compiled.

Lengths and speeds along the ground are given in the *step frame*: origin under the
support ankle, x along the support foot, y to the left of a left support foot and, as
in a mirror, to the right of a right one. So the swing foot is always at negative y.
"""

import math
from typing import NamedTuple

from gaitchain.messages import Array

STAND, SHIFT, SINGLE, DOUBLE, SETTLE = range(5)
"""Phases: standing; shifting the weight before the first step; one foot; two feet
between steps; two feet, coming to rest."""


class StepTimes(NamedTuple):
    """The rhythm and height of a walk."""

    step: float
    """T [s]."""
    single: float
    """T_a + T_b, on one foot [s]."""
    rise: float
    """T_a, until the swing foot is highest [s]."""
    shift: float
    """Weight shift before the first step [s]."""
    hip_height: float
    """Hips above the ankles [m]."""
    omega: float
    """Of the pendulum [1/s]."""
    period: float
    """Control period [s]."""


class Foot(NamedTuple):
    """A foot on the ground, in the step frame."""

    x: float
    y: float
    yaw: float
    """To the outside of the swing leg, as `StepTarget.turn` [rad]."""


class Pelvis(NamedTuple):
    """The pendulum's point, fixed in the pelvis, in the step frame."""

    x: float
    y: float
    vx: float
    vy: float


class Planar(NamedTuple):
    """Two numbers along the ground, in the step frame."""

    x: float
    y: float


NOT_YET = Planar(math.nan, math.nan)
"""A `first_zmp` before it is planned."""


class Attitude(NamedTuple):
    """The trunk's orientation R_z(yaw) R_y(pitch) R_x(roll), and its rates."""

    roll: float
    pitch: float
    yaw: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float


class View(NamedTuple):
    """What the sensors say about the base, relative to the support foot."""

    com: Pelvis
    """CoM of the robot, step frame."""
    foot_yaw: float
    """Support foot's heading, left of the trunk's [rad]."""
    foot_tilt: Planar
    """Support foot's roll (x) and pitch (y), about the trunk's heading [rad]."""
    swing: Foot
    """Swing foot, step frame."""
    clearance: float
    """Lowest corner of the swing sole above that of the support sole [m]."""


class Lean(NamedTuple):
    """The trunk's lean to the left against a push."""

    angle: float
    """Reference, to the left [rad]."""
    speed: float
    """[rad/s]"""
    aim: float
    """Where it goes [rad]."""


UPRIGHT = Lean(0.0, 0.0, 0.0)


class GaitState(NamedTuple):
    """Where the walk is, what it plans, and how far the robot is off."""

    phase: int
    side: float
    """+1 while the left foot supports, -1 while the right one does."""
    time: float
    """Since the phase's step began [s]."""
    pelvis: Pelvis
    """Reference."""
    pelvis_yaw: float
    """Reference, to the swing side of the support foot's heading as `Foot.yaw`."""
    lift_off: Foot
    """Where the swing foot left the ground, or the other foot stands."""
    landing: Foot
    """Where it shall land."""
    zmp: Planar
    """Planned."""
    first_zmp: Planar
    """Planned when the step began."""
    error: Planar
    """DCM, measured minus reference [m]."""
    rate: float
    """Of the step's time: above 1 the step is hurried."""
    holds: float
    """1 while the robot is held on one foot against its fall over it, else 0."""
    lean: Lean
    worst: float
    """Largest error of this step [m]."""
    caution: float
    """Of this step, see `caution_after`: 0 goes as commanded, 1 stays in place."""


class Memory(NamedTuple):
    """Arrays that the tick writes to."""

    joints: Array
    """(2 n,) reference joint angles of the latest tick [rad]."""
    next_joints: Array
    """(2 n,) where the IK of the next tick begins [rad]."""
    links: Array
    """(2, 3, n, 3) link CoMs of both legs from the pelvis, and two derivatives."""
    com: Array
    """(4,) reference CoM from the pelvis, in the trunk's heading: x, y and rates."""
    reaction: Array
    """(2,) multi-link ZMP minus the pendulum's, step frame [m]."""
    offset: Array
    """(2,) learned: robot's CoM off the model's, ahead and left of the trunk [m]."""
    zmp: Array
    """(2,) ZMP that the servos are told to make, step frame [m]."""
    load: Array
    """(2,) on the left and the right sole; NaN where it is not measured [N]."""
