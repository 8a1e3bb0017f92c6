"""`gaitchain calibrate`: find the servo, sign and zero of each joint."""

import math
import os
import sys
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from gaitchain.backends.makes import MakeName
from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.calibration import (
    LOW_PWM,
    Calibration,
    ImuCalibration,
    JointCalibration,
    check_calibration,
)
from gaitchain.backends.servos.calibration_file import (
    load_calibration,
    save_calibration,
)
from gaitchain.backends.servos.guide import (
    LEAST_MOVE_DEG,
    Mounted,
    angle_of,
    ends_at_zero,
    joint_at,
    joint_words,
    positions,
    seen_limits,
    who_moved,
)
from gaitchain.backends.servos.make import make_named
from gaitchain.backends.servos.search import opened, parse_ids
from gaitchain.backends.servos.setup import ServoSetup, servo_setup
from gaitchain.backends.servos.table import DEG_PER_COUNT
from gaitchain.backends.servos.torque import let_go
from gaitchain.cli.calibration_check import compare
from gaitchain.cli.console import print_table, say
from gaitchain.cli.exercise import run_exercise
from gaitchain.cli.files import check_writable
from gaitchain.cli.libraries import read_library
from gaitchain.cli.mixtures import refuse
from gaitchain.cli.options import Calibrate
from gaitchain.cli.prompt import Answers
from gaitchain.cli.servo_calibration import EMULATED
from gaitchain.errors import BackendError, CalibrationError, CommandError
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.robot import Robot

_OTHER_WAY = "-"
_NO_FURTHER = (
    "; beyond that its torque is not turned on: if it moves there, remount the horn, "
    "with 180 deg about the middle of the joint's range"
)


def run(options: Calibrate) -> tuple[int, dict[str, Any]]:
    """Calibrate with a person who moves the robot, or compare a file with the bus."""
    if options.exercise is not None or options.preview is not None:
        return run_exercise(options)
    if options.view is not None:
        raise CommandError("--view: shows an exercise; give --exercise FILE as well")
    _check_asked(options)
    port = _port(options)
    _check_unused(options)
    robot = read_library(options.library).robot.nominal
    if options.check is not None:
        calibration = load_calibration(options.check, robot)
        return compare(calibration, port, options.baud)
    out = options.output or Path()
    check_writable(out)
    if options.limits and os.name == "nt":
        raise CommandError("--limits needs Linux or macOS; edit the file's limits")
    calibration = _calibrate(options, port, robot, out)
    check_calibration(calibration, str(out))
    save_calibration(calibration, out)
    words = f"{options.library} --port {port} --check {out}"
    say(f"{out}: written. Next: gaitchain calibrate {words}")
    return 0, msgspec.to_builtins(calibration)


def _check_asked(options: Calibrate) -> None:
    """Refuse options that ask for nothing, or for two things at once."""
    if (options.output is None) == (options.check is None):
        raise CommandError(
            "calibrate: give one of -o FILE, to write a calibration, --check FILE, "
            "--exercise FILE and --preview FILE"
        )


def _port(options: Calibrate) -> str:
    """Return the serial port of the servos.

    Raises:
        CommandError: none is named, or that of emulated servos.
    """
    if options.port is None or options.robot_hidden is not None:
        raise CommandError("calibrate: give --port, the serial port of the servos")
    if options.port == EMULATED:
        raise CommandError(
            "--port emulated: emulated servos can only exercise, with --exercise FILE; "
            "give the serial port of real ones, such as /dev/ttyUSB0"
        )
    return options.port


def _check_unused(options: Calibrate) -> None:
    """Refuse options that neither a comparison nor a guided calibration looks at."""
    if options.check is None:
        refuse(options, ("calibration",), "of servos that exercise; -o makes a new one")
        return
    known = "has no effect with --check: the calibration says it"
    refuse(options, ("make", "ids"), known)
    refuse(options, ("calibration",), "has no effect with --check, which names the one")
    guided = "has no effect with --check; it is for calibrating"
    refuse(options, ("pose", "limits"), guided)


def _calibrate(options: Calibrate, port: str, robot: Robot, out: Path) -> Calibration:
    """Guide a person through the calibration; keep what the file before it says."""
    answers, earlier = Answers(sys.stdin), _earlier(out, options.make, robot)
    pose = _pose(robot.legs, options.pose)
    bauds = None if options.baud is None else (options.baud,)
    make = make_named(options.make)
    ids = None if options.ids is None else parse_ids(options.ids, make)
    with opened(port, bauds, ids, make) as (bus, baud, models):
        servos = _servos(bus, models)
        _check_imu(earlier, list(servos), out)
        guided = _Guided(bus, answers, robot.legs, servos)
        joints = guided.calibrate(pose, options.pose, limits=options.limits)
        return Calibration(
            robot=robot.name,
            fingerprint=robot.fingerprint,
            baud=baud,
            make=options.make,
            joints=_bounded(joints, earlier, out),
            imu=_kept_imu(earlier, out),
        )


