"""The simulator as a backend: MuJoCo in the role of Microsoft Robotics Studio."""

import math

import mujoco
import numpy as np

from gaitchain.biped import Biped
from gaitchain.errors import CommandError
from gaitchain.kinematics import Array
from gaitchain.messages import Sensors
from gaitchain.robot.model import build_model
from gaitchain.robot.noise import SensorNoise
from gaitchain.robot.world import GRAVITY, World, floor_heights, strew_blocks

CONTROL_PERIOD_S = 0.01
# A robot below this part of its standing height, or tilted further, has fallen.
_FALL_HEIGHT, _FALL_TILT = 0.65, math.radians(45.0)
_MIN_LOAD = 0.02  # of the weight; below it the ZMP says nothing
_BASE = 7  # generalised positions of the free joint
_NEAR = 1e-3  # a distance is only measured up to this [m]
_CORNERS = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])


class MujocoBackend:
    """Walk the robot in physics and measure what happens.

    `read` gives what a real robot could measure, with the world's noise; `zmp`,
    `foot_positions` and the rest are the simulator's truth, for judging a walk and for
    nothing else. Positions are in the floor's frame: z is 0 on the floor, also where
    it slopes.
    """

    def __init__(
        self,
        biped: Biped,
        world: World | None = None,
        period_s: float = CONTROL_PERIOD_S,
        *,
        foot_sensors: bool = False,
    ) -> None:
        """Build the robot in its world.

        Args:
            biped: the robot.
            world: the nominal one by default.
            period_s: control period, a whole number of the world's time steps [s].
            foot_sensors: whether the robot measures the load on its soles.

        Raises:
            CommandError: the control period is no whole number of time steps.
        """
        self.world = world or World()
        self._substeps = _count_steps(period_s, self.world)
        self.model = build_model(biped, self.world)
        self.data = mujoco.MjData(self.model)
        self._period_s = period_s
        self._foot_sensors = foot_sensors
        self._noise = SensorNoise(self.world, self.model.nu)
        self._blocks = strew_blocks(self.world)
        self._up_x, _, self._up_z = self.world.up.tolist()
        self._standing, self._clock_s = 0.0, 0.0
        self._weight = float(self.model.body_mass.sum()) * GRAVITY
        self._feet = [self.model.body(f"{s}_foot").id for s in ("left", "right")]
        self._soles = [self.model.geom(f"{s}_foot_box").id for s in ("left", "right")]
        self._sole_corners = _CORNERS * self.model.geom_size[self._soles][:, None]
        self._leg_pairs = _leg_pairs(self.model)
        self._hoist_views()

    def _hoist_views(self) -> None:
        """Look up once what every period reads or writes; the memory stays in place."""
        data = self.data
        self._quaternion, self._joints = data.qpos[3:_BASE], data.qpos[_BASE:]
        self._joint_rates, self._targets = data.qvel[_BASE - 1 :], data.ctrl
        self._gyro = data.sensor("gyro").data
        self._accelerometer = data.sensor("accelerometer").data
        self._wrenches = data.cfrc_ext
        self._push_force = data.xfrc_applied[self.model.body("trunk").id, :2]

    def connect(self, position: Array) -> None:
        """Stand on level soles at joint angles (2 n,) [rad]; everything starts anew.

        Clock, late targets, pushes and noise start from the beginning: the same targets
        give the same walk again.
        """
        mujoco.mj_resetData(self.model, self.data)
        self._joints[:] = position
        self._targets[:] = position
        self.data.act[:] = position
        for servo, (samples, _) in enumerate(self.model.actuator_history):
            if samples:
                held = np.full(samples, position[servo])
                mujoco.mj_initCtrlHistory(self.model, self.data, servo, None, held)
        mujoco.mj_kinematics(self.model, self.data)
        self._standing = float(self.data.qpos[2] - self._corners()[0, :, 2].min())
        self.data.qpos[2] = self._standing
        self._noise = SensorNoise(self.world, self.model.nu)
        self.start_clock()
        mujoco.mj_forward(self.model, self.data)

    def start_clock(self) -> None:
        """Let the times of the world's pushes count from now, not from `connect`."""
        self._clock_s = float(self.data.time)

    def stop_clock(self) -> None:
        """Hold all pushes back until `start_clock`."""
        self._clock_s = math.inf

    def read(self) -> Sensors:
        """Return joint positions and velocities, gyro, accelerometer, sole loads.

        Reading twice in one control period gives the same numbers.
        """
        noise = self._noise
        return Sensors(
            time=float(self.data.time),
            joint_position=self._joints + noise.joint_position,
            joint_velocity=self._joint_rates + noise.joint_velocity,
            angular_velocity=self._gyro + noise.angular_velocity,
            acceleration=self._accelerometer + noise.acceleration,
            foot_load=self.foot_loads() if self._foot_sensors else None,
        )

    def write(self, position: Array) -> None:
        """Hold joint targets (2 n,) [rad] for one control period of physics."""
        self._targets[:] = position
        if self.world.push and self._impulse_within(self._period_s).any():
            self._step_pushed()
        else:
            mujoco.mj_step(self.model, self.data, nstep=self._substeps)
        if self.world.noise:
            self._noise.draw()

    def close(self) -> None:
        """Let go; the simulator needs no farewell."""

    def _step_pushed(self) -> None:
        step = self.world.timestep
        for _ in range(self._substeps):
            self._push_force[:] = self._impulse_within(step) / step
            mujoco.mj_step(self.model, self.data)
        self._push_force[:] = 0.0

    def _impulse_within(self, duration_s: float) -> Array:
        """Impulse of the pushes on the trunk from now on, x and y [N s]."""
        now = self.data.time - self._clock_s
        w, x, y, z = self._quaternion.tolist()
        heading = math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
        total = np.zeros(2)
        for push in self.world.push:
            angle = heading + math.radians(push.direction_deg)
            part = push.impulse_within(now, now + duration_s)
            total += part * np.array([math.cos(angle), math.sin(angle)])
        return total

    @property
    def fallen(self) -> bool:
        """Whether the base is below 0.65 of its height or tilted past 45 deg."""
        low = self.data.qpos[2] < _FALL_HEIGHT * self._standing
        return bool(low or self._vertical()[2] < math.cos(_FALL_TILT))

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch of the trunk from the true vertical, positive right, forward.

        In radians, of the rotation R_z(yaw) R_y(pitch) R_x(roll).
        """
        x, y, z = self._vertical()
        return math.atan2(y, z), -math.atan2(x, math.hypot(y, z))

    @property
    def self_contact(self) -> bool:
        """Whether a box of one leg touches or cuts one of the other.

        Links pass through each other in the simulation; this tells when a real robot's
        would have hit.
        """
        return any(
            mujoco.mj_geomDistance(self.model, self.data, a, b, _NEAR, None) <= 0.0
            for a, b in self._leg_pairs
        )

    def sole_heights(self) -> Array:
        """Lowest corner of the left and the right sole above the floor, (2,) [m].

        Each corner is measured from what is right under it; a block between the corners
        is not seen. Negative where the sole is pressed in.
        """
        corners = self._corners()
        heights = corners[..., 2]
        if len(self._blocks):
            heights -= floor_heights(self._blocks, corners[..., :2])
        return np.asarray(heights.min(axis=1))

    def _corners(self) -> Array:
        """Corners of both soles, (2, 4, 3) [m]."""
        axes = self.data.geom_xmat[self._soles].reshape(2, 3, 3).swapaxes(1, 2)
        centres = self.data.geom_xpos[self._soles][:, None]  # (2, 1, 3)
        return np.asarray(centres + self._sole_corners @ axes)

    def foot_loads(self) -> Array:
        """Ground force on the left and the right sole, across the floor, (2,) [N]."""
        # Index order of a spatial force: torque, then force.
        return np.asarray(self._wrenches[self._feet, 5])

    def foot_positions(self) -> Array:
        """Ankles of the left and the right foot in the world, (2, 3) [m]."""
        return np.array(self.data.xpos[self._feet])

    def foot_yaws(self) -> Array:
        """Heading of the left and the right foot, (2,) [rad]."""
        axes = self.data.xmat[self._feet]
        return np.asarray(np.arctan2(axes[:, 3], axes[:, 0]))

    def _vertical(self) -> tuple[float, float, float]:
        """Return the true vertical in the trunk's frame, a unit vector."""
        w, x, y, z = self._quaternion.tolist()
        sin, cos = self._up_x, self._up_z
        return (
            sin * (1.0 - 2.0 * (y * y + z * z)) + cos * 2.0 * (x * z - w * y),
            sin * 2.0 * (x * y - w * z) + cos * 2.0 * (y * z + w * x),
            sin * 2.0 * (x * z + w * y) + cos * (1.0 - 2.0 * (x * x + y * y)),
        )

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


def _count_steps(period_s: float, world: World) -> int:
    steps = round(period_s / world.timestep)
    if steps < 1 or not math.isclose(steps * world.timestep, period_s):
        raise CommandError(
            f"timestep is {world.timestep:g} s, must divide the control period of "
            f"{period_s:g} s"
        )
    return steps


def _leg_pairs(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Pairs of geoms, one of each leg."""
    of_side: dict[str, list[int]] = {"left": [], "right": []}
    for geom in range(model.ngeom):
        side = model.body(model.geom_bodyid[geom]).name.partition("_")[0]
        if side in of_side:
            of_side[side].append(geom)
    return [(a, b) for a in of_side["left"] for b in of_side["right"]]
