"""The part that serves the live 3-D view of the robot."""

import logging
import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from gaitchain.discover.catalogue import list_robots
from gaitchain.discover.looks import find_looks
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.service.channel import Listener
from gaitchain.service.pulse import part_pulse
from gaitchain.service.settings import Settings, load_settings
from gaitchain.service.sight import SightBeat
from gaitchain.service.viewer import LiveView
from gaitchain.service.viewer_gate import gated
from gaitchain.sim.looks import Look
from gaitchain.sim.scene_meshes import local_server
from gaitchain.sim.world import World

_LOG = logging.getLogger(__name__)
_PERIOD_S = 1.0 / 30.0
_SILENT_S = 1.0


def run(folder: Path, ended: threading.Event) -> None:
    """Show telemetry on loopback.

    Args:
        folder: of the service.
        ended: ends it when it is set.

    Raises:
        GaitchainError: the library cannot be read, or the port cannot be had.
    """
    # Browsers that hang up in mid-handshake are no trouble of the service.
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
    settings = load_settings(folder)
    library = load_library(settings.library)
    with gated(settings.viewer_secret), local_server(settings.viewer_port) as server:
        view = LiveView(server, library.robot, _own_model(settings, library))
        view.wear(looks_of(settings, library))  # seconds later: meshes are large
        with (
            closing(Listener(folder, latest=True)) as listener,
            closing(SightBeat(folder)) as sight,
            closing(part_pulse(folder, "viewer")) as pulse,
        ):

            def beat() -> None:
                sight.beat()
                pulse.beat()

            watch(listener, view, ended, beat)


def looks_of(settings: Settings, library: GaitLibrary) -> tuple[Look, ...]:
    """Return the shapes in which the robot is drawn; none for its skeleton.

    Whoever wrote a log may have named any file of this computer in it: of a log's robot
    none is read, but that of a robot known by name, and the one that was given.
    """
    own = library.config
    if settings.drawn is not None:
        given = replace(own, robot=settings.drawn, profile=settings.profile)
        return find_looks(replace(library, config=given))
    here = {robot.name for robot in list_robots() if robot.available}
    known = own.profile is None and own.robot in here
    if settings.replay is None or known or library.robot.of_boxes:
        return find_looks(library)
    _LOG.warning(
        "drawn as its skeleton: the log names %r, and files that a log names are not "
        "read; give it by `gaitchain replay LOG --robot FILE`",
        own.robot[:200],
    )
    return ()


def _own_model(settings: Settings, library: GaitLibrary) -> Any:
    """Return the robot's own model; None where its skeleton is simulated."""
    if settings.own_model is None:
        return None
    from gaitchain.build.own_model import own_model  # noqa: PLC0415 - slow

    return own_model(settings.own_model, library.robot, World())


def watch(
    listener: Listener,
    view: LiveView,
    ended: threading.Event,
    beat: Callable[[], None] = lambda: None,
) -> None:
    """Draw the newest telemetry, 30 times a second at most.

    Args:
        listener: of the newest telemetry alone.
        view: what is drawn.
        ended: ends it when it is set.
        beat: called each time, once a second at least.
    """
    drawn_s = heard_s = time.monotonic()
    while not ended.is_set():
        beat()
        try:
            telemetry = listener.next(_SILENT_S)
        except msgspec.DecodeError:  # of another version of this package
            telemetry = None
        now_s = time.monotonic()
        if telemetry is not None and telemetry.leads:
            heard_s = now_s
        elif telemetry is not None:
            view.show(telemetry, now_s - drawn_s)
            drawn_s = heard_s = now_s
        elif now_s - heard_s >= _SILENT_S:
            view.miss()
        ended.wait(max(0.0, drawn_s + _PERIOD_S - time.monotonic()))
