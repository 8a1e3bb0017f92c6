"""The servos of a robot's joints: read from its actuators, or derived from its weight.

Gains scale with m g h, the stiffness below which a standing robot falls over its ankles
(m: its mass, h: the CoM above the soles). The factors are the project's own choice.

Light links on stiff servos oscillate, in physics as in a simulation, unless the rotor's
inertia, times the gear ratio squared, damps them. Where a file has none, it is derived
from the stiffness so that servo and rotor alone swing at 200 rad/s; in files that have
it, these are 180 to 370 rad/s for robots of 30 to 90 kg.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.actuators import BY_JOINT
from gaitchain.discover.findings import LEG_GAINS, FoundServo, Rows
from gaitchain.discover.pinned_robot import HINGE, PinnedRobot
from gaitchain.discover.profile import Profile
from gaitchain.messages import GRAVITY
from gaitchain.robot.holding import LEAST, holding_stiffness

_WEAKEST, _STIFFEST = 1.0, 100.0  # stiffness of a leg's servos that is believed, m g h
_LEG, _YAW = 4.0, 2.0  # derived stiffness of a leg's joints, m g h
# Cosine, above `legs.YAW`: hip rolls of T1 and G1 stand at 0.61 and bear load.
_UPRIGHT = 0.7
_LEG_TORQUE = 0.8  # derived limit, m g h
_STRONGEST = 50.0  # limit of a leg's motors that is believed, m g h
_HELD_TORQUE = 4.0  # limit of other joints, by their load
_RATIO = 0.8  # damping ratio against the inertia beyond the joint
_LAG = 0.08  # least damping by stiffness, sqrt(h / g)
_ALIKE, _LISTED = 0.1, 3  # of a number of both legs' servos; differences that are told
_SAID = {
    "stiffness": ("kp", "N m/rad"),
    "damping": ("damping", "N m s/rad"),
    "torque_limit": ("limit", "N m"),
    "speed_limit": ("limit", "rad/s"),
    "armature": ("armature", "kg m^2"),
}
_ROTOR_RATE = 200.0  # sqrt(stiffness / derived rotor inertia), twice a period [rad/s]


def _read(robot: PinnedRobot, joint: int, speeds: Mapping[str, float]) -> FoundServo:
    """Sum up a joint's actuators; the source is "position", "motor" or "none"."""
    model, name, dof = robot.model, robot.joint_name(joint), _dof(robot, joint)
    kind, stiffness, damping, force, speed = sum_actuators(model, joint)
    limit = float(np.abs(model.jnt_actfrcrange[joint]).min())
    limit = limit if model.jnt_actfrclimited[joint] else np.inf
    return FoundServo(
        joint=name,
        stiffness=stiffness,
        damping=damping + float(model.dof_damping[dof]),
        torque_limit=limit if kind == "none" else min(limit, force),
        speed_limit=min(speed, speeds.get(name, np.inf)),
        source=kind,
        armature=float(model.dof_armature[dof]),
    )


def _dof(robot: PinnedRobot, joint: int) -> int:
    return int(robot.model.jnt_dofadr[joint])


class Actuation(NamedTuple):
    """All actuators of a joint together, SI units of the joint."""

    kind: str
    """position, motor, or none."""
    stiffness: float
    damping: float
    force: float
    """Largest force or torque, infinite where nothing bounds it."""
    speed: float
    """Limit of the set-point's rate, infinite where there is none."""


