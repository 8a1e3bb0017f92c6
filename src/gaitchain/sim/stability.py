"""Whether a model's integrator can take its servos, and whether it did. Ours.

Euler's integrator with the time step h makes of a servo's damping kv and inertia I

    q'(t + h) = (1 - h kv / I) q'(t)                                            (1)

which grows where h kv / I > 2. MuJoCo's takes the damping of joints implicitly, but not
that of actuators. No integrator of MuJoCo takes the stiffness kp implicitly: without
damping the joint shakes where h^2 kp / I > 4. Runge and Kutta's of fourth order (RK4)
is stable for h lambda in [-2.785, 0] and in [-2.828 i, 2.828 i] [Hairer1996, IV.2], so
that damping may be 2.785 and stiffness 8.
"""

import mujoco
import numpy as np
import scipy
from numpy.typing import NDArray

IntArray = NDArray[np.int32]
_EXPLICIT = (mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_RK4)
_AFFINE = mujoco.mjtBias.mjBIAS_AFFINE
_KP, _KV = 1, 2  # columns of actuator_biasprm
_FIRST_BAD, _LAST_BAD = (
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
)
_RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)


def most_damping(model: mujoco.MjModel) -> float:
    """Return the h kv / I from which on a model's explicit integrator grows, (1)."""
    return 2.785 if model.opt.integrator == _RK4 else 2.0


def most_stiffness(model: mujoco.MjModel) -> float:
    """Return the h^2 kp / I from which on a joint without damping shakes ever more."""
    return 8.0 if model.opt.integrator == _RK4 else 4.0


def divergences(data: mujoco.MjData) -> IntArray:
    """Return how often the state was no number, or huge, since the last reset, (3,).

    MuJoCo then begins anew from the model's own pose, as if nothing had been. A view:
    it shows what happens later, too.
    """
    return np.asarray(data.warning.number[_FIRST_BAD : _LAST_BAD + 1])


def explicit_damping(model: mujoco.MjModel) -> tuple[float, str]:
    """Return the largest h kv / I of a model, (1), and the joint that it shakes most.

    It is the largest eigenvalue of h M^-1 D, with the mass matrix M and the damping D
    of all actuators; 0 for an implicit integrator, and without damping.
    """
    if model.opt.integrator not in _EXPLICIT:
        return 0.0, ""
    value, joint = _largest(model, _KV)
    return float(model.opt.timestep) * value, joint


def explicit_stiffness(model: mujoco.MjModel) -> tuple[float, str]:
    """Return the largest h^2 kp / I of a model, and the joint that it shakes most."""
    value, joint = _largest(model, _KP)
    return float(model.opt.timestep) ** 2 * value, joint


def _largest(model: mujoco.MjModel, column: int) -> tuple[float, str]:
    """Return the largest eigenvalue of M^-1 J^T diag(k) J, and the joint of its mode.

    Args:
        model: with the mass matrix M and the moments J of its actuators.
        column: of their bias, which has -k.
    """
    affine = model.actuator_biastype == _AFFINE
    gains = np.where(affine, -model.actuator_biasprm.T[column], 0.0)
    if not gains.any():
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
    values, modes = scipy.linalg.eigh(moment.T @ (gains[:, None] * moment), mass)
    shaken = int(np.argmax(np.abs(modes[:, -1])))
    return float(values[-1]), model.joint(model.dof_jntid[shaken]).name
