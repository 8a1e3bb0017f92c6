"""Safe motions that show what a robot is: hung legs swing, and it sways. Ours.

Every target is a slow sine and a fast, small one of other joints' other frequencies, so
that the joints can be told apart; both grow from rest and come to rest again. What the
leg weighs loads most joints of a leg that swings; a hip yaw, whose axis is vertical, it
loads not at all. So knees are bent, and the less a joint bears, the faster it shakes,
and its leg's inertia is the load. The first part needs a trunk that is held up, the
second one level ground under both soles.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gaitchain.balance.feedforward import LegLoad, load_torques
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import (
    Legs,
    Posture,
    com_from_pelvis,
    legs_of,
    posture,
)
from gaitchain.errors import BackendError
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.robot import Robot
from gaitchain.robot.turn import turn_matrix

Support = Literal["held", "standing"]
"""Whether the trunk is held up, or the robot stands on both feet."""
_SECONDS: dict[Support, float] = {"held": 28.0, "standing": 28.0}
_RAMP_S, _REST_S = 2.0, 1.0  # of growing from rest, and rest before and after
# Hung legs.
_SWING_RAD, _SHAKE_RAD = 0.45, 0.06  # most of the slow and of the fast sine
_OF_RANGE = 0.35  # of the way to the nearer limit: most of the slow sine, half fast
_OF_SPEED = 0.15, 0.3  # of the speed limit: most of the slow and of the fast sine
_APART_RAD = 0.2  # by which each leg is spread
_DRAWN, _DRAWING = 0.2, 20  # of the leg, by which feet are drawn up; poses on the way
_SLOW_HZ = 0.12, 0.3  # first and last joint's, of both legs: they swing side by side
_FAST_HZ = 1.0, 5.0  # of the joint that bears most, and of the one that bears least
_DIGITS = 6  # of what a joint bears: both legs' joints bear the same
_STEEP = 0.5  # least part of an axis that turns the leg outward
# Standing: the CoM ahead and aside, the pelvis lower, the trunk turned.
_AHEAD, _ASIDE, _LOWER = 0.07, 0.06, 0.05  # of the sole, the hips' width, the leg
_TURN_RAD = (0.06, 0.2, 0.1)  # roll, pitch, yaw of the trunk
_ROUNDS = 3  # of placing the pelvis so that the CoM is where it should be
_SWAY_HZ = (0.17, 0.23, 0.13, 0.29, 0.37, 0.19)  # of a leg of 0.5 m
_RIPPLE, _RIPPLE_HZ = 0.12, 6.1  # of a sway's size, times its frequency
_LEG_M = 0.5
_SWAYS = (1.0, 0.7, 0.5, 0.35, 0.25)  # parts of it, as the joints' ranges allow
_MOST_CUT_RAD = np.radians(6.0)  # by a joint's end: RES's knees lose 5 deg


@dataclass(frozen=True)
class Motion:
    """One part of an exercise: targets, period by period."""

    support: Support
    targets: Array
    """(N, 2 n) joint targets [rad], one in each `CONTROL_PERIOD_S` at first."""

    def smaller(self, part: float) -> "Motion":
        """Return a part of the motion around where it begins."""
        begin = self.targets[0]
        return Motion(self.support, begin + part * (self.targets - begin))

    def every(self, period_s: float) -> "Motion":
        """Return the same motion with targets of another control period [s]."""
        given = CONTROL_PERIOD_S * np.arange(len(self.targets))
        wanted = np.arange(0.0, given[-1] + 0.5 * period_s, period_s)
        columns = [np.interp(wanted, given, joint) for joint in self.targets.T]
        return Motion(self.support, np.stack(columns, axis=1))


def exercise(robot: Robot) -> tuple[Motion, ...]:
    """Return the motions of a robot: with its trunk held up, and standing.

    Joints stay within their ranges, and below half of their speed limits.

    Args:
        robot: the robot.

    Raises:
        BackendError: see `sway`.
    """
    return swing(robot), sway(robot)


def swing(robot: Robot) -> Motion:
    """Return the motion of hung legs; see `exercise`."""
    return Motion("held", _swinging(robot))


def sway(robot: Robot) -> Motion:
    """Return the motion of a robot that stands; see `exercise`.

    Raises:
        BackendError: a joint cannot turn as far as standing on level soles takes.
    """
    return Motion("standing", _shifting(robot))


def _times(support: Support) -> Array:
    return np.arange(0.0, _SECONDS[support], CONTROL_PERIOD_S)


def _envelope(times: Array) -> Array:
    """Return 0 at rest, 1 in between, smooth where it grows, (N, 1)."""
    end = times[-1] - _REST_S
    grown = np.clip(np.minimum(times - _REST_S, end - times) / _RAMP_S, 0.0, 1.0)
    return np.asarray((grown**2 * (3.0 - 2.0 * grown))[:, None])


def _swinging(robot: Robot) -> Array:
    """Return targets of legs that swing freely, (N, 2 n) [rad]."""
    legs, times = robot.legs, _times("held")
    middle = _hanging(robot)
    room = np.maximum(np.minimum(legs.upper - middle, middle - legs.lower), 0.0)
    speed = np.where(np.isfinite(legs.speed_limit), legs.speed_limit, 10.0)
    slow, fast = (part * speed / (2.0 * np.pi) for part in _OF_SPEED)
    slow_hz = np.tile(np.geomspace(*_SLOW_HZ, legs.leg_joints), 2)
    swing = np.minimum(_SWING_RAD, _OF_RANGE * room)
    swing = _alike(np.minimum(swing, slow / slow_hz))
    fast_hz = _fast_hz(_weight_borne(robot, middle, swing))
    shake = np.minimum(_SHAKE_RAD, 0.5 * _OF_RANGE * room)
    shake = np.minimum(shake, fast / fast_hz)
    turn, way = 2.0 * np.pi * times[:, None], _same_way(robot)
    off = way * swing * np.sin(turn * slow_hz) + shake * np.sin(turn * fast_hz)
    return np.asarray(middle + _envelope(times) * off)


def _alike(swing: Array) -> Array:
    """Return the lesser swing of both legs' joints: else the legs would meet."""
    return np.tile(np.min(swing.reshape(2, -1), axis=0), 2)


