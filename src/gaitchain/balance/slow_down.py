"""Take shorter steps after a disturbance: caution, from 0 to 1. Ours.

A robot that stumbles over a block falls some steps later, while it still tries to walk
on as commanded. One that steps in place meanwhile has all of its reach for its balance.
"""

from gaitchain.balance.gains import Gains, clip
from gaitchain.balance.state import GaitState
from gaitchain.messages import Command

_SMALLEST = 0.01  # part of a command that is left: nothing at all would be a stop


def caution_after(gains: Gains, state: GaitState, length: float) -> float:
    """Return how cautious the step after this one must be, 0 to 1.

    It rises at once with the step's largest DCM error, and falls by a part each step.
    Long steps have larger errors of their own, on any floor.

    Args:
        gains: of the balance.
        state: of the walk at the end of a step.
        length: of that step, as the chain chose it [m].
    """
    beyond = state.worst - gains.wary_from - gains.wary_stride * length**2
    return max(
        gains.wary_kept * state.caution, clip(beyond / gains.wary_over, 0.0, 1.0)
    )


def cautious(command: Command, caution: float) -> Command:
    """Return the part of a command that a disturbed robot carries out."""
    part = max(1.0 - caution, _SMALLEST)
    return Command(part * command.vx, part * command.vy, part * command.yaw_rate)
