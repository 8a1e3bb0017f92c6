"""The part that takes commands from ROS 2, publishes the state, and serves calls."""

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from gaitchain.backends.ros import PilotTopics, RosLink, RosPilot, open_link
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import load_library
from gaitchain.live.clock import Beat
from gaitchain.live.messages import Drive, LetGo, Note, Request, Telemetry
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.service.channel import Asker, Listener
from gaitchain.service.ros_path import RosPath
from gaitchain.service.ros_services import RosServices
from gaitchain.service.ros_state_topics import StateTopics
from gaitchain.service.settings import load_settings

DRIVER = "ros"
"""The name under which ROS drives."""
_WAIT_S = 0.5
_PERIOD_S = CONTROL_PERIOD_S  # between two published joint states


def run(folder: Path, ended: threading.Event) -> None:
    """Pass commands in and joint states out until the end of the service.

    Raises:
        CommandError: there is no such link.
    """
    settings = load_settings(folder)
    if settings.ros is None:
        raise CommandError("no link to ROS was named; give --ros")
    robot = load_library(settings.library).robot
    asker, listener = Asker(folder), Listener(folder)
    behind = settings.backend.startswith("ros")
    topics = PilotTopics(state=None, target=None) if behind else PilotTopics()
    link = open_link(settings.ros)
    driver = _Driver(asker, link)
    pilot = RosPilot(
        link,
        driver.drive,
        stamped=settings.ros_stamped,
        topics=topics,
        period_s=_PERIOD_S,
    )
    with closing(asker), closing(listener), closing(pilot):
        state = StateTopics(link, robot, behind=behind)
        services = RosServices(link, driver.ask, DRIVER)
        names, joints = robot.legs.joint_names, Beat(_PERIOD_S)
        heard = _heard(listener, services.take, ended)
        for telemetry in _reported(pilot, heard, driver.ask):
            driver.path.take(telemetry)
            if joints.due(telemetry.time_s):
                _publish(pilot, telemetry, names)
            state.publish(telemetry, pilot.health(), pilot.ignored)


class _Driver:
    """What ROS asks the loop for: commands, paths, and all else."""

    def __init__(self, asker: Asker, link: RosLink) -> None:
        self._asker = asker
        self._lock = threading.Lock()  # commands come on a thread of the link
        self._walks = False
        self.path = RosPath(link, self.ask, DRIVER)

    def ask(self, request: Request) -> bool:
        """Ask the loop for something; return whether it was sent."""
        with self._lock:
            return self._asker.ask(request)

    def drive(self, command: Command) -> None:
        """Hold the wheel while something is asked for, not by zeros for ever."""
        asks = not command.stops or command.crouch > 0.0
        if asks:
            self.path.forget()
        elif self.path.is_walked:  # which zeros do not end
            self._walks = False
        if self._walks or asks:
            self.ask(Drive(DRIVER, *command.motion, command.crouch))
        if self._walks and not asks:
            self.ask(LetGo(DRIVER))
        self._walks = asks


def _heard(
    listener: Listener, take: Callable[[Telemetry], None], ended: threading.Event
) -> Iterator[Telemetry | None]:
    """Yield all telemetry, which is taken first; None after each silence."""
    while not ended.is_set():
        telemetry = listener.next(_WAIT_S)
        if telemetry is not None:
            take(telemetry)
        yield telemetry


def _reported(
    pilot: RosPilot,
    heard: Iterable[Telemetry | None],
    ask: Callable[[Request], bool],
) -> Iterator[Telemetry]:
    """Yield all telemetry, and report what is wrong with the link."""
    reported = ""
    for telemetry in heard:
        note = pilot.health().note
        if note != reported:
            reported = note
            ask(Note("link", f"ROS: {note or 'reached again'}"))
        if telemetry is not None:
            yield telemetry


def _publish(pilot: RosPilot, telemetry: Telemetry, names: tuple[str, ...]) -> None:
    """Publish joint states and targets."""
    pilot.publish(
        telemetry.stamp_ns,
        names,
        position=np.array(telemetry.joint_position),
        velocity=np.array(telemetry.joint_velocity),
        effort=np.array(telemetry.joint_torque),
        target=np.array(telemetry.joint_target),
    )
