"""A backend that cannot end the loop, and when to try to reach it again."""

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from gaitchain.backends.base import (
    Backend,
    Bounded,
    LinkHealth,
    MotorDriven,
    SimulatedTruth,
    WholeBodied,
)
from gaitchain.errors import BackendError
from gaitchain.messages import Array, MotorTargets, Sensors
from gaitchain.walker.sensor_check import in_arrays

_FIRST_S, _LONGEST_S = 1.0, 10.0
_ASKED = 10  # times, before a joint counts as one that does not answer
_log = logging.getLogger(__name__)
_T = TypeVar("_T")


class SafeBackend:
    """Another backend, of which nothing but `BackendError` comes out.

    Backends are also written by others. Whatever else they raise is logged once, with
    its trace, and reported to the driver.
    """

    def __init__(self, backend: Backend, joints: int) -> None:
        """Take a backend.

        Args:
            backend: the robot.
            joints: how many it has to measure.
        """
        self._backend, self._joints = backend, joints
        self.physical, self.load_unit = backend.physical, backend.load_unit
        self.simulator: SimulatedTruth | None = None
        """The backend, if it is a simulator; None for a real robot."""
        if not backend.physical and isinstance(backend, SimulatedTruth):
            self.simulator = backend
        self._whole = backend if isinstance(backend, WholeBodied) else None
        self.whole_joint_names = self._whole.whole_joint_names if self._whole else ()
        """All joints that it can move; none where these are only the legs."""
        self._logged = self._held = ""

    @property
    def has_imu(self) -> bool:
        """Whether gyro and accelerometer are heard; behind ROS they may come late."""
        return self._backend.has_imu

    @property
    def limits(self) -> tuple[Array, Array] | None:
        """Ends of what its servos take, once connected [rad]; None for any angle."""
        bounded = self._backend
        if not isinstance(bounded, Bounded):
            return None
        return self._trying("say its limits", lambda: bounded.limits)

    def connect(self, position: Array) -> None:
        """Take hold of the robot."""
        self._trying("connect", lambda: self._backend.connect(position))
        self._held = ""

    def read(self) -> Sensors:
        """Return the latest measurements, in new arrays of the right shapes."""
        return self._trying("read", lambda: _sound(self._backend.read(), self._joints))

    def write(self, position: Array, motors: MotorTargets | None = None) -> None:
        """Send joint targets.

        Args:
            position: for position servos [rad].
            motors: the same for motor drivers, sent instead where the backend takes
                them; None while no gait moves the joints.
        """
        driven = self._backend
        if motors is not None and isinstance(driven, MotorDriven):
            self._trying("drive", lambda: driven.drive(motors))
        else:
            self._trying("write", lambda: self._backend.write(position))

    def read_whole(self) -> Sensors:
        """Return the latest measurements of all joints."""
        whole = self._whole
        assert whole is not None  # there are `whole_joint_names`
        count = len(self.whole_joint_names)
        return self._trying(
            "read all joints", lambda: _sound(whole.read_whole(), count)
        )

    def where(self, names: Sequence[str]) -> Array:
        """Return where the joints are [rad]; those that do not answer are asked again.

        Args:
            names: of the joints, for the error.

        Raises:
            BackendError: one does not answer, however often it is asked.
        """
        return _where(self.read, names)

    def where_whole(self) -> Array:
        """Return the same of all joints."""
        return _where(self.read_whole, self.whole_joint_names)

    def write_whole(self, position: Array) -> None:
        """Send targets of all joints [rad]."""
        whole = self._whole
        assert whole is not None  # there are `whole_joint_names`
        self._trying("write all joints", lambda: whole.write_whole(position))

    def engage(self) -> None:
        """Turn the torque on."""
        self._trying("engage", self._backend.engage)

    def release(self) -> None:
        """Turn the torque off; where that fails, `health` says so."""
        try:
            self._trying("release", self._backend.release)
            self._held = ""
        except BackendError as error:
            self._held = f"NOT known to have let go: {error}"

    def loads(self) -> Array:
        """Return what the motors bore, NaN where unknown."""
        try:
            return self._trying(
                "return loads", lambda: _sized(self._backend.loads(), self._joints)
            )
        except BackendError:
            return np.full(self._joints, np.nan)

    def health(self) -> LinkHealth:
        """Return how well the robot was reached so far."""
        try:
            health = self._trying("return its health", self._backend.health)
        except BackendError as error:
            health = LinkHealth(note=str(error))
        if not self._held:
            return health
        note = "; ".join(filter(None, (health.note, self._held)))
        return replace(health, note=note, holds=True)

    def close(self) -> None:
        """Let go of the robot."""
        try:
            self._backend.close()
        except Exception:
            _log.exception("closing the backend")

    def _trying(self, what: str, act: Callable[[], _T]) -> _T:
        try:
            return act()
        except BackendError:
            raise
        except Exception as error:
            said = f"the backend failed to {what}: {type(error).__name__}: {error}"
            if said != self._logged:
                _log.exception("%s", said)
            self._logged = said
            raise BackendError(said) from error


def _sound(sensors: Sensors, joints: int) -> Sensors:
    """Return the same measurements in arrays that all parts of the loop compute with.

    Raises:
        TypeError, ValueError: they are no numbers, or too many or too few.
    """
    made = in_arrays(sensors)
    for values in (made.joint_position, made.joint_velocity):
        _sized(values, joints)
    for values in (made.angular_velocity, made.acceleration):
        _sized(values, 3)
    if made.foot_load is not None:
        _sized(made.foot_load, 2)
    return made


def _sized(values: ArrayLike, count: int) -> Array:
    found = np.array(values, np.float64)
    if found.shape != (count,):
        raise ValueError(f"{found.shape} numbers, not ({count},)")
    return found


def _where(read: Callable[[], Sensors], names: Sequence[str]) -> Array:
    found = np.full(len(names), np.nan)
    for _ in range(_ASKED):
        found = np.where(np.isnan(found), read().joint_position, found)
        if np.isfinite(found).all():
            return found
    silent = [n for n, q in zip(names, found, strict=True) if not np.isfinite(q)]
    raise BackendError(
        f"no answer of {', '.join(silent)}, asked {_ASKED} times; check cables and "
        "supply"
    )


class Backoff:
    """When to try again what failed: soon at first, then ever less often."""

    def __init__(self) -> None:
        """Try at once."""
        self._pause_s, self._due_s = 0.0, -math.inf

    def cancel(self) -> None:
        """Try no more: it was done, or is no longer wanted."""
        self._pause_s, self._due_s = 0.0, math.inf

    def failed(self, now_s: float) -> float:
        """Return after how long to try again [s].

        Args:
            now_s: when it failed [s].
        """
        self._pause_s = min(max(2.0 * self._pause_s, _FIRST_S), _LONGEST_S)
        self._due_s = now_s + self._pause_s
        return self._pause_s

    def due(self, now_s: float) -> bool:
        """Return whether to try now [s]."""
        return now_s >= self._due_s
