"""Whether a model's integrator can take the damping of its servos. Ours.

An explicit integrator with the time step h makes of a servo's damping kv and inertia I

    q'(t + h) = (1 - h kv / I) q'(t)                                            (1)

which grows where h kv / I > 2. MuJoCo's Euler integrator takes the damping of joints
implicitly, but not that of actuators.
"""

import mujoco
import numpy as np
import scipy

_EXPLICIT = (mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_RK4)
_AFFINE = mujoco.mjtBias.mjBIAS_AFFINE
MOST = 2.0
"""h kv / I from which on (1) grows."""


def explicit_damping(model: mujoco.MjModel) -> tuple[float, str]:
    """Return the largest h kv / I of a model, (1), and the joint that it shakes most.

    It is the largest eigenvalue of h M^-1 D, with the mass matrix M and the damping D
    of all actuators; 0 for an implicit integrator, and without damping.
    """
    damping = np.where(
        model.actuator_biastype == _AFFINE, model.actuator_biasprm.T[2], 0
    )
    if model.opt.integrator not in _EXPLICIT or not damping.any():
        return 0.0, ""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass, moment = np.zeros((model.nv, model.nv)), np.zeros((model.nu, model.nv))
    mujoco.mj_fullM(model, data, mass)
    mujoco.mju_sparse2dense(
        moment,
        data.actuator_moment.ravel(),
        data.moment_rownnz,
        data.moment_rowadr,
        data.moment_colind.ravel(),
    )
    values, modes = scipy.linalg.eigh(moment.T @ (-damping[:, None] * moment), mass)
    shaken = int(np.argmax(np.abs(modes[:, -1])))
    name = model.joint(model.dof_jntid[shaken]).name
    return float(model.opt.timestep * values[-1]), name
