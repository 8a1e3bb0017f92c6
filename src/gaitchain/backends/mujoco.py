"""The simulator as a backend: MuJoCo in place of the paper's Robotics Studio."""

import math
from dataclasses import replace

import mujoco
import numpy as np

from gaitchain.backends.base import (
    TORQUE_UNIT,
    Disturbances,
    LinkHealth,
    PunchesState,
    Truth,
    joint_angles,
    numbers,
)
from gaitchain.errors import CommandError
from gaitchain.gait.limits import check_period
from gaitchain.messages import CONTROL_PERIOD_S, Array, Sensors
from gaitchain.robot.robot import Robot, given_robot
from gaitchain.sim.model import build_model
from gaitchain.sim.outside_forces import OutsideForces
from gaitchain.sim.push import Push
from gaitchain.sim.robot_faults import encoder_offsets, likely_robot, world_of
from gaitchain.sim.sensor_faults import SensorFaults
from gaitchain.sim.servo_faults import ServoFaults
from gaitchain.sim.trunk import count_trunk
from gaitchain.sim.truth import SimulatorTruth
from gaitchain.sim.world import SAME_PERIOD, World
from gaitchain.sim.world_draws import SensorNoise

_LIMP = int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)


class SimulatedMotors:
    """What the backends of MuJoCo share: motors without a link that could fail."""

    physical = False
    has_imu = True
    load_unit = TORQUE_UNIT
    model: mujoco.MjModel

    def release(self) -> None:
        """Turn all actuators off."""
        self.model.opt.disableflags |= _LIMP

    def health(self) -> LinkHealth:
        """Return a link without losses."""
        return LinkHealth()

    def start_clock(self) -> None:
        """Count the times of pushes from now; by default there are none."""

    def stop_clock(self) -> None:
        """Suspend all pushes until `start_clock`."""

    def close(self) -> None:
        """Do nothing: a simulator holds no external resources."""

    def _turn_on(self) -> None:
        self.model.opt.disableflags &= ~_LIMP


