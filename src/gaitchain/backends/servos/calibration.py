"""The calibration of a robot: servo, sign, zero and limits of each joint, and IMU."""

import difflib
from collections import Counter
from collections.abc import Iterable
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from gaitchain.backends.makes import LEAST_BAUD, MOST_BAUD, MakeName
from gaitchain.backends.servos.make import make_named
from gaitchain.errors import CalibrationError
from gaitchain.robot.robot import Robot

TURN_DEG = 360.0
LOW_PWM = 40.0
"""Torque limit to begin with, and of a robot that hangs: enough to stand or to lift a
leg, little enough to be held by hand [% of the supply voltage]."""
MOST_PWM = 100.0
"""No limit of the torque [% of the supply voltage]."""
_ROUNDING_DEG = 1e-6
_SHOWN = 3  # number of names that a message gives as examples
_Address = Annotated[int, msgspec.Meta(ge=0, le=1000)]
_Scale = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]
_Angle = Annotated[float, msgspec.Meta(ge=-TURN_DEG, le=TURN_DEG)]
_Axis = Literal["x", "-x", "y", "-y", "z", "-z"]
_NUMBER_BYTES = {"int16": 2, "float32": 4}


class JointCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The servo of one joint."""

    id: int
    """From 0 to the make's highest id, as `check_calibration` checks."""
    sign: Literal[1, -1]
    """1 if servo and joint have the same positive direction."""
    offset: Annotated[float, msgspec.Meta(ge=-TURN_DEG, le=2.0 * TURN_DEG)]
    """Servo angle at joint angle 0; may be outside the servo's range [deg]."""
    lower: _Angle
    """Lower limit of the joint targets [deg]."""
    upper: _Angle
    model: str = ""
    """Servo model, such as "xm430-w350"; empty for any of the make."""
    pwm_limit: Annotated[float, msgspec.Meta(ge=1.0, le=MOST_PWM)] = MOST_PWM
    """Largest part of the supply voltage at the motor, which limits torque [%]."""

    @property
    def servo_range(self) -> tuple[float, float]:
        """Servo angles at the ends of the joint's range, lower one first [deg]."""
        ends = (self.offset + self.sign * end for end in (self.lower, self.upper))
        low, high = sorted(ends)
        return low, high


class ImuCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An IMU on the servos' bus, such as that of an OpenCR board."""

    id: int
    gyro: _Address
    """Address of the x component; y and z follow."""
    accelerometer: _Address
    gyro_scale: _Scale
    """Angular velocity per count, or per unit of a float [rad/s]."""
    accelerometer_scale: _Scale
    """Acceleration per count, or per unit of a float [m/s^2]."""
    format: Literal["int16", "float32"] = "int16"
    axes: tuple[_Axis, _Axis, _Axis] = ("x", "y", "z")
    """Axes of the IMU that point forward, left and up."""

    @property
    def vector_bytes(self) -> int:
        """Size of one sensor's three components in the device's table [byte]."""
        return 3 * _NUMBER_BYTES[self.format]

    @property
    def turn(self) -> Any:
        """(3, 3) rotation matrix from the IMU frame to the trunk frame."""
        rows = np.zeros((3, 3))
        for row, axis in enumerate(self.axes):
            rows[row, "xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
        return rows


class Calibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A robot's servos on one bus."""

    robot: str
    fingerprint: str
    """Fingerprint of the robot in the gait library, as `gaitchain inspect` shows it."""
    baud: Annotated[int, msgspec.Meta(ge=LEAST_BAUD, le=MOST_BAUD)]
    """Rate of the bus [bit/s]."""
    joints: dict[str, JointCalibration]
    imu: ImuCalibration | None = None
    make: MakeName = "dynamixel"
    """Make of the servos."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the file."""
        return tuple(self.joints)


def plain_calibration(
    robot: Robot,
    baud: int = 1_000_000,
    make: MakeName = "dynamixel",
) -> Calibration:
    """Return a calibration for an emulated bus.

    Args:
        robot: the robot; its leg joints get ids from 1 on, centred zeros and the
            robot's limits.
        baud: rate of the bus [bit/s].
        make: make of the servos.
    """
    model = make_named(make).plain_model
    legs = robot.legs
    degrees = np.clip(np.degrees([legs.lower, legs.upper]), -179.0, 179.0)
    return Calibration(
        robot=robot.name,
        fingerprint=robot.fingerprint,
        baud=baud,
        make=make,
        joints={
            name: JointCalibration(number, 1, TURN_DEG / 2.0, low, high, model)
            for number, (name, low, high) in enumerate(
                zip(legs.joint_names, *degrees.tolist(), strict=True), start=1
            )
        },
    )


def check_calibration(calibration: Calibration, origin: str) -> None:
    """Check that the values are possible, each alone and all together.

    Raises:
        CalibrationError: a value is impossible; the message begins with `origin`.
    """
    for name, joint in calibration.joints.items():
        _check_joint(joint, f"{origin}: joints.{name}", calibration.make)
    ids = [joint.id for joint in calibration.joints.values()]
    owners = [*calibration.joints, "imu"]
    if calibration.imu is not None:
        ids.append(calibration.imu.id)
        _check_id(calibration.imu.id, f"{origin}: imu", calibration.make)
        _check_imu(calibration.imu, origin, calibration.make)
    for number, times in Counter(ids).items():
        if times > 1:
            sharing = [o for o, i in zip(owners, ids, strict=False) if i == number]
            raise CalibrationError(
                f"{origin}: id = {number} is that of {', '.join(sharing)}; each needs "
                "its own"
            )


def check_robot(calibration: Calibration, robot: Robot, origin: str) -> None:
    """Check that a calibration is for a robot.

    Raises:
        CalibrationError: the robots or their joints differ.
    """
    if calibration.fingerprint != robot.fingerprint:
        raise CalibrationError(
            f"{origin}: fingerprint = {calibration.fingerprint!r}, that of "
            f"{calibration.robot}; the library is for {robot.name}, "
            f"{robot.fingerprint!r}: calibrate this robot with `gaitchain calibrate`, "
            "or put its fingerprint in the file if its joints are the same"
        )
    legs = robot.legs
    check_joints(calibration, legs.joint_names, legs.held, origin)


def check_joints(
    calibration: Calibration,
    needed: Iterable[str],
    others: Iterable[str] = (),
    origin: str = "calibration",
) -> None:
    """Check that a calibration has all joints of a robot and no others.

    Args:
        calibration: the calibration.
        needed: joints that it must have.
        others: joints that it may have.
        origin: name of the file in messages.

    Raises:
        CalibrationError: a joint is missing or unknown.
    """
    needed = tuple(needed)
    missing = [name for name in needed if name not in calibration.joints]
    if missing:
        raise CalibrationError(
            f"{origin}: joints: {', '.join(missing)} missing; all {len(needed)} are "
            f"needed: {', '.join(needed)}"
        )
    known = [*needed, *others]
    for name in calibration.joints:
        if name not in known:
            near = difflib.get_close_matches(name, known, _SHOWN) or known[:_SHOWN]
            raise CalibrationError(
                f"{origin}: joints.{name}: no joint of the robot; near: "
                f"{', '.join(near)}"
            )


def _check_id(number: int, where: str, make: str) -> None:
    most = make_named(make).wire.last_id
    if not 0 <= number <= most:
        raise CalibrationError(
            f"{where}.id = {number!r:.60}: allowed for {make} servos: 0 to {most}"
        )


def _check_joint(joint: JointCalibration, where: str, make: str) -> None:
    _check_id(joint.id, where, make)
    if not joint.lower < joint.upper:
        raise CalibrationError(
            f"{where}: lower = {joint.lower:g} deg must be below upper = "
            f"{joint.upper:g} deg"
        )
    low, high = joint.servo_range
    if low < -_ROUNDING_DEG or high > TURN_DEG + _ROUNDING_DEG:
        raise CalibrationError(
            f"{where}: lower = {joint.lower:g} to upper = {joint.upper:g} deg is servo "
            f"angle {low:g} to {high:g} deg; allowed: 0 to 360; turn the horn and "
            "calibrate again, or narrow the limits"
        )
    names = [model.name for model in make_named(make).models.values()]
    if joint.model and joint.model not in names:
        near = difflib.get_close_matches(joint.model, names, _SHOWN)
        raise CalibrationError(
            f"{where}.model = {joint.model!r}: unknown; near: "
            f"{', '.join(near or sorted(names)[:_SHOWN])}; without it any {make} "
            "servo is taken"
        )


def _check_imu(imu: ImuCalibration, origin: str, make: str) -> None:
    if not np.isclose(np.linalg.det(imu.turn), 1.0):
        raise CalibrationError(
            f"{origin}: imu.axes = {list(imu.axes)}: no right-handed set of axes; such "
            'as ["x", "y", "z"] or ["-y", "x", "z"]'
        )
    size = imu.vector_bytes
    if abs(imu.gyro - imu.accelerometer) < size:
        raise CalibrationError(
            f"{origin}: imu.accelerometer = {imu.accelerometer}: overlaps gyro = "
            f"{imu.gyro}; each has {size} bytes"
        )
    _check_read(imu, origin, make)


def _check_read(imu: ImuCalibration, origin: str, make: str) -> None:
    """Refuse places that one request of the make's protocol cannot ask for."""
    wire, size = make_named(make).wire, imu.vector_bytes
    places = {"gyro": imu.gyro, "accelerometer": imu.accelerometer}
    first, last = sorted(places, key=lambda name: places[name])
    most = wire.last_address + 1 - size
    if places[last] > most:
        raise CalibrationError(
            f"{origin}: imu.{last} = {places[last]}: {size} bytes from there go beyond "
            f"the addresses of {make} servos; allowed: 0 to {most}"
        )
    apart = places[last] - places[first]
    if apart + size > wire.most_data:
        raise CalibrationError(
            f"{origin}: imu.{last} = {places[last]}: {apart} after {first} = "
            f"{places[first]}, which is too much for one answer of {make} servos; "
            f"allowed: {wire.most_data - size}"
        )
