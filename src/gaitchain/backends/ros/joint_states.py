"""Joint states by name: gathered from messages, and made into one."""

import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gaitchain.backends.ros.messages import Header, JointState, Time
from gaitchain.messages import Array

_APART_S = 0.1
"""A joint that is that much older than the newest one does not answer [s]."""


class Latest(NamedTuple):
    """The joints as they were last heard of."""

    time: float
    """When the newest was received; NaN if none was [s]."""
    position: Array
    """[rad], NaN where nothing is known"""
    velocity: Array
    """[rad/s]"""
    effort: Array
    """[N m]"""


class JointStates:
    """The latest state of each joint, from messages that may hold any of them.

    Thread-safe. Messages may come from several publishers, each with its own joints, in
    any order; others than those asked for are ignored. Where a velocity is missing it
    is the difference of two positions by the stamps, or arrivals, of their messages.
    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        """Set the joints and their order."""
        self.joint_names = tuple(joint_names)
        self._row = {name: row for row, name in enumerate(joint_names)}
        n = len(self.joint_names)
        self._received, self._measured = np.full(n, np.nan), np.full(n, np.nan)
        self._position, self._velocity = np.full(n, np.nan), np.full(n, np.nan)
        self._effort = np.full(n, np.nan)
        self._lock = threading.Lock()
        self.strangers: tuple[str, ...] = ()
        """The joints of a message that had none of those asked for."""

    def add(self, message: JointState, now: float) -> bool:
        """Take a message in.

        Args:
            message: positions, maybe velocities and efforts.
            now: when it was received [s].

        Returns:
            Whether it had anything to say of these joints.
        """
        names, position = message.name, message.position
        if len(position) != len(names):
            return False
        pick = [i for i, name in enumerate(names) if name in self._row]
        if not pick:
            self.strangers = self.strangers or names
            return False
        rows = np.array([self._row[names[i]] for i in pick])
        stamp = message.header.stamp.ns * 1e-9 or now
        rate, effort = (
            part[pick] if len(part) == len(names) else np.full(len(pick), np.nan)
            for part in (message.velocity, message.effort)
        )
        with self._lock:
            rates = self._rates(rows, position[pick], stamp)
            self._velocity[rows] = np.where(np.isfinite(rate), rate, rates)
            self._position[rows], self._measured[rows] = position[pick], stamp
            self._effort[rows], self._received[rows] = effort, now
        return True

    def _rates(self, rows: Array, position: Array, stamp: float) -> Array:
        """Differences to the last positions; what was, where no time has passed."""
        span = stamp - self._measured[rows]
        moved = position - self._position[rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.where(span == 0.0, self._velocity[rows], moved / span)
        # A clock that was set back, or by more than a moment ahead, gives no rate.
        return np.where((span < 0.0) | (span > _APART_S), np.nan, rates)

    def latest(self) -> Latest:
        """Return all joints as they were last heard of."""
        with self._lock:
            received = self._received.copy()
            arrays = [self._position.copy(), self._velocity.copy(), self._effort.copy()]
        if np.isnan(received).all():
            return Latest(float("nan"), *arrays)
        newest = float(np.nanmax(received))
        late = ~(newest - received <= _APART_S)
        for array in arrays:
            array[late] = np.nan
        return Latest(newest, *arrays)

    def missing(self) -> tuple[str, ...]:
        """Return the joints whose position is not known now."""
        unknown = ~np.isfinite(self.latest().position)
        names = zip(self.joint_names, unknown, strict=True)
        return tuple(name for name, is_unknown in names if is_unknown)


def joint_state(
    time_ns: int,
    joint_names: Sequence[str],
    position: Array,
    velocity: Array,
    effort: Array,
) -> JointState:
    """Return a message of what is known.

    A joint without a position is left out. Velocities or efforts that are not known of
    all the others are left out altogether, as ROS has it.

    Args:
        time_ns: ROS time of the measurement [ns].
        joint_names: in the order of the arrays.
        position: [rad]
        velocity: [rad/s]
        effort: [N m]
    """
    known = np.isfinite(position)
    rates, efforts = velocity[known], effort[known]
    empty = np.zeros(0)
    return JointState(
        header=Header(stamp=Time.at(time_ns)),
        name=tuple(n for n, k in zip(joint_names, known, strict=True) if k),
        position=position[known],
        velocity=rates if np.isfinite(rates).all() else empty,
        effort=efforts if np.isfinite(efforts).all() else empty,
    )
