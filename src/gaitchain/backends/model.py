"""A user's own MuJoCo model as a backend, with all its joints, actuators and geoms."""

import copy
import math
from typing import Any, NamedTuple, Protocol

import mujoco
import numpy as np

from gaitchain.backends.actuators import (
    BY_JOINT,
    Servo,
    SetPoints,
    joint_servo,
    joint_stiffness,
    make_servo,
    set_points,
)
from gaitchain.backends.mujoco import SimulatedMotors, count_steps
from gaitchain.errors import CommandError
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array, Sensors
from gaitchain.robot.holding import holding_stiffness
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.robot import Robot
from gaitchain.sim.stability import divergences
from gaitchain.sim.truth import FALL_HEIGHT, FALL_TILT

_XBODY, _SITE = mujoco.mjtObj.mjOBJ_XBODY, mujoco.mjtObj.mjOBJ_SITE
_IMU = (int(mujoco.mjtSensor.mjSENS_GYRO), int(mujoco.mjtSensor.mjSENS_ACCELEROMETER))
_FREE, _HINGE = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_HINGE)
_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
_FAR = 10.0  # largest distance at which a floor is found below a foot [m]
_HELD_DAMPING = 0.8  # damping ratio of joints outside the legs
SOLE_DEPTH_M = 0.01
"""Height above a sole's lowest geom up to which others are of it [m]."""
_NAMED = 6  # joints that a message names


class OtherRobotError(CommandError):
    """A model is not that of the library's robot."""


class OfRobot(Protocol):
    """What is of a robot, as its gait library is."""

    @property
    def robot(self) -> Robot:
        """The robot."""


class InModel(NamedTuple):
    """Where a robot is in a model."""

    base: int
    """Body of its base."""
    free: int
    """Where its place begins in `qpos`."""
    turn: Array
    """(3, 3) from the pelvis frame to the base's."""
    joints: tuple[int, ...]
    """Its joints, in the order of `joint_names`."""


