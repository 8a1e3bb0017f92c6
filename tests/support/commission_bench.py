"""A robot that is commissioned: emulated servos, and somebody who answers."""

from contextlib import contextmanager
from functools import cache

import msgspec
from live_robot import SteppedClock
from servo_bench import patient_bus

from gaitchain.backends.servos import ServoBusEmulator, plain_calibration
from gaitchain.backends.servos.calibration import ImuCalibration
from gaitchain.cli.libraries import shipped_library
from gaitchain.commission.bench import Bench
from gaitchain.gait.library_file import load_library

CHANGED = msgspec.structs.replace
IMU = ImuCalibration(200, 38, 44, 0.001065, 0.000598)
PATIENT_HZ = 2.0  # a control period that a busy machine cannot miss
NEVER_S = 2.5
LATE_S = 0.5  # an answer may be, on a busy machine; servos stop at more than `NEVER_S`


@cache
def library():
    return load_library(shipped_library())


def plain():
    return CHANGED(plain_calibration(library().robot), imu=IMU)


class Somebody:
    """Says yes to all but what is about a joint, and does what `acts` says."""

    present = True

    def __init__(self, no="", acts=None):
        self.no, self.acts, self.asked = no, acts or {}, []

    def ready(self, text, meanwhile=None):
        self._answer(text, meanwhile)

    def confirms(self, question, meanwhile=None):
        self._answer(question, meanwhile)
        return not (self.no and self.no in question)

    def _answer(self, text, meanwhile):
        self.asked.append(text)
        if meanwhile is not None:
            meanwhile()
        for words, act in self.acts.items():
            if words in text:
                act()


@contextmanager
def robot(
    person=None,
    calibration=None,
    truth=None,
    rate_hz=PATIENT_HZ,
    late_s=None,
    delay_s=0.0,
):
    """A bench, and the emulated servos of a robot in its standing pose.

    Args:
        person: beside it.
        calibration: of the bench; by default that of the servos.
        truth: how the servos are.
        rate_hz: of control.
        late_s: an answer may be; by default a part of a period.
        delay_s: before each answer.
    """
    truth, clock = truth or plain(), SteppedClock()
    stand = library().robot.legs.stand
    emulated = ServoBusEmulator.like(truth, stand, clock=clock.now)
    with patient_bus(1.0 / rate_hz, late_s), emulated as bus:
        bus.delay_s = delay_s
        bench = Bench(
            library(),
            calibration or truth,
            bus.port,
            rate_hz,
            person or Somebody(),
            clock=clock,
            watchdog_s=NEVER_S,
        )
        yield bench, bus
        reached = set(bus.servos) - bus.bus.dead
        assert not any(bus.servos[number].torque for number in reached)
