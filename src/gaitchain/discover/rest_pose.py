"""A robot with its legs' joints at 0, taken apart into links, in the pelvis frame."""

from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.discover.findings import Findings, FoundLeg
from gaitchain.messages import Array


class Link(NamedTuple):
    """What moves as one; CoM and inertia in the pelvis frame."""

    mass: float
    com: Array
    inertia: Array


class DrawnLeg(NamedTuple):
    """A leg with its joints at 0, in the pelvis frame."""

    centres: Array
    axes: Array
    links: list[Link]
    ankle: Array
    """Ankle point: over the sole's origin, at the height of the last joint."""
    sole: Array
    """(3, 3) axes of the sole."""
    hip: int
    """Index of the hip pitch joint."""


class Drawn:
    """The robot with its legs' joints at 0."""

    def __init__(self, model: Any, found: Findings) -> None:
        self.model, self.found = model, found
        self.data = mujoco.MjData(model)
        mujoco.mj_resetData(model, self.data)
        own = {name for leg in found.legs for name in leg.joints}
        for joint, angle in found.stand.items():
            self.data.joint(joint).qpos = 0.0 if joint in own else angle
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        base = self.data.body(found.base)
        left = np.cross(found.up, found.forward)
        own_axes = np.column_stack([found.forward, left, found.up])
        self.base_turn = own_axes
        self._axes = base.xmat.reshape(3, 3) @ own_axes
        self._origin = np.zeros(3)
        self._origin = np.mean([self._hip(leg) for leg in found.legs], axis=0)
        inverse = base.xmat.reshape(3, 3).T
        self.base_at = inverse @ (self._origin - base.xpos)

    def place(self, point: Array) -> Array:
        """Give a point of the world in the pelvis frame."""
        return np.asarray((point - self._origin) @ self._axes)

    def turn(self, rotation: Array) -> Array:
        """Give a rotation of the world in the pelvis frame."""
        return np.asarray(self._axes.T @ rotation)

    def leg(self, leg: FoundLeg) -> DrawnLeg:
        """Collect a leg."""
        joints = [self.data.joint(name) for name in leg.joints]
        sole, foot = leg.sole, self.data.body(leg.sole.body)
        turn = foot.xmat.reshape(3, 3)
        centres = np.array([self.place(joint.xanchor) for joint in joints])
        axes = np.array([self._axes.T @ joint.xaxis for joint in joints])
        level = self.turn(turn @ sole.rotation)
        point = self.place(foot.xpos + turn @ sole.origin)
        rise = float((centres[-1] - point) @ level[:, 2])
        return DrawnLeg(
            centres=centres,
            axes=axes,
            links=self._links(leg),
            ankle=point + rise * level[:, 2],
            sole=level,
            hip=hip_pitch(axes, leg.knee),
        )

    def trunk(self) -> Link:
        """Put together all that is no leg."""
        first = [self.model.joint(leg.joints[0]).bodyid[0] for leg in self.found.legs]
        legs = {body for top in first for body in self._below(int(top))}
        root = self.model.body(self.found.base).id
        return self._join(set(self._below(root)) - legs)

    def _hip(self, leg: FoundLeg) -> Array:
        joints = [self.data.joint(name) for name in leg.joints]
        hip = hip_pitch(np.array([joint.xaxis for joint in joints]), leg.knee)
        return np.array(joints[hip].xanchor)

    def _links(self, leg: FoundLeg) -> list[Link]:
        """One link per joint: what it moves and the next joint does not."""
        tops = [int(self.model.joint(name).bodyid[0]) for name in leg.joints]
        links = []
        for i, top in enumerate(tops):
            below = set(self._below(top))
            beyond = set(self._below(tops[i + 1])) if i + 1 < len(tops) else set()
            links.append(self._join(below - beyond))
        return links

    def _below(self, top: int) -> list[int]:
        """Return a body and all that hangs on it."""
        found = [top]
        for body in range(top + 1, self.model.nbody):
            if self.model.body_parentid[body] in found:
                found.append(body)
        return found

    def _join(self, bodies: set[int]) -> Link:
        """Add up masses and inertias."""
        model, data = self.model, self.data
        rows = sorted(bodies)
        masses = model.body_mass[rows]
        mass = float(masses.sum())
        if mass <= 0.0:
            return Link(0.0, np.zeros(3), np.zeros((3, 3)))
        places = np.array([self.place(data.xipos[b]) for b in rows])
        com = masses @ places / mass
        inertia = np.zeros((3, 3))
        for body, own, at in zip(rows, masses, places - com, strict=True):
            axes = self.turn(data.ximat[body].reshape(3, 3))
            inertia += axes @ np.diag(model.body_inertia[body]) @ axes.T
            inertia += own * (at @ at * np.eye(3) - np.outer(at, at))
        return Link(mass, com, inertia)


def hip_pitch(axes: Array, knee: int) -> int:
    """Return the index of the hip joint whose axis is most parallel to the knee's."""
    return int(np.argmax(np.abs(axes[:knee] @ axes[knee])))
