"""Check of the sensor data: arrays of the right type and size, plausible values.

A measurement that is NaN or implausibly large is replaced by the last valid one, and so
is a single sample of the gyro that is far from those around it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Real
from types import MappingProxyType
from typing import Any

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.gait.limits import is_real
from gaitchain.messages import Array, Sensors

ABSURD = 1000.0
"""Numbers of this size or more are no measurement, whatever they are of."""
LIMITS: Mapping[str, float] = MappingProxyType(
    {
        "joint_position": ABSURD,
        "joint_velocity": ABSURD,
        "angular_velocity": 40.0,  # gyros of robots end at 2000 deg/s
        "acceleration": 320.0,  # their accelerometers at 32 g
    }
)
"""Fields of `Sensors` that a walk needs; values of this size or more are invalid."""
GYRO_JUMP = 5.0
"""A gyro's sample further from the one before is believed once the next one agrees. A
trunk that falls turns by sqrt(3 g / h), which is that for a height h of 1.2 m, and only
the floor changes that at once. In 10 ms of simulation it was 0.7 rad/s where robots
walked, 2.3 where they were pushed over, and 9 on the floor [rad/s]."""


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
        try:
            made = in_arrays(sensors)
        except (AttributeError, TypeError, ValueError):
            raise self._refusal(sensors) from None
        if (
            made.joint_position.shape == made.joint_velocity.shape == self._joints
            and made.angular_velocity.shape == made.acceleration.shape == self._axes
            and (made.foot_load is None or made.foot_load.shape == (2,))
        ):
            return made
        raise self._refusal(sensors)

    def _refusal(self, sensors: Sensors) -> CommandError:
        if not isinstance(sensors, Sensors):
            return CommandError(f"sensors: {sensors!r:.80}: give gaitchain.Sensors")
        for name, (shape, what) in self._needed.items():
            value = getattr(sensors, name)
            if value is None and name == "foot_load":
                continue
            try:
                found = np.array(_in_doubles(value), dtype=np.float64).shape
            except (TypeError, ValueError):
                return CommandError(f"sensors: {name} holds no numbers: {value!r:.80}")
            if found != shape:
                size = f"{found[0]} values" if len(found) == 1 else f"shape {found}"
                return CommandError(
                    f"sensors: {name} has {size}, needs {shape[0]}: {what}"
                )
        return CommandError(f"sensors: time is {sensors.time!r:.80}, must be seconds")


def in_arrays(sensors: Sensors) -> Sensors:
    """Return the same measurements in new arrays, of whatever size.

    A whole number that is too large for a double becomes NaN.

    Raises:
        TypeError, ValueError: they are no numbers.
    """
    try:
        return _converted(sensors)
    except OverflowError:
        held = {name: _in_doubles(value) for name, value in vars(sensors).items()}
        return _converted(Sensors(**held))


def _in_double(value: object) -> object:
    """Return NaN for a number that is too large for a double, else the value."""
    return math.nan if isinstance(value, Real) and not is_real(value) else value


_in_doubles = np.frompyfunc(_in_double, 1, 1)


def _converted(sensors: Sensors) -> Sensors:
    load = sensors.foot_load
    return Sensors(
        float(sensors.time),
        np.array(sensors.joint_position, np.float64),
        np.array(sensors.joint_velocity, np.float64),
        np.array(sensors.angular_velocity, np.float64),
        np.array(sensors.acceleration, np.float64),
        None if load is None else _loads(load),
    )


def _loads(values: Any) -> Array:
    """Return the loads of the soles; a value that is not finite becomes NaN."""
    loads = np.array(values, dtype=np.float64)
    return np.where(np.isfinite(loads), loads, np.nan)


def below(values: Array, most: float) -> bool:
    """Return whether all values are numbers of a size below a limit."""
    return bool((np.abs(values) < most).all())


def unsound(sensors: Sensors) -> list[str]:
    """Return the names of the fields that contain an invalid measurement."""
    timeless = [] if math.isfinite(sensors.time) else ["time"]
    return timeless + [
        name for name, most in LIMITS.items() if not below(getattr(sensors, name), most)
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
    for name, most in LIMITS.items():
        values = getattr(sensors, name)
        valid = np.abs(values) < most
        fields[name] = np.where(valid, values, getattr(good, name))
    return replace(sensors, **fields)


class GyroCheck:
    """Replace a single sample of a gyro that is far from those around it."""

    def __init__(self) -> None:
        """Believe the first sample."""
        self._known: tuple[Array, ...] = ()  # the last one measured, and believed

    def believed(self, sensors: Sensors) -> Sensors:
        """Return the sensors, with the gyro's last sample where this one is a jump.

        Args:
            sensors: without an invalid measurement, of each control period.
        """
        gyro = sensors.angular_velocity
        if not self._known or any(_agree(gyro, g) for g in self._known):
            self._known = gyro, gyro
            return sensors
        believed = self._known[1]
        self._known = gyro, believed
        return replace(sensors, angular_velocity=believed)


def _agree(gyro: Array, other: Array) -> bool:
    return bool(np.abs(gyro - other).max() <= GYRO_JUMP)
