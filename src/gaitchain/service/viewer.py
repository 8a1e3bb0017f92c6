"""The live 3-D view: the robot, its ZMP and its support in a browser.

All drawn nodes are children of one node, the world. Each client has its own copy of
that node, which moves back as the robot walks: the robot stays in view, and the viewer
can orbit freely, which a camera moved from here would not allow.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from gaitchain.live.messages import Telemetry
from gaitchain.live.scene import Point, Scene, Stage
from gaitchain.live.shown_joints import shown_joints
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.looks import Look
from gaitchain.sim.model import build_model
from gaitchain.sim.scene_meshes import BLUE, RED, WORLD, draw_bodies, segments
from gaitchain.walker.place import Place

if TYPE_CHECKING:
    from viser import (
        ClientHandle,
        FrameHandle,
        GuiInputHandle,
        SceneNodeHandle,
        ViserServer,
    )

_GLIDE_S = 0.35  # the world follows the robot as slowly as that
_GREY = (128, 134, 144)  # seen on white and on black
_AMBER = (200, 120, 0)
_ARROW = np.array([[1.0, 0.0], [-0.6, 0.6], [-0.2, 0.0], [-0.6, -0.6], [1.0, 0.0]])
_RING = np.linspace(0.0, 2.0 * math.pi, 25)


@dataclass
class _Visitor:
    """What one browser has to itself."""

    world: FrameHandle
    follows: GuiInputHandle[bool]
    at: Array = field(default_factory=lambda: np.zeros(2))
    """What is in the middle of the view [m]."""


class LiveView:
    """Draws telemetry for whoever looks."""

    def __init__(
        self, server: ViserServer, robot: Robot, own: mujoco.MjModel | None = None
    ) -> None:
        """Draw the robot as it stands; one of a file as its skeleton.

        Args:
            server: where to draw.
            robot: the robot.
            own: the robot's own model, if that is simulated; drawn in its place.
        """
        self._server, self._robot, self._stage = server, robot, Stage(robot)
        skeleton = build_model(robot, looks=())
        hips = float(mujoco.MjData(skeleton).qpos[2])
        self._size = max(hips, 0.05)  # height of the hips [m]
        self._own = own is not None
        self._model = skeleton if own is None else own
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)
        self._bodies = draw_bodies(server, self._model, self._data)
        self._place_bodies()
        self._furnish()
        self._mark()
        self._visitors: dict[int, _Visitor] = {}
        self._lock = threading.Lock()
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._forget_client)

    def wear(self, looks: Sequence[Look]) -> None:
        """Draw the robot in its own shapes, see `sim.looks`; () is no change."""
        if not looks or self._own:
            return
        standing = self._data
        self._model = build_model(self._robot, looks=looks)
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:] = standing.qpos
        mujoco.mj_kinematics(self._model, self._data)
        with self._server.atomic():
            for frame in self._bodies.values():
                frame.remove()
            self._bodies = draw_bodies(self._server, self._model, self._data)
            self._place_bodies()

    def show(self, telemetry: Telemetry, since_s: float) -> None:
        """Draw the robot as it is now.

        Args:
            telemetry: of now.
            since_s: since it was drawn last [s].
        """
        scene = self._stage.scene(telemetry)
        self._data.qpos[:] = self._positions(telemetry, scene)
        mujoco.mj_kinematics(self._model, self._data)
        with self._server.atomic():
            self.silence.visible = False
            self._place_bodies()
            _put(self.ball, scene.zmp, 0.02 * self._size)
            _put(self.ring, scene.planned_zmp, 0.006 * self._size)
            self._outline(scene.region)
            self._aim(scene.goal)
        self._follow(np.array(scene.trunk[:2]), since_s)

    def miss(self) -> None:
        """Say that no telemetry comes; the robot stays as it was."""
        self.silence.visible = True

    def _positions(self, telemetry: Telemetry, scene: Scene) -> Array:
        """(nq,) generalised positions; what is not known is as in a stand."""
        if self._own:  # not every row has its truth
            whole = telemetry.truth.whole if telemetry.truth else ()
            return np.array(whole or self._data.qpos)
        if telemetry.truth is not None:
            return np.array(telemetry.truth.qpos)
        joints = shown_joints(telemetry, self._robot.legs.stand)
        return np.concatenate([scene.trunk, joints])

    def _place_bodies(self) -> None:
        for body, frame in self._bodies.items():  # viser sends only what has moved
            frame.position, frame.wxyz = self._data.xpos[body], self._data.xquat[body]

    def _furnish(self) -> None:
        """Lay the floor, look at it from the side and front, and clear the screen."""
        server, size = self._server, self._size
        server.scene.add_frame(WORLD, show_axes=False)
        server.scene.add_grid(
            f"{WORLD}/floor",
            cell_size=0.1,
            section_size=0.5,
            cell_color=_GREY,
            cell_thickness=0.5,
            section_color=_GREY,
            section_thickness=1.2,
            infinite_grid=True,
            fade_distance=20.0 * size,
            fade_strength=0.5,
        )
        server.initial_camera.fov = math.radians(35.0)
        server.initial_camera.position = size * np.array([3.0, -3.6, 2.4])
        server.initial_camera.look_at = size * np.array([0.0, 0.0, 0.85])
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.gui.set_panel_label("View")
        server.gui.main_panel.set_width(200)
        server.gui.main_panel.minimize()

    def _mark(self) -> None:
        """Make what marks the ZMP, its plan, the support, and the lack of news."""
        scene, size = self._server.scene, self._size
        self.ball = scene.add_icosphere(f"{WORLD}/ZMP", 0.03 * size, RED, visible=False)
        circle = np.stack([np.cos(_RING), np.sin(_RING), 0.0 * _RING], axis=1)
        self.ring = scene.add_line_segments(
            f"{WORLD}/planned ZMP",
            segments(0.045 * size * circle),
            RED,
            thickness=0.012 * size,
            visible=False,
        )
        self.edge = scene.add_line_segments(
            f"{WORLD}/support",
            np.zeros((1, 2, 3)),
            BLUE,
            thickness=0.016 * size,
            visible=False,
        )
        self.goal = scene.add_line_segments(
            f"{WORLD}/goal",
            segments(np.insert(0.2 * size * _ARROW, 2, 0.004 * size, axis=1)),
            _AMBER,
            thickness=0.02 * size,
            visible=False,
        )
        self.silence = scene.add_label(
            "/no telemetry",
            "no telemetry",
            position=(0.0, 0.0, 1.9 * size),
            font_screen_scale=1.6,
            anchor="center-center",
        )

    def _outline(self, corners: tuple[Point, ...]) -> None:
        self.edge.visible = len(corners) > 1
        if self.edge.visible:
            loop = np.array([*corners, corners[0]])
            middle = loop[:-1].mean(axis=0)
            # A browser moves a node at once, but is slow to give it another shape.
            self.edge.position = *middle, 0.003 * self._size
            self.edge.points = segments(np.insert(loop - middle, 2, 0.0, axis=1))

    def _aim(self, goal: Place | None) -> None:
        """Put an arrow where the driver sent the robot."""
        self.goal.visible = goal is not None
        if goal is not None:
            x, y, yaw = goal
            self.goal.position = x, y, 0.0
            self.goal.wxyz = math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)

    def _follow(self, trunk: Array, since_s: float) -> None:
        if not np.isfinite(trunk).all():
            return
        with self._lock:
            visitors = list(self._visitors.values())
        for visitor in visitors:
            if visitor.follows.value:
                visitor.at += (trunk - visitor.at) * -math.expm1(-since_s / _GLIDE_S)
                visitor.world.position = (-visitor.at[0], -visitor.at[1], 0.0)

    def _welcome(self, client: ClientHandle) -> None:
        """Give a browser its own world, which takes the place of the common one."""
        world = client.scene.add_frame(WORLD, show_axes=False)
        follows = client.gui.add_checkbox("Follow the robot", initial_value=True)
        with self._lock:
            self._visitors[client.client_id] = _Visitor(world, follows)

    def _forget_client(self, client: ClientHandle) -> None:
        with self._lock:
            self._visitors.pop(client.client_id, None)


def _put(node: SceneNodeHandle, place: Point, height: float) -> None:
    """Put a mark on the floor, or hide it where nothing is known."""
    node.visible = all(map(math.isfinite, place))
    if node.visible:
        node.position = (*place, height)