class MujocoBackend(SimulatorTruth, SimulatedMotors):
    """Simulate the robot in its world.

    `read` returns what a real robot can measure, with the world's sensor noise. The
    members of `SimulatorTruth` return the ground truth, for judging a walk only.
    """

    def __init__(
        self,
        robot: Robot,
        world: World | None = None,
        period_s: float = CONTROL_PERIOD_S,
    ) -> None:
        """Build the robot in its world.

        Args:
            robot: the robot.
            world: the nominal one by default.
            period_s: control period, a whole number of the world's time steps [s].

        Raises:
            CommandError: the robot is none, the control period is no whole number of
                time steps, the robot has no body that is to be pushed, or the world
                doubts what was not identified.
        """
        world = world or World()
        robot = likely_robot(given_robot(robot, CommandError), world)
        self.world = world_of(robot, world, period_s)
        self._substeps = count_steps(period_s, self.world.timestep)
        known = robot.identified is not None
        self._has_servo_faults = known or self.world.has_servo_faults
        self._has_sensor_faults = known or self.world.has_sensor_faults
        # Servos with faults have a bus of their own that delays targets.
        modelled = self.world
        if self._has_servo_faults:
            modelled = replace(self.world, delay_s=0.0)
        self.model = build_model(robot, modelled)
        self.data = mujoco.MjData(self.model)
        super().__init__(self.model, self.data, self.world)
        self._robot = robot
        self._draw_faults()
        self._hoist_views()
        self._outside = OutsideForces(robot, self, self.world)

    def __getstate__(self) -> None:
        """Refuse a copy: views of its arrays would stay with this simulator.

        Raises:
            CommandError: always.
        """
        raise CommandError(
            "a simulated robot cannot be copied or pickled: make another one of the "
            "same robot and world, and give it the same targets, to have the same walk"
        )

    def _hoist_views(self) -> None:
        """Keep views of the arrays that every control period reads or writes."""
        data = self.data
        count = self.model.nu  # joints of a waist are behind the legs'
        joints, dofs = (slice(n, n + count) for n in count_trunk(self.model))
        self.joints = data.qpos[joints]
        """(2 n,) true angles of the leg joints [rad]."""
        self._joint_rates = data.qvel[dofs]
        self._targets = data.ctrl
        self._gyro = data.sensor("gyro").data
        self._accelerometer = data.sensor("accelerometer").data

    def _draw_faults(self) -> None:
        """Take new sensors and servos, with the errors of the world."""
        world, joints = self.world, self.model.nu
        self._noise = SensorNoise(world, joints)
        self._sensors = self._servos = None
        if self._has_sensor_faults:
            offsets = encoder_offsets(self._robot, world)
            self._sensors = SensorFaults(world, offsets)
        if self._has_servo_faults:
            self._servos = ServoFaults(self.model, self.data, world, self._robot)

    def connect(self, position: Array) -> None:
        """Place the robot on level soles at joint angles (2 n,) [rad], and reset.

        Clock, delayed targets, pushes and noise are reset, so that the same targets
        give the same walk again.

        Raises:
            CommandError: they are other than finite angles of its joints.
        """
        position = joint_angles(position, self.model.nu)
        mujoco.mj_resetData(self.model, self.data)
        self._draw_faults()
        if self._servos is not None:
            position = self._servos.bus.true(position)
        self.joints[:] = position
        self._aim(position)
        mujoco.mj_kinematics(self.model, self.data)
        self._standing = float(self._trunk.pose[2] - self._corners()[..., 2].min())
        if not self.world.held:
            self._trunk.pose[2] = self._standing
        self._outside.plan(self.world)
        self._turn_on()
        self.start_clock()
        mujoco.mj_forward(self.model, self.data)

    def set_pushes(self, *pushes: Push) -> None:
        """Replace the world's pushes, from the next `connect` on."""
        self.world = replace(self.world, push=pushes)

    def start_clock(self) -> None:
        """Count the times of the world's pushes from now instead of `connect`."""
        self._outside.pushes.start_clock(self.data.time)

    def stop_clock(self) -> None:
        """Suspend all pushes until `start_clock`."""
        self._outside.pushes.stop_clock()

    def read(self) -> Sensors:
        """Return joint positions and velocities, gyro, accelerometer, sole loads.

        Repeated reads in one control period return the same numbers. MuJoCo measures
        gyro and accelerometer at the begin of its last time step.
        """
        noise = self._noise
        found = Sensors(
            time=float(self.data.time),
            joint_position=self.joints + noise.joint_position,
            joint_velocity=self._joint_rates + noise.joint_velocity,
            angular_velocity=self._gyro + noise.angular_velocity,
            acceleration=self._accelerometer + noise.acceleration,
            foot_load=self.foot_loads() if self.world.foot_sensors else None,
        )
        return found if self._sensors is None else self._sensors.shown(found)

    def write(self, position: Array) -> None:
        """Hold joint targets (2 n,) [rad] for one control period of physics.

        Raises:
            CommandError: they are other than finite angles of its joints.
        """
        position = joint_angles(position, self.model.nu)
        if self._servos is None:
            self._targets[:] = position
        else:
            self._servos.bus.send(position, float(self.data.time))
        self.hold()

    def hold(self) -> None:
        """Run one control period of physics with the targets that were sent before."""
        if self._servos is None:
            self._outside.step(self._substeps)
        else:
            self._outside.step(self._substeps, self._servos.act)
        if self.world.noise:
            self._noise.draw()

    def engage(self) -> None:
        """Turn all servos on; each holds its joint's present angle."""
        self._aim(self.joints)
        if self._servos is not None:
            self._servos.bus.clear()
        self._turn_on()

    def _aim(self, position: Array) -> None:
        """Make true angles (2 n,) set-points and targets, with none on its way."""
        self._targets[:] = position
        self.data.act[:] = position
        for servo, (samples, _) in enumerate(self.model.actuator_history):
            if samples:
                held = np.full(samples, position[servo])
                mujoco.mj_initCtrlHistory(self.model, self.data, servo, None, held)

    def release(self) -> None:
        """Turn all actuators off, and what their faults add to them."""
        super().release()
        self.data.actuator_force[:] = 0.0  # that of the last time step until now
        if self._servos is not None:
            self._servos.power(on=False)

    def loads(self) -> Array:
        """Return the torques (2 n,) that the servos give, faults and all [N m]."""
        given = np.array(self.data.actuator_force)
        return given if self._servos is None else given + self._servos.missing

    def _turn_on(self) -> None:
        super()._turn_on()
        if self._servos is not None:
            self._servos.power(on=True)

    def truth(self) -> Truth:
        """Return the ground truth of the robot now."""
        data, feet = self.data, self.feet
        return Truth(
            qpos=numbers(self._trunk.pose, self.joints),
            qvel=numbers(self._trunk.twist, self._joint_rates),
            place=numbers(data.xpos[feet]),
            turn=numbers(data.xmat[feet]),
            wrench=numbers(self.ground_wrenches()),
            twist=numbers(data.cvel[feet]),
            com=numbers(data.subtree_com[1]),
            tilt=self.tilt,
            foot_height=numbers(self.sole_heights()),
            self_contact=self.self_contact,
        )

    def push(
        self,
        impulse_ns: float,
        direction_deg: float,
        elevation_deg: float = Push.elevation_deg,
        body: str = Push.body,
    ) -> Push:
        """Push a body, in addition to the world's pushes; see `SimulatedTruth.push`.

        Raises:
            CommandError: a number is outside its limits, or there is no such body.
        """
        push = Push(
            impulse_ns, direction_deg, 0.0, elevation_deg=elevation_deg, body=body
        )
        return self._outside.push(push)

    @property
    def disturbances(self) -> Disturbances:
        """What disturbs the robot now, besides pushes."""
        world, punches = self.world, None
        if world.punches is not None:
            punches = PunchesState(world.punches.most_ns, world.punches.every_s)
        return Disturbances(punches, world.arms, world.payload)

    def disturb(self, wanted: Disturbances) -> None:
        """Replace what disturbs the robot; see `SimulatedTruth.disturb`.

        Raises:
            CommandError: a number is outside its limits.
        """
        punches = self.world.punches  # with their own duration
        if wanted.punches != self.disturbances.punches:
            punches = None if wanted.punches is None else wanted.punches.checked()
        self.world = replace(
            self.world, punches=punches, arms=wanted.arms, payload=wanted.payload
        )
        self._outside.change(self.world)

    def take_punches(self) -> list[Push]:
        """Return the punches that have begun since the last call."""
        return self._outside.pushes.take_begun(self.data.time)

    @property
    def masses(self) -> dict[str, float]:
        """Mass of each body by its name [kg]."""
        return self._outside.masses

    @property
    def known_pushes(self) -> list[Push]:
        """The world's pushes, and its punches so far."""
        return self._outside.pushes.known(self.data.time)


def count_steps(period_s: float, timestep: float) -> int:
    """Return how many time steps make a control period.

    Raises:
        CommandError: it is none, or no whole number of them.
    """
    check_period(period_s)
    steps = round(period_s / timestep)
    if steps < 1 or not math.isclose(steps * timestep, period_s, rel_tol=SAME_PERIOD):
        raise CommandError(
            f"timestep is {timestep:g} s, must divide the control period of "
            f"{period_s:g} s"
        )
    return steps
