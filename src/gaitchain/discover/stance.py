"""A standing pose on both soles with bent knees.

The *level* frame has its origin at the base, x forward, y left, z up.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from gaitchain.discover.findings import FoundLeg, UnfitError
from gaitchain.discover.notes import listed
from gaitchain.discover.pinned_robot import PinnedRobot
from gaitchain.discover.ranges import is_narrowed
from gaitchain.messages import Array

_FLEXION = (0.87, 0.9, 0.84, 0.93, 0.8, 0.75)  # hip to ankle, of the straight leg
_GAP = 0.1  # of a sole's width, at least this much between the soles
_SPLAY = 0.5  # of the leg: feet that are drawn further apart than the hips are splayed
_TILT_MOST = 2e-3  # of a sole that counts as level [rad]
_OFF_MOST = 4e-3  # of the leg: a foot this close to its height is there


@dataclass(frozen=True, eq=False)
class LegPlan:
    """A leg as standing needs it: ids, hip, ankle and how to bend the knee."""

    found: FoundLeg
    joints: tuple[int, ...]
    foot: int
    hip: Array
    """(3,) where its hip's axes meet, level frame at the neutral pose [m]."""
    ankle: Array
    """(3,) the ankle's centre in the foot's frame [m]."""
    straight: float
    """Hip to ankle with the knee straight [m]."""
    knee_straight: float
    """The knee's position when straight [rad]."""

    @property
    def below(self) -> float:
        """The sole below the ankle [m]."""
        sole = self.found.sole
        return float((self.ankle - sole.origin) @ sole.rotation[:, 2])


def stand(
    robot: PinnedRobot,
    legs: tuple[LegPlan, LegPlan],
    rest: Array,
    hip_height: float | None,
) -> tuple[Array, float]:
    """Solve for a standing pose with bent knees.

    Args:
        robot: the robot; it is left in the pose.
        legs: left and right.
        rest: (nq,) the pose of all other joints.
        hip_height: hips above the soles as the profile wants it [m].

    Returns:
        (nq,) the pose and the hips' height above the soles [m].

    Raises:
        RobotFileError: no pose within the joint ranges has both soles level.
    """
    straight = float(np.mean([leg.straight for leg in legs]))
    below = float(np.mean([leg.below for leg in legs]))
    heights = [share * straight + below for share in _FLEXION]
    worst = ""
    for height in [hip_height] if hip_height else heights:
        flexed = min(max((height - below) / straight, 0.3), 0.995)
        pose, tilt, off = _solve(robot, legs, _bent(robot, legs, rest, flexed), height)
        if tilt < _TILT_MOST and off < _OFF_MOST * straight:
            return pose, height
        worst = f"tilt {np.degrees(tilt):.2g} deg, {1e3 * off:.2g} mm off its height"
    joints = [joint for leg in legs for joint in leg.joints]
    cut = [robot.joint_name(j) for j in joints if is_narrowed(robot.model, j)]
    by_servos = (
        f" ({listed('joint', cut)} by the ctrlrange of the servo)" if cut else ""
    )
    raise UnfitError(
        f"no standing pose with bent knees within the joint ranges{by_servos}; at best "
        f"a sole is left with {worst} (allowed: {np.degrees(_TILT_MOST):.2g} deg, "
        f"{1e3 * _OFF_MOST * straight:.2g} mm)",
        "stand.hip_height, stand.angles or legs.left and legs.right",
    )


def _bent(
    robot: PinnedRobot, legs: tuple[LegPlan, LegPlan], rest: Array, flexed: float
) -> Array:
    """Guess a pose: knees bent so that hip and ankle come as close as asked."""
    pose = np.array(rest)
    robot.place(rest)
    for leg in legs:
        knee = leg.joints[leg.found.knee]
        bend = 2.0 * float(np.arccos(flexed))
        for joint in leg.joints:
            pose[robot.address(joint)] = robot.neutral[robot.address(joint)]
        pose[robot.address(knee)] = leg.knee_straight + leg.found.knee_bends * bend
        forwards = leg.found.knee_bends * np.sign(robot.axis(knee)[1])
        for part in (leg.joints[: leg.found.knee], leg.joints[leg.found.knee + 1 :]):
            pitch = max(part, key=lambda j: abs(robot.axis(j)[1]))
            turn = -0.5 * forwards * bend * np.sign(robot.axis(pitch)[1])
            pose[robot.address(pitch)] += turn
    return pose


