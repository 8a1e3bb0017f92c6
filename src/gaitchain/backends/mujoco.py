"""The simulator as a backend: MuJoCo in the role of Microsoft Robotics Studio."""

import math

import mujoco
import numpy as np

from gaitchain.biped import Biped
from gaitchain.kinematics import Array
from gaitchain.messages import Sensors
from gaitchain.robot.joints import LEG_JOINTS
from gaitchain.robot.model import World, build_model

CONTROL_PERIOD_S = 0.01
# A robot below this part of its standing height, or tilted further, has fallen.
_FALL_HEIGHT, _FALL_TILT = 0.65, math.radians(45.0)
_MIN_LOAD = 0.02  # of the weight; below it the ZMP says nothing
_BASE = 7  # generalised positions of the free joint


class MujocoBackend:
    """Walk the robot in physics and measure what happens.

    `read` gives what a real robot could measure; `zmp`, `foot_positions` and the rest
    are the simulator's truth, for judging a walk and for nothing else.
    """

    def __init__(
        self,
        biped: Biped,
        world: World | None = None,
        period_s: float = CONTROL_PERIOD_S,
    ) -> None:
        """Build the robot in its world, with a control period [s]."""
        self.model = build_model(biped, world)
        self.data = mujoco.MjData(self.model)
        self._substeps = round(period_s / self.model.opt.timestep)
        self._feet = [self.model.body(f"{s}_foot").id for s in ("left", "right")]
        self._biped = biped
        self._standing = 0.0
        self._weight = float(self.model.body_mass.sum()) * 9.81

    def connect(self, position: Array) -> None:
        """Stand on level soles at the joint angles (12,) [rad]."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[_BASE:] = position
        self.data.ctrl[:] = position
        self.data.act[:] = position
        self._standing = _hip_height(self._biped, position)
        self.data.qpos[2] = self._standing
        mujoco.mj_forward(self.model, self.data)

    def read(self) -> Sensors:
        """Return joint positions and velocities, gyro and accelerometer."""
        data = self.data
        return Sensors(
            time=float(data.time),
            joint_position=data.qpos[_BASE:].copy(),
            joint_velocity=data.qvel[_BASE - 1 :].copy(),
            angular_velocity=data.sensor("gyro").data.copy(),
            acceleration=data.sensor("accelerometer").data.copy(),
        )

    def write(self, position: Array) -> None:
        """Hold joint targets (12,) [rad] for one control period of physics."""
        self.data.ctrl[:] = position
        mujoco.mj_step(self.model, self.data, nstep=self._substeps)

    def close(self) -> None:
        """Let go; the simulator needs no farewell."""

    @property
    def fallen(self) -> bool:
        """Whether the base is below 0.65 of its height or tilted past 45 deg."""
        x, y = self.data.qpos[4], self.data.qpos[5]
        upright = 1.0 - 2.0 * (x * x + y * y)
        low = self.data.qpos[2] < _FALL_HEIGHT * self._standing
        return bool(low or upright < math.cos(_FALL_TILT))

    def foot_loads(self) -> Array:
        """Vertical ground force on the left and the right sole, (2,) [N]."""
        # Index order of a spatial force: torque, then force.
        return np.array(self.data.cfrc_ext[self._feet, 5])

    def foot_positions(self) -> Array:
        """Ankles of the left and the right foot in the world, (2, 3) [m]."""
        return np.array(self.data.xpos[self._feet])

    def foot_yaws(self) -> Array:
        """Heading of the left and the right foot, (2,) [rad]."""
        axes = self.data.xmat[self._feet]
        return np.asarray(np.arctan2(axes[:, 3], axes[:, 0]))

    def zmp(self) -> Array:
        """ZMP of the ground forces on both soles, (2,) [m]; NaN off the ground."""
        torque, force = np.split(self.data.cfrc_ext[self._feet].sum(axis=0), 2)
        if force[2] < _MIN_LOAD * self._weight:
            return np.full(2, np.nan)
        # The wrench is about the CoM of the whole robot; move it to the floor.
        x, y, z = self.data.subtree_com[1]
        return np.array(
            [
                x - (torque[1] + z * force[0]) / force[2],
                y + (torque[0] - z * force[1]) / force[2],
            ]
        )


def _hip_height(biped: Biped, position: Array) -> float:
    """Hip above the floor when the left sole is level on it [m]."""
    leg = dict(zip(LEG_JOINTS, position[: len(LEG_JOINTS)], strict=True))
    crus = -leg["ankle_pitch"]
    femur = crus - leg["knee"]
    reach = biped.crus_length * math.cos(crus) + biped.femur_length * math.cos(femur)
    return biped.ankle_height + reach * math.cos(leg["ankle_roll"])