def _same_way(robot: Robot) -> Array:
    """Return the signs with which both legs swing side by side, (2 n,)."""
    left, right = robot.legs.axis
    mirrored = np.sum(left * right, axis=1) < 0.0
    return np.concatenate([np.ones(len(mirrored)), np.where(mirrored, -1.0, 1.0)])


def _weight_borne(robot: Robot, middle: Array, swing: Array) -> Array:
    """Return what a leg's weight changes by at each joint that swings, (2 n,) [N m]."""
    legs = legs_of(robot)
    hung = LegLoad(np.zeros(3), 0.0, 0.0, 0.0)
    still = np.zeros((2, 3, robot.legs.leg_joints, 3))

    def held(joints: Array) -> Array:
        return load_torques(legs, posture(legs, joints), hung, hung, still)

    ends = [(held(middle + one), held(middle - one)) for one in np.diag(swing)]
    return np.array([abs((a - b)[j]) for j, (a, b) in enumerate(ends)])


def _fast_hz(borne: Array) -> Array:
    """Return how fast each joint shakes, the faster the less it bears, (2 n,) [Hz]."""
    order = np.argsort(-np.round(borne, _DIGITS), kind="stable")
    hz = np.empty(len(borne))
    hz[order] = np.geomspace(*_FAST_HZ, len(borne))
    return hz


def _hanging(robot: Robot) -> Array:
    """Return a pose with the feet drawn up and the legs apart, within their ranges.

    A shank that hangs straight down loads no knee, and its leg has no inertia about a
    hip yaw.
    """
    legs = robot.legs
    outward = legs.axis[..., 0].copy()
    outward[1] *= -1.0
    upper = np.arange(legs.leg_joints) < legs.knee
    chosen = np.where(upper & (np.abs(outward) > _STEEP), np.sign(outward), 0.0)
    drawn = _drawn_up(robot) + _APART_RAD * chosen.ravel()
    ease = 0.1 * (legs.upper - legs.lower)
    return np.asarray(np.clip(drawn, legs.lower + ease, legs.upper - ease))


