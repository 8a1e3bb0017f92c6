"""Whether the poses of Table I, as printed, form a closed cycle.

They do not: row 5 of what `docs/paper_map.md` says that we decided.
"""

from dataclasses import dataclass

import numpy as np

from gaitchain.errors import UnreachableError
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.keypose.primitives import PARAMETERS, factorise
from gaitchain.robot.kinematics import exchange_roles
from gaitchain.robot.robot import Robot

_DRAWS = 20
_HIP_X = PARAMETERS.index("hip_x")


@dataclass(frozen=True)
class Closure:
    """Result for the candidates of one key moment."""

    key_moment: str
    drawn: int
    """Number of candidates drawn."""
    reachable: int
    """Number of candidates within reach of the legs."""
    hip_low_m: float
    """Least distance of the hip ahead of the support ankle [m]."""
    hip_high_m: float
    """Greatest distance of the hip ahead of the support ankle [m]."""
    verdict: str

    @property
    def hip_range(self) -> str:
        """Range of the hip as text [m]."""
        return f"{self.hip_low_m:+.3f} to {self.hip_high_m:+.3f}"


def closure_report(robot: Robot, rng: np.random.Generator) -> tuple[Closure, ...]:
    """Draw Table I and compare the end of a step with the start of the next.

    A cycle closes when kp_4 with the legs' roles exchanged can be kp_1, that is when
    the hip ranges of both overlap.

    Args:
        robot: the robot.
        rng: source of randomness.

    Returns:
        One entry per key moment, and one for kp_4 as the next step's kp_1.
    """
    counts = (_DRAWS,) * 4
    try:
        poses = draw_candidates(robot, "table1", rng, counts=counts)
    except UnreachableError:
        # The table is in metres, for RES: a small robot cannot reach its poses.
        verdict = "out of reach: the table is for a leg of 0.592 m"
        return (Closure("all", _DRAWS, 0, 0.0, 0.0, verdict),)
    hips = [p[:, _HIP_X] for p in poses.parameters]
    next_start = factorise(robot, exchange_roles(poses.q[3])).parameters[:, _HIP_X]
    gap = max(hips[0].min() - next_start.max(), next_start.min() - hips[0].max())
    verdict = "closes" if gap <= 0.0 else f"{gap:.3f} m off kp_1: the cycle is open"
    named = [(f"kp_{i}", hip, "legs reach") for i, hip in enumerate(hips, start=1)]
    named.append(("kp_4 as next kp_1", next_start, verdict))
    return tuple(
        Closure(name, _DRAWS, len(hip), float(hip.min()), float(hip.max()), result)
        for name, hip, result in named
    )
