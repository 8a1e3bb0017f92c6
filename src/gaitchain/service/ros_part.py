"""The part that takes commands from ROS 2, publishes the state, and serves calls."""

import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from gaitchain.backends.ros import PilotTopics, RosPilot, open_link
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import load_library
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
_PERIOD_S = CONTROL_PERIOD_S  # least time between two published joint states


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

    lock = threading.Lock()  # commands come on a thread of the link
    walks = False

    def ask(request: Request) -> bool:
        with lock:
            return asker.ask(request)

    def drive(command: Command) -> None:
        """Hold the wheel while something is asked for, not by zeros for ever."""
        nonlocal walks
        asks = not command.stops or command.crouch > 0.0
        if asks:
            path.forget()
        elif path.is_walked:  # which zeros do not end
            walks = False
        if walks or asks:
            ask(Drive(DRIVER, *command.motion, command.crouch))
        if walks and not asks:
            ask(LetGo(DRIVER))
        walks = asks

    behind = settings.backend.startswith("ros")
    topics = PilotTopics(state=None, target=None) if behind else PilotTopics()
    link = open_link(settings.ros)
    path = RosPath(link, ask, DRIVER)
    pilot = RosPilot(
        link, drive, stamped=settings.ros_stamped, topics=topics, period_s=_PERIOD_S
    )
    with closing(asker), closing(listener), closing(pilot):
        state = StateTopics(link, robot, behind=behind)
        services = RosServices(link, ask, DRIVER)
        names = robot.legs.joint_names
        for telemetry in _telemetry(pilot, listener, ask, ended):
            services.take(telemetry)
            path.take(telemetry)
            _publish(pilot, telemetry, names)
            state.publish(telemetry)


def _telemetry(
    pilot: RosPilot,
    listener: Listener,
    ask: Callable[[Request], bool],
    ended: threading.Event,
) -> Iterator[Telemetry]:
    """Yield every telemetry that is due, and report what is wrong with the link."""
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
