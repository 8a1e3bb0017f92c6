"""Find what walking needs in a robot's model, by geometry and structure, not by names.

What geometry cannot settle, a profile does; the front, names of left and right, too.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from gaitchain.discover.findings import (
    Findings,
    FoundLeg,
    FoundSole,
    Row,
    Rows,
    UnfitError,
)
from gaitchain.discover.legs import (
    PITCH,
    YAW,
    LegParts,
    across,
    centre_of,
    face_forward,
    knee_of,
    knee_side,
    leg_parts,
    pair_up,
    why_idle,
)
from gaitchain.discover.limbs import (
    DOWN,
    Limb,
    bodies_of,
    find_base,
    limb_to,
    lowest_pair,
    own_joints,
    refuse_balls,
    refuse_loops,
    shared_links,
)
from gaitchain.discover.notes import listed
from gaitchain.discover.pinned_robot import SLIDE, PinnedRobot
from gaitchain.discover.profile import Profile
from gaitchain.discover.ranges import is_narrowed, joint_range, own_range
from gaitchain.discover.repair import BALLAST_KG
from gaitchain.discover.servos import read_servos, unlike_rows
from gaitchain.discover.shapes import VISUAL, ground_geoms
from gaitchain.discover.sole import check_sole, sole_of
from gaitchain.discover.springs import spring_rows
from gaitchain.discover.stance import LegPlan, stand
from gaitchain.errors import RobotFileError
from gaitchain.messages import Array


def find(
    model: Any,
    origin: str,
    profile: Profile | None = None,
    speeds: Mapping[str, float] | None = None,
    balls: Mapping[str, str] | None = None,
) -> Findings:
    """Find legs, soles, servos and a standing pose of a robot.

    Args:
        model: the compiled robot, with a free joint on its base.
        origin: what messages call the robot.
        profile: a person's answers, which override every guess.
        speeds: speed limits by joint, as `RobotModel` has them [rad/s].
        balls: welded ball joints by body, as `RobotModel` has them.

    Returns:
        What walking needs, and the evidence for it.

    Raises:
        RobotFileError: the robot cannot walk on two flat feet, or geometry does not
            show how; the message names the profile key that would settle it.
    """
    try:
        return _find(model, profile or Profile(), speeds or {}, balls or {})
    except UnfitError as error:
        raise RobotFileError(f"{origin}: {error}") from None


def _find(
    model: Any, answers: Profile, speeds: Mapping[str, float], balls: Mapping[str, str]
) -> Findings:
    base = find_base(model)
    robot = PinnedRobot(model, base, *_upward(model, base, answers))
    pair = _named_pair(robot, answers) or lowest_pair(robot)
    shared = shared_links(*pair)
    if shared == min(len(limb.links) for limb in pair):
        raise UnfitError("one leg is part of the other", "legs.left and legs.right")
    refuse_loops(robot, pair)
    refuse_balls(robot, pair, balls)
    joints = [own_joints(robot, limb, shared) for limb in pair]
    _refuse_strangers(robot, joints, answers)
    aside = across(robot, joints)
    legs = [
        leg_parts(robot, limb, own, answers.legs.get(side), aside)
        for limb, own, side in zip(pair, joints, ("left", "right"), strict=True)
    ]
    legs = pair_up(robot, legs, bool(answers.legs))
    rows: Rows = [("base", model.body(base).name, "the body with the free joint")]
    robot, legs = face_forward(robot, legs, answers, rows)
    left, right = (_plan(robot, leg, answers, rows) for leg in legs)
    _refuse_massless(robot, (left, right))
    return _assemble(robot, (left, right), pair, answers, speeds, rows)


def _upward(model: Any, base: int, answers: Profile) -> tuple[Array, Array]:
    """Return up, and some way across it, in the base's frame."""
    up = np.array(answers.up or (0.0, 0.0, 1.0))
    if answers.up is None:
        at = model.jnt_qposadr[model.body_jntadr[base]] + 3
        mat = np.zeros(9)
        mujoco.mju_quat2Mat(mat, model.qpos0[at : at + 4])
        up = mat.reshape(3, 3)[2]
    return up, np.asarray(np.linalg.svd(up[None])[2][1])


