"""Fig. 9: rendered images of the walk, with the ZMP in red."""

# ruff: noqa: PLC0415 - OpenGL loads only when snapshots are rendered.

import os
import platform
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitchain.analysis.record import WalkRecord
from gaitchain.errors import RenderError
from gaitchain.figures.steps import WalkedStep, two_cycles
from gaitchain.figures.style import drawing, rounded, write_json
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.bodies import SIDES
from gaitchain.sim.looks import Look
from gaitchain.sim.model import build_model, standing_height
from gaitchain.sim.scene_meshes import ANKLE

_WIDTH, _HEIGHT = 520, 800  # [pixel]
_RED, _GLASS = (0.86, 0.05, 0.05, 1.0), 0.3
Image = NDArray[np.uint8]
"""(height, width, 3) red, green and blue."""
_CLAIM = {
    "text": "Snapshots of the walk in Microsoft Robotics Studio; the red point is the "
    "ZMP computed in the simulated world."
}


def figure_9(
    out: Path, record: WalkRecord, robot: Robot, looks: Sequence[Look] = ()
) -> dict[str, Any]:
    """Render the walk at the key moments of two cycles, with the measured ZMP (Fig. 9).

    Arguments, result and errors are those of `figure_8`; `looks` are the robot's
    visible shapes, see `sim.looks.add_shapes`.

    Raises:
        RenderError: off-screen rendering is not available.
    """
    steps = two_cycles(record)
    moments = [(step, i, step.moments[i]) for step in steps for i in range(3)]
    rows = [row for _, _, row in moments]
    images = _render(robot, record, rows, looks)
    captions = [
        f"kp$_{i + 1}$, step {step.number}\nt = {record.time_s[row]:.2f} s"
        for step, i, row in moments
    ]
    _draw(out / "fig09.png", images, captions, steps)
    result = {
        "time_s": rounded(record.time_s[rows], 3),
        "key_moment": [f"kp_{i + 1}" for _, i, _ in moments],
        "step": [step.number for step, _, _ in moments],
        "support": record.support[rows].tolist(),
        "zmp_m": rounded(record.zmp[rows]),
        "base_m": rounded(record.qpos[rows, :3]),
        "ours": f"{len(rows)} snapshots from MuJoCo, measured ZMP in red",
        "paper": _CLAIM,
    }
    return write_json(out / "fig09.json", result)


def draw_portrait(robot: Robot, looks: Sequence[Look] = ()) -> Image:
    """Render a robot in its standing pose, with bent knees.

    Args:
        robot: the robot.
        looks: its visible shapes, see `sim.looks.add_shapes`.

    Raises:
        RenderError: off-screen rendering is not available.
    """
    model = build_model(robot, looks=looks)
    _light(model)
    data = mujoco.MjData(model)
    stand_on_floor(model, data, robot)
    with _context(model) as context:
        return _picture(_scene(model, data, standing_height(robot)), context)


def stand_on_floor(model: mujoco.MjModel, data: mujoco.MjData, robot: Robot) -> None:
    """Place a robot in its standing pose, the lower side of its soles on the floor.

    Args:
        model: of the robot, see `sim.model.build_model`.
        data: its state, which is set.
        robot: the robot.
    """
    data.qpos[7 : 7 + len(robot.legs.stand)] = robot.legs.stand
    mujoco.mj_kinematics(model, data)
    soles = [f"{side}_foot_box" for side in SIDES]
    data.qpos[2] -= min(data.geom(s).xpos[2] - model.geom(s).size[2] for s in soles)
    mujoco.mj_forward(model, data)


