"""How late the joints follow the reference. Compiled, ours.

Servos that get their targets late, or are softer than in the file, carry the whole
robot behind its plan. A DCM that is behind for that reason is no error: steps that
answer it go wide, sway more, and are later still.
"""

from typing import Any

from gaitchain.balance.compiled import compiled
from gaitchain.balance.curves import clip
from gaitchain.balance.packed_state import Walk
from gaitchain.balance.state import Memory
from gaitchain.messages import Array

_MOVED = 10.0  # rad^2/s, of all joints: what is remembered of them, 1 s of a walk
_USUAL_S, _LATEST_S = 0.01, 0.06


@compiled
def note_lag(walk: Any, joints: Array, memory: Memory) -> None:
    """Learn how late the joints are, by least mean squares [Widrow60].

    A joint that is late by tau is behind its reference by tau q', so

        tau <- tau + dt / M  sum_j q'_j (q_j - m_j - tau q'_j)

    with the reference q and the measured m. Offsets of encoders cancel in a cycle, and
    a standing robot neither learns nor forgets.

    Args:
        walk: its `state.lag` is rewritten.
        joints: (2 n,) measured [rad].
        memory: of the last period, whose reference the joints have now if they follow
            at once.
    """
    behind, moved = 0.0, 0.0
    for j in range(joints.shape[0]):
        rate = memory.rates[j]
        behind += rate * (memory.joints[j] - joints[j])
        moved += rate * rate
    part = walk.times.period / _MOVED
    state = walk.state
    state.lag += part * (behind - min(moved, 1.0 / part) * state.lag)


@compiled
def lag_of(walk: Walk) -> float:
    """Return how late the robot is beyond what servos always are [s].

    RES is late by 3 to 7 ms under its own weight, T1 leads by 5.
    """
    return clip(walk.state.lag - _USUAL_S, 0.0, _LATEST_S)
