"""The walker: sensors to joint targets by one `step` a period. No clock, no I/O."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np

from gaitchain.balance.bounds import sane
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.keypose.family import KEY_POSES
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import check_library, load_library
from gaitchain.gait.limits import check_period, is_real
from gaitchain.gait.stride.family import STRIDES
from gaitchain.messages import (
    CONTROL_PERIOD_S,
    GRAVITY,
    Array,
    Command,
    JointTargets,
    Sensors,
)
from gaitchain.robot.joint_map import JointMap
from gaitchain.robot.robot import Robot
from gaitchain.walker.footsteps import Footstep
from gaitchain.walker.generator import Decision
from gaitchain.walker.keypose_gait import KeyposeGait
from gaitchain.walker.leg_odometry import LegOdometry
from gaitchain.walker.lying import Lying
from gaitchain.walker.motor_targets import MotorForm
from gaitchain.walker.mounting import Mounting
from gaitchain.walker.odometry import Odometry
from gaitchain.walker.place import ORIGIN, Place
from gaitchain.walker.policy_table import Policy
from gaitchain.walker.sensor_check import (
    LIMITS,
    GyroCheck,
    SensorCheck,
    mended,
    unsound,
)
from gaitchain.walker.stride_gait import StrideGait
from gaitchain.walker.target_check import TargetCheck
from gaitchain.walker.warm_up import warm_up
from gaitchain.walker.waypoints import Near, Way, check_way

_LIMITS = np.array(list(LIMITS.values()))
_GAITS: dict[str, type[KeyposeGait] | type[StrideGait]] = {
    KEY_POSES.name: KeyposeGait,
    STRIDES.name: StrideGait,
}


class Walker:
    """Turn commands into joint targets, one control period at a time."""

    def __init__(
        self,
        library: GaitLibrary,
        policy: Policy = "look_ahead",
        *,
        feedback: bool = True,
        require_qualified: bool = True,
        period_s: float = CONTROL_PERIOD_S,
        joint_names: Sequence[str] | None = None,
        signs: Mapping[str, int] | None = None,
    ) -> None:
        """Prepare a library for walking, and compile the code that `step` runs.

        Args:
            library: the gaits.
            policy: selection rule of the chain, see `Generator`.
            feedback: whether to balance; otherwise the plan goes to the servos as is.
            require_qualified: False only for qualifying the library itself.
            period_s: control period, at which `step` is called [s].
            joint_names: the robot's joints in the order of sensors and targets: all leg
                joints of the library, and any joints that it holds still; by default
                the leg joints in the library's order.
            signs: -1 for each joint whose servo is mounted the other way round.

        Raises:
            LibraryError: the library is not qualified, or none.
            CommandError: a joint's name is unknown, or its sign is not 1 or -1; the
                policy is none, or the control period is none or too long for the steps.
        """
        check_library(library)
        _check_policy(policy)
        check_step_period(period_s, library)
        if require_qualified and not library.qualified:
            raise LibraryError(
                f"the library for {library.robot.name} is not qualified: physics has "
                "not passed it; build it with `gaitchain build`, which qualifies it"
            )
        legs = library.robot.legs
        given = joint_names is not None or signs is not None
        self._map = JointMap(legs, joint_names, signs) if given else None
        kind = _GAITS[library.family.name]
        make = partial(kind, library, policy, feedback=feedback, period_s=period_s)
        warm_up(make, library, period_s, feedback=feedback)
        self.gait = make()
        """The gait of the library's family: state of the chain, decisions and plan."""
        found = library.robot.identified
        self._mounting = None if found is None else Mounting(found)
        self.joint_names: tuple[str, ...] = (
            self.gait.joint_names if self._map is None else self._map.joint_names
        )
        """Joints in the order of sensors and targets."""
        self.period_s = period_s
        """Control period [s]."""
        self._sensor_check = SensorCheck(self.joint_names)
        self._target_check = TargetCheck(legs, self.gait.stand)
        self._motor_form = MotorForm(legs)
        self._gyro_check = GyroCheck()
        self._good: Sensors | None = None
        self._way: Way | None = None
        self._odometry: LegOdometry | None = None
        self._lying: Lying | None = None

    @classmethod
    def load(
        cls,
        path: str | Path,
        robot: Robot | None = None,
        policy: Policy = "look_ahead",
        **options: Any,
    ) -> "Walker":
        """Create a walker from the file of a library.

        Args:
            path: the file.
            robot: the robot that the library must be for; any by default.
            policy: see the constructor.
            options: other arguments of the constructor.

        Raises:
            LibraryError: the file is not a library, or is one for another robot.
        """
        return cls(load_library(path, robot), policy, **options)

    def reset(self, *, fell: bool = False) -> None:
        """Return to the standing state before the first `step`; keep the commands.

        A way to a place ends, and its command with it.

        Args:
            fell: whether its place goes on, as of a robot that fell and got up: the
                feet's middle is that of before the fall, and the heading by the gyro,
                where `lie` was called since then. By default the place begins anew,
                where the robot stands now.
        """
        if self._way is not None:
            self.gait.command(self.gait.commanded.halted)
        here = self.place or ORIGIN
        yaw = None if self._lying is None else self._lying.yaw
        if fell:
            self.gait.reset(here if yaw is None else here._replace(yaw=yaw))
        else:
            self.gait.reset()
        self._gyro_check = GyroCheck()
        self._good = self._way = self._lying = None
        if self._odometry is not None and fell:
            self._odometry.rise(yaw)
        elif self._odometry is not None:
            self._odometry.reset()

    def lie(self, sensors: Sensors) -> None:
        """Follow the attitude of a robot that is not balanced, as it falls and lies.

        Called in place of `step`, once per control period, until `reset` with `fell`.

        Args:
            sensors: as for `step`.

        Raises:
            CommandError: an array has the wrong size; the walker's state is unchanged.
        """
        sensors, estimate = self._taken(sensors), self.gait.estimate
        if estimate is None or self.place is None:
            return
        if self._lying is None:
            self._lying = Lying(estimate, self.gait.gyro_bias, self.period_s)
        believed, bad = self._believed(sensors)
        self._lying.feel(believed, measured="angular_velocity" not in bad)

    def keep_odometry(self) -> None:
        """Keep up `odometry` from the next `step` on; key poses have none.

        It begins at `place`, with no uncertainty.
        """
        if self.place is not None:
            self._odometry = LegOdometry(self.library, self.period_s, self.place)

    def command(self, command: Command) -> Command:
        """Set the command for all steps from the next one on.

        Returns:
            The command after clamping; if it was changed, `note` gives the reason.

        Raises:
            CommandError: it is no command, or one without numbers.
        """
        _check_command(command)
        self._way = None
        return self.gait.command(command)

    def follow(self, commands: Sequence[Command]) -> None:
        """Set one command for each coming step; the last one stays in force.

        A stop that is followed by another command is stood on for the time of a step.

        Raises:
            CommandError: `commands` is empty, or one of them is no command.
        """
        if not isinstance(commands, Sequence):
            raise CommandError(f"commands {commands!r}: give a list of Command")
        for command in commands:
            _check_command(command)
        self.gait.follow(commands)
        self._way = None

    def go_to(self, goal: Place, near: Near | None = None, crouch: float = 0.0) -> None:
        """Walk to a place and stand there, as far as the robot's own steps tell.

        Each `step` gives the command that is soonest there; any `command` or `follow`
        ends the way. Where the feet slip, so does the place: see `place`.

        Args:
            goal: x and y of the middle between the feet, and heading, from where the
                robot stood at its start or last `reset` [m, m, rad].
            near: how near counts as there; by default 0.02 leg and 2 deg, or
                0.06 leg where the library does not walk to all sides.
            crouch: hips lower by this on the way [m].

        Raises:
            CommandError: the library is of key poses, which do not measure where the
                robot is, or the place is not finite, further than 1 km away, or in
                a direction that the range of its commands lacks, nothing is so near,
                or the crouch is no depth.
        """
        here = self.place
        if here is None:
            raise CommandError(
                "go_to: key poses do not measure where the robot is; it needs a "
                "library of strides, as preset 'brisk' builds"
            )
        if not is_real(crouch) or not 0.0 <= crouch < math.inf:
            raise CommandError(f"crouch {crouch!r:.80}: need 0 or more [m], as 0.01")
        way = Way.of(self.library, goal, near, crouch)
        check_way(here, goal, self.command_range, way.near)
        self._way = way

    def follow_steps(self, steps: Sequence[Footstep]) -> None:
        """Make given footsteps from a stand, then stand.

        The other foot is put beside the last one, unless it is there. Each landing is
        made from where the support foot is, as the legs measured it, so what a step
        misses the next one makes up for. Any `command`, `follow` or `go_to` ends it.

        Args:
            steps: landings, left and right by turns, in the frame of `place`.

        Raises:
            CommandError: the robot does not stand, the library is of key poses, or a
                step is none that physics passed after the one before; the message has
                its number, and what could be made.
        """
        if not isinstance(self.gait, StrideGait):
            raise CommandError(
                "footsteps need a library of strides, as preset 'brisk' builds"
            )
        self.gait.follow_steps(steps)
        self._way = None

    @property
    def goal(self) -> Place | None:
        """Where `go_to` leads; None without it."""
        return None if self._way is None else self._way.goal

    @property
    def arrived(self) -> bool:
        """Whether the robot stands at its `goal`."""
        place = self.place
        if self._way is None or place is None:
            return False
        return self.standing and self._way.ends_at(place)

    def step(self, sensors: Sensors) -> JointTargets:
        """Compute the joint targets; call once per control period.

        Sensor arrays may be lists, integers or views of the right size. A measurement
        that is NaN or implausibly large is replaced by the last valid one, joint by
        joint, and so is a single sample of the gyro that jumps by `GYRO_JUMP`. Targets
        are finite and within the joints' ranges, see `TargetCheck`. The targets'
        `status` names what was replaced.

        Raises:
            CommandError: an array has the wrong size; the walker's state is unchanged.
        """
        return self._sent(self._step(self._taken(sensors)))

    def _taken(self, sensors: Sensors) -> Sensors:
        """Return sensors as the library has them."""
        taken = self._sensor_check.taken(sensors)
        if self._map is not None:
            taken = self._map.sensed(taken)
        return taken if self._mounting is None else self._mounting.sensed(taken)

    def _sent(self, targets: JointTargets) -> JointTargets:
        """Return targets as the robot's servos take them, in its own order."""
        if self._mounting is not None:
            targets = self._mounting.asked(targets)
        return targets if self._map is None else self._map.asked(targets)

    def _step(self, sensors: Sensors) -> JointTargets:
        """Do the same with the joints as the library has them."""
        self._lying = None
        if self._way is not None and (place := self.stop_place) is not None:
            way, stepping = self._way, self.gait.stepping
            self.gait.command(way.command(place, stepping=stepping))
        believed, bad = self._believed(sensors)
        targets = self.gait.step(believed)
        self._move(believed)
        if bad:
            status = f"no measurement in {', '.join(bad)}: last one used"
            targets = replace(targets, status=status)
        return self._checked(targets)

    def _believed(self, sensors: Sensors) -> tuple[Sensors, list[str]]:
        """Replace what cannot have been measured; return the names of it, too."""
        bad = [] if _is_sound(sensors) else unsound(sensors)
        if bad:
            good = self._good or _still(self.gait.stand)
            sensors = mended(sensors, good, self.period_s)
        self._good = self._gyro_check.believed(sensors)
        if self._good is not sensors:
            bad.append("angular_velocity")
        return self._good, bad

    def _move(self, sensors: Sensors) -> None:
        """Let the odometry go on, if it is kept up."""
        gait, estimate = self.gait, self.gait.estimate
        if self._odometry is None or estimate is None:
            return
        support = None if gait.standing else gait.support
        joints, stepping = sensors.joint_position, gait.stepping
        self._odometry.update(joints, estimate, support, stepping=stepping)

    def _checked(self, asked: JointTargets) -> JointTargets:
        """Return valid targets, also for motor drivers."""
        kept = self._target_check.kept(asked)
        effort = self.gait.effort if kept is asked else None  # else they are held
        motors = self._motor_form.made(kept.position, effort)
        return JointTargets(kept.joint_names, kept.position, kept.status, motors)

    @property
    def library(self) -> GaitLibrary:
        """The gaits."""
        return self.gait.generator.library

    @property
    def command_range(self) -> CommandRange:
        """The speeds that commands are clamped to, see `GaitLibrary.command_range`."""
        return self.library.command_range

    @property
    def commanded(self) -> Command:
        """The command in force, after clamping: given, or that of the way to a goal."""
        return self.gait.commanded

    @property
    def footsteps_left(self) -> int:
        """Number of footsteps, given by `follow_steps`, that have not begun."""
        return self.gait.footsteps_left

    @property
    def feet(self) -> tuple[Place, Place] | None:
        """Left and right ankle, in the frame of `place`; None for key poses."""
        return self.gait.feet

    @property
    def place(self) -> Place | None:
        """Where the robot is by its own steps, from where it stood at the start.

        Each step as the legs and the gyro measured it, and what feet usually slide in
        it, added up: it drifts. After a fall see `reset`. None for a library of key
        poses.
        """
        return self.gait.place

    @property
    def stop_place(self) -> Place | None:
        """Where the robot comes to stand if it is told to stop now.

        The step in hand lands as planned, and the other foot beside it; what is
        commanded now moves the robot from there. None for key poses.
        """
        return self.gait.stop_place

    @property
    def odometry(self) -> Odometry | None:
        """Where the trunk is by legs and gyro, and how sure; see `LegOdometry`.

        None before `keep_odometry`, and for key poses.
        """
        return None if self._odometry is None else self._odometry.latest

    @property
    def tilt(self) -> tuple[float, float] | None:
        """Estimated roll and pitch of the trunk, also where the robot lies [rad].

        By `step`, or by `lie` where that was called last; None for key poses.
        """
        if self._lying is not None:
            return self._lying.tilt
        found = self.gait.estimate
        return None if found is None else (found.roll, found.pitch)

    @property
    def decision(self) -> Decision | None:
        """Latest decision and its runners-up; None before the first."""
        return self.gait.decision

    @property
    def note(self) -> str:
        """Reason why the command was changed; empty if it was not."""
        return self.gait.note

    @property
    def stand(self) -> Array:
        """(n,) angles of the standing pose, in the order of `joint_names` [rad]."""
        stand = JointTargets(self.gait.joint_names, self.gait.stand)
        return self._sent(stand).position

    @property
    def standing_targets(self) -> JointTargets:
        """Targets that keep the standing pose, in the form that `step` returns.

        For strides they bear the robot's weight, so that joints are as in `stand`.
        """
        stand = self.gait.stand_targets
        motors = self._motor_form.made(stand, None)
        return self._sent(JointTargets(self.gait.joint_names, stand, motors=motors))

    @property
    def standing(self) -> bool:
        """Whether the robot stands still with its feet side by side."""
        return self.gait.standing


