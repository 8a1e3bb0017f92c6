"""Feasible pairs of strides: those that the plan can carry out, without physics.

The plan is run with sensors that report its own reference. A pair is feasible if the
ZMP stays inside the sole without moving the landing, and no joint exceeds its limits.
Ours.
"""

import math
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from gaitchain.balance.compiled import compiled
from gaitchain.balance.leg_kinematics import Legs, posture
from gaitchain.balance.state import DOUBLE, SHIFT, STAND
from gaitchain.balance.walk_controller import Snapshot, rehearse
from gaitchain.build.jobs import run_jobs
from gaitchain.gait.motion import Timing
from gaitchain.gait.step_target import StepTarget
from gaitchain.gait.stride.draw import shaped_poses
from gaitchain.gait.stride.presets import Reach
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.robot import Robot
from gaitchain.walker.stride_setup import make_walk

_ANGLE_HEADROOM = 0.98  # part of half the range
# Part of a joint's speed limit: the plan may exceed the limit for a moment, as the
# servo catches up. Whether the walk is stable is decided in physics, where servos keep
# the limit.
_SPEED_HEADROOM = 1.6
_MOVED = 0.01  # of the leg: if the landing moves further the pair is not feasible
_MOVED_STOP = 0.05  # outward, in a stop: narrow soles need the feet further apart
_STEADY_CYCLES = 2  # of two steps, until a walk from standing is periodic
_FURTHEST = 0.9995  # part of the leg's reach
_STRAIGHT = "a leg would be all but straight"
_TRIED = 26  # number of strides up to the furthest
_IN_PLACE = 1  # stride of `furthest_strides`
_WAYS = {
    "ahead": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
    "outward": (0.0, 1.0, 0.0),
    "turn_out": (0.0, 0.0, 1.0),
    "turn_in": (0.0, 0.0, -1.0),
}


def feasible_pairs(
    poses: StridePoses,
    timing: Timing,
    speed_limit: float | Array,
    wanted: NDArray[np.bool_] | None = None,
    workers: int = 1,
) -> NDArray[np.bool_]:
    """Check every pair of strides, or those that are wanted.

    Args:
        poses: the candidates.
        timing: the step's times.
        speed_limit: limit for all joints, or (2 n,) for each; infinite for none
            [rad/s].
        wanted: (N_1, N_4) mask of the pairs to check, all by default.
        workers: number of processes.

    Returns:
        (N_1, N_4) mask of the feasible pairs among them.
    """
    count = poses.counts[0]
    asked = [[True] * count] * count if wanted is None else wanted.tolist()
    jobs = [(poses, timing, speed_limit, i, row) for i, row in enumerate(asked)]
    rows = list(run_jobs(_feasible_from, jobs, list[bool], workers))
    allowed = np.array(rows, dtype=np.bool_)
    allowed[STAND, STAND] = False
    return allowed


def _feasible_from(
    poses: StridePoses,
    timing: Timing,
    speed_limit: float | Array,
    first: int,
    wanted: list[bool],
) -> list[bool]:
    """Check the pairs of one first stride, (N_4,)."""
    rehearsal = _Rehearsal(poses, timing, speed_limit)
    widths, alike = np.unique(poses.strides[:, 1], return_inverse=True)
    allowed = [False] * len(wanted)
    for group in range(len(widths)):
        start = None
        for last in np.flatnonzero((alike == group) & wanted).tolist():
            start = start or rehearsal.after(first, last)
            allowed[last] = rehearsal.step(start, last)
    return allowed


def feasible_walk(
    poses: StridePoses,
    timing: Timing,
    gaits: NDArray[np.int64],
    speed_limit: float | Array,
) -> bool:
    """Check the steps of a walk from standing, one after another.

    Args:
        poses: the candidates.
        timing: the step's times.
        gaits: (S, 4) pose indices, linked.
        speed_limit: see `feasible_pairs`.
    """
    rehearsal = _Rehearsal(poses, timing, speed_limit)
    rehearsal.begin()
    return all(map(rehearsal.go_on, poses.step_targets(gaits[:, 1:].tolist())))


def first_fault(poses: StridePoses, timing: Timing, speed_limit: float | Array) -> str:
    """Return why the shortest stride is not feasible, from standing or after itself.

    Arguments are those of `feasible_pairs`; empty if it is feasible. Of limits of the
    joints it says what the whole step would need.
    """
    rehearsal = _Rehearsal(poses, timing, speed_limit)
    shortest = 1 + int(np.argmin(np.abs(poses.strides[1:]).sum(axis=1)))
    for first in (STAND, shortest):
        start = rehearsal.after(first, shortest)
        if not rehearsal.step(start, shortest):
            return rehearsal.needed(start, shortest) or rehearsal.fault
    return ""


