"""Feasible edges: motions between key poses that a robot can carry out.

Joint angles and speeds are within the limits (row 20 of `docs/paper_map.md`), each
joint's own where the robot was read from a file. Ours: the swing foot keeps a clearance
on its way down from its highest point, and from heel contact to the end of the step it
is set down, not dragged.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.motion import StepMotion, Timing
from gaitchain.messages import Array
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import points
from gaitchain.robot.robot import Robot

_SAMPLES = 13  # per segment
# Parts of the joint limits that a plan may use, as a servo overshoots it.
_ANGLE_HEADROOM, _SPEED_HEADROOM = 0.95, 0.9
_DRAG = 0.035  # of the leg: largest travel of the foot between kp_3 and kp_4
_SCRAPE = 0.003  # interpolation error allowed below the ground [m]
_CLEARANCE = 0.017  # of the leg: least height of the sole between kp_2 and kp_3
_SWING_ANKLE = 6  # in kinematics.POINTS

Mask = NDArray[np.bool_]
Angles = Callable[[Array, bool], Array]
"""Joint angles (..., 2 n) [rad] of reduced poses (..., 7), NaN where out of reach.
The second argument is whether the left leg supports."""


def feasible_edges(
    poses: KeyPoses, timing: Timing, angles: Angles = joint_angles
) -> tuple[Mask, ...]:
    """Check every edge between neighbouring key moments.

    Args:
        poses: the candidates.
        timing: the step's times.
        angles: joint angles of the robot; by default those of a robot of boxes.

    Returns:
        Three masks, (N_i, N_{i+1}), true where the edge is feasible.
    """
    masks = [_within_limits(poses, timing, layer, angles) for layer in range(3)]
    feet = poses.foot_x
    dragged = (
        np.abs(feet[2][:, None] - feet[3]) > _DRAG * poses.robot.reduced.leg_length
    )
    masks[2] &= ~dragged
    return tuple(masks)


def _within_limits(poses: KeyPoses, timing: Timing, layer: int, angles: Angles) -> Mask:
    robot = poses.robot
    found, speeds = _sampled_angles(poses, timing, layer, angles)
    lower, upper = headroom(robot)
    ankle = points(robot.reduced, _edge_motion(poses, timing, layer))[
        ..., _SWING_ANKLE, 2
    ]
    lowest = ankle.min(axis=-1) - robot.reduced.ankle_height
    # A robot that was read from a file has its foot down at kp_3 (`weight_shift`).
    swings = layer == 1 and robot.of_boxes
    needed = _CLEARANCE * robot.reduced.leg_length if swings else -_SCRAPE
    inside = (found >= lower) & (found <= upper)  # false for NaN
    slow = speeds <= _SPEED_HEADROOM * robot.legs.speed_limit
    allowed = inside.all(axis=(-1, -2)) & slow.all(axis=(-1, -2)) & (lowest >= needed)
    return np.asarray(allowed)


def headroom(robot: Robot) -> tuple[Array, Array]:
    """Return the joint angles that a plan may use, (2 n,) least and largest [rad]."""
    rest = 1.0 - _ANGLE_HEADROOM
    lower, upper = robot.legs.lower, robot.legs.upper
    return (
        lower * np.where(lower < 0.0, _ANGLE_HEADROOM, 1.0 + rest),
        upper * np.where(upper > 0.0, _ANGLE_HEADROOM, 1.0 + rest),
    )


def _sampled_angles(
    poses: KeyPoses, timing: Timing, layer: int, angles: Angles
) -> tuple[Array, Array]:
    """Return joint angles and speeds at samples, (N_i, N_{i+1}, samples, 2 n)."""
    found = angles(_edge_motion(poses, timing, layer), True)
    step_s = timing.segments[layer] / (_SAMPLES - 1)
    return found, np.abs(np.diff(found, axis=-2)) / step_s


def _edge_motion(poses: KeyPoses, timing: Timing, layer: int) -> Array:
    """Return samples of the poses along every edge, (N_i, N_{i+1}, samples, 7)."""
    size = poses.counts[layer], poses.counts[layer + 1], 7
    ends = [
        np.stack(
            [
                np.broadcast_to(values[layer][:, None], size),
                np.broadcast_to(values[layer + 1][None], size),
            ],
            axis=-2,
        )
        for values in (poses.q, poses.dq)
    ]
    times = timing.key_times[layer : layer + 2]
    samples: Array = np.linspace(times[0], times[1], _SAMPLES, dtype=np.float64)
    return StepMotion(times, *ends).at(samples).q