@dataclass
class _Guided:
    """The guided calibration of a limp robot, and the servos found so far."""

    bus: ServoBus
    answers: Answers
    legs: LegModel
    servos: dict[int, ServoSetup]
    taken: dict[int, str] = field(default_factory=dict)

    def calibrate(
        self, pose: dict[str, float], named: str, *, limits: bool
    ) -> dict[str, JointCalibration]:
        """Go through all steps; return the joints by name."""
        self._show()
        names = self.legs.joint_names
        if len(self.servos) < len(names):
            raise BackendError(
                f"{self.bus.name}: {len(self.servos)} servos found, the robot has "
                f"{len(names)} leg joints; check cables, ids that are there twice, and "
                "that all have one rate"
            )
        self.answers.choose(
            "Hang the robot up so that its legs swing freely: all torques are turned "
            "off now, and stay off. Press Enter"
        )
        disobeying = let_go(self.bus, list(self.servos))
        if disobeying:
            raise BackendError(f"{self.bus.name}: id {disobeying} does not let go")
        words = joint_words(self.legs)
        mounted = {
            name: self._find(name, f"[{i} of {len(names)}] {name}: {words[name]}")
            for i, name in enumerate(names, start=1)
        }
        joints = self._zero(mounted, pose, named)
        stand = dict(zip(names, np.degrees(self.legs.stand).tolist(), strict=True))
        _check_stand(joints, stand)  # before a person moves all of them to their ends
        if not limits:
            return joints
        return {n: self._range(n, joint, stand[n]) for n, joint in joints.items()}

    def _show(self) -> None:
        at = positions(self.bus, list(self.servos))
        rows = [
            (f"{number}", setup.model.name, f"{at[number] * DEG_PER_COUNT:.1f}")
            for number, setup in self.servos.items()
        ]
        print_table(f"Servos on {self.bus.name}", ("id", "model", "at [deg]"), rows)

    def _find(self, name: str, words: str) -> Mounted:
        """Find the servo of a joint: the one that turns when the joint is moved."""
        ids = list(self.servos)
        while True:
            before = positions(self.bus, ids)
            typed = self.answers.choose(
                f"{words}, by {2 * LEAST_MOVE_DEG:.0f} deg or more, hold it there and "
                f"press Enter (type {_OTHER_WAY} before it if only the other way goes)",
                _OTHER_WAY,
            )
            try:
                found, sign = who_moved(before, positions(self.bus, ids), self.taken)
            except CommandError as error:
                say(f"  {error}: once more")
                continue
            sign = -sign if typed == _OTHER_WAY else sign
            self.taken[found] = name
            way = "up" if sign > 0 else "down"
            say(f"  id {found}, counts {way} where the joint goes up")
            return Mounted(found, sign, self.servos[found])

    def _zero(
        self, mounted: dict[str, Mounted], pose: dict[str, float], named: str
    ) -> dict[str, JointCalibration]:
        """Compute the offsets in a known pose, which the person sets by hand."""
        if named == "standing":
            rows = [(name, f"{angle:.1f}") for name, angle in pose.items()]
            print_table("The standing pose", ("joint", "angle [deg]"), rows)
            what = "Bring the robot into the standing pose above"
        else:
            what = (
                "Stretch both legs: all joints straight, feet side by side, toes ahead,"
                " soles level"
            )
        self.answers.choose(f"{what}; hold it still and press Enter")
        at = positions(self.bus, list(self.servos))
        lower, upper = np.degrees([self.legs.lower, self.legs.upper])
        joints = {}
        for row, (name, servo) in enumerate(mounted.items()):
            limits = float(lower[row]), float(upper[row])
            joint = joint_at(servo, at[servo.id], pose[name], limits)
            if (joint.lower, joint.upper) != tuple(round(end, 3) for end in limits):
                say(
                    f"  {name}: limits {limits[0]:.1f} to {limits[1]:.1f} deg narrowed "
                    f"to {joint.lower:.1f} to {joint.upper:.1f} by its servo's range"
                    f"{_NO_FURTHER * ends_at_zero(joint)}"
                )
            joints[name] = joint
        return joints

    def _range(
        self, name: str, joint: JointCalibration, stand: float
    ) -> JointCalibration:
        """Narrow a joint's limits to the range through which the person moves it.

        Args:
            name: of the joint.
            joint: its calibration, with the limits of the robot's file.
            stand: its angle as the robot stands, which stays in the range [deg].
        """
        while True:
            angles: list[float] = []
            self.answers.choose(
                f"{name}: move it slowly to both ends, then press Enter",
                meanwhile=partial(self._note_angle, joint, angles),
            )
            try:
                low, high = seen_limits(angles, (joint.lower, joint.upper), stand)
            except CommandError as error:
                say(f"  {error}: once more")
                continue
            say(f"  {low:.1f} to {high:.1f} deg")
            return msgspec.structs.replace(joint, lower=low, upper=high)

    def _note_angle(self, joint: JointCalibration, angles: list[float]) -> None:
        angles.append(angle_of(joint, positions(self.bus, [joint.id])[joint.id]))


