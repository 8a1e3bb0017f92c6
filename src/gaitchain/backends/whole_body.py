"""The robot in its own model as a live loop drives it: legs, and all joints at need."""

import mujoco
import numpy as np

from gaitchain.backends.base import Disturbances, Truth, numbers
from gaitchain.backends.model import ModelBackend
from gaitchain.backends.mujoco import SimulatedMotors
from gaitchain.balance.leg_kinematics import Legs, legs_of, posture
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import CONTROL_PERIOD_S, Array, Sensors
from gaitchain.robot.leg_model import Soles
from gaitchain.sim.bodies import check_body, subtree
from gaitchain.sim.push import Push
from gaitchain.sim.rotation import quaternion
from gaitchain.sim.world import World

_ALL = slice(None)
_CALM = Disturbances(None, World.arms, World.payload)


class WholeBodyBackend(SimulatedMotors):
    """Walk a robot in its own model by its legs, and get it up by all joints.

    `read` and `write` are of the legs, in the order of the library; the other joints
    are held as the library holds them. `read_whole` and `write_whole` are of all.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        library: GaitLibrary,
        period_s: float = CONTROL_PERIOD_S,
    ) -> None:
        """Find the robot in its model.

        Args:
            model: see `ModelBackend`.
            library: the gait library of the robot.
            period_s: control period, a whole number of the model's time steps [s].

        Raises:
            CommandError: see `ModelBackend`.
        """
        self._body, self._period_s = ModelBackend(model, library, period_s), period_s
        self.model, self.data = self._body.model, self._body.data
        self.whole_joint_names = self._body.joint_names
        """All joints that are driven, in the model's order."""
        legs = library.robot.legs
        self._rows = [self.whole_joint_names.index(name) for name in legs.joint_names]
        self._stand = np.array(self._body.read().joint_position)
        self._legs, self._turn = legs_of(library.robot), self._body.in_model.turn
        self._at = np.array(legs.base_at)
        joints = [self._body.in_model.joints[row] for row in self._rows]
        self._dofs = [int(self.model.jnt_dofadr[joint]) for joint in joints]
        half = len(joints) // 2
        ends = joints[half - 1], joints[-1]
        self._feet = [self._beyond(end) for end in ends]
        roots = joints[0], joints[half]
        self._sides = [set(self._beyond(root)) for root in roots]
        legs_bodies = self._sides[0] | self._sides[1]
        of_base = subtree(self.model, self._body.in_model.base)
        self._trunk = [body for body in of_base if body not in legs_bodies]
        masses = self.model.body_mass[self._trunk]
        self._trunk_parts = masses / masses.sum()
        self._sole_corners = _corners(library.robot.legs.soles, self._legs)
        self._pushes: list[Push] = []

    def connect(self, position: Array) -> None:
        """Put the robot on its feet.

        Args:
            position: (2 n,) angles of the legs [rad].
        """
        self._pushes.clear()
        self.data.xfrc_applied[:] = 0.0
        self._body.connect(self.with_legs(position))

    def read(self) -> Sensors:
        """Return what the legs' joints and the IMU measure."""
        return self._measured(self._rows)

    def read_whole(self) -> Sensors:
        """Return what all joints and the IMU measure."""
        return self._measured(_ALL)

    def write(self, position: Array) -> None:
        """Hold targets of the legs (2 n,) [rad] for one control period of physics."""
        self.write_whole(self.with_legs(position))

    def write_whole(self, position: Array) -> None:
        """Hold targets of all joints [rad] for one control period of physics."""
        now_s = float(self.data.time)
        self._pushes = [push for push in self._pushes if push.ends_s > now_s]
        impulse = np.zeros(3)
        for push in self._pushes:
            part = push.impulse_within(now_s, now_s + self._period_s)
            impulse += part * np.array(push.axis(self._heading))
        # By mass, so that it is the trunk's CoM that is pushed, waist or not.
        forces = np.outer(self._trunk_parts, impulse / self._period_s)
        self.data.xfrc_applied[self._trunk, :3] = forces
        self._body.write(position)

    def engage(self) -> None:
        """Turn all actuators on; each servo holds its joint's present angle."""
        self._body.engage()

    def loads(self) -> Array:
        """Return the torques of the legs' joints (2 n,) [N m]."""
        return np.asarray(self._body.loads()[self._rows])

    @property
    def fallen(self) -> bool:
        """See `ModelBackend.fallen`."""
        return self._body.fallen

    @property
    def free_joint(self) -> int:
        """The joint of the base."""
        return int(self.model.body_jntadr[self._body.in_model.base])

    def foot_loads(self) -> Array:
        """Return what the left and the right foot carry (2,) [N]."""
        mujoco.mj_rnePostConstraint(self.model, self.data)
        return np.array([self._wrench(foot)[5] for foot in self._feet])

    def truth(self) -> Truth:
        """Return the ground truth of the robot now."""
        data = self.data
        mujoco.mj_rnePostConstraint(self.model, data)
        at, turn = self._pelvis
        joints = self._body.read().joint_position[self._rows]
        found = posture(self._legs, joints)
        feet, ankles = turn @ found.feet, at + found.ankles @ turn.T
        soles = zip(ankles, feet, self._sole_corners, strict=True)
        heights = [(ankle + own @ foot.T)[:, 2].min() for ankle, foot, own in soles]
        return Truth(
            qpos=numbers(at, quaternion(turn), joints),
            qvel=numbers(self._pelvis_speed(), data.qvel[self._dofs]),
            place=numbers(ankles),
            turn=numbers(feet),
            wrench=numbers(*map(self._wrench, self._feet)),
            twist=numbers(*(data.cvel[foot[0]] for foot in self._feet)),
            com=numbers(data.subtree_com[self._body.in_model.base]),
            tilt=_tilt(turn),
            foot_height=numbers(np.array(heights)),
            self_contact=self._legs_touch(),
            whole=numbers(data.qpos),
        )

    def push(
        self,
        impulse_ns: float,
        direction_deg: float,
        elevation_deg: float = Push.elevation_deg,
        body: str = Push.body,
    ) -> Push:
        """Push the trunk; see `SimulatedTruth.push`.

        Raises:
            CommandError: a number is outside its limits, or it is another body.
        """
        check_body(body, (Push.body,))
        push = Push(
            impulse_ns,
            direction_deg,
            float(self.data.time),
            elevation_deg=elevation_deg,
        )
        self._pushes.append(push)
        return push

    @property
    def disturbances(self) -> Disturbances:
        """None: the robot's own model is as its file says."""
        return _CALM

    def disturb(self, wanted: Disturbances) -> None:
        """Refuse; see `SimulatedTruth.disturb`.

        Raises:
            CommandError: something is wanted.
        """
        if wanted != _CALM:
            raise CommandError(
                "in the robot's own model nothing but pushes of the trunk; leave out "
                "--own-model for punches, arms and a payload"
            )

    def take_punches(self) -> list[Push]:
        """Return no punches."""
        return []

    def with_legs(self, position: Array) -> Array:
        """Return targets of all joints (n,) [rad] from those of the legs."""
        whole = self._stand.copy()
        whole[self._rows] = position
        return whole

    def _measured(self, rows: list[int] | slice) -> Sensors:
        found = self._body.read()
        return Sensors(
            time=found.time,
            joint_position=found.joint_position[rows],
            joint_velocity=found.joint_velocity[rows],
            angular_velocity=found.angular_velocity,
            acceleration=found.acceleration,
        )

    @property
    def _pelvis(self) -> tuple[Array, Array]:
        """The pelvis frame in the world: (3,) origin [m], (3, 3) axes."""
        free, axes = self._body.in_model.free, np.zeros(9)
        mujoco.mju_quat2Mat(axes, self.data.qpos[free + 3 : free + 7])
        base = axes.reshape(3, 3)
        at = self.data.qpos[free : free + 3] + base @ self._at
        return at, base @ self._body.in_model.turn

    @property
    def _heading(self) -> float:
        ahead = self._pelvis[1][:, 0]
        return float(np.arctan2(ahead[1], ahead[0]))

    def _wrench(self, foot: list[int]) -> Array:
        """Return torque and force on a foot in the world's axes, (6,)."""
        return np.asarray(self.data.cfrc_ext[foot].sum(axis=0))

    def _pelvis_speed(self) -> Array:
        """Return its velocity in the world, and its own angular velocity (6,)."""
        first = self.model.body_dofadr[self._body.in_model.base]
        speed, spin = np.split(self.data.qvel[first : first + 6], 2)
        axes = self._pelvis[1] @ self._body.in_model.turn.T  # of the base
        speed = speed + axes @ np.cross(spin, self._at)
        return np.concatenate([speed, self._body.in_model.turn.T @ spin])

    def _beyond(self, joint: int) -> list[int]:
        """Return the bodies that a joint moves."""
        return subtree(self.model, int(self.model.jnt_bodyid[joint]))

    def _legs_touch(self) -> bool:
        pairs = self.model.geom_bodyid[self.data.contact.geom]
        left, right = self._sides
        return any(
            (a in left and b in right) or (a in right and b in left)
            for a, b in pairs.tolist()
        )


def _corners(soles: Soles, legs: Legs) -> list[Array]:
    """Return the corners of each sole, from its ankle along its axes (n, 3) [m]."""
    half = legs.sole_half_width
    box = [(x, y) for x in (legs.sole_rear, legs.sole_front) for y in (-half, half)]
    below = -legs.ankle_height
    return [np.array([(x, y, below) for x, y in of]) for of in soles or (box, box)]


def _tilt(turn: Array) -> tuple[float, float]:
    """Return roll and pitch of R_z(yaw) R_y(pitch) R_x(roll) [rad]."""
    x, y, z = turn[2].tolist()
    return float(np.arctan2(y, z)), float(-np.arctan2(x, np.hypot(y, z)))
