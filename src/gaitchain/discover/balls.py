"""Ball joints: walking moves hinges alone, and no servo holds a ball. Ours."""

from typing import Any

import mujoco

from gaitchain.discover.isolate import drop_users, names_of
from gaitchain.discover.notes import Doubt, listed

_BALL = mujoco.mjtJoint.mjJNT_BALL
_EQ = mujoco.mjtEq
_CLOSING = (_EQ.mjEQ_CONNECT, _EQ.mjEQ_WELD)


def weld_balls(spec: Any) -> tuple[dict[str, str], list[str]]:
    """Weld what hangs on ball joints where it is drawn.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone; changed in place.

    Returns:
        The ball joints by the bodies that hung on them, and notes. Those of closed
        loops stay: without them, the other joints of a loop could not move.
    """
    before = names_of(spec)
    balls = [j for j in spec.joints if j.type == _BALL and not _in_loop(spec, j.parent)]
    welded = {ball.parent.name: ball.name for ball in balls}
    for ball in balls:
        spec.delete(ball)
    if not welded:
        return {}, []
    what = listed("ball joint", list(welded.values()))
    note = Doubt(f"{what} welded as drawn: servos hold hinges and slides alone.")
    return welded, [note, *drop_users(spec, before)]


def _in_loop(spec: Any, body: Any) -> bool:
    """Whether an equality closes a loop by a body, or by what hangs on it."""
    kinds = (mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE)
    names = {item.name for kind in kinds for item in body.find_all(kind)}
    names.add(body.name)
    ties = [tie for tie in spec.equalities if tie.type in _CLOSING and tie.active]
    return any(not names.isdisjoint((tie.name1, tie.name2)) for tie in ties)
