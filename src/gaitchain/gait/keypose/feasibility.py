"""Feasible edges: motions between key poses that a robot can carry out.

Joint angles and speeds are within the limits (decisions row 20). Ours: the swing foot
keeps a clearance on its way down from its highest point, and from heel contact to the
end of the step it is set down, not dragged.
"""

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.motion import StepMotion, Timing
from gaitchain.messages import Array
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import points

_SAMPLES = 13  # per segment
# Parts of the joint limits that a plan may use, as a servo overshoots it.
_ANGLE_HEADROOM, _SPEED_HEADROOM = 0.95, 0.9
_DRAG = 0.035  # of the leg: largest travel of the foot between kp_3 and kp_4
_SCRAPE = 0.003  # interpolation error allowed below the ground [m]
_CLEARANCE = 0.017  # of the leg: least height of the sole between kp_2 and kp_3
_SWING_ANKLE = 6  # in kinematics.POINTS

Mask = NDArray[np.bool_]


def feasible_edges(poses: KeyPoses, timing: Timing) -> tuple[Mask, ...]:
    """Check every edge between neighbouring key moments.

    Args:
        poses: the candidates.
        timing: the step's times.

    Returns:
        Three masks, (N_i, N_{i+1}), true where the edge is feasible.
    """
    masks = [_within_limits(poses, timing, layer) for layer in range(3)]
    feet = poses.foot_x
    dragged = (
        np.abs(feet[2][:, None] - feet[3]) > _DRAG * poses.robot.reduced.leg_length
    )
    masks[2] &= ~dragged
    return tuple(masks)


def joint_extremes(poses: KeyPoses, timing: Timing, layer: int) -> tuple[Array, Array]:
    """Return the largest joint angle and speed on every edge out of a layer.

    Args:
        poses: the candidates.
        timing: the step's times.
        layer: 0, 1 or 2.

    Returns:
        (N_i, N_{i+1}) angles [rad] and speeds [rad/s].
    """
    angles, step_s = _sampled_angles(poses, timing, layer)
    speed = np.abs(np.diff(angles, axis=-2)) / step_s
    return np.abs(angles).max(axis=(-1, -2)), speed.max(axis=(-1, -2))


def _within_limits(poses: KeyPoses, timing: Timing, layer: int) -> Mask:
    robot = poses.robot
    angle, speed = joint_extremes(poses, timing, layer)
    ankle = points(robot.reduced, _edge_motion(poses, timing, layer))[
        ..., _SWING_ANKLE, 2
    ]
    lowest = ankle.min(axis=-1) - robot.reduced.ankle_height
    needed = _CLEARANCE * robot.reduced.leg_length if layer == 1 else -_SCRAPE
    allowed = (
        (angle <= _ANGLE_HEADROOM * robot.reduced.joint_angle_limit)
        & (speed <= _SPEED_HEADROOM * robot.reduced.joint_speed_limit)
        & (lowest >= needed)
    )
    return np.asarray(allowed)


def _sampled_angles(poses: KeyPoses, timing: Timing, layer: int) -> tuple[Array, float]:
    angles = joint_angles(_edge_motion(poses, timing, layer), left_support=True)
    return angles, timing.segments[layer] / (_SAMPLES - 1)


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
