"""Emulated servos on a real pseudo-terminal, with a clock that the test moves."""

from contextlib import contextmanager
from string import ascii_lowercase

import msgspec
import numpy as np
import pytest
from patience import PATIENCE_S

from gaitchain.backends.servos import ServoBackend, ServoBusEmulator, plain_calibration
from gaitchain.backends.servos.calibration import Calibration, JointCalibration
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")
STAND = RES.legs.stand
TURN = msgspec.structs.replace
PATIENT_S = 0.5  # a control period that a busy machine cannot miss
_LIMITS_S = {
    "backend._IDLE_PATIENCE_S": 0.1,
    "backend._MISSING_WAIT_S": PATIENCE_S,
    "backend._RELEASE_WAIT_S": PATIENCE_S,
    "bus._BUDGET_S": PATIENCE_S,
}


_PARTS_OF_A_PERIOD = ("backend._PATIENCE", "backend._READING")


@contextmanager
def patient_bus(period_s=PATIENT_S, late_s=None):
    """Give late answers of an emulated bus the time that a busy machine needs.

    Args:
        period_s: control period [s].
        late_s: how long answers are waited for in a period; a part of it by default.
    """
    limits = dict(_LIMITS_S)
    if late_s is not None:
        limits |= dict.fromkeys(_PARTS_OF_A_PERIOD, late_s / period_s)
    with pytest.MonkeyPatch.context() as patch:
        for name, limit in limits.items():
            patch.setattr(f"gaitchain.backends.servos.{name}", limit)
        yield


class Clock:
    """Time of the servos, which passes when it is told to."""

    now = 100.0

    def __call__(self):
        return self.now


def mounted_oddly():
    """RES with every other servo the other way round, and no two zeros alike."""
    plain = plain_calibration(RES)
    joints = {
        name: TURN(joint, sign=1 - 2 * (i % 2), offset=150.0 + 5.0 * i, id=3 * i + 2)
        for i, (name, joint) in enumerate(plain.joints.items())
    }
    return TURN(plain, joints=joints)


def few(count=2, **changes):
    """A robot of a few joints: a, b and so on."""
    joint = TURN(JointCalibration(1, 1, 180.0, -90.0, 90.0), **changes)
    joints = {ascii_lowercase[i]: TURN(joint, id=i + 1) for i in range(count)}
    return Calibration("few", "0" * 16, 1_000_000, joints)


@contextmanager
def bench(
    calibration=None,
    position=None,
    period_s=PATIENT_S,
    watchdog_s=2.5,
    patiently=patient_bus,
    **more,
):
    """A bus, a backend that is connected to it, and the servos' clock."""
    calibration = calibration or few()
    clock = Clock()
    emulated = ServoBusEmulator.like(calibration, position, clock=clock, **more)
    with patiently(), emulated as bus:
        robot = ServoBackend(
            bus.port,
            calibration,
            calibration.joint_names,
            period_s,
            watchdog_s=watchdog_s,
        )
        robot.connect(np.zeros(len(calibration.joints)))
        try:
            yield bus, robot, clock
        finally:
            robot.close()


def angles_deg(bus):
    """Where the servos stand, by id."""
    return {number: bus.angle_deg(number) for number in bus.servos}
