"""The walker: one `step` from sensors to joint targets. No clock, no I/O."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.balance.bounds import sane
from gaitchain.errors import LibraryError
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.keypose.family import KEY_POSES
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
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
from gaitchain.walker.generator import Decision
from gaitchain.walker.keypose_gait import KeyposeGait
from gaitchain.walker.policy_table import Policy
from gaitchain.walker.sensor_check import ABSURD, SensorCheck, mended, unsound
from gaitchain.walker.stride_gait import StrideGait
from gaitchain.walker.target_check import TargetCheck
from gaitchain.walker.warm_up import warm_up

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
        """Take a library, and make the machine code that `step` will run.

        Args:
            library: the gaits.
            policy: how the chain chooses, see `Generator`.
            feedback: whether to balance; else the plan alone is sent to the servos.
            require_qualified: False only for qualifying the library itself.
            period_s: control period [s].
            joint_names: the robot's joints in the order in which sensors come and
                targets go: all leg joints of the library, and any that it holds still;
                the library's own order of the leg joints by default.
            signs: -1 for each joint whose servo is mounted the other way round.

        Raises:
            LibraryError: physics has not passed the library.
            CommandError: a joint's name or sign cannot be.
        """
        if require_qualified and not library.qualified:
            raise LibraryError(
                f"the library for {library.robot.name} is not qualified: physics has "
                "not passed it; build it with `gaitchain build`, which qualifies it"
            )
        kind = _GAITS[library.family.name]
        make = partial(kind, library, policy, feedback=feedback, period_s=period_s)
        warm_up(make, library, period_s, feedback=feedback)
        self.gait = make()
        """What moves the joints: the chain's state, its choices, the plan."""
        legs = library.robot.legs
        self._map = (
            None
            if joint_names is None and not signs
            else JointMap(legs, joint_names, signs)
        )
        self.joint_names: tuple[str, ...] = (
            self.gait.joint_names if self._map is None else self._map.joint_names
        )
        """The order in which sensors come and targets go."""
        self.period_s = period_s
        """Control period [s]."""
        self._sensor_check = SensorCheck(self.joint_names)
        self._target_check = TargetCheck(legs, self.gait.stand)
        self._good: Sensors | None = None

    @classmethod
    def load(
        cls,
        path: str | Path,
        robot: Robot | None = None,
        policy: Policy = "look_ahead",
        **options: Any,
    ) -> "Walker":
        """Load a library's file and take the library.

        Args:
            path: the file.
            robot: the robot that the library must be for; any by default.
            policy: see the constructor.
            options: the constructor's other ones.

        Raises:
            LibraryError: the file is no library, or one for another robot.
        """
        return cls(load_library(path, robot), policy, **options)

    def reset(self) -> None:
        """Stand again, as before the first `step`; the commands stay."""
        self.gait.reset()
        self._good = None

    def command(self, command: Command) -> Command:
        """Ask for a motion from the next step on.

        Returns:
            The command that will be carried out; `note` says why if it is another.
        """
        return self.gait.command(command)

    def follow(self, commands: Sequence[Command]) -> None:
        """Ask for a motion for each of the coming steps; the last one stays.

        Raises:
            CommandError: there is no command.
        """
        self.gait.follow(commands)

    def step(self, sensors: Sensors) -> JointTargets:
        """Return what the servos shall do now; call once per control period.

        Arrays may be anything that holds the right number of numbers: lists, integers,
        views. A measurement that is no number, or an absurd one, is replaced by the
        last good one, joint by joint. Targets are finite and within the joints' ranges,
        see `TargetCheck`. What was replaced is said in the targets' `status`.

        Raises:
            CommandError: an array has not the size that it needs; nothing has changed.
        """
        taken = self._sensor_check.taken(sensors)
        if self._map is None:
            return self._step(taken)
        return self._map.asked(self._step(self._map.sensed(taken)))

    def _step(self, sensors: Sensors) -> JointTargets:
        """Do the same in the library's own order of joints."""
        if _is_sound(sensors):
            self._good = sensors
            return self._target_check.kept(self.gait.step(sensors))
        bad = unsound(sensors)
        self._good = mended(sensors, self._good or _still(self.gait.stand))
        targets = self.gait.step(self._good)
        status = f"no measurement in {', '.join(bad)}: last one used"
        return self._target_check.kept(replace(targets, status=status))

    @property
    def library(self) -> GaitLibrary:
        """The gaits."""
        return self.gait.generator.library

    @property
    def command_range(self) -> CommandRange:
        """The speeds that commands are clamped to, see `GaitLibrary.command_range`."""
        return self.library.command_range

    @property
    def decision(self) -> Decision | None:
        """The latest decision and its runners-up."""
        return self.gait.decision

    @property
    def note(self) -> str:
        """Why the command is not carried out as asked, empty where it is."""
        return self.gait.note

    @property
    def stand(self) -> Array:
        """(n,) targets of the standing pose, in the order of `joint_names` [rad]."""
        return self.standing_targets.position

    @property
    def standing_targets(self) -> JointTargets:
        """The standing pose, as `step` gives its targets."""
        legs = JointTargets(self.gait.joint_names, self.gait.stand)
        return legs if self._map is None else self._map.asked(legs)

    @property
    def standing(self) -> bool:
        """Whether the robot stands still with its feet together."""
        return self.gait.standing


def _is_sound(sensors: Sensors) -> bool:
    """As `unsound`, in machine code."""
    return bool(
        sane(
            sensors.joint_position,
            sensors.joint_velocity,
            sensors.angular_velocity,
            sensors.acceleration,
            ABSURD,
        )
    )


def _still(position: Array) -> Sensors:
    upright = np.array([0.0, 0.0, GRAVITY])
    return Sensors(0.0, position, np.zeros_like(position), np.zeros(3), upright)
