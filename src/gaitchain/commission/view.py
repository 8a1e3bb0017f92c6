"""A page with the robot in 3-D as it is asked to be, and the joint that should move."""

from __future__ import annotations

import math
import multiprocessing
import queue
import signal
from itertools import cycle
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from gaitchain.discover.looks import find_looks
from gaitchain.errors import CommandError, GaitchainError
from gaitchain.gait.library import GaitLibrary
from gaitchain.live.clock import Clock
from gaitchain.messages import Array
from gaitchain.sim.model import build_model
from gaitchain.sim.scene_meshes import RED, WORLD, draw_bodies, local_server, segments

if TYPE_CHECKING:
    from collections.abc import Iterator

    from viser import SceneNodeHandle, ViserServer

_PERIOD_S = 1.0 / 30.0  # between two pictures
_END_S = 5.0  # in which a process ends by itself
_RING = 0.2  # its radius over the height of the hips
_WIDTH = 6.0  # pixels
_AROUND = np.linspace(0.0, 2.0 * math.pi, 37)
_SAYS = "The robot as it is asked to be. Compare it with the one beside you."
_BASE = 7  # generalised coordinates of the trunk


class RobotView:
    """A robot on a page, with its joints at their targets and its trunk held still."""

    def __init__(
        self, server: ViserServer, library: GaitLibrary, title: str = "Doctor"
    ) -> None:
        """Draw the robot as it stands.

        Args:
            server: where to draw.
            library: of the robot.
            title: of the panel with the words.
        """
        self._server = server
        self._model = build_model(library.robot, looks=find_looks(library))
        self._data = mujoco.MjData(self._model)
        self._size = float(self._data.qpos[2])
        mujoco.mj_kinematics(self._model, self._data)
        server.scene.add_frame(WORLD, show_axes=False)
        self._bodies = draw_bodies(server, self._model, self._data)
        self._marks: tuple[SceneNodeHandle, ...] = ()
        self._joint = -1
        self._film: Iterator[Array] = iter(())
        self._furnish(title)
        stand = np.asarray(library.robot.legs.stand)
        self.show(stand)

    def show(self, target: Array) -> None:
        """See `Screen.show`."""
        self._data.qpos[_BASE : _BASE + len(target)] = target
        mujoco.mj_kinematics(self._model, self._data)
        with self._server.atomic():
            for body, frame in self._bodies.items():
                frame.position = self._data.xpos[body]
                frame.wxyz = self._data.xquat[body]
            self._mark()

    def point(self, joint: int, text: str) -> None:
        """See `Screen.point`: a red ring about the joint's axis, with the text."""
        self.clear()
        self._joint = joint
        scene, size = self._server.scene, self._size
        round_it = np.stack([np.cos(_AROUND), np.sin(_AROUND), np.zeros(37)], axis=1)
        ring = scene.add_line_segments(
            f"{WORLD}/asked",
            segments(_RING * size * round_it),
            RED,
            thickness=_WIDTH,
            thickness_units="screen",
        )
        label = scene.add_label(f"{WORLD}/name", text)
        self._marks = ring, label
        self.text.content = f"**{text}**"
        self._mark()

    def play(self, targets: Array, period_s: float, text: str) -> None:
        """See `Screen.play`; `advance` shows the next picture."""
        every = max(1, round(_PERIOD_S / period_s))
        self._film = cycle(targets[::every])
        self.text.content = f"**{text}**"

    def advance(self) -> None:
        """Show the next picture of what is played, if anything is."""
        target = next(self._film, None)
        if target is not None:
            self.show(target)

    def clear(self) -> None:
        """See `Screen.clear`."""
        self._film = iter(())
        for mark in self._marks:
            mark.remove()
        self._marks, self._joint = (), -1
        self.text.content = _SAYS

    def _mark(self) -> None:
        """Put ring and name to the joint that is pointed at."""
        if not self._marks:
            return
        joint = 1 + self._joint  # the first one is the base's
        turn = np.empty(4)
        mujoco.mju_quatZ2Vec(turn, self._data.xaxis[joint])
        at = self._data.xanchor[joint]
        ring, label = self._marks
        ring.position, ring.wxyz = at, turn
        label.position = at + np.array([0.0, 0.0, 1.3 * _RING * self._size])

    def _furnish(self, title: str) -> None:
        server, size = self._server, self._size
        camera = server.initial_camera
        camera.fov = math.radians(35.0)
        camera.position = size * np.array([3.8, -1.3, 1.4])
        camera.look_at = size * np.array([0.0, 0.0, 0.75])
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.gui.set_panel_label(title)
        self.text = server.gui.add_markdown(_SAYS)


class ViewProcess:
    """A view in a process of its own, so that no picture delays the servos."""

    def __init__(self, library: GaitLibrary, port: int, title: str = "Doctor") -> None:
        """Start it, and wait until the page is there.

        Args:
            library: of the robot.
            port: to listen on; 0 for a free one.
            title: of the panel with the words.

        Raises:
            CommandError: the port cannot be had, or a package for the view is missing.
        """
        own = multiprocessing.get_context("spawn")
        self._asked: Any = own.Queue()
        told, tells = own.Pipe(duplex=False)
        self._process = own.Process(
            target=_serve,
            args=(library, port, title, self._asked, tells),
            daemon=True,
        )
        self._process.start()
        tells.close()
        with told:
            self.address = _heard(told)
        self._clock, self._shown_s = Clock(), -math.inf

    def show(self, target: Array) -> None:
        """See `Screen.show`; no more than 30 pictures a second are asked for."""
        now_s = self._clock.now()
        if now_s - self._shown_s >= _PERIOD_S:
            self._shown_s = now_s
            self._ask("show", np.array(target))

    def point(self, joint: int, text: str) -> None:
        """See `Screen.point`."""
        self._ask("point", joint, text)

    def play(self, targets: Array, period_s: float, text: str) -> None:
        """See `Screen.play`."""
        self._ask("play", targets, period_s, text)

    def clear(self) -> None:
        """See `Screen.clear`."""
        self._ask("clear")

    def close(self) -> None:
        """End it."""
        self._asked.put(None)
        self._process.join(_END_S)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join()
        # What nobody reads any more would keep this process from its end.
        self._asked.cancel_join_thread()

    def _ask(self, name: str, *arguments: Any) -> None:
        """Ask for a method of the view; not where its process has gone."""
        if self._process.is_alive():
            self._asked.put((name, *arguments))


def _serve(library: GaitLibrary, port: int, title: str, asked: Any, tells: Any) -> None:
    """Serve a view until it is told to end.

    Args:
        library: of the robot.
        port: to listen on; 0 for a free one.
        title: of the panel with the words.
        asked: names of the view's methods with their arguments; None ends it.
        tells: pipe for the address, or an error.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other process tells the end
    try:
        with local_server(port) as server:
            view = RobotView(server, library, title)
            tells.send(f"http://127.0.0.1:{server.get_port()}")
            while (wanted := _next(asked)) is not None:
                name, *arguments = wanted
                getattr(view, name)(*arguments)
    except GaitchainError as error:
        tells.send(error)


def _next(asked: Any) -> Any:
    """Return what is asked; the next picture, where nothing is."""
    try:
        return asked.get(timeout=_PERIOD_S)
    except queue.Empty:
        return ("advance",)


def _heard(told: Any) -> str:
    """Return the address that the process tells."""
    try:
        found = told.recv()
    except EOFError:
        found = CommandError("the page of the view could not be served")
    if isinstance(found, GaitchainError):
        raise found
    return str(found)
