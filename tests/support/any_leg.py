"""Legs of any make, and MuJoCo models of them."""

import mujoco
import numpy as np

from gaitchain.robot.leg_model import LegModel


def turns(rng, *shape):
    """Random rotations."""
    quaternions = rng.normal(size=(int(np.prod(shape)), 4))
    matrices = np.empty((len(quaternions), 9))
    for quaternion, matrix in zip(quaternions, matrices, strict=True):
        mujoco.mju_normalize4(quaternion)
        mujoco.mju_quat2Mat(matrix, quaternion)
    return matrices.reshape(*shape, 3, 3)


def inertias(rng, *shape):
    """Random inertias that masses can have: a <= b + c."""
    turn, main = turns(rng, *shape), rng.uniform(0.01, 0.019, (*shape, 3))
    return np.einsum("...ij,...j,...kj->...ik", turn, main, turn)


def any_legs(rng, count):
    """Joints anywhere, about any axes, links that weigh anywhere."""
    axis = rng.normal(size=(2, count, 3))
    both = (2 * count,)
    return LegModel(
        joint_names=tuple(f"{side}_{j}" for side in "lr" for j in range(count)),
        knee=3,
        at=rng.uniform(-0.3, 0.3, (2, count, 3)),
        axis=axis / np.linalg.norm(axis, axis=2, keepdims=True),
        com=rng.uniform(-0.2, 0.2, (2, count, 3)),
        inertia=inertias(rng, 2, count),
        link_mass=rng.uniform(0.1, 5.0, (2, count)),
        foot_at=rng.uniform(-0.1, 0.1, (2, 3)),
        foot_turn=turns(rng, 2),
        trunk_mass=rng.uniform(1.0, 30.0),
        trunk_com=rng.uniform(-0.2, 0.2, 3),
        trunk_inertia=inertias(rng),
        lower=np.full(both, -3.0),
        upper=np.full(both, 3.0),
        stiffness=rng.uniform(50.0, 900.0, both),
        damping=(damping := rng.uniform(0.0, 20.0, both)),
        joint_damping=0.3 * damping,
        torque_limit=np.full(both, 200.0),
        speed_limit=np.full(both, np.inf),
        armature=rng.uniform(0.0, 0.1, both),
        friction_loss=np.zeros(both),
        stand=np.zeros(both),
    )


def weighed(body, mass, com, inertia):
    x, y, z = inertia
    body.mass, body.ipos = mass, com
    body.fullinertia = [x[0], y[1], z[2], x[1], x[2], y[2]]
    body.explicitinertial = True


def simulator(legs):
    """Free trunk, then the left leg, then the right; a site at each ankle point."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = [0.0, 0.0, -9.81]
    trunk = spec.worldbody.add_body(name="trunk")
    trunk.add_freejoint()
    weighed(trunk, legs.trunk_mass, legs.trunk_com, legs.trunk_inertia)
    count = legs.leg_joints
    for leg in range(2):
        body = trunk
        for j in range(count):
            name = legs.joint_names[count * leg + j]
            body = body.add_body(name=name, pos=legs.at[leg, j])
            weighed(
                body,
                legs.link_mass[leg, j],
                legs.com[leg, j],
                legs.inertia[leg, j],
            )
            body.add_joint(
                name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=legs.axis[leg, j]
            )
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, legs.foot_turn[leg].ravel())
        body.add_site(name=f"ankle_{leg}", pos=legs.foot_at[leg], quat=quaternion)
    return spec.compile()
