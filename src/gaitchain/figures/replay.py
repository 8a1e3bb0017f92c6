"""A recorded walk as one HTML file that any browser plays, without server or network.

All drawn nodes are children of ``/walk``, which moves back by the smoothed path of the
robot. So the robot stays in view, and the viewer can orbit freely.
"""

# ruff: noqa: PLC0415 - mujoco loads only when a replay is written.

from __future__ import annotations

import html
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import CommandError, file_errors
from gaitchain.sim.scene_meshes import (
    BLUE,
    RED,
    WORLD,
    draw_bodies,
    local_server,
    segments,
)

if TYPE_CHECKING:
    from mujoco import MjModel
    from viser import FrameHandle, ViserServer

_PALE = (244, 214, 214)
_WINDOW = 1.0  # [s] of past ZMP that is drawn, and of path over which the view averages


@dataclass(frozen=True)
class Recording:
    """The data of a walk for a replay, N samples; SI units, world frame."""

    time: NDArray[np.float64]  # (N,) [s], rising
    qpos: NDArray[np.float64]  # (N, nq) MuJoCo positions, free joint first
    zmp: NDArray[np.float64]  # (N, 2) [m] on the floor; NaN while no foot touches
    support: tuple[NDArray[np.float64], ...] | None = None  # N polygons (K, 2) [m]

    def __post_init__(self) -> None:
        n = len(self.time)
        # A robot that fell while it settled has one sample.
        if n < 1 or not np.all(np.diff(self.time) > 0.0):
            raise CommandError(f"time must rise over 1 or more samples, got {n}")
        for name in ("qpos", "zmp", "support"):
            rows = getattr(self, name)
            if rows is not None and len(rows) != n:
                raise CommandError(f"{name} has {len(rows)} samples, time has {n}")


def write_replay(
    model: MjModel,
    recording: Recording,
    path: Path,
    *,
    fps: float = 25.0,
    title: str = "gaitchain walk",
) -> int:
    """Write a walk as a self-contained HTML page that loops and has a time slider.

    Args:
        model: Robot whose geometry, colours and kinematics are drawn.
        recording: The walk.
        path: File to write, usually ``walk.html``.
        fps: Frames per second of the replay, independent of the sample rate.
        title: Title of the page.

    Returns:
        Number of bytes written.

    Raises:
        CommandError: ``qpos`` does not fit ``model``, or ``fps`` is not in (0, 240].
    """
    if recording.qpos.shape[1:] != (model.nq,):
        raise CommandError(f"qpos is {recording.qpos.shape}, must be (N, {model.nq})")
    if not 0.0 < fps <= 240.0:
        raise CommandError(f"fps is {fps:g}, must be in (0, 240]")
    frames = _resample(recording, fps)
    # The root where it is highest, as a robot that gets up lies at first [m].
    size = max(float(frames.qpos[:, 2].max()), 0.05)
    with local_server() as server:
        floor = _floor(server, frames, size)
        robot = _robot(server, model, frames)
        marks = _marks(server, frames, size)
        steps = zip(floor, robot, marks, strict=True)
        next(steps)  # the first frame is the state to which the loop returns
        serializer = server.get_scene_serializer()
        for _ in frames.time:
            serializer.insert_sleep(1.0 / fps)
            next(steps, None)
        page = serializer.as_html()
    page = page.replace("<title>Viser<", f"<title>{html.escape(title)}<", 1)
    with file_errors(path, "written", CommandError):
        return path.write_bytes(page.encode())


def _resample(recording: Recording, fps: float) -> Recording:
    """Take the latest sample at each frame of the replay."""
    start, end = recording.time[[0, -1]]
    time = start + np.arange(max(int((end - start) * fps + 1e-9), 1) + 1) / fps
    pick = np.searchsorted(recording.time, time + 1e-9, side="right") - 1
    support = recording.support and tuple(recording.support[i] for i in pick)
    return Recording(time, recording.qpos[pick], recording.zmp[pick], support)


def _floor(server: ViserServer, frames: Recording, size: float) -> Iterator[None]:
    """Draw a grid of 10 cm, set the camera, and move the grid along with the robot."""
    server.scene.add_grid(
        f"{WORLD}/floor",
        cell_size=0.1,
        section_size=0.5,
        infinite_grid=True,
        fade_distance=20.0 * size,
        fade_strength=0.5,
        plane_color=(238, 241, 245),
        plane_opacity=1.0,
    )
    server.initial_camera.fov = np.deg2rad(35.0)
    server.initial_camera.position = size * np.array([3.0, -3.6, 2.4])
    server.initial_camera.look_at = size * np.array([0.0, 0.0, 0.85])
    walk = server.scene.add_frame(WORLD, show_axes=False)
    window = max(round(_WINDOW / (frames.time[1] - frames.time[0])), 1)
    ends = window // 2, window - 1 - window // 2
    padded = np.pad(frames.qpos[:, :2], (ends, (0, 0)), mode="edge")
    path = np.lib.stride_tricks.sliding_window_view(padded, window, axis=0)
    for x, y in _snap(path.mean(axis=-1)):
        walk.position = (-x, -y, 0.0)
        yield


def _robot(server: ViserServer, model: MjModel, frames: Recording) -> Iterator[None]:
    """Draw the geoms once on a node per body, then move the bodies."""
    import mujoco

    data = mujoco.MjData(model)
    bodies: dict[int, FrameHandle] = {}
    for qpos in frames.qpos:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        bodies = bodies or draw_bodies(server, model, data)
        for body, frame in bodies.items():  # viser sends only the changes
            frame.position, frame.wxyz = _snap(data.xpos[body]), _snap(data.xquat[body])
        yield


def _marks(server: ViserServer, frames: Recording, size: float) -> Iterator[None]:
    """Draw the support region in blue, and the ZMP in red with a fading trail."""
    trail = max(round(_WINDOW / (frames.time[1] - frames.time[0])), 1)
    valid = np.isfinite(frames.zmp[:, 0] + frames.zmp[:, 1])
    # Without contact the trail ends at the last ZMP, initially at the first one.
    last = np.maximum.accumulate(np.where(valid, np.arange(len(valid)), valid.argmax()))
    path = np.pad(_snap(np.nan_to_num(frames.zmp[last])), ((trail, 0), (0, 1)), "edge")
    path[:, 2] = 0.004 * size  # above the floor
    fade = segments(np.linspace(_PALE, RED, trail + 1))
    lines = server.scene.add_line_segments
    tail = lines(
        f"{WORLD}/ZMP trail", fade, fade.astype(np.uint8), thickness=0.012 * size
    )
    ball = server.scene.add_icosphere(f"{WORLD}/ZMP", radius=0.03 * size, color=RED)
    edge = lines(f"{WORLD}/support", np.zeros((1, 2, 3)), BLUE, thickness=0.016 * size)
    tail.visible = bool(valid.any())
    for i, corners in enumerate(frames.support or [np.empty((0, 2))] * len(valid)):
        ball.visible, ball.position = bool(valid[i]), path[i + trail]
        tail.points = segments(path[i : i + trail + 1])
        edge.visible = len(corners) > 1
        if edge.visible:
            loop = _snap(np.vstack([corners, corners[:1]]))
            edge.points = segments(np.insert(loop, 2, 0.003 * size, axis=1))
        yield


def _snap(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round to 2^-14 (0.06 mm), because numbers with few digits compress better."""
    return np.round(values * 2.0**14) / 2.0**14
