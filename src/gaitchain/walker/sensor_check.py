"""What drivers measure, as the walk needs it: arrays of the right kind and size.

A measurement that is no number, or an absurd one, is replaced by the last good one.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array, Sensors

ABSURD = 1000.0
"""No robot measures this [rad, rad/s, m/s^2]."""
MEASURED = ("joint_position", "joint_velocity", "angular_velocity", "acceleration")
"""What a walk needs of `Sensors`."""


class SensorCheck:
    """Turn what a driver gives into new float64 arrays, or say what is wrong with it.

    Machine code is made for one kind of array; lists, integers, views with strides and
    read-only arrays become that kind here. The arrays are the walker's own, so a driver
    may fill the same ones in each period.
    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        """Take the robot's joints, in the order in which they are measured."""
        joints = (len(joint_names),), f"one for each of {', '.join(joint_names)}"
        axes = (3,), "x, y, z in the trunk's frame"
        self._joints, self._axes = joints[0], axes[0]
        self._needed = {
            "joint_position": joints,
            "joint_velocity": joints,
            "angular_velocity": axes,
            "acceleration": axes,
            "foot_load": ((2,), "left and right sole, or None"),
        }

    def taken(self, sensors: Sensors) -> Sensors:
        """Return the same measurements in new arrays.

        Raises:
            CommandError: an array has another size, or holds no numbers.
        """
        load = sensors.foot_load
        try:
            made = Sensors(
                float(sensors.time),
                np.array(sensors.joint_position, np.float64),
                np.array(sensors.joint_velocity, np.float64),
                np.array(sensors.angular_velocity, np.float64),
                np.array(sensors.acceleration, np.float64),
                None if load is None else _loads(load),
            )
        except (TypeError, ValueError):
            raise self._refusal(sensors) from None
        if (
            made.joint_position.shape == made.joint_velocity.shape == self._joints
            and made.angular_velocity.shape == made.acceleration.shape == self._axes
            and (load is None or np.shape(load) == (2,))
        ):
            return made
        raise self._refusal(sensors)

    def _refusal(self, sensors: Sensors) -> CommandError:
        for name, (shape, what) in self._needed.items():
            value = getattr(sensors, name)
            if value is None and name == "foot_load":
                continue
            try:
                found = np.array(value, dtype=np.float64).shape
            except (TypeError, ValueError):
                return CommandError(f"sensors: {name} holds no numbers: {value!r:.80}")
            if found != shape:
                size = f"{found[0]} values" if len(found) == 1 else f"shape {found}"
                return CommandError(
                    f"sensors: {name} has {size}, needs {shape[0]}: {what}"
                )
        return CommandError(f"sensors: time is {sensors.time!r:.80}, must be seconds")


def _loads(values: Any) -> Array:
    """Return the soles' loads; one that is not finite counts as not measured."""
    loads = np.array(values, dtype=np.float64)
    return np.where(np.isfinite(loads), loads, np.nan)


def unsound(sensors: Sensors) -> list[str]:
    """Return the names of what holds a number that cannot be."""
    return [n for n in MEASURED if not np.all(np.abs(getattr(sensors, n)) < ABSURD)]


def mended(sensors: Sensors, good: Sensors) -> Sensors:
    """Return the sensors with good numbers in place of those that cannot be.

    Args:
        sensors: as measured.
        good: whole ones.
    """
    whole: dict[str, Any] = {}
    if not math.isfinite(sensors.time):
        whole["time"] = good.time
    for name in MEASURED:
        values = getattr(sensors, name)
        sound = np.abs(values) < ABSURD
        whole[name] = np.where(sound, values, getattr(good, name))
    return replace(sensors, **whole)
