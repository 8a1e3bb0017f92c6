"""Check of the sensor data: arrays of the right type and size, plausible values.

A measurement that is NaN or implausibly large is replaced by the last valid one.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array, Sensors

ABSURD = 1000.0
"""Measurements of this size or more are invalid [rad, rad/s, m/s^2]."""
MEASURED = ("joint_position", "joint_velocity", "angular_velocity", "acceleration")
"""Fields of `Sensors` that a walk needs."""


class SensorCheck:
    """Convert a driver's measurements to new float64 arrays, or reject them.

    Compiled code accepts one type of array; lists, integers, strided views and
    read-only arrays are converted to it here. The arrays are copies, so a driver may
    reuse its own in each period.
    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        """Set the joint names, in the order in which the driver measures them."""
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
            CommandError: an array has the wrong size or holds no numbers.
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
    """Return the loads of the soles; a value that is not finite becomes NaN."""
    loads = np.array(values, dtype=np.float64)
    return np.where(np.isfinite(loads), loads, np.nan)


def unsound(sensors: Sensors) -> list[str]:
    """Return the names of the fields that contain an invalid measurement."""
    timeless = [] if math.isfinite(sensors.time) else ["time"]
    return timeless + [
        n for n in MEASURED if not np.all(np.abs(getattr(sensors, n)) < ABSURD)
    ]


def mended(sensors: Sensors, good: Sensors, passed_s: float) -> Sensors:
    """Replace invalid measurements by valid ones.

    Args:
        sensors: as measured.
        good: sensors without an invalid measurement.
        passed_s: how much later a measurement without a time is [s].
    """
    fields: dict[str, Any] = {}
    if not math.isfinite(sensors.time):
        fields["time"] = good.time + passed_s
    for name in MEASURED:
        values = getattr(sensors, name)
        valid = np.abs(values) < ABSURD
        fields[name] = np.where(valid, values, getattr(good, name))
    return replace(sensors, **fields)
