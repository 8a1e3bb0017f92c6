"""Linkages: motors that move a leg's joints by way of cranks, rods or screws. Ours.

Where MJCF closes a loop by `connect`, the motor is on one side of it, and the joint
that carries the foot, without a motor of its own, on the other. Walking needs a servo
at that joint. With q_m the motors' angles and q the joints', q_m' = G q' where the loop
stays closed, and tau = G^T tau_m: so stiffness, damping, rotors and limits of the
motors are seen at the joints, in the drawn pose, and the rods become part of what they
hang from.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.discover.gears import driven_by
from gaitchain.discover.isolate import drop_users, names_of
from gaitchain.discover.servos import sum_actuators
from gaitchain.messages import Array

_HINGE, _SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
_CONNECT = mujoco.mjtEq.mjEQ_CONNECT
_SITE = mujoco.mjtObj.mjOBJ_SITE
_FIXED, _AFFINE = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
_OPEN = 1e-3  # m: a loop that is drawn further open is none that can be followed
_EXACT = 1e-6  # part of a motion that may be left over where the loop stays closed
# How far a part may turn for a joint, rad / rad, or for one of two joints over the
# other: beyond it, a linkage is at a dead point.
_DEAD = 20.0


class _Loop(NamedTuple):
    """A `connect`, and the joints on either side of it."""

    number: int
    """Of the equality in the model, and in the spec."""
    one: frozenset[int]
    other: frozenset[int]

    @property
    def joints(self) -> frozenset[int]:
        """On both sides."""
        return self.one | self.other


class _Linkage(NamedTuple):
    """Loops that share joints, in the drawn pose."""

    loops: list[_Loop]
    motors: list[int]
    turned: list[int]
    """Joints that carry the foot, as many as motors."""
    rods: list[int]
    """All other joints."""
    ratio: Array
    """(motors, turned) G of q_m' = G q'."""


def fold_linkages(spec: Any) -> list[str]:
    """Move motors behind linkages to the joints that they turn.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone, which compiles; changed in place.

    Returns:
        A note for each linkage, and one for what referred to joints that are none any
        more, such as the sensor of a crank. A loop that is none stays.
    """
    if not any(_closes(tie) for tie in spec.equalities):
        return []
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    found = list(_linkages(model, data))
    notes, before = [_told(model, linkage) for linkage in found], names_of(spec)
    _fold(spec, model, found)
    return notes + drop_users(spec, before)


def _closes(tie: Any) -> bool:
    return bool(tie.type == _CONNECT and tie.active)


def _linkages(model: Any, data: Any) -> Iterator[_Linkage]:
    """Yield what can be folded: each group of loops that share joints."""
    groups: list[list[_Loop]] = []
    for e in range(model.neq):
        if model.eq_type[e] != int(_CONNECT) or not model.eq_active0[e]:
            continue
        loop = _Loop(e, *_sides(model, *_bodies(model, e)))
        near = [g for g in groups if any(loop.joints & other.joints for other in g)]
        groups = [g for g in groups if g not in near]
        groups.append([loop, *(other for group in near for other in group)])
    for group in groups:
        linkage = _linkage(model, data, group)
        if linkage is not None:
            yield linkage


def _bodies(model: Any, tie: int) -> tuple[int, int]:
    one, other = int(model.eq_obj1id[tie]), int(model.eq_obj2id[tie])
    if model.eq_objtype[tie] == int(_SITE):
        return int(model.site_bodyid[one]), int(model.site_bodyid[other])
    return one, other


def _sides(model: Any, one: int, other: int) -> Iterator[frozenset[int]]:
    """Yield the joints between either body and the first one that both hang from."""
    ways = [_way(model, body) for body in (one, other)]
    shared = set(ways[0]) & set(ways[1])
    for way in ways:
        own = [body for body in way if body not in shared]
        starts, counts = model.body_jntadr[own], model.body_jntnum[own]
        yield frozenset(
            int(start + i)
            for start, count in zip(starts, counts, strict=True)
            for i in range(count)
        )


def _way(model: Any, body: int) -> list[int]:
    """Return a body and all that it hangs from."""
    way = [body]
    while body:
        body = int(model.body_parentid[body])
        way.append(body)
    return way


def _linkage(model: Any, data: Any, loops: list[_Loop]) -> _Linkage | None:
    """Return loops as a linkage, if motors on one side turn hinges on the other."""
    joints = frozenset[int]().union(*(loop.joints for loop in loops))
    motors = [j for j in sorted(joints) if _is_driven(model, j)]
    idle = [
        [side for side in (loop.one, loop.other) if side.isdisjoint(motors)]
        for loop in loops
    ]
    if any(len(sides) != 1 for sides in idle):
        return None
    turned = sorted(frozenset[int]().union(*(sides[0] for sides in idle)))
    kinds = {int(model.jnt_type[j]) for j in turned}
    if kinds != {_HINGE} or len(turned) != len(motors):
        return None
    rods = sorted(joints.difference(turned, motors))
    ratio = _ratio(model, data, loops, (motors, turned, rods))
    return None if ratio is None else _Linkage(loops, motors, turned, rods, ratio)


def _is_driven(model: Any, joint: int) -> bool:
    one_way = model.jnt_type[joint] in (_HINGE, _SLIDE)
    return bool(one_way and sum_actuators(model, joint).kind != "none")


def _ratio(
    model: Any,
    data: Any,
    loops: Sequence[_Loop],
    joints: tuple[Sequence[int], Sequence[int], Sequence[int]],
) -> Array | None:
    """Return G where the loops are closed and stay so, else None."""
    rows = []
    for loop in loops:
        ends = _ends(model, data, loop.number)
        if np.linalg.norm(ends[1] - ends[0]) > _OPEN:
            return None
        slopes = []
        for body, end in zip(_bodies(model, loop.number), ends, strict=True):
            slope = np.empty((3, model.nv))
            mujoco.mj_jac(model, data, slope, None, end, body)
            slopes.append(slope)
        rows.append(slopes[1] - slopes[0])
    apart = np.concatenate(rows)
    motors, turned, rods = (_dofs(model, own) for own in joints)
    free = apart[:, motors + rods]
    moved = np.linalg.lstsq(free, -apart[:, turned], rcond=None)[0]
    left = free @ moved + apart[:, turned]
    ratio = moved[: len(motors)]
    stuck = np.abs(left).max() > _EXACT * np.abs(apart[:, turned]).max()
    spread = np.linalg.svd(ratio, compute_uv=False)
    dead = np.abs(moved).max() > _DEAD or spread[0] > _DEAD * spread[-1]
    return None if stuck or dead else ratio


def _ends(model: Any, data: Any, tie: int) -> tuple[Array, Array]:
    """Return the points that a `connect` holds together, in the world [m]."""
    if model.eq_objtype[tie] == int(_SITE):
        one, other = int(model.eq_obj1id[tie]), int(model.eq_obj2id[tie])
        return np.array(data.site_xpos[one]), np.array(data.site_xpos[other])
    anchors = model.eq_data[tie][:3], model.eq_data[tie][3:6]
    one, other = (
        data.xpos[body] + data.xmat[body].reshape(3, 3) @ anchor
        for body, anchor in zip(_bodies(model, tie), anchors, strict=True)
    )
    return one, other


def _dofs(model: Any, joints: Sequence[int]) -> list[int]:
    sizes = {int(mujoco.mjtJoint.mjJNT_BALL): 3}
    return [
        int(model.jnt_dofadr[j]) + i
        for j in joints
        for i in range(sizes.get(int(model.jnt_type[j]), 1))
    ]


def _told(model: Any, linkage: _Linkage) -> str:
    turned, motors = (
        [model.joint(j).name or f"joint {j}" for j in joints]
        for joints in (linkage.turned, linkage.motors)
    )
    both, verb = " and ".join(turned), "is" if len(turned) == 1 else "are"
    ways = "; ".join(
        f"{motor} by "
        + " and ".join(f"{r:.3g} of {j}" for r, j in zip(row, turned, strict=True))
        for motor, row in zip(motors, linkage.ratio.tolist(), strict=True)
    )
    return (
        f"{both} {verb} turned by {' and '.join(motors)} through a linkage: "
        f"targets are those of {both}. As drawn, a motor moves so: {ways}. Gains and "
        "limits are seen through that; the rods are held."
    )


class _Seen(NamedTuple):
    """What a joint has of the motors that turn it."""

    stiffness: float
    damping: float
    limit: float
    """Torque of all its motors together, infinite where nothing bounds one [N m]."""
    armature: float
    friction: float
    joint_damping: float
    span: tuple[float, float]
    """Its range, and where those of its motors end [rad]."""


def _seen(model: Any, linkage: _Linkage, turned: int) -> _Seen:
    """Return what a joint has of its motors, the diagonal of G^T X G."""
    ratio, motors = linkage.ratio[:, turned], linkage.motors
    dofs = _dofs(model, motors)
    own = [sum_actuators(model, joint) for joint in motors]
    bound = np.abs(model.jnt_actfrcrange[motors]).min(axis=1)
    bound[~model.jnt_actfrclimited[motors].astype(bool)] = np.inf
    limit = np.minimum([a.force for a in own], bound)
    return _Seen(
        stiffness=float(ratio**2 @ [a.stiffness for a in own]),
        damping=float(ratio**2 @ [a.damping for a in own]),
        limit=float(limit[ratio != 0.0] @ np.abs(ratio[ratio != 0.0])),
        armature=float(ratio**2 @ model.dof_armature[dofs]),
        friction=float(np.abs(ratio) @ model.dof_frictionloss[dofs]),
        joint_damping=float(ratio**2 @ model.dof_damping[dofs]),
        span=_span(model, linkage, turned),
    )


def _span(model: Any, linkage: _Linkage, turned: int) -> tuple[float, float]:
    """Return the range that the motors leave a joint, the others as drawn [rad]."""
    drawn = [float(model.qpos0[model.jnt_qposadr[j]]) for j in linkage.motors]
    low, high = -np.inf, np.inf
    for motor, at, ratio in zip(
        linkage.motors, drawn, linkage.ratio[:, turned], strict=True
    ):
        if model.jnt_limited[motor] and ratio:
            ends = sorted((model.jnt_range[motor] - at) / ratio)
            low, high = max(low, ends[0]), min(high, ends[1])
    joint = linkage.turned[turned]
    own = float(model.qpos0[model.jnt_qposadr[joint]])
    low, high = own + low, own + high
    if model.jnt_limited[joint]:
        ends = model.jnt_range[joint]
        low, high = max(low, float(ends[0])), min(high, float(ends[1]))
    return low, high


def _fold(spec: Any, model: Any, found: Sequence[_Linkage]) -> None:
    """Give the joints their servos; take loops, and their other joints, out."""
    joints = {joint.id: joint for joint in spec.joints}
    ties = {tie.id: tie for tie in spec.equalities}
    seen = [[_seen(model, one, k) for k in range(len(one.turned))] for one in found]
    for linkage, servos in zip(found, seen, strict=True):
        for j, motor, servo in zip(linkage.turned, linkage.motors, servos, strict=True):
            _drive(spec, joints[j], joints[motor], servo)
        for loop in linkage.loops:
            spec.delete(ties[loop.number])
    gone = [j for linkage in found for j in linkage.motors + linkage.rods]
    for j in gone:
        for geom in joints[j].parent.geoms:
            geom.contype = geom.conaffinity = 0  # a rod that is held meets the foot
        spec.delete(joints[j])


def _drive(spec: Any, turned: Any, motor: Any, seen: _Seen) -> None:
    """Give a joint the first actuator of a motor; delete the motor's others."""
    servo, *others = driven_by(spec, motor)
    for other in others:
        spec.delete(other)
    servo.target = turned.name
    servo.gear = np.eye(6)[0]
    servo.gaintype, servo.biastype = _FIXED, _AFFINE
    servo.dyntype = mujoco.mjtDyn.mjDYN_NONE
    servo.gainprm, servo.biasprm = np.zeros(10), np.zeros(10)
    servo.gainprm[0] = seen.stiffness or 1.0
    servo.biasprm[1:3] = -seen.stiffness, -seen.damping
    servo.ctrllimited = False
    if np.isfinite(seen.limit):
        servo.forcerange, servo.forcelimited = [-seen.limit, seen.limit], True
    if np.isfinite(seen.span).all() and seen.span[0] < seen.span[1]:
        # A joint that the file leaves free ends where its motors do all the same.
        turned.range, turned.limited = seen.span, mujoco.mjtLimited.mjLIMITED_TRUE
    turned.armature += seen.armature
    turned.frictionloss += seen.friction
    turned.damping = np.asarray(turned.damping) + np.eye(3)[0] * seen.joint_damping