class ModelBackend(SimulatedMotors):
    """Walk a library's robot in any MuJoCo model of it.

    The model may contain other bodies beside the robot. The leg servos are set to the
    library's gains, as in motor drivers; other actuators stay unchanged if they can
    hold the weight on their joint. The given model is not changed: `model` is a copy.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        library: OfRobot,
        period_s: float = CONTROL_PERIOD_S,
        *,
        imu: str | None = None,
        servo_gain: float = 1.0,
    ) -> None:
        """Find the robot in its model.

        Args:
            model: a model with a floor; the robot's joints are named as in the file
                that the library was built from, and its base has a free joint.
            library: the gait library of the robot, or what else has it.
            period_s: control period, a whole number of the model's time steps [s].
            imu: site of a gyro and an accelerometer, which measure in its frame; by
                default both are computed from the base's motion, without errors.
            servo_gain: part of the library's stiffness and damping that the leg servos
                have.

        Raises:
            CommandError: the model or the library is none, a joint, its actuator, the
                free joint, the floor or the IMU is missing, or the period does not fit.
        """
        _check_kinds(model, library)
        self.model = copy.copy(model)
        self.data = mujoco.MjData(self.model)
        self._substeps = count_steps(period_s, float(model.opt.timestep))
        legs = library.robot.legs
        self._joints = _joints_of(self.model, legs)
        self.joint_names = tuple(self.model.joint(j).name for j in self._joints)
        """The robot's leg and held joints in the library, in the model's order."""
        self._qpos = self.model.jnt_qposadr[self._joints]
        self._dofs = self.model.jnt_dofadr[self._joints]
        self._base = _base_of(self.model, self._joints[0])
        self._free = int(self.model.jnt_qposadr[self.model.body_jntadr[self._base]])
        self._turn, self._at = np.array(legs.base_turn), np.array(legs.base_at)
        self._imu = None if imu is None else _imu_at(self.model, imu)
        self._contacts = _contacts_of(self.model, self._base)
        self._place(np.array([_angle(legs, name) for name in self.joint_names]))
        self._servos, self._rows, self._told = self._set_servos(
            legs.with_servos(servo_gain, servo_gain)
        )

    def connect(self, position: Array) -> None:
        """Place the robot upright, with its lowest geom just on the floor.

        Args:
            position: (n,) joint angles in the order of `joint_names`, such as
                `Walker.stand` [rad].
        """
        self._place(position)
        self._turn_on()
        self._aim(np.asarray(position))
        mujoco.mj_forward(self.model, self.data)
        self._height = self._hips_height()

    def read(self) -> Sensors:
        """Return joint positions and velocities, gyro and accelerometer."""
        gyro, acceleration = self._read_imu() if self._imu else self._ideal_imu()
        return Sensors(
            time=float(self.data.time),
            joint_position=self.data.qpos[self._qpos],
            joint_velocity=self.data.qvel[self._dofs],
            angular_velocity=gyro,
            acceleration=acceleration,
        )

    def write(self, position: Array) -> None:
        """Hold joint targets (n,) [rad] for one control period of physics."""
        self.data.ctrl[self._servos] = self._told.of(position[self._rows])
        mujoco.mj_step(self.model, self.data, nstep=self._substeps)

    def engage(self) -> None:
        """Turn all actuators on; each servo holds its joint's present angle."""
        self._aim(self.data.qpos[self._qpos])
        self._turn_on()

    def release(self) -> None:
        """Turn all actuators off."""
        super().release()
        self.data.qfrc_actuator[:] = 0.0  # that of the last time step until now

    def loads(self) -> Array:
        """Return the joints' torques (n,) [N m]."""
        return np.array(self.data.qfrc_actuator[self._dofs])

    @property
    def in_model(self) -> InModel:
        """Where the robot is in its model."""
        return InModel(self._base, self._free, self._turn, tuple(self._joints))

    @property
    def touching(self) -> list[int]:
        """Geoms that touch the floor, or nearly so, where the robot stands."""
        above = self.above_floor()
        least = min(above) + SOLE_DEPTH_M
        pairs = zip(self._contacts, above, strict=True)
        return [own for (own, _), height in pairs if height < least]

    @property
    def base_position(self) -> Array:
        """(3,) of the base's origin in the world [m]."""
        return np.array(self.data.qpos[self._free : self._free + 3])

    @property
    def fallen(self) -> bool:
        """Whether the hips are below 0.65 of their height, or tilted past 45 deg.

        Also if the physics diverged.
        """
        upright = self.data.xmat[self._base].reshape(3, 3)[2] @ self._turn[:, 2]
        high = self._hips_height() >= FALL_HEIGHT * self._height
        stands = high and upright >= math.cos(FALL_TILT)  # no NaN does
        return not stands or self.diverged

    @property
    def diverged(self) -> bool:
        """Whether the state was no number, or huge, since `connect`.

        MuJoCo then begins anew from the model's own pose: nothing that it shows
        afterwards is of this walk.
        """
        return bool(divergences(self.data).any())

    def _hips_height(self) -> float:
        """Return the height of the pelvis frame's origin above the floor [m].

        The base's own origin may be anywhere, at the soles too.
        """
        up = self.data.xmat[self._base].reshape(3, 3)[2]
        return float(self.data.qpos[self._free + 2] + up @ self._at) - self._floor_z

    def above_floor(self) -> list[float]:
        """Return how high above the floor each geom is that can touch it [m]."""
        return [
            mujoco.mj_geomDistance(self.model, self.data, own, floor, _FAR, None)
            for own, floor in self._contacts
        ]

    def _place(self, position: Array) -> None:
        """Place the robot on the floor with a level pelvis, facing along x."""
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[self._qpos] = position
        quaternion = data.qpos[self._free + 3 : self._free + 7]
        mujoco.mju_mat2Quat(quaternion, self._turn.T.ravel())
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        drop, (_, floor) = min(zip(self.above_floor(), self._contacts, strict=True))
        data.qpos[self._free + 2] -= drop
        self._floor_z = float(data.geom_xpos[floor][2])
        self._height = self._hips_height()
        com = data.subtree_com[self._base]
        self._com_height = float(com[2] - drop) - self._floor_z

    def _aim(self, position: Array) -> None:
        """Set the set-points, and the activation states of the servos."""
        data = self.data
        data.ctrl[self._servos] = self._told.of(position[self._rows])
        memory = self.model.actuator_actadr[self._servos]
        data.act[memory[memory >= 0]] = data.ctrl[self._servos[memory >= 0]]
        for servo in self._servos.tolist():  # those with MuJoCo's `delay`
            samples = int(self.model.actuator_history[servo, 0])
            if samples:
                held = np.full(samples, data.ctrl[servo])
                mujoco.mj_initCtrlHistory(self.model, data, servo, None, held)

    def _read_imu(self) -> tuple[Array, Array]:
        """Return the model's gyro and accelerometer, in the pelvis frame."""
        assert self._imu is not None
        site, *sensors = self._imu
        axes = self.data.site_xmat[site].reshape(3, 3)
        pelvis = self.data.xmat[self._base].reshape(3, 3) @ self._turn
        gyro, acceleration = (
            pelvis.T @ axes @ self.data.sensordata[adr : adr + 3] for adr in sensors
        )
        return gyro, acceleration

    def _ideal_imu(self) -> tuple[Array, Array]:
        """Return what an ideal IMU at the origin of the pelvis frame measures."""
        model, data = self.model, self.data
        rate, change = np.empty(6), np.empty(6)
        mujoco.mj_rnePostConstraint(model, data)
        mujoco.mj_objectVelocity(model, data, _XBODY, self._base, rate, 1)
        mujoco.mj_objectAcceleration(model, data, _XBODY, self._base, change, 1)
        spin, at = rate[:3], self._at
        acceleration = change[3:] + np.cross(change[:3], at)
        acceleration += np.cross(spin, np.cross(spin, at))
        return self._turn.T @ spin, self._turn.T @ acceleration

    def _set_servos(self, legs: LegModel) -> tuple[Array, Array, SetPoints]:
        """Set the gains of each joint's actuators.

        Returns:
            Actuators that take set-points, the rows of their joints in `joint_names`,
            and how they are told joint angles.
        """
        found = _actuators_of(self.model, self._joints, legs)
        actuators, rows = np.array(found).T
        for row in np.unique(rows):
            of_joint = actuators[rows == row]
            wanted = self._wanted(row, joint_servo(self.model, of_joint), legs)
            if wanted is not None:
                make_servo(self.model, self._joints[row], of_joint, wanted)
        # Others, as a <velocity/> that damps, get 0: an angle is no speed.
        servos = [joint_stiffness(self.model, actuator) > 0.0 for actuator in actuators]
        actuators, rows = actuators[servos], rows[servos]
        return actuators, rows, set_points(self.model, actuators)

    def _wanted(self, row: int, own: Servo, legs: LegModel) -> Servo | None:
        """Choose the servo of a joint; None if the model's own stays."""
        name, dof = self.joint_names[row], self._dofs[row]
        passive = float(self.model.dof_damping[dof])
        if name not in legs.joint_names:
            return self._holding(row, own)
        leg = legs.joint_names.index(name)
        wanted = Servo(
            stiffness=float(legs.stiffness[leg]),
            damping=max(float(legs.damping[leg]) - passive, 0.0),
            limit=float(legs.torque_limit[leg]),
        )
        return None if own.is_like(wanted, passive) else wanted

    def _holding(self, row: int, own: Servo) -> Servo | None:
        """Choose the servo of a joint outside the legs by the weight that it bears."""
        model, data = self.model, self.data
        joint, dof = self._joints[row], self._dofs[row]
        body = model.jnt_bodyid[joint]
        lever = float(np.linalg.norm(data.subtree_com[body] - data.xanchor[joint]))
        load = float(model.body_subtreemass[body]) * GRAVITY * lever
        if own.stiffness and own.stiffness >= load:
            return None
        weight = float(model.body_subtreemass[self._base]) * GRAVITY
        stiffness = holding_stiffness(
            load, weight * self._com_height, hinge=model.jnt_type[joint] == _HINGE
        )
        damping = 2.0 * _HELD_DAMPING * math.sqrt(stiffness * float(model.dof_M0[dof]))
        damping -= float(model.dof_damping[dof])
        return Servo(stiffness, max(damping, 0.0), own.limit)


