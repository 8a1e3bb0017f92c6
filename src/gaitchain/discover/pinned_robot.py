"""A robot whose base is pinned upright while its joints are set.

The *level* frame has its origin at the base, x forward, y left, z up.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.actuators import BY_JOINT
from gaitchain.discover.ranges import joint_range
from gaitchain.messages import Array

_UPRIGHT = 0.94  # cosine: a keyframe with the base this upright is a standing pose
_REAL = 1e-6  # rad: roots whose imaginary part is smaller are real
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
"""MuJoCo's types of joints with one degree of freedom."""


class _Coupling(NamedTuple):
    """A joint that follows another one, by an equality."""

    follower: int
    leader: int
    """-1 where it is held."""
    curve: Array
    """(5,) coefficients, constant first, of the first joint over the second."""
    turned: bool
    """Whether the first joint of the equality leads."""

    def follow(self, by: float) -> float:
        """Return how far the follower is from `qpos0` for that of the leader."""
        if not self.turned:
            return float(np.polyval(self.curve[::-1], by))
        roots = np.roots((self.curve - by * np.eye(5)[0])[::-1])
        real = roots.real[np.abs(roots.imag) < _REAL]
        # Curves are followed from the drawn pose; the nearest one is its branch.
        return float(min(real, key=abs)) if len(real) else 0.0


class PinnedRobot:
    """A robot whose base is pinned to the level frame while its joints are set."""

    def __init__(self, model: Any, base: int, up: Array, forward: Array) -> None:
        """Pin the base by the unit vectors `up` and `forward` of its own frame."""
        self.model, self.base, self.up = model, base, up
        ahead = forward - (forward @ up) * up
        self.forward = ahead / np.linalg.norm(ahead)
        self.data = mujoco.MjData(model)
        root = model.body_rootid[base]
        self.bodies = [b for b in range(model.nbody) if model.body_rootid[b] == root]
        self.joints = [
            j
            for j in range(model.njnt)
            if model.body_rootid[model.jnt_bodyid[j]] == root
            and model.jnt_type[j] in (HINGE, SLIDE)
        ]
        self.mass = float(model.body_subtreemass[base])  # [kg]
        by_joint = np.isin(model.actuator_trntype, BY_JOINT)
        self.driven = frozenset(model.actuator_trnid[by_joint, 0].tolist())
        self._couplings = list(self._coupled())
        self.neutral = self._clipped(model.qpos0)
        self.place(self.neutral)

    @property
    def followers(self) -> frozenset[int]:
        """Joints that are coupled to others."""
        return frozenset(coupling.follower for coupling in self._couplings)

    def leader(self, joint: int) -> int | None:
        """Return the joint that moves another; None where nothing does."""
        for coupling in self._couplings:
            tied = coupling.leader >= 0 and coupling.curve[1:].any()
            if coupling.follower == joint and tied:
                return coupling.leader
        return None

    def led_by(self, joint: int) -> list[int]:
        """Return the joints that a joint moves with itself."""
        return [j for j in self.joints if self.leader(j) == joint]

    def address(self, joint: int) -> int:
        """Return a joint's place in `qpos`."""
        return int(self.model.jnt_qposadr[joint])

    def joint_name(self, joint: int) -> str:
        """Return a joint's name; `joint N` where it has none."""
        return str(self.model.joint(joint).name) or f"joint {joint}"

    def bounds(self, joint: int) -> tuple[float, float]:
        """Return between which positions a joint can be sent; see `joint_range`."""
        return joint_range(self.model, joint)

    def place(self, qpos: Array) -> None:
        """Set the joints and compute where everything is.

        Args:
            qpos: (nq,) joint positions; the base's own are ignored, and coupled joints
                follow those that they are coupled to.
        """
        model, data = self.model, self.data
        data.qpos[:] = qpos
        free = self.address(model.body_jntadr[self.base])
        rows = np.stack([self.forward, np.cross(self.up, self.forward), self.up])
        data.qpos[free : free + 3] = 0.0
        mujoco.mju_mat2Quat(data.qpos[free + 3 : free + 7], rows.ravel())
        for coupling in self._couplings:
            self._couple(coupling)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)

    def com(self) -> Array:
        """Return the CoM in the level frame, (3,) [m]."""
        return np.array(self.data.subtree_com[self.base])

    def axis(self, joint: int) -> Array:
        """Return a joint's axis in the level frame, (3,)."""
        return np.array(self.data.xaxis[joint])

    def anchor(self, joint: int) -> Array:
        """Return where a joint is in the level frame, (3,) [m]."""
        return np.array(self.data.xanchor[joint])

    def turn(self, body: int) -> Array:
        """Return a body's rotation into the level frame, (3, 3)."""
        return np.array(self.data.xmat[body].reshape(3, 3))

    def point(self, body: int, local: Array) -> Array:
        """Return a body's point in the level frame, (3,) [m]."""
        return np.asarray(self.data.xpos[body] + self.turn(body) @ local)

    def rest(self, waist: set[int], angles: Mapping[int, float]) -> tuple[Array, str]:
        """Return the pose of all that the legs leave free, and where it comes from.

        Args:
            waist: joints between base and pelvis; they stay straight.
            angles: the profile's, by joint.

        Returns:
            (nq,) angles of the first upright keyframe, else those nearest to the drawn
            ones within range; and in words what is from where.
        """
        qpos, source = np.array(self.neutral), "nearest to the file's, within range"
        free = self.address(self.model.body_jntadr[self.base])
        for key in range(self.model.nkey):
            upward = np.zeros(3)
            mujoco.mju_rotVecQuat(
                upward, self.up, self.model.key_qpos[key, free + 3 : free + 7]
            )
            if upward[2] > _UPRIGHT:
                qpos = self._clipped(self.model.key_qpos[key])
                source = f"keyframe {self.model.key(key).name or key}"
                break
        for joint in waist:
            qpos[self.address(joint)] = self.neutral[self.address(joint)]
        for joint, angle in angles.items():
            qpos[self.address(joint)] = angle
        straight = ", the waist straight" if waist else ""
        told = f", {len(angles)} by the profile" if angles else ""
        return qpos, f"{source}{straight}{told}"

    def _clipped(self, qpos: Array) -> Array:
        clipped = np.array(qpos)
        for joint in self.joints:
            at = self.address(joint)
            clipped[at] = np.clip(clipped[at], *self.bounds(joint))
        return clipped

    def _coupled(self) -> Iterator[_Coupling]:
        """Yield the joints' couplings: the undriven joint of two follows the driven."""
        model = self.model
        for e in np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)):
            first, second = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
            curve = np.array(model.eq_data[e][:5])
            tied = second >= 0 and bool(curve[1:].any())  # else the first is held
            turned = tied and first in self.driven and second not in self.driven
            pair = (second, first) if turned else (first, second)
            if model.eq_active0[e]:
                yield _Coupling(*pair, curve, turned)

    def _couple(self, coupling: _Coupling) -> None:
        start, to, by = self.model.qpos0, self.address(coupling.follower), 0.0
        if coupling.leader >= 0:
            at = self.address(coupling.leader)
            by = float(self.data.qpos[at] - start[at])
        self.data.qpos[to] = start[to] + coupling.follow(by)