def sum_actuators(model: Any, joint: int) -> Actuation:
    """Add up the actuators of a joint of an `mujoco.MjModel`.

    Where there are servos that take set-points, the limit is theirs: one that only
    damps stands for their own damping, and nobody tells a motor beside them anything.
    """
    kind, stiffness, damping, speed = "none", 0.0, 0.0, np.inf
    holding, pushing, damping_only = list[float](), list[float](), list[float]()
    by_joint = np.isin(model.actuator_trntype, BY_JOINT)
    for a in np.flatnonzero(by_joint & (model.actuator_trnid[:, 0] == joint)):
        gear = abs(float(model.actuator_gear[a, 0]))
        affine = model.actuator_biastype[a] == int(mujoco.mjtBias.mjBIAS_AFFINE)
        held = -float(model.actuator_biasprm[a, 1]) if affine else 0.0
        if held > 0.0:
            stiffness += held * gear**2
            kind = "position"
        elif kind == "none":
            kind = "motor"
        rate = -float(model.actuator_biasprm[a, 2]) if affine else 0.0
        damping += gear**2 * rate
        if model.actuator_dyntype[a] == int(mujoco.mjtDyn.mjDYN_PID):
            slew = float(model.actuator_dynprm[a, 1])
            speed = slew / gear if slew > 0.0 else speed
        forces = holding if held > 0.0 else damping_only if rate > 0.0 else pushing
        forces.append(gear * _force(model, int(a), held > 0.0))
    force = sum(holding or pushing or damping_only)
    return Actuation(kind, stiffness, damping, force, speed)


def _force(model: Any, actuator: int, position: bool) -> float:
    """Return an actuator's largest force, infinite where nothing bounds it."""
    force = np.inf
    if model.actuator_forcelimited[actuator]:
        force = float(np.abs(model.actuator_forcerange[actuator]).min())
    fixed = model.actuator_gaintype[actuator] == int(mujoco.mjtGain.mjGAIN_FIXED)
    if model.actuator_ctrllimited[actuator] and fixed and not position:
        gain = abs(float(model.actuator_gainprm[actuator, 0]))
        force = min(
            force, gain * float(np.abs(model.actuator_ctrlrange[actuator]).min())
        )
    return force


class _Scale(NamedTuple):
    """The robot's m g h and h, and whether its legs' own gains are believed."""

    weight: float
    height: float
    believed: bool


def read_servos(
    robot: PinnedRobot,
    legs: Sequence[int],
    passive: Sequence[int],
    sole_height: float,
    profile: Profile,
    speeds: Mapping[str, float],
) -> tuple[dict[str, FoundServo], Rows]:
    """Collect the servo of every joint.

    Args:
        robot: the robot in its standing pose.
        legs: ids of the driven joints of both legs.
        passive: ids of the legs' passive joints.
        sole_height: height of the soles in the level frame [m].
        profile: numbers that override what was read.
        speeds: limits by joint, where the file's text has them [rad/s].

    Returns:
        Servos by joint, and rows of evidence.

    Raises:
        RobotFileError: the profile names a joint that the model has not.
    """
    height = float(robot.com()[2]) - sole_height
    weight = robot.mass * GRAVITY * height
    read = {j: _read(robot, j, speeds) for j in robot.joints}
    driven = any(r.source != "none" for r in read.values())
    believed, rows = _judge(robot, legs, read, weight)
    scale = _Scale(weight, height, believed)
    servos = {}
    for joint in robot.joints:
        idle = driven and read[joint].source == "none" and joint not in legs
        if idle or joint in passive:
            servo = _passive(robot, joint, read[joint])
        elif joint in legs:
            servo = _leg_servo(robot, joint, read[joint], scale)
        else:
            servo = _held_servo(robot, joint, read[joint], scale)
        servos[servo.joint] = servo
    rows += _limit_rows(robot, legs, read, servos)
    servos = _overridden(servos, profile)
    rows += _rows(robot, legs, servos, weight)
    return _with_rotors(robot, legs, servos, profile, rows), rows


def unlike_rows(
    pairs: Iterable[tuple[str, str]], servos: Mapping[str, FoundServo]
) -> Rows:
    """Say which joints of one leg have other servos than those of the other leg.

    Args:
        pairs: joints of the left and the right leg that mirror each other.
        servos: by joint.
    """
    found = [
        f"{one} {what} {mine:.4g}, {other} {its:.4g} {unit}"
        for one, other in pairs
        for what, unit, mine, its in _numbers(servos[one], servos[other])
        if abs(mine - its) > _ALIKE * max(abs(mine), abs(its))
    ]
    if not found:
        return []
    more = f"; and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
    why = f"{'; '.join(found[:_LISTED])}{more}: is one of them a mistake?"
    return [("left and right", "their servos differ", why)]