def furthest_strides(
    robot: Robot,
    shape: StrideShape,
    timing: Timing,
    speed_limit: float | Array,
    most: Reach,
) -> Reach:
    """Find how far the plan can step each way, again and again.

    Ahead and back the stride is repeated; outward and turned, every second step brings
    the feet together again. Turned feet must not overlap.

    Args:
        robot: the robot.
        shape: shape of its steps.
        timing: the step's times.
        speed_limit: see `feasible_pairs`.
        most: the furthest strides to try.

    Returns:
        The furthest strides, 0 where none is feasible.
    """
    found = {}
    for name, way in _WAYS.items():
        end = getattr(most, name)
        if way[2]:
            apart = shape.stance * robot.reduced.hip_width
            end = min(end, _widest_turn(robot, apart, end, outward=way[2] > 0.0))
        parts = np.linspace(0.0, end, _TRIED + 1)
        strides = parts[:, None] * np.array(way)
        rehearsal = _rehearsal(robot, shape, timing, speed_limit, strides)
        repeats = rehearsal.repeats if way[0] else rehearsal.alternates
        held = takewhile(repeats, range(_IN_PLACE + 1, _IN_PLACE + 1 + _TRIED))
        found[name] = float(parts[len(list(held))])
    return Reach(**found)


def _rehearsal(
    robot: Robot,
    shape: StrideShape,
    timing: Timing,
    speed_limit: float | Array,
    strides: Array,
) -> "_Rehearsal":
    """Prepare to try strides, in parts of the leg; stride 0 is standing."""
    leg = robot.reduced.leg_length
    rows = np.insert(strides * np.array([leg, leg, 1.0]), 0, 0.0, axis=0)
    return _Rehearsal(shaped_poses(robot, shape, rows), timing, speed_limit)


def _widest_turn(robot: Robot, stance: float, most: float, *, outward: bool) -> float:
    """Return how far a foot can turn beside the other one before they overlap [rad]."""
    biped = robot.reduced
    rear, front = biped.sole_x
    inward = -rear if outward else front  # the end of the sole that turns inward
    half = 0.5 * biped.sole_width

    def apart(turn: float) -> bool:
        reach = inward * math.sin(turn) + half * math.cos(turn)
        return reach + half <= stance

    turns = np.linspace(0.0, most, 10 * _TRIED + 1).tolist()
    return max(takewhile(apart, turns), default=0.0)


def joint_speeds(robot: Robot, limit_deg_s: float | None) -> float | Array:
    """Return the speed limit of all joints, or (2 n,) of each [rad/s].

    Args:
        robot: the robot.
        limit_deg_s: limit for all joints [deg/s]; None for those of the robot.
    """
    if limit_deg_s is not None:
        return math.radians(limit_deg_s)
    return np.asarray(robot.legs.speed_limit)


