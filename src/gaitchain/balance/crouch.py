"""Crouching: the hips follow a commanded height smoothly. Compiled, ours.

Two lags of one rate r in a row follow the command, so neither the hips nor their speed
ever jumps: a change by d begins with d r^2 and is never faster than d r / e.

Plan and feedback stay those of the standing height: with the pendulum as long as the
CoM is high then, and over the CoM that the knees take ahead, no robot walked better.
"""

from typing import Any

from gaitchain.balance.compiled import compiled
from gaitchain.balance.packed_state import Walk


@compiled
def follow_crouch(walk: Any) -> None:
    """Lower or raise the hips by what is due in one control period.

    Args:
        walk: its crouch is rewritten.
    """
    state = walk.state
    part = walk.gains.crouch * walk.times.period
    state.sinking += part * (state.crouch_asked - state.sinking)
    state.crouch += part * (state.sinking - state.crouch)


@compiled
def hips_above_ankles(walk: Walk) -> float:
    """Return how high the hips are meant to be [m]."""
    return walk.times.hip_height - walk.state.crouch
