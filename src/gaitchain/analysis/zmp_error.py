"""Error of the point-mass ZMP, which plans use, against the ZMP of the full robot.

A walk by strides is planned without physics. The motion of its links gives two ZMPs:
that of point masses, the paper's multi-link ZMP, and that of the ground reaction wrench
by inverse dynamics of the full robot.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.balance.leg_kinematics import posture
from gaitchain.balance.state import SINGLE
from gaitchain.balance.walk_controller import WalkController, rehearse
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.gait.zmp import zmp_of_wrench
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.model import build_model
from gaitchain.sim.rotation import quaternion
from gaitchain.walker.stride_setup import make_walk

STRIDE = 0.3
"""Step length of the planned walk, part of the leg."""
_PERIOD_S = 0.002  # of the plan, short because accelerations are second differences
_SHAPES = np.array([[0.5, 1.4, 1.0]]), np.array([[0.08, 0.1]])  # those of `brisk`
_FIRST, _STEPS = 3, 4  # steps until the walk is steady, and evaluated steps
_FREE = 6  # degrees of freedom of the base
_BODY = mujoco.mjtObj.mjOBJ_BODY


class ZmpError(NamedTuple):
    """Root mean square errors over the single supports of a walk."""

    ahead: float
    """Forward error [m]."""
    left: float
    """Lateral error [m]."""
    speed: float
    """Speed of the walk [m/s]."""


def zmp_error(robot: Robot) -> ZmpError:
    """Compare both ZMPs over a planned walk straight ahead.

    Args:
        robot: the robot, from a model or of boxes.
    """
    poses, timing = _poses(robot), StrideShape().timing(robot)
    walk = make_walk(poses, timing, _PERIOD_S, feedback=False)
    model = build_model(robot)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model.opt.gravity[:] = 0.0, 0.0, -GRAVITY
    found = [_differences(model, support) for support in _walk(poses, walk)]
    squares = np.mean(np.square(np.concatenate(found)), axis=0)
    ahead, left = np.sqrt(squares).tolist()
    return ZmpError(ahead, left, speed=STRIDE * robot.reduced.leg_length / timing.step)


def _poses(robot: Robot) -> StridePoses:
    """Return three strides: standing, half a stride, and the whole stride."""
    leg = robot.reduced.leg_length
    strides = np.zeros((3, 3))
    strides[1:, 0] = 0.5 * STRIDE * leg, STRIDE * leg
    passing, landing = _SHAPES
    shape = StrideShape()
    shapes = passing * [1.0, 1.0, shape.lift * leg], landing
    return StridePoses(robot, shape.hip_height * leg, (strides, *shapes, strides))


def _walk(poses: StridePoses, walk: WalkController) -> list[Array]:
    """Run the plan; return the positions (N, 7 + 2 n) of each single support."""
    full = poses.robot.legs
    lead = full.at[0, 0] - walk.legs.at[0, 0]  # shift by `stride_setup.centred`
    walk.begin_shift(left_support=True)
    supports = []
    for stride in [1] + [2] * (_FIRST + _STEPS - 1):
        periods = rehearse(walk, [poses.step_target(0, 0, stride)])
        rows = [_position(walk, lead) for _ in periods if walk.phase == SINGLE]
        supports.append(np.array(rows))
    return supports[_FIRST:]


def _position(walk: WalkController, lead: Array) -> Array:
    """Return base pose and joints with the support ankle above the origin."""
    joints = walk.reference
    leg = 0 if walk.side > 0 else 1
    found = posture(walk.legs, joints)
    turn = found.feet[leg].T
    ankle = np.array([0.0, 0.0, walk.legs.ankle_height])
    base = ankle - turn @ (found.ankles[leg] + lead)
    return np.concatenate([base, quaternion(turn), joints])


def _differences(model: Any, positions: Array) -> Array:
    """Return the differences of the two ZMPs, (N - 2, 2) [m]."""
    data, speed = mujoco.MjData(model), np.zeros((len(positions) - 1, model.nv))
    for row, (before, after) in enumerate(pairwise(positions)):
        mujoco.mj_differentiatePos(model, speed[row], _PERIOD_S, before, after)
    apart = []
    for row in range(1, len(speed)):
        data.qpos[:] = positions[row]
        data.qvel[:] = 0.5 * (speed[row - 1] + speed[row])
        data.qacc[:] = (speed[row] - speed[row - 1]) / _PERIOD_S
        mujoco.mj_inverse(model, data)
        apart.append(_of_points(model, data) - _of_wrench(data))
    return np.array(apart)


def _of_wrench(data: Any) -> Array:
    """Compute the ZMP of the wrench on the base by inverse dynamics, (2,) [m]."""
    moment = data.xmat[1].reshape(3, 3) @ data.qfrc_inverse[3:_FREE]
    return zmp_of_wrench(moment, data.qfrc_inverse[:3], data.qpos[:3])


def _of_points(model: Any, data: Any) -> Array:
    """Compute the multi-link ZMP of the links as point masses, (2,) [m].

    p = sum m ((g + z'') r - z r'') / sum m (g + z''), with each link's CoM r.
    """
    mujoco.mj_rnePostConstraint(model, data)
    moment, weight, change = np.zeros(2), 0.0, np.empty(6)
    for body in range(1, model.nbody):
        # MuJoCo counts gravity in: r'' + g upward.
        mujoco.mj_objectAcceleration(model, data, _BODY, body, change, 0)
        at, force = data.xipos[body], float(model.body_mass[body]) * change[3:]
        moment += force[2] * at[:2] - at[2] * force[:2]
        weight += force[2]
    return np.asarray(moment / weight)