def _shifting(robot: Robot) -> Array:
    """Return targets of a robot that sways on both feet, (N, 2 n) [rad]."""
    times, reduced = _times("standing"), robot.reduced
    size = np.array(
        [
            _AHEAD * reduced.sole_length,
            _ASIDE * reduced.hip_width,
            _LOWER * reduced.leg_length,
            *_TURN_RAD,
        ]
    )
    hz = np.array(_SWAY_HZ) * np.sqrt(_LEG_M / reduced.leg_length)
    turn = 2.0 * np.pi * times[:, None] * hz
    way = size * (np.sin(turn) + _RIPPLE * np.sin(_RIPPLE_HZ * turn))
    way[:, 2] -= size[2]  # lower only: the legs may be nearly straight
    way *= _envelope(times)
    low, high = robot.legs.lower, robot.legs.upper
    for part in _SWAYS:
        joints = _swaying(robot, part * way)
        cut = np.maximum(joints - high, low - joints).max(axis=0)
        if cut.max() <= _MOST_CUT_RAD:
            return np.clip(joints, low, high)
    # One knee that bends less than the other one would lean the robot.
    at = int(np.argmax(cut))
    raise BackendError(
        f"{robot.legs.joint_names[at]} ends {np.degrees(cut[at]):.0f} deg before what "
        f"the least sway takes, at most {np.degrees(_MOST_CUT_RAD):.0f} may be cut; "
        "widen its limits in the calibration and the servo, or calibrate it again"
    )


def _swaying(robot: Robot, way: Array) -> Array:
    """Return the joints of a robot that sways over feet that stay, (N, 2 n) [rad].

    The pelvis makes up for what a turn of the trunk moves the CoM by: so the trunk
    turns far, which tells how high the CoM is, and the weight stays over the soles.

    Args:
        robot: the robot.
        way: (N, 6) CoM from where it is when standing, ahead and to the left, pelvis
            upward [m], and the trunk's roll, pitch, yaw [rad].
    """
    legs, joints = legs_of(robot), np.array(robot.legs.stand)
    stand = posture(legs, joints)
    still, found = com_from_pelvis(legs, stand), np.empty((len(way), len(joints)))
    for i, (x, y, z, *angles) in enumerate(way.tolist()):
        turn = turn_matrix(np.array(angles))
        for _ in range(_ROUNDS):
            com = turn @ com_from_pelvis(legs, posture(legs, joints)) - still
            moved = np.array([x - com[0], y - com[1], z])
            _stand_with(legs, stand, moved, turn, joints)
        found[i] = joints
    return found


def _drawn_up(robot: Robot) -> Array:
    """Return the stand with its feet drawn up by steps, (2 n,) [rad]."""
    legs, joints = legs_of(robot), np.array(robot.legs.stand)
    stand, up = posture(legs, joints), _DRAWN * robot.reduced.leg_length
    for lower in np.linspace(0.0, up, _DRAWING):
        _stand_with(legs, stand, np.array([0.0, 0.0, -lower]), np.eye(3), joints)
    return joints


def _stand_with(
    legs: Legs, stand: Posture, moved: Array, turn: Array, joints: Array
) -> None:
    """Turn the joints so that the feet stay where they stand.

    Args:
        legs: the robot.
        stand: its posture when it stands.
        moved: (3,) the pelvis from where it is then [m].
        turn: (3, 3) the pelvis' turn.
        joints: (2 n,) near ones [rad]; rewritten.
    """
    for leg, own in enumerate(np.split(joints, 2)):
        ankle = np.ascontiguousarray(turn.T @ (stand.ankles[leg] - moved))
        foot = np.ascontiguousarray(turn.T @ stand.feet[leg])
        own[:] = leg_joints(legs, leg, ankle, foot, own.copy())