class _Rehearsal:
    """A run of the plan without physics, which checks its limits."""

    def __init__(
        self, poses: StridePoses, timing: Timing, speed_limit: float | Array
    ) -> None:
        # Feedback would answer the jump of speeds where the feet exchange their parts.
        self._walk = make_walk(poses, timing, CONTROL_PERIOD_S, feedback=False)
        self._poses = poses
        most = _SPEED_HEADROOM * np.asarray(speed_limit)
        self._most_speed = np.broadcast_to(most, self._walk.stand.shape).copy()
        self._landed = 0.0, 0.0
        self._steady: dict[StepTarget, Snapshot] = {}
        self.fault = ""
        """First reason why the latest step is not feasible; empty if it is."""

    def begin(self) -> None:
        """Leave a stand."""
        self._walk.reset()
        self._walk.begin_shift(left_support=True)

    def after(self, stride: int, then: int) -> Snapshot:
        """Repeat a stride until the walk is periodic, and another one may follow.

        Where the other one is wider or narrower, they take turns in that.

        Returns:
            The state at the end of the stride.
        """
        if stride == STAND:
            self.begin()
            return self._walk.snapshot()
        own, _ = self._poses.step_targets([(0, 0, stride), (0, 0, then)])
        if own not in self._steady:
            self.begin()
            between = own._replace(width=own.next_width, next_width=own.width)
            for _ in rehearse(self._walk, [between, own] * _STEADY_CYCLES):
                pass  # limits are those of the step that follows
            self._steady[own] = self._walk.snapshot()
        return self._steady[own]

    def repeats(self, stride: int) -> bool:
        """Return whether a stride can be made after itself."""
        return self.step(self.after(stride, stride), stride)

    def alternates(self, stride: int) -> bool:
        """Return whether a stride can be made in turn with a step in place."""
        beside = self.step(self.after(_IN_PLACE, stride), stride)
        return beside and self.step(self._walk.snapshot(), _IN_PLACE)

    def step(self, start: Snapshot, stride: int) -> bool:
        """Make one step from a state; return whether it is feasible.

        The next one brings the feet together again.
        """
        self._walk.restore(start)
        return self.go_on(self._poses.step_target(0, 0, stride))

    def go_on(self, target: StepTarget) -> bool:
        """Make one more step; return whether it is feasible."""
        self.fault = ""
        self._make(target)
        leg = self._poses.robot.reduced.leg_length
        ahead, beside = self._landed[0] - target.length, self._landed[1] + target.width
        if target.stops > 0.0:
            ahead *= 0.5  # the plan goes as far beyond its place again (`most_further`)
        further_out = target.stops > 0.0 and -_MOVED_STOP * leg <= beside <= 0.0
        off = abs(ahead) if further_out else math.hypot(ahead, beside)
        if off > _MOVED * leg:
            self.fault = self.fault or (
                f"the foot would have to land {1000.0 * off:.0f} mm from its place to "
                "keep the ZMP in the sole"
            )
        return not self.fault

    def needed(self, start: Snapshot, stride: int) -> str:
        """Return what a step needs of joints that have less; empty if they have it."""
        self._walk.restore(start)
        goal, joints, speeds = self._poses.step_target(0, 0, stride), [], []
        for before in rehearse(self._walk, [goal]):
            if self._walk.phase != SHIFT:
                joints.append(self._walk.reference)
                speeds.append(np.abs(joints[-1] - before) / CONTROL_PERIOD_S)
        slow, short = self._too_fast(np.max(speeds, axis=0)), self._beyond(joints)
        return ", and ".join(filter(None, (slow, short)))

    def _make(self, target: StepTarget) -> None:
        """Make a step; end it with a `fault` at the first violated limit."""
        walk = self._walk
        for before in rehearse(walk, [target]):
            phase = walk.phase
            if phase == DOUBLE:
                self._landed = walk.state.landing[:2]
            if phase != SHIFT:
                now = walk.reference
                if not _within_limits(walk.legs, now, before, self._most_speed):
                    self.fault = self._fault_of(now, before)
                    return

    def _fault_of(self, joints: Array, before: Array) -> str:
        """Return which limit these joints (2 n,) exceed [rad]."""
        speeds = np.abs(joints - before) / CONTROL_PERIOD_S
        return self._too_fast(speeds) or self._beyond([joints]) or _STRAIGHT

    def _too_fast(self, speeds: Array) -> str:
        most = self._most_speed
        if not (speeds > most).any():
            return ""
        joint = int(np.argmax(speeds - most))
        limit = most[joint] / _SPEED_HEADROOM
        return (
            f"{self._name(joint)} would have to move at {speeds[joint]:.2f} rad/s, "
            f"its limit is {limit:.2f}"
        )

    def _beyond(self, joints: list[Array]) -> str:
        legs, all_joints = self._walk.legs, np.array(joints)
        middle, half = 0.5 * (legs.upper + legs.lower), 0.5 * (legs.upper - legs.lower)
        over = np.abs(all_joints - middle) - _ANGLE_HEADROOM * half
        row, joint = np.unravel_index(np.argmax(over), over.shape)
        if not over[row, joint] > 0.0:
            return ""
        low, high = np.degrees([legs.lower[joint], legs.upper[joint]])
        return (
            f"{self._name(int(joint))} would have to turn to "
            f"{np.degrees(all_joints[row, joint]):.1f} deg, its range is {low:.1f} to "
            f"{high:.1f} and plans use {_ANGLE_HEADROOM:.0%} of it"
        )

    def _name(self, joint: int) -> str:
        return self._poses.robot.legs.joint_names[joint]


@compiled
def _within_limits(legs: Legs, joints: Array, before: Array, most: Array) -> bool:
    """Return whether joints (2 n,) keep their ranges, and speeds from the ones before.

    A leg that is nearly straight does not: its foot may be out of reach.
    """
    for j in range(joints.shape[0]):
        if abs(joints[j] - before[j]) / CONTROL_PERIOD_S > most[j]:
            return False
        middle = 0.5 * (legs.upper[j] + legs.lower[j])
        half = 0.5 * (legs.upper[j] - legs.lower[j])
        if abs(joints[j] - middle) > _ANGLE_HEADROOM * half:
            return False
    centres, longest = posture(legs, joints).centres, 0.0
    for leg in range(2):
        hip, ankle = centres[leg, legs.knee - 1], centres[leg, legs.knee + 1]
        x, y, z = ankle[0] - hip[0], ankle[1] - hip[1], ankle[2] - hip[2]
        longest = max(longest, math.sqrt(x * x + y * y + z * z))
    return longest <= _FURTHEST * legs.reach
