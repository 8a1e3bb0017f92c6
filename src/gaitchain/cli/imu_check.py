"""What the IMU of a calibration says while the robot hangs upright and still."""

import math
import time

import numpy as np

from gaitchain.backends.dynamixel.bus import ServoBus
from gaitchain.backends.dynamixel.calibration import ImuCalibration
from gaitchain.backends.dynamixel.imu import BusImu
from gaitchain.cli.console import say
from gaitchain.messages import Array

_READS, _APART_S = 25, 0.01
_GRAVITY, _OFF = 9.81, 1.0  # m/s^2; a robot that is held by hand sways a little
_MOST_TILT = 45.0  # deg; a walk counts 50 as a fall
_MOST_RATE = 5.0  # deg/s; what a gyro drifts by is less
_AXES = "xyz"


def felt(bus: ServoBus, imu: ImuCalibration) -> list[str]:
    """Say what an IMU measures, for a quarter of a second; return what is wrong.

    Args:
        bus: where it is.
        imu: how it is said to be mounted.

    Raises:
        BackendError: the port is lost.
    """
    name, device = f"imu (id {imu.id})", BusImu(imu)
    turning, pulling = _averages(bus, device)
    if not np.isfinite([turning, pulling]).all():
        wrong = ["does not answer, or with what are no numbers: check id and format"]
    else:
        rate, size = np.degrees(turning), float(np.linalg.norm(pulling))
        tilt = math.degrees(math.acos(min(max(pulling[2] / max(size, 1e-9), -1), 1)))
        say(
            f"{name}: acceleration {_numbers(pulling)} m/s^2, {size:.2f} long, up is "
            f"{tilt:.0f} deg from the trunk's z; turns by {_numbers(rate)} deg/s"
        )
        wrong = _nonsense(rate, pulling, size, tilt)
    for words in wrong:
        say(f"{name}: {words}")
    return wrong


def _averages(bus: ServoBus, device: BusImu) -> tuple[Array, Array]:
    """Return the mean rate [rad/s] and acceleration [m/s^2]; NaN if none came."""
    came = []
    for _ in range(_READS):
        both = np.array(device.read(bus))
        if np.isfinite(both).all():
            came.append(both)
        elif device.note:
            break
        time.sleep(_APART_S)
    turning, pulling = np.mean(came, axis=0) if came else np.full((2, 3), np.nan)
    return turning, pulling


def _nonsense(rate: Array, pulling: Array, size: float, tilt: float) -> list[str]:
    """Return what a trunk that is upright and still cannot feel, and what to check."""
    wrong = []
    if not abs(size - _GRAVITY) <= _OFF:
        wrong.append(
            f"the acceleration is {size:.2f} m/s^2 long, at rest {_GRAVITY}: check "
            "accelerometer_scale, its address and format, and that nobody moves the "
            "robot"
        )
    elif tilt > _MOST_TILT:
        most = int(np.argmax(np.abs(pulling)))
        up = f"{'-' if pulling[most] < 0.0 else '+'}{_AXES[most]}"
        wrong.append(
            f"up is near the trunk's {up}, {tilt:.0f} deg from its z: check axes, or "
            "hold the trunk upright"
        )
    if not np.abs(rate).max() <= _MOST_RATE:
        wrong.append(
            f"it turns by {np.abs(rate).max():.1f} deg/s, at rest {_MOST_RATE:g} at "
            "most: check gyro_scale, its address and format, and that nobody moves the "
            "robot"
        )
    return wrong


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:.2f}" for value in values.tolist())