def _draw(
    path: Path,
    images: Sequence[Image],
    captions: Sequence[str],
    steps: list[WalkedStep],
) -> None:
    columns = min(6, len(images))
    count = -(-len(images) // columns)
    with drawing(path, 1.25 * columns, 2.3 * count + 0.3) as figure:
        panels = figure.subplots(count, columns, squeeze=False).ravel()
        for axes in panels:
            axes.set_axis_off()
        for axes, image, caption in zip(panels, images, captions, strict=False):
            axes.imshow(image, interpolation="antialiased")
            axes.set_title(caption, fontsize=8)
        figure.suptitle(
            f"Fig. 9: steps {steps[0].number} to {steps[-1].number} in MuJoCo, "
            "measured ZMP in red (kp$_4$ is kp$_1$ of the next step)",
            fontsize=9.5,
        )


def _render(
    robot: Robot, record: WalkRecord, rows: Sequence[int], looks: Sequence[Look]
) -> list[Image]:
    model = build_model(robot, looks=looks)
    _light(model)
    _show_soles(model)
    data = mujoco.MjData(model)
    size = standing_height(robot)
    images = []
    with _context(model) as context:
        for row in rows:
            data.qpos[:] = record.qpos[row]
            mujoco.mj_forward(model, data)
            scene = _scene(model, data, size)
            _add_zmp(scene, record.zmp[row], size)
            images.append(_picture(scene, context))
    return images


def _show_soles(model: mujoco.MjModel) -> None:
    """Make the feet translucent, as the ZMP is below one."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    low = data.geom_xpos[:, 2] < ANKLE * data.qpos[2]
    model.geom_rgba[low & (model.geom_bodyid > 0), 3] = _GLASS


def _light(model: mujoco.MjModel) -> None:
    """Light a robot evenly."""
    model.vis.global_.offwidth, model.vis.global_.offheight = _WIDTH, _HEIGHT
    model.light_type[:] = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    model.light_diffuse[:] = 0.3
    model.vis.headlight.ambient[:] = 0.45
    model.vis.headlight.diffuse[:] = 0.4
    model.vis.headlight.specular[:] = 0.0
    model.vis.rgba.haze[:] = 1.0


def _scene(model: Any, data: Any, size: float) -> mujoco.MjvScene:
    """Return the scene, seen from the robot's front right."""
    camera = mujoco.MjvCamera()
    camera.lookat[:] = [*data.qpos[:2], 0.92 * size]
    camera.distance = 3.3 * size
    camera.azimuth, camera.elevation = 140.0, -14.0
    scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 100)
    every = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, every, scene)
    for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
        scene.flags[flag] = 0
    scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = 1
    return scene


def _add_zmp(scene: mujoco.MjvScene, zmp: Array, size: float) -> None:
    """Add a red ball at the ZMP, unless no foot touches the floor."""
    if np.isnan(zmp).any():
        return
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom],
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=np.full(3, 0.035 * size),
        pos=np.array([*zmp, 0.02 * size]),
        mat=np.eye(3).ravel(),
        rgba=np.array(_RED, dtype=np.float32),
    )
    scene.geoms[scene.ngeom].emission = 1.0
    scene.ngeom += 1


def _picture(scene: mujoco.MjvScene, context: Any) -> Image:
    frame = mujoco.MjrRect(0, 0, _WIDTH, _HEIGHT)
    image = np.empty((_HEIGHT, _WIDTH, 3), dtype=np.uint8)
    mujoco.mjr_render(frame, scene, context)
    depth = np.empty((_HEIGHT, _WIDTH), dtype=np.float32)
    mujoco.mjr_readPixels(image, depth, frame, context)
    image[np.abs(depth - np.round(depth)) < 1e-6] = 255  # white background
    return image[::-1]


@contextmanager
def _context(model: Any) -> Iterator[Any]:
    """Open an off-screen OpenGL context.

    `mujoco.Renderer` chooses its OpenGL library from MUJOCO_GL when mujoco is imported,
    which has already happened here; so the context is created directly.
    """
    try:
        window = _gl_class()(_WIDTH, _HEIGHT)
        window.make_current()
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    except Exception as error:  # each OpenGL library raises other exceptions
        raise RenderError(
            f"no off-screen OpenGL here ({error}); on Debian and Ubuntu "
            "`apt install libegl1 libopengl0 libgl1-mesa-dri` gives it"
        ) from error
    try:
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        yield context
    finally:
        context.free()
        window.free()


def _gl_class() -> Any:
    if platform.system() == "Linux" and not os.environ.get("MUJOCO_GL"):
        from mujoco.egl import GLContext
    else:
        from mujoco.gl_context import GLContext
    return GLContext
