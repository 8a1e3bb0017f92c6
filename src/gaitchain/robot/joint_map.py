"""Map a robot's own joint order and signs to the library's, and back. No I/O."""

import difflib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import JointTargets, MotorTargets, Sensors
from gaitchain.robot.leg_model import LegModel

_NEAR = 3  # number of similar names suggested for an unknown one


class JointMap:
    """The map between the joints of a robot's interface and those of its library."""

    def __init__(
        self,
        model: LegModel,
        joint_names: Sequence[str] | None = None,
        signs: Mapping[str, int] | None = None,
    ) -> None:
        """Match the names.

        Args:
            model: leg model of the library's robot, with leg joints and held joints.
            joint_names: the robot's joints in its own order; by default the library's
                leg joints in the library's order.
            signs: -1 for each joint whose positive direction is opposite.

        Raises:
            CommandError: the names are no list or the signs no table, a name is
                unknown, repeated or missing, or a sign is neither 1 nor -1.
        """
        legs, held = model.joint_names, model.held
        names = _given_names(legs if joint_names is None else joint_names)
        signs = _given_signs(signs)
        _check_names(names, legs, held)
        _check_signs(signs, names)
        self.joint_names = names
        """The robot's joints in its own order."""
        sign = np.array([float(signs.get(name, 1)) for name in names])
        self._rows = np.array([names.index(name) for name in legs])
        self._signs = sign[self._rows]
        self._still = sign * [held.get(name, 0.0) for name in names]

    def sensed(self, sensors: Sensors) -> Sensors:
        """Return the sensors with leg joints only, in the library's order and signs."""
        return replace(
            sensors,
            joint_position=self._signs * sensors.joint_position[self._rows],
            joint_velocity=self._signs * sensors.joint_velocity[self._rows],
        )

    def asked(self, targets: JointTargets) -> JointTargets:
        """Return targets in the robot's order and signs; non-leg joints are held."""
        position = self._still.copy()
        position[self._rows] = self._signs * targets.position
        motors = targets.motors and self._driven(targets.motors)
        return replace(
            targets, joint_names=self.joint_names, position=position, motors=motors
        )

    def _driven(self, motors: MotorTargets) -> MotorTargets:
        """Return motor targets in the robot's order and signs."""
        position = self._still.copy()
        position[self._rows] = self._signs * motors.position
        others = np.full((4, len(position)), np.nan)
        others[:2] = 0.0
        others[0, self._rows] = self._signs * motors.velocity
        others[1, self._rows] = self._signs * motors.torque
        others[2:, self._rows] = motors.stiffness, motors.damping
        return MotorTargets(position, *others)


def _given_signs(signs: object) -> Mapping[str, int]:
    """Return what was given as the signs of joints; none by default.

    Raises:
        CommandError: they do not go by the joints' names.
    """
    if signs is None:
        return {}
    if not isinstance(signs, Mapping):
        raise CommandError(
            f"signs {signs!r:.80}: give a dict by name, such as {{'left_knee': -1}}"
        )
    return signs


def _given_names(names: object) -> tuple[str, ...]:
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise CommandError(
            f"joint_names {names!r:.80}: give a list of names, such as ['left_knee']"
        )
    return tuple(names)


def _check_names(
    names: Sequence[str], legs: Sequence[str], held: Iterable[str]
) -> None:
    known = [*legs, *held]
    for name in names:
        if not isinstance(name, str) or name not in known:
            near = difflib.get_close_matches(str(name), known, n=_NEAR) or list(legs)
            raise CommandError(
                f"joint_names: {name!r} is no joint of the library's robot; near: "
                f"{', '.join(near)}"
            )
    twice = [name for name, times in Counter(names).items() if times > 1]
    if twice:
        raise CommandError(f"joint_names: {', '.join(twice)} twice; give each once")
    missing = [name for name in legs if name not in names]
    if missing:
        raise CommandError(
            f"joint_names: {', '.join(missing)} missing; all {len(legs)} leg joints "
            f"are needed: {', '.join(legs)}"
        )


def _check_signs(signs: Mapping[str, int], names: Sequence[str]) -> None:
    for name, sign in signs.items():
        if name not in names:
            near = difflib.get_close_matches(str(name), names, n=_NEAR) or list(names)
            raise CommandError(
                f"signs: {name!r} is not among the joints; near: {', '.join(near)}"
            )
        if sign not in (1, -1):
            raise CommandError(f"signs: {name} = {sign!r}; give 1 or -1")