def _check_kinds(model: object, library: object) -> None:
    """Refuse what is no model, or has no robot."""
    if not isinstance(model, mujoco.MjModel):
        raise CommandError(
            f"model {model!r:.80}: give a mujoco.MjModel, such as "
            "mujoco.MjModel.from_xml_path('scene.xml')"
        )
    if not isinstance(getattr(library, "robot", None), Robot):
        raise CommandError(
            f"{library!r:.80} is no gait library; give one, as load_library(path) "
            "returns, not its robot alone"
        )


def _angle(legs: LegModel, name: str) -> float:
    """Return a joint's angle in the standing pose [rad]."""
    if name in legs.held:
        return legs.held[name]
    return float(legs.stand[legs.joint_names.index(name)])


def _joints_of(model: Any, legs: LegModel) -> list[int]:
    """Return the robot's joints in the library, in the model's order."""
    names = [model.joint(j).name for j in range(model.njnt)]
    missing = [name for name in legs.joint_names if name not in names]
    if missing:
        raise OtherRobotError(
            f"the model lacks joints of the library's robot: {_some(missing)}; it "
            f"has {_some([*filter(None, names)]) or 'none with a name'}"
        )
    known = {*legs.joint_names, *legs.held}
    return [joint for joint, name in enumerate(names) if name in known]


