"""What a walk carries from one control step to the next: named tuples of numbers.

Lengths and speeds along the ground are given in the *step frame*: origin under the
support ankle, x along the support foot, y to the left of a left support foot and, as
in a mirror, to the right of a right one. So the swing foot is always at negative y.
"""

import math
from typing import NamedTuple

from gaitchain.gait.motion import Timing
from gaitchain.messages import GRAVITY, Array

STAND, SHIFT, SINGLE, DOUBLE, SETTLE = range(5)
"""Phases: standing; shifting the weight before the first step; one foot; two feet
between steps; two feet, coming to rest."""
_SHIFT = 4.0  # pendulum times: weight shift before the first step


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
    """Natural frequency of the pendulum, sqrt(g / height) [1/s]."""
    period: float
    """Control period [s]."""


def step_times(
    timing: Timing, hip_height: float, com_height: float, period_s: float
) -> StepTimes:
    """Return the rhythm of a walk: the paper's times, and the pendulum over them.

    Args:
        timing: the step's times.
        hip_height: hips above the ankles [m].
        com_height: length of the pendulum, the CoM above the ground [m].
        period_s: control period [s].
    """
    omega = math.sqrt(GRAVITY / com_height)
    return StepTimes(
        step=timing.step,
        single=timing.rise + timing.fall,
        rise=timing.rise,
        shift=round(_SHIFT / omega / period_s) * period_s,
        hip_height=hip_height,
        omega=omega,
        period=period_s,
    )


class Planar(NamedTuple):
    """Two numbers along the ground, in the step frame."""

    x: float = 0.0
    y: float = 0.0


NOT_YET = Planar(math.nan, math.nan)
"""A `first_zmp` before it is planned."""


class Foot(NamedTuple):
    """A foot on the ground, in the step frame."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    """Toward the outside of the swing leg, as `StepTarget.turn` [rad]."""


class Pelvis(NamedTuple):
    """The pendulum's point, fixed in the pelvis, in the step frame."""

    x: float = 0.0
    y: float = 0.0
    vx: float = 0.0
    vy: float = 0.0


class Attitude(NamedTuple):
    """The trunk's orientation R_z(yaw) R_y(pitch) R_x(roll), and its rates."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    roll_rate: float = 0.0
    pitch_rate: float = 0.0
    yaw_rate: float = 0.0


class View(NamedTuple):
    """The base relative to the support foot, as the sensors have it."""

    com: Pelvis
    """CoM of the robot, step frame."""
    turning: Planar
    """What turning adds to the CoM's speed, see `dcm_error`, step frame [m/s]."""
    foot_yaw: float
    """Support foot's heading, left of the trunk's [rad]."""
    foot_tilt: Planar
    """Support foot's roll (x) and pitch (y), about the trunk's heading; where ankles do
    not roll, x is the mean of both feet, which lean to opposite sides [rad]."""
    swing: Foot
    """Swing foot, step frame."""
    swing_height: float
    """Hips above the swing sole [m]."""
    clearance: float
    """Lowest corner of the swing sole above that of the support sole [m]."""


class GaitState(NamedTuple):
    """Where the walk is, what it plans, and how far the robot is off.

    A field is declared here, with the value that it has in a standing robot, and
    written by the rule that computes it. One that is given in the step frame also
    changes where the feet exchange their parts, in `seen_from`.
    """

    phase: int = STAND
    side: float = 1.0
    """+1 while the left foot supports, -1 while the right one does."""
    time: float = 0.0
    """Since the phase's step began [s]."""
    pelvis: Pelvis = Pelvis()
    """Reference."""
    pelvis_yaw: float = 0.0
    """Reference, toward the swing side of the support foot as `Foot.yaw` [rad]."""
    lift_off: Foot = Foot()
    """Where the swing foot left the ground, or the other foot stands."""
    landing: Foot = Foot()
    """Where the swing foot is to land."""
    zmp: Planar = Planar()
    """Planned ZMP [m]."""
    first_zmp: Planar = NOT_YET
    """The same in the first control step of this step [m]."""
    error: Planar = Planar()
    """DCM, measured minus reference [m]."""
    lag: float = 0.0
    """How late the joints follow the reference, as learned [s]."""
    rate: float = 1.0
    """Rate of the step's time: above 1 the step is hurried."""
    sag: float = 0.0
    """Hips below their nominal height, reference [m]."""
    crouch_asked: float = 0.0
    """How far the hips are to go lower, as commanded [m]."""
    sinking: float = 0.0
    """That, once delayed [m]; see `balance.crouch`."""
    crouch: float = 0.0
    """How much lower their nominal height is now [m]."""
    worst: float = 0.0
    """Largest error of this step [m]."""
    heel: float = 0.0
    """Pitch of the support foot about its toes before it leaves, reference [rad]."""
    heading: float = math.nan
    """Of the support foot as single support began, about the gyro's z; NaN before
    [rad]."""
    slip: float = 0.0
    """How far it has turned on the ground since then, either way [rad]."""


class SoleLoads(NamedTuple):
    """The load on each sole, NaN where it is not measured [N]."""

    left: float = math.nan
    right: float = math.nan


class Memory(NamedTuple):
    """Arrays of the latest control step, which the next one reads and rewrites."""

    joints: Array
    """(2 n,) reference joint angles [rad]."""
    next_joints: Array
    """(2 n,) where the IK of the next control step begins [rad]."""
    links: Array
    """(2, 3, n, 3) link CoMs of both legs from the pelvis, and two derivatives."""
    rates: Array
    """(2 n,) of the reference [rad/s]."""
    torques: Array
    """(2 n,) that the reference needs [N m]."""


def seen_from(other: Foot, state: GaitState) -> GaitState:
    """Return a state in the step frame of the foot that stands at `other`.

    Step frames of the right foot are mirrored, so left and right change sign.
    """
    pelvis, zmp, error = state.pelvis, state.zmp, state.error
    middle = _turned_over(other, -other.x, -other.y)
    back = Foot(middle.x, middle.y, other.yaw)
    place = _turned_over(other, pelvis.x - other.x, pelvis.y - other.y)
    speed = _turned_over(other, pelvis.vx, pelvis.vy)
    return state._replace(
        side=-state.side,
        pelvis=Pelvis(place.x, place.y, speed.x, speed.y),
        pelvis_yaw=other.yaw - state.pelvis_yaw,
        lift_off=back,
        landing=back,
        zmp=_turned_over(other, zmp.x - other.x, zmp.y - other.y),
        error=_turned_over(other, error.x, error.y),
        heel=0.0,  # of the foot that leaves; this one is level
    )


def _turned_over(other: Foot, x: float, y: float) -> Planar:
    """Return a vector along the axes of the other foot's step frame."""
    c, s = math.cos(other.yaw), math.sin(other.yaw)
    return Planar(c * x - s * y, -(s * x + c * y))
