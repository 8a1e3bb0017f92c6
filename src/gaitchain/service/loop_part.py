"""The part that drives the robot."""

import contextlib
import os
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

from gaitchain.backends.ros import RobotTopics
from gaitchain.balance.compiled import telling_compilation
from gaitchain.errors import BackendError, CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.live.clock import Clock
from gaitchain.live.guard import Trouble
from gaitchain.live.loop import ControlLoop
from gaitchain.live.messages import TroubleKind
from gaitchain.live.safe_backend import SafeBackend
from gaitchain.messages import Array
from gaitchain.service.channel import LoopEnd
from gaitchain.service.pulse import COMPILING, Pulse
from gaitchain.service.robots import OpenedRobot, open_riser, open_robot
from gaitchain.service.settings import Settings, load_settings
from gaitchain.walker.walker import Walker

_LOG_S = 1.0  # a log that cannot be had so soon misses the first rows, and counts them


def run(folder: Path, ended: threading.Event) -> None:
    """Drive the robot until the end of the service; it stops walking first.

    Raises:
        GaitchainError: the library, the robot or its calibration does not do.
    """
    settings = load_settings(folder)
    loop, port = make_loop(settings, folder, begin=_go_first)
    with contextlib.closing(port):
        if settings.log is not None:
            port.await_log(_LOG_S)
        loop.run(ended)


def _go_first() -> None:
    """Let this thread run before all ordinary processes, where the system allows it."""
    if not hasattr(os, "sched_setscheduler"):
        return
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


def make_loop(
    settings: Settings, folder: Path, begin: Callable[[], None] = lambda: None
) -> tuple[ControlLoop, LoopEnd]:
    """Make the loop of some settings, and its end of the channels.

    Args:
        settings: of the service.
        folder: of the service.
        begin: called when all is compiled, before the thread of the channels begins,
            which inherits this one's priority.

    Raises:
        GaitchainError: see `run`; the robot is let go of then.
    """
    library = load_library(settings.library)
    robot = open_robot(settings, library)
    stand = library.robot.legs.stand
    with contextlib.closing(Pulse(folder)) as pulse, contextlib.ExitStack() as undo:
        undo.callback(robot.backend.close)
        backend = SafeBackend(robot.backend, len(stand))
        connected = backend.physical and _connect(backend, stand, settings)
        with telling_compilation(partial(_tell, pulse)):
            walker = _walker_for(robot, library, settings)
        begin()
        port = LoopEnd(folder)
        undo.callback(port.close)
        loop = ControlLoop(
            walker,
            backend,
            port,
            Clock(),
            1.0 / settings.rate_hz,
            connected=connected,
        )
        loop.modes.held = _held(pulse.kept)
        loop.modes.up.riser = open_riser(settings, library)
        undo.pop_all()
    return loop, port


def _held(why: str) -> Trouble | None:
    """Return what only a reset may end, as `LoopEnd` kept it; None for nothing.

    The stop of a loop that was killed is no less a stop.
    """
    kind, _, reason = why.partition(": ")
    return Trouble(TroubleKind(kind), reason) if kind else None


def _tell(pulse: Pulse, functions: int) -> None:
    pulse.say(f"{COMPILING} the control step, {functions} functions so far")


def _connect(backend: SafeBackend, stand: Array, settings: Settings) -> bool:
    """Connect a robot with motors; False if it is out of reach and may be tried again.

    Once connected, it says whether it has an IMU.
    """
    try:
        backend.connect(stand)
    except BackendError:
        # The loop tries again, except behind ROS, which has an IMU once heard.
        if not settings.waits or settings.backend.startswith("ros"):
            raise
        return False
    return True


def _walker_for(robot: OpenedRobot, library: GaitLibrary, settings: Settings) -> Walker:
    """Return a walker that balances by what this robot measures.

    Raises:
        CommandError: it measures nothing of what the library balances by.
    """
    backend, feedback = robot.backend, not settings.open_loop
    balances = library.family.balanced and feedback and backend.physical
    if balances and not backend.has_imu:
        if not robot.emulated:
            raise CommandError(_without_imu(settings))
        if settings.calibration is not None:  # a rehearsal, which has to say so
            refused = f"servos that are real would be refused: {_without_imu(settings)}"
            print(f"gaitchain: {refused}", file=sys.stderr, flush=True)
    # Emulated servos have no body: balance would answer to what does not move.
    walker = Walker(
        library,
        feedback=feedback and backend.has_imu and not robot.emulated,
        period_s=1.0 / settings.rate_hz,
    )
    walker.keep_odometry()
    return walker


def _without_imu(settings: Settings) -> str:
    would = "name the IMU in the calibration"
    if settings.backend.startswith("ros"):
        topic = RobotTopics().imu
        would = f"nothing came on {topic}; have a node publish its IMU there"
    return (
        "this library balances by gyro and accelerometer, and the robot has none: "
        f"{would}, or walk with --open-loop"
    )
