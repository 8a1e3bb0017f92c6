"""Collect joint states by name from messages, and build messages from them."""

import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gaitchain.backends.ros.messages import Header, JointState, Time
from gaitchain.messages import Array

_APART_S = 0.1
"""A joint whose state is this much older than the newest one is silent [s]."""


class Latest(NamedTuple):
    """The latest state of all joints."""

    time: float
    """Arrival of the newest state; NaN if none was received [s]."""
    position: Array
    """(n,) positions, NaN where unknown [rad]."""
    velocity: Array
    """(n,) velocities, NaN where unknown [rad/s]."""
    effort: Array
    """(n,) torques, NaN where unknown [N m]."""


class JointStates:
    """The latest state of each joint, from messages with any of the joints.

    Thread-safe. Several publishers may each send some of the joints in any order;
    unknown joints are ignored. A missing velocity is computed from two positions and
    the stamps, or arrival times, of their messages.
    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        """Set the joints and their order."""
        self.joint_names = tuple(joint_names)
        self._row = {name: row for row, name in enumerate(joint_names)}
        unknown = np.full((5, len(self.joint_names)), np.nan)
        self._received, self._measured = unknown[:2]
        self._state = unknown[2:]  # position, velocity, effort
        self._lock = threading.Lock()
        self.strangers: tuple[str, ...] = ()
        """The joints of the first message that had none of `joint_names`."""

    def add(self, message: JointState, now: float) -> bool:
        """Add a message.

        Args:
            message: positions, and possibly velocities and efforts.
            now: time of arrival [s].

        Returns:
            Whether the message had positions of any of the joints.
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
            velocity = np.where(np.isfinite(rate), rate, rates)
            self._state[:, rows] = position[pick], velocity, effort
            self._measured[rows], self._received[rows] = stamp, now
        return True

    def _rates(self, rows: Array, position: Array, stamp: float) -> Array:
        """Return velocities from position differences; the last ones at equal times."""
        span = stamp - self._measured[rows]
        before, velocity, _ = self._state[:, rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.where(span == 0.0, velocity, (position - before) / span)
        # No velocity over a negative or long interval, as after a clock adjustment.
        return np.where((span < 0.0) | (span > _APART_S), np.nan, rates)

    def latest(self) -> Latest:
        """Return the latest state of all joints."""
        with self._lock:
            received, state = self._received.copy(), self._state.copy()
        if np.isnan(received).all():
            return Latest(float("nan"), *state)
        newest = float(np.nanmax(received))
        state[:, ~(newest - received <= _APART_S)] = np.nan
        return Latest(newest, *state)

    def missing(self, latest: Latest | None = None) -> tuple[str, ...]:
        """Return the names of the joints whose position is unknown, by default now."""
        unknown = ~np.isfinite((latest or self.latest()).position)
        names = zip(self.joint_names, unknown, strict=True)
        return tuple(name for name, is_unknown in names if is_unknown)


def joint_state(
    time_ns: int,
    joint_names: Sequence[str],
    position: Array,
    velocity: Array,
    effort: Array,
) -> JointState:
    """Return a message with the known states.

    A joint without a position is omitted. Velocities, or efforts, are omitted
    altogether unless they are known for all other joints, as ROS requires.

    Args:
        time_ns: ROS time of the measurement [ns].
        joint_names: names of the joints in the order of the arrays.
        position: (n,) positions, NaN where unknown [rad].
        velocity: (n,) velocities, NaN where unknown [rad/s].
        effort: (n,) torques, NaN where unknown [N m].
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