def _servos(bus: ServoBus, models: dict[int, int]) -> dict[int, ServoSetup]:
    """Return the servos among the devices, and print a note about unknown devices."""
    for number, model in models.items():
        if model not in bus.make.models:
            say(
                f"id {number} (model {model}) is no servo that is known; if it is an "
                "IMU, give the calibration a table [imu]: docs/connect_servos.md"
            )
    return {
        number: servo_setup(bus, number, f"id {number}", model)
        for number, model in models.items()
        if model in bus.make.models
    }


def _pose(legs: LegModel, named: Literal["straight", "standing"]) -> dict[str, float]:
    """Return the joint angles [deg] of the pose that the person will hold."""
    if named == "standing":
        angles = np.degrees(legs.stand).tolist()
        return dict(zip(legs.joint_names, angles, strict=True))
    for name, low, high in zip(legs.joint_names, legs.lower, legs.upper, strict=True):
        if not low <= 0.0 <= high:
            raise CommandError(
                f"--pose straight: {name} goes from {math.degrees(low):.1f} to "
                f"{math.degrees(high):.1f} deg and has no zero; use --pose standing"
            )
    return dict.fromkeys(legs.joint_names, 0.0)


def _earlier(out: Path, make: MakeName, robot: Robot) -> Calibration | None:
    """Return the calibration that the new one replaces; None if it is of others.

    A torque limit means another register, and another torque, on another make or robot.

    Raises:
        CalibrationError: what it holds cannot be read, and would be lost.
    """
    if not out.exists():
        return None
    try:
        earlier = load_calibration(out)
    except CalibrationError as error:
        raise CalibrationError(
            f"{error}; a new calibration keeps its pwm_limit and [imu], so mend it, "
            "remove it, or write to another file"
        ) from None
    if earlier.fingerprint != robot.fingerprint:
        others = f"another robot, {earlier.robot!r:.60}, or an older file of it"
    elif earlier.make != make:
        others = f"{earlier.make} servos"
    else:
        return earlier
    imu = " and its table [imu]" if earlier.imu else ""
    say(f"{out}: its values of pwm_limit{imu} are not kept: they are of {others}")
    return None


def _check_imu(earlier: Calibration | None, servos: list[int], out: Path) -> None:
    """Refuse an IMU of the earlier file whose id a servo has, before all is moved."""
    if earlier is not None and earlier.imu is not None and earlier.imu.id in servos:
        raise CalibrationError(
            f"{out}: imu.id = {earlier.imu.id} is a servo on this bus; correct or "
            "remove its table [imu], which a new calibration keeps, or write to "
            "another file"
        )


def _bounded(
    joints: dict[str, JointCalibration], earlier: Calibration | None, out: Path
) -> dict[str, JointCalibration]:
    """Return joints with the torque limits of the earlier file, or low ones."""
    before = {} if earlier is None else earlier.joints
    limits = {n: before[n].pwm_limit if n in before else LOW_PWM for n in joints}
    if before:
        say(f"{out}: its values of pwm_limit are kept")
    else:
        say(f"{out}: pwm_limit is {LOW_PWM:g} %, to begin with; raise it by hand")
    replaced = msgspec.structs.replace
    return {n: replaced(joint, pwm_limit=limits[n]) for n, joint in joints.items()}


def _kept_imu(earlier: Calibration | None, out: Path) -> ImuCalibration | None:
    """Return the IMU of the earlier file, to be kept in the new one."""
    imu = None if earlier is None else earlier.imu
    if imu is not None:
        say(f"{out}: its table [imu] is kept")
    return imu


def _check_stand(joints: dict[str, JointCalibration], stand: dict[str, float]) -> None:
    """Check that the servos reach the standing pose [deg]."""
    for name, angle in stand.items():
        joint = joints[name]
        if not joint.lower <= angle <= joint.upper:
            raise CalibrationError(
                f"{name} stands at {angle:.1f} deg, outside {joint.lower:.1f} to "
                f"{joint.upper:.1f}: turn the horn of id {joint.id} so that the middle "
                "of its range is the middle of the joint's, and calibrate again"
            )