def _numbers(
    one: FoundServo, other: FoundServo
) -> Iterator[tuple[str, str, float, float]]:
    """Yield each number of two servos, with its name and unit, where both have it."""
    for field, (what, unit) in _SAID.items():
        both = getattr(one, field), getattr(other, field)
        if np.isfinite(both).all():
            yield what, unit, *both


def _judge(
    robot: PinnedRobot,
    legs: Sequence[int],
    read: Mapping[int, FoundServo],
    weight: float,
) -> tuple[bool, Rows]:
    """Decide whether the legs' gains are meant to carry the robot."""
    bearing = [j for j in legs if not _is_upright(robot, j)]
    gains = {j: read[j].stiffness for j in bearing if read[j].source == "position"}
    if not gains:
        return False, []
    weakest = min(gains, key=lambda j: gains[j])
    stiffest = max(gains, key=lambda j: gains[j])
    for joint, wrong in (
        (weakest, gains[weakest] < _WEAKEST * weight),
        (stiffest, gains[stiffest] > _STIFFEST * weight),
    ):
        if wrong:
            found = f"{robot.joint_name(joint)}: kp {gains[joint]:.4g} N m/rad"
            limits = f"{_WEAKEST:g} to {_STIFFEST:g} m g h, {weight:.4g} N m"
            return False, [(LEG_GAINS, "not believed", f"{found}; allowed {limits}")]
    return True, []


def _is_upright(robot: PinnedRobot, joint: int) -> bool:
    """Whether a leg's joint bears little of the weight, as its axis is upright."""
    return bool(abs(robot.axis(joint)[2]) > _UPRIGHT)


def _passive(robot: PinnedRobot, joint: int, read: FoundServo) -> FoundServo:
    model = robot.model
    return replace(
        read,
        stiffness=float(np.ravel(model.jnt_stiffness[joint])[0]),
        damping=float(model.dof_damping[_dof(robot, joint)]),
        torque_limit=0.0,
        speed_limit=np.inf,
        source="passive",
    )


def _leg_servo(
    robot: PinnedRobot, joint: int, read: FoundServo, scale: _Scale
) -> FoundServo:
    weight, limit = scale.weight, read.torque_limit
    own = read.source == "position" and scale.believed
    # The file's limit is the robot's, however small: with another one, a robot too weak
    # to walk would be qualified.
    most = np.inf if own else _STRONGEST * weight
    if not (0.0 < limit <= most and np.isfinite(limit)):
        limit = _LEG_TORQUE * weight
    if own:
        return replace(read, torque_limit=limit, source="actuator")
    stiffness = (_YAW if _is_upright(robot, joint) else _LEG) * weight
    return _derived(robot, joint, read, (stiffness, limit), scale.height)


def _limit_rows(
    robot: PinnedRobot,
    legs: Sequence[int],
    read: Mapping[int, FoundServo],
    servos: Mapping[str, FoundServo],
) -> Rows:
    """Say which torque limits of the legs are not those of the file."""
    given = {robot.joint_name(j): read[j].torque_limit for j in legs}
    made = {n: g for n, g in given.items() if g != servos[n].torque_limit}
    if not made:
        return []
    said = f"{min(made.values()):.4g} to {max(made.values()):.4g} N m"
    said = said if np.isfinite(min(made.values())) else "none"
    limit = servos[next(iter(made))].torque_limit
    why = (
        f"the file gives {said}; believed are limits above 0 and up to {_STRONGEST:g} "
        "m g h, others come from servo.torque_limit in a profile"
    )
    return [("leg torque limits", f"{len(made)} derived: {limit:.3g} N m", why)]


