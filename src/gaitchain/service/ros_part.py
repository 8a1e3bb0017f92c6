"""The part that takes commands from ROS 2 and publishes joint states."""

import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np

from gaitchain.backends.ros import PilotTopics, RosPilot, open_link
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import load_library
from gaitchain.live.messages import Drive, LetGo, Note, Request
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.service.channel import Asker, Listener
from gaitchain.service.settings import load_settings

DRIVER = "ros"
"""The name under which ROS drives."""
_WAIT_S = 0.5
_PERIOD_S = CONTROL_PERIOD_S  # least time between two published joint states


def run(folder: Path, ended: threading.Event) -> None:
    """Pass commands in and joint states out until the end of the service.

    Raises:
        CommandError: there is no such link.
    """
    settings = load_settings(folder)
    if settings.ros is None:
        raise CommandError("no link to ROS was named; give --ros")
    names = load_library(settings.library).robot.legs.joint_names
    asker, listener = Asker(folder), Listener(folder)

    lock = threading.Lock()  # commands come on a thread of the link
    walks = False

    def ask(request: Request) -> None:
        with lock:
            asker.ask(request)

    def drive(command: Command) -> None:
        """Hold the wheel while something is asked for, not by zeros for ever."""
        nonlocal walks
        asks = not command.stops or command.crouch > 0.0
        if walks or asks:
            ask(Drive(DRIVER, *command.motion, command.crouch))
        if walks and not asks:
            ask(LetGo(DRIVER))
        walks = asks

    behind = settings.backend.startswith("ros")
    topics = PilotTopics(state=None, target=None) if behind else PilotTopics()
    pilot = RosPilot(open_link(settings.ros), drive, topics=topics, period_s=_PERIOD_S)
    with closing(asker), closing(listener), closing(pilot):
        _publish(pilot, listener, ask, names, ended)


def _publish(
    pilot: RosPilot,
    listener: Listener,
    ask: Callable[[Request], None],
    names: tuple[str, ...],
    ended: threading.Event,
) -> None:
    """Publish every telemetry that is due, and report what is wrong with the link."""
    reported, due_s = "", -np.inf
    while not ended.is_set():
        telemetry = listener.next(_WAIT_S)
        note = pilot.health().note
        if note != reported:
            reported = note
            ask(Note("link", f"ROS: {note or 'reached again'}"))
        if telemetry is None or 0.0 < due_s - telemetry.time_s <= _PERIOD_S:
            continue
        due_s = telemetry.time_s + _PERIOD_S - 1e-6
        pilot.publish(
            telemetry.stamp_ns,
            names,
            position=np.array(telemetry.joint_position),
            velocity=np.array(telemetry.joint_velocity),
            effort=np.array(telemetry.joint_torque),
            target=np.array(telemetry.joint_target),
        )
