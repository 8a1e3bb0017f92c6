"""Which way a robot faces: by its feet, its knees and its base."""

import numpy as np

from gaitchain.discover.findings import Array, refusal
from gaitchain.discover.leg_parts import LegParts, centre_of, knee_of, knee_side
from gaitchain.discover.limbs import DOWN
from gaitchain.discover.pinned_robot import HeldRobot
from gaitchain.discover.profile import Profile
from gaitchain.discover.shapes import ground_geoms, shapes_of

_PITCH = 0.7  # cosine between a pitch joint's axis and the way across
_UNDECIDED = 0.3  # votes for ahead against back
Rows = list[tuple[str, str, str]]


def face_forward(
    robot: HeldRobot, legs: list[LegParts], answers: Profile, rows: Rows, origin: str
) -> tuple[HeldRobot, list[LegParts]]:
    """Turn the held robot so that it looks along x, and put its left leg first."""
    robot.place(robot.neutral)
    turn = robot.turn(robot.base)
    across = _across(robot, legs)
    ahead = np.cross(across, -DOWN)  # forward if the first leg is the left one
    if answers.forward is not None:
        said = turn @ np.array(answers.forward)
        vote, why = float(np.sign(said @ ahead)), "the profile says so"
        ahead = vote * (said - said @ DOWN * DOWN)
        ahead /= np.linalg.norm(ahead)
    elif answers.legs or answers.foot:
        vote, why = 1.0, "the profile names left and right"
    else:
        vote, why = _vote(robot, legs, ahead)
    if abs(vote) < _UNDECIDED:
        raise refusal(origin, f"front and back look alike ({why})", "forward")
    if vote < 0.0:
        ahead, legs = -ahead, legs[::-1]
    forward = turn.T @ ahead
    nearest = np.zeros(3)
    largest = int(np.argmax(np.abs(forward)))
    nearest[largest] = np.sign(forward[largest])
    if forward @ nearest > 0.9994 and answers.forward is None:  # 2 deg
        forward = nearest
    faced = HeldRobot(robot.model, robot.base, robot.up, forward)
    shown = ", ".join(f"{v:+.2f}" for v in faced.forward)
    rows.append(("forward", f"[{shown}] in the base's frame", why))
    return faced, legs


def _across(robot: HeldRobot, legs: list[LegParts]) -> Array:
    """Return the level unit vector from the second leg to the first."""
    for pick in (0, -1):
        gap = robot.anchor(legs[0].joints[pick]) - robot.anchor(legs[1].joints[pick])
        gap -= gap @ DOWN * DOWN
        if np.linalg.norm(gap) > 1e-3:
            break
    return np.asarray(gap / np.linalg.norm(gap))


def _vote(robot: HeldRobot, legs: list[LegParts], ahead: Array) -> tuple[float, str]:
    """Weigh what tells the front: longer forefeet, knees, the base's x axis."""
    left = np.cross(-DOWN, ahead)
    fore, bend = 0.0, 0.0
    for leg in legs:
        knee = knee_of(robot, leg, left)
        ankle = centre_of(robot, leg.joints[knee + 1 :])
        geoms, _ = ground_geoms(robot.model, set(leg.soles))
        shapes = shapes_of(robot.model, robot.data, geoms, 0)
        points = np.concatenate([s.touching(DOWN) for s in shapes] or [ankle[None]])
        reach = (points - ankle) @ ahead
        fore += 0.5 * float((reach.max() + reach.min()) / max(np.ptp(reach), 1e-9))
        sided, _ = knee_side(robot, leg, knee)
        bend += 0.5 * sided * float(np.sign(robot.axis(leg.joints[knee]) @ left))
    axis = float(robot.turn(robot.base)[:, 0] @ ahead)
    votes = {
        "forefeet": float(np.clip(4.0 * fore, -1.0, 1.0)),
        "knees": 0.7 * bend,
        "base's x axis": 0.5 * axis if abs(axis) > _PITCH else 0.0,
    }
    total = sum(votes.values())
    sign = 1.0 if total >= 0.0 else -1.0
    return total, ", ".join(f"{k} {sign * v:+.1f}" for k, v in votes.items())