def _named_pair(robot: PinnedRobot, answers: Profile) -> tuple[Limb, Limb] | None:
    """Return the legs that a profile names, left and right."""
    model = robot.model
    names = [model.body(b).name for b in range(model.nbody)]
    hinges = [model.joint(j).name for j in range(model.njnt)]
    limbs = []
    for side in ("left", "right"):
        for joint in answers.legs.get(side, ()):
            answers.require(joint, hinges, f"legs.{side}")
        if side in answers.foot:
            name = answers.require(answers.foot[side], names, f"foot.{side}")
            link = model.body_weldid[model.body(name).id]
        elif side in answers.legs:
            link = model.jnt_bodyid[model.joint(answers.legs[side][-1]).id]
        else:
            continue
        limbs.append(limb_to(robot, int(link)))
    if len(limbs) == 1:
        raise RobotFileError(
            f"{answers.origin}: only one leg is given; to settle it, give both legs or "
            "both feet in a profile"
        )
    return (limbs[0], limbs[1]) if limbs else None


def _refuse_strangers(
    robot: PinnedRobot, legs: Sequence[Sequence[int]], answers: Profile
) -> None:
    """Refuse joints that a profile gives a leg and that are not on it.

    Args:
        robot: the robot.
        legs: ids of the joints of either leg, from hip to foot.
        answers: of the profile.
    """
    model = robot.model
    for side, own in zip(("left", "right"), legs, strict=True):
        known = {robot.joint_name(joint) for joint in own}
        for name in answers.legs.get(side, ()):
            if name not in known:
                top = model.body_parentid[model.jnt_bodyid[own[0]]]
                last = answers.foot.get(side, answers.legs[side][-1])
                raise RobotFileError(
                    f"{answers.origin}: legs.{side}: {name} is not between "
                    f"{model.body(top).name} and {last}; list the joints of that leg, "
                    "hip to ankle"
                )


def _plan(robot: PinnedRobot, leg: LegParts, answers: Profile, rows: Rows) -> LegPlan:
    """Read a leg's knee, hip, ankle and sole."""
    robot.place(robot.neutral)
    left = -np.cross(DOWN, [1.0, 0.0, 0.0])
    knee = knee_of(robot, leg, left)
    sided, straight = knee_side(robot, leg, knee)
    forwards = float(np.sign(robot.axis(leg.joints[knee]) @ left))
    hip = centre_of(robot, leg.joints[:knee])
    centre = centre_of(robot, leg.joints[knee + 1 :])
    ankle = robot.turn(leg.foot).T @ (centre - robot.data.xpos[leg.foot])
    at = robot.anchor(leg.joints[knee])
    length = float(np.linalg.norm(hip - at) + np.linalg.norm(centre - at))
    sole, why = sole_of(robot, leg, ankle, length, answers)
    check_sole(sole, why, length, _may_be_toes(robot, leg, knee, left))
    rows.append(_sole_row(sole, why))
    rows.append(_knee_row(robot.joint_name(leg.joints[knee]), sided, forwards))
    leg_found = FoundLeg(
        joints=tuple(robot.joint_name(j) for j in leg.joints),
        knee=knee,
        knee_bends=sided or forwards,
        passive=tuple(robot.joint_name(j) for j in leg.passive),
        sole=sole,
    )
    return LegPlan(leg_found, leg.joints, leg.foot, hip, ankle, length, straight)


def _sole_row(sole: FoundSole, why: str) -> Row:
    found = (
        f"{sole.rear:+.3f} to {sole.front:+.3f} m, {2.0 * sole.half_width:.3f} m wide"
    )
    return f"sole of {sole.body}", found, why


def _knee_row(name: str, sided: float, forwards: float) -> Row:
    """Say to which side a knee bends.

    Args:
        name: of its joint.
        sided: the only side that its range allows, +1 or -1; 0 for either.
        forwards: the side on which the knee goes ahead.
    """
    bends = sided or forwards
    way = "forward" if bends == forwards else "backward, as its range allows no other"
    why = "its range" if sided else "either side within its range"
    return "knee", f"{name} {'+' if bends > 0 else '-'}", f"{way}; {why}"


