"""The part that drives the robot."""

import contextlib
import os
import threading
from pathlib import Path

import numpy as np

from gaitchain.boxes import anatomy_of
from gaitchain.errors import CommandError
from gaitchain.library_file import load_library
from gaitchain.live.clock import MonotonicClock
from gaitchain.live.loop import ControlLoop
from gaitchain.messages import Sensors
from gaitchain.service.channel import LoopEnd
from gaitchain.service.robots import open_robot
from gaitchain.service.settings import Settings, load_settings
from gaitchain.walker import Walker


def run(folder: Path, ended: threading.Event) -> None:
    """Drive the robot until the end of the service; it stops walking first.

    Raises:
        GaitchainError: the library, the robot or its calibration does not do.
    """
    loop, wires = make_loop(load_settings(folder), folder)
    _go_first()
    try:
        loop.run(ended)
    finally:
        wires.close()


def _go_first() -> None:
    """Run before all ordinary processes, where the system allows it."""
    if not hasattr(os, "sched_setscheduler"):
        return
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


def make_loop(settings: Settings, folder: Path) -> tuple[ControlLoop, LoopEnd]:
    """Make the loop of some settings, and its end of the wires.

    Raises:
        GaitchainError: see `run`.
    """
    library = load_library(settings.library)
    period_s = 1.0 / settings.rate_hz
    robot = open_robot(settings, library)
    feedback = not settings.open_loop
    if robot.backend.physical:
        robot.backend.connect(anatomy_of(library.biped).stand)  # has it an IMU?
    if library.dynamic and feedback and robot.backend.physical and not robot.emulated:
        _must_feel(robot.backend.has_imu)
    walker = Walker(
        library, feedback=feedback and robot.backend.has_imu, period_s=period_s
    )
    _warm_up(walker)
    wires = LoopEnd(folder)
    loop = ControlLoop(
        walker,
        robot.backend,
        wires,
        MonotonicClock(),
        period_s,
        simulator=robot.simulator,
    )
    return loop, wires


def _warm_up(walker: Walker) -> None:
    """Make the machine code of a step now, not while the robot waits for it."""
    still = np.zeros(len(walker.stand))
    upright = np.array([0.0, 0.0, 9.81])
    walker.step(Sensors(0.0, walker.stand, still, np.zeros(3), upright))
    walker.reset()


def _must_feel(has_imu: bool) -> None:
    if not has_imu:
        raise CommandError(
            "this library balances by gyro and accelerometer, and the robot has none: "
            "name the IMU in the calibration, or walk with --open-loop"
        )
