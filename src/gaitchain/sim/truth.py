"""The simulator's ground truth: for judging a walk, never for walking."""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.zmp import LEAST_LOAD, zmp_of_wrench
from gaitchain.messages import GRAVITY, Array
from gaitchain.sim.stability import divergences
from gaitchain.sim.trunk import trunk_of
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import draw_blocks, floor_heights

FALL_HEIGHT = 0.65
"""Part of the base's standing height; a robot below it has fallen."""
FALL_TILT = math.radians(45.0)
"""Tilt of the trunk; a robot that leans further has fallen [rad]."""
_NEAR = 1e-3  # largest distance that is measured exactly [m]
_CORNERS = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
_DOWN = np.array([0.0, 0.0, -1.0])
_SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE


class SimulatorTruth:
    """The robot's true pose and the ground forces on its feet.

    Positions are in the floor's frame: z is 0 on the floor, also if it slopes.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, world: World
    ) -> None:
        """Keep the model and its data, whose memory must not be reallocated."""
        self.model, self.data = model, data
        self._blocks = draw_blocks(world)
        self._up_x, _, self._up_z = world.up
        self._standing = 0.0
        self.update_weight()
        self.feet = [model.body(f"{s}_foot").id for s in ("left", "right")]
        """Bodies of the left and the right foot."""
        self._soles = _sole_geoms(model)
        sizes = model.geom_size[self._soles]
        self._round = bool((model.geom_type[self._soles] == _SPHERE).all())
        self._sole_corners = sizes[..., :1] * _DOWN if self._round else _CORNERS * sizes
        self._leg_pairs = _leg_pairs(model)
        self._trunk, self._wrenches = trunk_of(model, data), data.cfrc_ext
        self._quaternion = self._trunk.pose[3:]
        self._divergences = divergences(data)

    def update_weight(self) -> None:
        """Take note of the robot's weight, again where it has changed."""
        self._weight = float(self.model.body_mass.sum()) * GRAVITY

    @property
    def fallen(self) -> bool:
        """Whether the base is below 0.65 of its height or tilted past 45 deg.

        Also if the physics diverged.
        """
        high = self._trunk.pose[2] >= FALL_HEIGHT * self._standing
        upright = self._vertical()[2] >= math.cos(FALL_TILT)  # no NaN is
        return not (high and upright) or bool(self._divergences.any())

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch of the trunk from the true vertical, positive right, forward.

        In radians, of the rotation R_z(yaw) R_y(pitch) R_x(roll).
        """
        x, y, z = self._vertical()
        return math.atan2(y, z), -math.atan2(x, math.hypot(y, z))

    @property
    def heading(self) -> float:
        """The trunk's heading, to the left of the world's x axis [rad]."""
        w, x, y, z = self._quaternion.tolist()
        return math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))

    @property
    def self_contact(self) -> bool:
        """Whether a geom of one leg touches or intersects one of the other leg.

        Links pass through each other in the simulation; on a real robot they collide.
        """
        return any(
            mujoco.mj_geomDistance(self.model, self.data, a, b, _NEAR, None) <= 0.0
            for a, b in self._leg_pairs
        )

    def sole_heights(self) -> Array:
        """Return the height of each sole's lowest corner above the floor, (2,) [m].

        Each corner is measured from the floor or block right below it; a block between
        the corners is missed. Negative if the sole penetrates the floor.
        """
        corners = self._corners()
        heights = corners[..., 2]
        if len(self._blocks):
            heights -= floor_heights(self._blocks, corners[..., :2])
        return np.asarray(heights.min(axis=1))

    def _corners(self) -> Array:
        """Return the corners of both soles (2, 4, 3), or their balls (2, n, 3) [m]."""
        centres = self.data.geom_xpos[self._soles]
        if self._round:
            return np.asarray(centres + self._sole_corners)
        axes = self.data.geom_xmat[self._soles[:, 0]].reshape(2, 3, 3).swapaxes(1, 2)
        return np.asarray(centres + self._sole_corners @ axes)

    def foot_loads(self) -> Array:
        """Return the normal ground force on the left and right sole, (2,) [N]."""
        return np.asarray(self.ground_wrenches()[:, 5])

    def ground_wrenches(self) -> Array:
        """Return torque and force of the ground on each foot, (2, 6) [N m, N].

        In the world's axes, about the CoM of the whole robot.
        """
        wrenches = self._wrenches[self.feet]
        pushed = self.data.xfrc_applied[self.feet]
        if pushed.any():  # MuJoCo counts all forces from outside as one
            force, torque = pushed[:, :3], pushed[:, 3:]
            arm = self.data.xipos[self.feet] - self.data.subtree_com[1]
            wrenches -= np.hstack([torque + np.cross(arm, force), force])
        return np.asarray(wrenches)

    def foot_positions(self) -> Array:
        """Return the left and right ankle in the world, (2, 3) [m]."""
        return np.array(self.data.xpos[self.feet])

    def foot_yaws(self) -> Array:
        """Return the heading of the left and the right foot, (2,) [rad]."""
        axes = self.data.xmat[self.feet]
        return np.asarray(np.arctan2(axes[:, 3], axes[:, 0]))

    def _vertical(self) -> tuple[float, float, float]:
        """Return the true vertical in the trunk's frame, a unit vector."""
        w, x, y, z = self._quaternion.tolist()
        sin, cos = self._up_x, self._up_z
        return (
            sin * (1.0 - 2.0 * (y * y + z * z)) + cos * 2.0 * (x * z - w * y),
            sin * 2.0 * (x * y - w * z) + cos * 2.0 * (y * z + w * x),
            sin * 2.0 * (x * z + w * y) + cos * (1.0 - 2.0 * (x * x + y * y)),
        )

    def zmp(self) -> Array:
        """Return the ZMP of the forces on both soles, (2,) [m]; NaN off the ground."""
        wrench = self.ground_wrenches().sum(axis=0)
        torque, force = wrench[:3], wrench[3:]
        if force[2] < LEAST_LOAD * self._weight:
            return np.full(2, np.nan)
        return zmp_of_wrench(torque, force, self.data.subtree_com[1])


def _sole_geoms(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Return the box of each sole, or its balls where it tapers, (2, n).

    A sole with fewer balls than the other one counts its first again.
    """
    found = []
    for side in ("left", "right"):
        foot = model.body(f"{side}_foot")
        geoms = range(foot.geomadr[0], foot.geomadr[0] + foot.geomnum[0])
        balls = [geom for geom in geoms if model.geom_type[geom] == _SPHERE]
        found.append(balls or [model.geom(f"{side}_foot_box").id])
    most = max(map(len, found))
    return np.array([of + of[:1] * (most - len(of)) for of in found])


def _leg_pairs(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Return all pairs of geoms with one of each leg."""
    of_side: dict[str, list[int]] = {"left": [], "right": []}
    for geom in range(model.ngeom):
        side = model.body(model.geom_bodyid[geom]).name.partition("_")[0]
        if side in of_side:
            of_side[side].append(geom)
    return [(a, b) for a in of_side["left"] for b in of_side["right"]]