def _may_be_toes(robot: PinnedRobot, leg: LegParts, knee: int, left: Array) -> bool:
    """Whether a foot hangs on a pitch hinge after another one below the knee.

    Or on one that nothing drives.
    """
    ankle = leg.joints[knee + 1 :]
    pitches = [abs(float(robot.axis(j) @ left)) > PITCH for j in ankle]
    idle = leg.foot in robot.model.jnt_bodyid[list(leg.passive)]
    return bool(idle) or (sum(pitches) > 1 and pitches[-1])


def _refuse_massless(robot: PinnedRobot, plans: tuple[LegPlan, LegPlan]) -> None:
    """Refuse legs whose thigh, shank or foot weighs what repair made up."""
    model = robot.model
    links = {
        int(model.jnt_bodyid[plan.joints[at]])
        for plan in plans
        for at in (plan.found.knee - 1, plan.found.knee, -1)
    }
    masses = {b: model.body_mass[list(bodies_of(robot, b))].sum() for b in links}
    light = [model.body(b).name for b in sorted(links) if masses[b] <= BALLAST_KG]
    if light:
        raise UnfitError(
            f"thigh, shank or foot without mass: {listed('link', light)}; give them "
            "<inertial>"
        )


def _assemble(
    robot: PinnedRobot,
    plans: tuple[LegPlan, LegPlan],
    pair: tuple[Limb, Limb],
    answers: Profile,
    speeds: Mapping[str, float],
    rows: Rows,
) -> Findings:
    """Stand the robot up, read its servos and put everything together."""
    model = robot.model
    shared = pair[0].links[: shared_links(*pair)]
    waist = {j for j in pair[0].joints if model.jnt_bodyid[j] in shared}
    joints = {robot.joint_name(j): j for j in robot.joints}
    driven = [j for plan in plans for j in plan.joints]
    rest, source = robot.rest(waist, _given_angles(robot, driven, answers))
    pose, height = stand(robot, plans, rest, answers.hip_height)
    left, right = (plan.found for plan in plans)
    rows.extend(_leg_rows(robot, plans) + _turning_rows(robot, plans))
    rows.extend(_contact_rows(robot, plans))
    rows.extend(_range_rows(robot, plans))
    rows.append(_stand_row(plans[0], height, answers.hip_height is not None, source))
    sole = robot.point(plans[0].foot, left.sole.origin)
    passive = [joints[n] for leg in (left, right) for n in leg.passive]
    servos, evidence = read_servos(
        robot, driven, passive, float(sole[2]), answers, speeds
    )
    evidence += unlike_rows(zip(left.joints, right.joints, strict=True), servos)
    evidence += spring_rows(robot, driven, pose, servos)
    return Findings(
        base=model.body(robot.base).name,
        pelvis=model.body(shared[-1] if shared else robot.base).name,
        forward=robot.forward,
        up=robot.up,
        left=left,
        right=right,
        stand={name: float(pose[robot.address(j)]) for name, j in joints.items()},
        hip_height=height,
        servos=servos,
        evidence=tuple(rows + evidence),
    )


def _stand_row(leg: LegPlan, height: float, told: bool, source: str) -> Row:
    """Say how a robot stands, and what of that comes from where.

    Args:
        leg: one of both.
        height: of the hips above the soles [m].
        told: whether that is the profile's.
        source: of all other joints' angles.
    """
    share = (height - leg.below) / leg.straight
    at = ", at the profile's height" if told else ""
    why = f"legs: both soles level under the CoM{at}; others: {source}"
    return "stand", f"hips at {height:.3f} m, {share:.2f} of the leg", why