def _some(names: list[str]) -> str:
    """Join names, the first ones of many."""
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _base_of(model: Any, joint: int) -> int:
    """Return the body with the robot's free joint."""
    base = int(model.body_rootid[model.jnt_bodyid[joint]])
    first = model.body_jntadr[base]
    if first < 0 or model.jnt_type[first] != _FREE:
        raise CommandError(
            f"the model's body {model.body(base).name!r} has no free joint, so that "
            "the robot cannot walk; give it a <freejoint/>"
        )
    return base


def _contacts_of(model: Any, base: int) -> list[tuple[int, int]]:
    """Return the pairs of a geom of the robot and a floor that can collide."""
    geoms = range(model.ngeom)
    floors = [g for g in geoms if model.geom_type[g] == _PLANE]
    pairs = [
        (own, floor)
        for own in geoms
        for floor in floors
        if model.body_rootid[model.geom_bodyid[own]] == base
        and _collide(model, own, floor)
    ]
    if not pairs:
        raise CommandError(
            "the model has no floor that the robot touches; add a geom of type plane "
            "to its worldbody"
        )
    return pairs


def _collide(model: Any, one: int, other: int) -> bool:
    kinds, affine = model.geom_contype, model.geom_conaffinity
    by_mask = kinds[one] & affine[other] or kinds[other] & affine[one]
    pairs = zip(model.pair_geom1, model.pair_geom2, strict=True)
    return bool(by_mask) or {one, other} in [{*pair} for pair in pairs]


def _imu_at(model: Any, site: str) -> tuple[int, int, int]:
    """Return the site, and the addresses of gyro and accelerometer in `sensordata`."""
    index = mujoco.mj_name2id(model, _SITE, site) if isinstance(site, str) else -1
    found = [
        int(model.sensor_adr[s])
        for kind in _IMU
        for s in range(model.nsensor)
        if (model.sensor_type[s], model.sensor_objid[s]) == (kind, index)
    ]
    if index < 0 or len(found) != len(_IMU):
        raise CommandError(
            f"imu: the model has no site {site!r} with one gyro and one accelerometer"
        )
    return index, found[0], found[1]


def _actuators_of(
    model: Any, joints: list[int], legs: LegModel
) -> list[tuple[int, int]]:
    """Return each actuator of one of the joints, with the joint's row."""
    found = [
        (actuator, joints.index(model.actuator_trnid[actuator, 0]))
        for actuator in range(model.nu)
        if model.actuator_trntype[actuator] in BY_JOINT
        and model.actuator_trnid[actuator, 0] in joints
    ]
    driven = {model.joint(joints[row]).name for _, row in found}
    idle = [name for name in legs.joint_names if name not in driven]
    if idle:
        raise CommandError(
            f"the model has no actuator on {', '.join(idle)}; give each a <position/> "
            "or a <motor/>"
        )
    return found
