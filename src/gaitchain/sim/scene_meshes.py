"""The robot's model as meshes in a viser scene, for replay and live view."""

# ruff: noqa: PLC0415 - mujoco, viser and trimesh load only when something is drawn.

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import CommandError, needed_by

if TYPE_CHECKING:
    from mujoco import MjData, MjModel
    from trimesh import Trimesh
    from viser import FrameHandle, ViserServer

RED, BLUE = (214, 39, 40), (31, 95, 191)
WORLD = "/walk"
"""The parent node of all drawn nodes; it moves back as the robot walks forward."""
_GLASS = 0.4  # opacity of the feet, so that ZMP and support region stay visible
ANKLE = 0.16
"""Part of the root's height; a geom centred below it belongs to a foot."""
# As coarse as smooth shading hides, to within 1.3 % of a radius: without a graphics
# card, and with shadows, each triangle counts. trimesh's own are 4 to 7 times as many.
_CAPSULE = (12, 24)
"""How many pieces a capsule has from pole to pole, and around."""
_SPHERE = 2
"""How often the faces of an icosahedron are split in four."""


@contextmanager
def local_server(port: int = 0) -> Iterator[ViserServer]:
    """Run a viser server on loopback without console output; stop it at the end.

    Args:
        port: port to listen on; 0 for a free one.

    Yields:
        The server, which refuses to open a public tunnel.

    Raises:
        CommandError: the port is taken, or may not be listened on.
        MissingExtraError: a package for the view is missing.
    """
    import rich

    with needed_by("a 3-D view"):
        from viser import ViserServer

    class LocalServer(ViserServer):
        """A server that can be reached from this machine only."""

        def request_share_url(self, verbose: bool = True) -> str | None:
            """Refuse a public URL, which any client can request."""
            return None

    if port:
        _check_port(port)
    console = rich.get_console()
    with ExitStack() as stack:
        stack.callback(setattr, console, "quiet", console.quiet)
        console.quiet = True  # viser 1.1 prints at start and stop, verbose or not
        server = LocalServer("127.0.0.1", port, verbose=False)
        stack.callback(server.stop)
        found = server.get_port()
        if port not in (0, found):  # taken since it was looked at
            raise CommandError(f"port {port} of the 3-D view is taken; {found} is free")
        yield server


def _check_port(port: int) -> None:
    """Refuse a port that cannot be had: viser would try others, some for ever."""
    try:
        socket.create_server(("127.0.0.1", port)).close()
    except OSError as error:
        why = os.strerror(error.errno or 0)
        raise CommandError(
            f"port {port} of the 3-D view: {why}; choose another, or 0 for a free one"
        ) from None


def draw_bodies(
    server: ViserServer, model: MjModel, data: MjData
) -> dict[int, FrameHandle]:
    """Draw the geoms that MuJoCo's own viewer shows, with translucent feet.

    Args:
        server: the server whose scene to draw in.
        model: the robot.
        data: the robot standing, to tell its feet from its hands.

    Returns:
        The node of each visible body, under `WORLD`.
    """
    import mujoco

    option = mujoco.MjvOption()
    if not (model.geom_group[model.geom_bodyid > 0] <= 2).any():
        option.geomgroup[:] = 1  # the robot has collision geoms only
    scene = mujoco.MjvScene(model, 2 * model.ngeom + 100)
    kinds, camera = mujoco.mjtCatBit.mjCAT_ALL, mujoco.MjvCamera()
    mujoco.mjv_updateScene(model, data, option, None, camera, kinds, scene)
    bodies: dict[int, FrameHandle] = {}
    for geom in scene.geoms[: scene.ngeom]:
        is_geom = geom.objtype == mujoco.mjtObj.mjOBJ_GEOM
        mesh = _mesh(model, geom.objid) if is_geom else None
        if mesh is None:
            continue
        body = int(model.geom_bodyid[geom.objid])
        # The number makes the name unique; a slash would start a child node.
        name = f"{WORLD}/{body} {model.body(body).name.replace('/', ':')}"
        if body not in bodies:
            bodies[body] = server.scene.add_frame(name, show_axes=False)
        is_foot = body > 0 and geom.pos[2] < ANKLE * data.qpos[2]
        opacity = min(float(geom.rgba[3]), _GLASS if is_foot else 1.0)
        server.scene.add_mesh_simple(
            f"{name}/{geom.objid}",
            mesh.vertices,
            mesh.faces,
            color=geom.rgba[:3],
            opacity=opacity if opacity < 1.0 else None,
            position=model.geom_pos[geom.objid],
            wxyz=model.geom_quat[geom.objid],
        )
    return bodies


def _mesh(model: MjModel, geom: int) -> Trimesh | None:
    """Triangulate a geom in its own frame; None for the floor and unsupported types."""
    from mujoco import mjtGeom
    from trimesh import Trimesh, creation

    size, kind = model.geom_size[geom], mjtGeom(model.geom_type[geom])
    mesh: Trimesh | None = None
    if kind == mjtGeom.mjGEOM_BOX:
        mesh = creation.box(2.0 * size)
    elif kind == mjtGeom.mjGEOM_CAPSULE:
        mesh = creation.capsule(2.0 * size[1], size[0], count=_CAPSULE)
    elif kind == mjtGeom.mjGEOM_CYLINDER:
        mesh = creation.cylinder(size[0], 2.0 * size[1])
    elif kind in (mjtGeom.mjGEOM_SPHERE, mjtGeom.mjGEOM_ELLIPSOID):
        mesh = creation.icosphere(_SPHERE)
        mesh.apply_scale(size if size[1] else size[0])
    elif kind == mjtGeom.mjGEOM_MESH:
        part = model.mesh(model.geom_dataid[geom])
        vertices = model.mesh_vert[part.vertadr[0] :][: part.vertnum[0]]
        mesh = Trimesh(vertices, model.mesh_face[part.faceadr[0] :][: part.facenum[0]])
    return mesh and mesh.smooth_shaded  # smooth curved surfaces, sharp edges


def segments(points: NDArray[np.float64]) -> NDArray[np.float32]:
    """Join (n + 1, 3) points into (n, 2, 3) line segments."""
    return np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