def _given_angles(
    robot: PinnedRobot, driven: Sequence[int], answers: Profile
) -> dict[int, float]:
    """Return the angles of the standing pose that a profile gives, by joint [rad].

    Raises:
        RobotFileError: a joint is none, is driven in a leg, follows another one, or
            does not go there.
    """
    joints, angles = {robot.joint_name(j): j for j in robot.joints}, {}
    for name, angle in answers.angles.items():
        joint = joints[answers.require(name, joints, "stand.angles")]
        low, high = robot.bounds(joint)
        told = f"{answers.origin}: stand.angles.{name} = {angle:.9g}"
        if joint in driven:
            raise RobotFileError(
                f"{told}: the joint walks, and stands as it has to; give angles of "
                "joints outside the legs: stand.hip_height bends the legs"
            )
        if joint in robot.followers:
            raise RobotFileError(f"{told}: {_why_it_follows(robot, joint)}")
        if not low <= angle <= high:
            unit = "m" if robot.model.jnt_type[joint] == SLIDE else "rad"
            raise RobotFileError(
                f"{told}: it can be sent from {low:.9g} to {high:.9g} {unit}"
            )
        angles[joint] = angle
    return angles


def _why_it_follows(robot: PinnedRobot, joint: int) -> str:
    """Say why a joint that an equality moves or holds takes no angle of a profile."""
    leader = robot.leader(joint)
    if leader is None:
        return "the file holds the joint, by an <equality>; change it there"
    name = robot.joint_name(leader)
    return f"the joint follows {name}, by an <equality>; give that one's angle"


def _leg_rows(robot: PinnedRobot, plans: tuple[LegPlan, LegPlan]) -> Rows:
    rows = []
    for name, plan in zip(("left leg", "right leg"), plans, strict=True):
        joints, passive = plan.found.joints, plan.found.passive
        rows.append((name, f"{len(joints)} joints", " ".join(joints)))
        if passive:
            why = "; ".join(why_idle(robot, j) for j in _passive_of(robot, plan))
            rows.append((name, f"passive: {' '.join(passive)}", why))
    return rows


def _passive_of(robot: PinnedRobot, plan: LegPlan) -> list[int]:
    ids = {robot.joint_name(joint): joint for joint in robot.joints}
    return [ids[name] for name in plan.found.passive]


def _turning_rows(robot: PinnedRobot, plans: tuple[LegPlan, LegPlan]) -> Rows:
    """Say of a standing robot that none of its servos could turn it, and why."""
    driven = [joint for plan in plans for joint in plan.joints]
    idle = [joint for plan in plans for joint in _passive_of(robot, plan)]
    turning, held = (
        [joint for joint in joints if abs(robot.axis(joint)[2]) > YAW]
        for joints in (driven, idle)
    )
    if turning:
        return []
    why = "; ".join(why_idle(robot, joint) for joint in held)
    why = f"held: {why}" if held else "no joint of its legs is about the vertical"
    return [("turning", "it will not turn", why)]


def _contact_rows(robot: PinnedRobot, plans: tuple[LegPlan, LegPlan]) -> Rows:
    """Say which soles are drawn alone: in the file's own model they hit nothing."""
    bare, model = list[str](), robot.model
    for sole in (plan.found.sole for plan in plans):
        bodies = set(model.geom_bodyid[list(sole.geoms)].tolist())
        if sole.geoms and ground_geoms(model, bodies)[1] == VISUAL:
            bare.append(sole.body)
    if not bare:
        return []
    why = "none of its shapes collides, so the file's own model sinks into the floor"
    return [("contact", f"none of {' and '.join(bare)}", why)]


def _range_rows(robot: PinnedRobot, plans: tuple[LegPlan, LegPlan]) -> Rows:
    """Say which joints of the legs their servos cannot be sent all the way."""
    model, rows = robot.model, list[Row]()
    for joint in (joint for plan in plans for joint in plan.joints):
        if is_narrowed(model, joint):
            own, left = (
                "{:.3g} to {:.3g} deg".format(*np.degrees(span))
                for span in (own_range(model, joint), joint_range(model, joint))
            )
            why = f"its servo's ctrlrange; the joint's own range is {own}"
            rows.append((f"range of {robot.joint_name(joint)}", left, why))
    return rows