def _held_servo(
    robot: PinnedRobot, joint: int, read: FoundServo, scale: _Scale
) -> FoundServo:
    """Hold a joint outside the legs, by the weight that it carries."""
    model, body = robot.model, robot.model.jnt_bodyid[joint]
    lever = float(np.linalg.norm(robot.data.subtree_com[body] - robot.anchor(joint)))
    load = float(model.body_subtreemass[body]) * GRAVITY * lever
    limit = read.torque_limit
    if not (np.isfinite(limit) and limit > 0.0):
        limit = max(_HELD_TORQUE * load, LEAST * scale.weight)
    if read.source == "position" and read.stiffness >= load:
        return replace(read, torque_limit=limit, source="actuator")
    hinge = model.jnt_type[joint] == HINGE
    stiffness = holding_stiffness(load, scale.weight, hinge=hinge)
    return _derived(robot, joint, read, (stiffness, limit), scale.height)


def _derived(
    robot: PinnedRobot,
    joint: int,
    read: FoundServo,
    gains: tuple[float, float],
    height: float,
) -> FoundServo:
    stiffness, limit = gains
    dof = _dof(robot, joint)
    inertia = float(robot.model.dof_M0[dof])
    damping = 2.0 * _RATIO * np.sqrt(stiffness * inertia)
    damping = max(damping, _LAG * np.sqrt(height / GRAVITY) * stiffness)
    own = float(robot.model.dof_damping[dof])
    why = "placeholder gains" if read.source == "position" else read.source
    return replace(
        read,
        stiffness=stiffness,
        damping=max(float(damping), own),
        torque_limit=limit,
        source=f"derived: {why}",
    )


def _overridden(
    servos: dict[str, FoundServo], profile: Profile
) -> dict[str, FoundServo]:
    changed = dict(servos)
    # "*" first, so that a joint's own numbers win.
    for name, numbers in sorted(
        profile.servo.items(), key=lambda entry: entry[0] != "*"
    ):
        if name == "*":
            chosen = [j for j, servo in servos.items() if servo.source != "passive"]
        else:
            chosen = [profile.require(name, servos, "servo")]
        for joint in chosen:
            changes: dict[str, Any] = {**numbers, "source": "profile"}
            changed[joint] = replace(changed[joint], **changes)
    return changed


def _with_rotors(
    robot: PinnedRobot,
    legs: Sequence[int],
    servos: dict[str, FoundServo],
    profile: Profile,
    rows: Rows,
) -> dict[str, FoundServo]:
    """Give the legs' servos a rotor inertia where neither file nor profile does."""
    given = {n for n, numbers in profile.servo.items() if "armature" in numbers}
    derived = {
        name: replace(servo, armature=servo.stiffness / _ROTOR_RATE**2)
        for name, servo in ((n, servos[n]) for n in map(robot.joint_name, legs))
        if servo.armature == 0.0 and given.isdisjoint(("*", name))
    }
    if derived:
        inertias = [servo.armature for servo in derived.values()]
        sizes = f"{min(inertias):.2g} to {max(inertias):.2g} kg m^2"
        why = f"no rotor inertia in the file: stiffness / ({_ROTOR_RATE:g} rad/s)^2"
        rows.append(("leg armature", f"{len(derived)} derived: {sizes}", why))
    return servos | derived


def _rows(
    robot: PinnedRobot,
    legs: Sequence[int],
    servos: Mapping[str, FoundServo],
    weight: float,
) -> Rows:
    """Sum the servos up by where they come from, legs first."""
    rows = []
    named = {robot.joint_name(j) for j in legs}
    for what, names in (("leg servos", named), ("other servos", servos.keys() - named)):
        for source in sorted({servos[n].source for n in names}):
            group = [servos[n] for n in names if servos[n].source == source]
            kp = [s.stiffness for s in group]
            torque = [s.torque_limit for s in group]
            gains = (
                f"kp {min(kp):.3g} to {max(kp):.3g} N m/rad, limit {min(torque):.3g} "
                f"to {max(torque):.3g} N m; m g h {weight:.3g} N m"
            )
            rows.append((what, f"{len(group)} {source}", gains))
    return rows
