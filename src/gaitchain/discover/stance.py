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

# Hip to ankle, of the straight leg. The last ones are nearly straight: for ankles or
# hips that pitch too little for others.
_FLEXION = (0.87, 0.9, 0.84, 0.93, 0.8, 0.75, 0.96, 0.98)
_GAP = 0.1  # of a sole's width, at least this much between the soles
_SPLAY = 0.5  # of the leg: feet that are drawn further apart than the hips are splayed
_TILT_MOST = 2e-3  # of a sole that counts as level [rad]
_OFF_MOST = 4e-3  # of the leg: a foot this close to its height is there
_AT_END = 0.01  # rad: a joint this close to an end of its range is held there


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
    usual = [share * straight + below for share in _FLEXION]
    tries = []
    for height in [hip_height] if hip_height else usual:
        tries.append(_try(robot, legs, rest, height))
        if tries[-1].miss < 1.0:
            return tries[-1].pose, height
    best = min(tries, key=lambda tried: tried.miss)
    if hip_height:
        tries = [_try(robot, legs, rest, height) for height in usual]
    raise UnfitError(
        f"no standing pose with bent knees within the joint ranges"
        f"{_cut_by_servos(robot, legs)}; at best, with the hips {best.height:.3g} m "
        f"high, a sole is left with tilt {np.degrees(best.tilt):.2g} deg, "
        f"{1e3 * best.off:.2g} mm off its height (allowed: "
        f"{np.degrees(_TILT_MOST):.2g} deg, {1e3 * _OFF_MOST * straight:.2g} mm)"
        f"{_at_ends(robot, legs, best.pose)}; {_better_height(best, tries)}",
        "stand.hip_height, stand.angles of joints outside the legs, or legs.left and "
        "legs.right",
    )


@dataclass(frozen=True, eq=False)
class _Try:
    """The pose nearest to a stance with the hips at one height."""

    height: float
    """Hips above the soles [m]."""
    pose: Array
    tilt: float
    """Of a sole, the worse one [rad]."""
    off: float
    """Of a foot from its place, the worse one [m]."""
    miss: float
    """Tilt and place by what is allowed, the larger; below 1 the robot stands."""


def _try(
    robot: PinnedRobot, legs: tuple[LegPlan, LegPlan], rest: Array, height: float
) -> _Try:
    straight = float(np.mean([leg.straight for leg in legs]))
    below = float(np.mean([leg.below for leg in legs]))
    flexed = min(max((height - below) / straight, 0.3), 0.995)
    pose, tilt, off = _solve(robot, legs, _bent(robot, legs, rest, flexed), height)
    miss = max(tilt / _TILT_MOST, off / (_OFF_MOST * straight))
    return _Try(height, pose, tilt, off, miss)


def _cut_by_servos(robot: PinnedRobot, legs: tuple[LegPlan, LegPlan]) -> str:
    joints = [joint for leg in legs for joint in leg.joints]
    cut = [robot.joint_name(j) for j in joints if is_narrowed(robot.model, j)]
    return f" ({listed('joint', cut)} by the ctrlrange of the servo)" if cut else ""


def _at_ends(robot: PinnedRobot, legs: tuple[LegPlan, LegPlan], pose: Array) -> str:
    """Name the joints of a pose that are at an end of their range."""
    names = []
    for joint in (joint for leg in legs for joint in leg.joints):
        low, high = robot.bounds(joint)
        angle = float(pose[robot.address(joint)])
        if min(angle - low, high - angle) < _AT_END:
            ends = f"{np.degrees(low):.3g} to {np.degrees(high):.3g} deg"
            names.append(f"{robot.joint_name(joint)}, {ends}")
    return f", at the end of the range of {listed('joint', names)}" if names else ""


def _better_height(best: _Try, tries: list[_Try]) -> str:
    """Say at which other height of the hips the robot stands, or nearly so."""
    heights = sorted(tried.height for tried in tries)
    if standing := [tried for tried in tries if tried.miss < 1.0]:
        other = min(standing, key=lambda tried: abs(tried.height - best.height))
        way = "higher" if other.height > best.height else "lower"
        return f"it stands with {way} hips, at {other.height:.3g} m"
    other = min(tries, key=lambda tried: tried.miss)
    said = f"hips from {heights[0]:.3g} to {heights[-1]:.3g} m were tried"
    if other.height in (heights[0], heights[-1]):
        way = "higher" if other.height == heights[-1] else "lower"
        said += f", {way} ones may do"
    return said


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