def _check_command(command: object) -> None:
    """Refuse what no walk can be asked for; NaN is a number, and stops."""
    such = "give one such as Command(vx=0.2)"
    if not isinstance(command, Command):
        raise CommandError(f"{command!r:.80} is no command; {such}")
    for name, value in vars(command).items():
        if not is_real(value):
            raise CommandError(
                f"{name} is {value!r:.80}, no number of a float's size; {such}"
            )


def _check_policy(policy: str) -> None:
    known = get_args(Policy)
    if policy not in known:
        raise CommandError(f"policy {policy!r}: it must be {' or '.join(known)}")


def check_step_period(period_s: float, library: GaitLibrary) -> None:
    """Refuse a period in which a swing foot goes up, or down, in less than two.

    Raises:
        CommandError: the control period is too long for the steps, or none.
    """
    check_period(period_s)
    most = 0.5 * min(library.timing.rise, library.timing.fall)
    if period_s > most:
        raise CommandError(
            f"control period {period_s:g} s: for steps of {library.timing.step:.3g} s "
            f"it must be above 0 and at most {most:.3g} s"
        )


def _is_sound(sensors: Sensors) -> bool:
    """Whether all measurements are valid; `unsound` in compiled code."""
    return math.isfinite(sensors.time) and bool(
        sane(
            sensors.joint_position,
            sensors.joint_velocity,
            sensors.angular_velocity,
            sensors.acceleration,
            _LIMITS,
        )
    )


def _still(position: Array) -> Sensors:
    """Return the sensors of an upright robot at rest."""
    upright = np.array([0.0, 0.0, GRAVITY])
    return Sensors(0.0, position, np.zeros_like(position), np.zeros(3), upright)