def _solve(
    robot: PinnedRobot, legs: tuple[LegPlan, LegPlan], guess: Array, height: float
) -> tuple[Array, float, float]:
    """Return the pose, the soles' worst tilt [rad] and error of height [m]."""
    at = np.array([robot.address(j) for leg in legs for j in leg.joints])
    low, high = np.array([robot.bounds(j) for leg in legs for j in leg.joints]).T
    sides = _sides(robot, legs, guess)
    centre = np.mean([leg.hip for leg in legs], axis=0)
    pose, scale = np.array(guess), legs[0].straight

    def errors(angles: Array) -> Array:
        pose[at] = angles
        robot.place(pose)
        feet = [_foot(robot, leg, centre, height) for leg in legs]
        middle = 0.5 * (feet[0][7] + feet[1][7])
        level = [e for foot in feet for e in foot[3:5]]
        heading = [0.3 * foot[5] for foot in feet]
        ankles = [0.3 * (foot[6] - y) for foot, y in zip(feet, sides, strict=True)]
        place = [*ankles, feet[0][7] - feet[1][7], middle - robot.com()[0]]
        place += [foot[2] for foot in feet]
        stay = 1e-4 * (angles - start)
        return np.concatenate([level, heading, np.array(place) / scale, stay])

    margin = np.minimum(1e-3, 0.25 * (high - low))
    start = np.clip(guess[at], low + margin, high - margin)
    found = scipy.optimize.least_squares(
        errors, start, bounds=(low, high), xtol=1e-12, ftol=1e-12
    )
    rest = errors(found.x)
    off = scale * float(np.abs(rest[8:12]).max())
    # With coupled joints where they followed to.
    return np.array(robot.data.qpos), float(np.abs(rest[:4]).max()), off


def _foot(robot: PinnedRobot, leg: LegPlan, centre: Array, height: float) -> Array:
    """Return a foot's (x, y, height error, tilts, heading, ankle y, sole centre x)."""
    sole = leg.found.sole
    at = robot.point(leg.foot, sole.origin)
    turn = robot.turn(leg.foot) @ sole.rotation
    ankle = robot.point(leg.foot, leg.ankle)
    middle = robot.point(leg.foot, sole.centre)
    off = at[2] - (centre[2] - height)
    return np.array(
        [at[0], at[1], off, turn[0, 2], turn[1, 2], turn[1, 0], ankle[1], middle[0]]
    )


def _sides(
    robot: PinnedRobot, legs: tuple[LegPlan, LegPlan], guess: Array
) -> tuple[float, float]:
    """Return where the ankles stand sideways [m].

    Where they come to be with the legs neither rolled nor turned, if that is near the
    hips, else under the hips; wider where the soles would touch.
    """
    robot.place(guess)
    left, right = legs
    drawn = [float(robot.point(leg.foot, leg.ankle)[1]) for leg in legs]
    hips = float(left.hip[1] - right.hip[1])
    apart = drawn[0] - drawn[1]
    if abs(apart - hips) > _SPLAY * left.straight:
        apart = hips
    inner = 0.0
    for leg, sign in ((left, 1.0), (right, -1.0)):
        sole = leg.found.sole
        offset = (leg.ankle - sole.origin) @ sole.rotation[:, 1]
        inner += float((sign * (offset - sole.outline[:, 1])).max())
    width = 2.0 * max(leg.found.sole.half_width for leg in legs)
    apart = max(apart, inner + _GAP * width)
    middle = 0.5 * float(left.hip[1] + right.hip[1])
    return middle + 0.5 * apart, middle - 0.5 * apart
