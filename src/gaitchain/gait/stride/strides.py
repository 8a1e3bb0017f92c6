"""Key poses of a dynamic walk: strides, and the shapes of the swing between them.

Layers 1 and 4 hold *strides*: where a step ends, and so where the next one begins.
Layers 2 and 3 hold *shapes*: how the swing foot passes kp_2 and how it arrives at kp_3,
as parts of the way between the two strides, so that any shape fits any pair of strides.
The pelvis is not chosen: it swings as a pendulum over the ZMP (`balance.step_plan`).
The primitives are the paper's, Move (pelvis), Lift (swing foot), Swing (pelvis
sideways, and the foot where a step goes to the side), and Turn, our extension.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.family import STAND
from gaitchain.gait.step_target import StepTarget
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

STRIDE = ("length", "outward", "turn")
"""Landing ankle ahead of the support ankle [m], further out than the hips are wide [m],
and turned out [rad]. The primitives Move, Swing and Turn."""
PASSING = ("share", "share_rate", "lift")
"""At kp_2: part of the way gone, ways per single support, foot height [m]. Lift."""
LANDING = ("share_rate", "fall_rate")
"""At kp_3: ways per single support along, lifts per single support down. Lift."""
COLUMNS = (STRIDE, PASSING, LANDING, STRIDE)
"""What the columns of each layer's parameters mean."""


@dataclass(frozen=True, eq=False)
class StridePoses:
    """The candidates of each key moment of a dynamic walk.

    The set is closed: kp_4 of one step, seen from the other foot, is kp_1 of the next,
    and stride 0 of both is standing.
    """

    robot: Robot
    hip_height: float
    """Hips above the ankles [m]."""
    parameters: tuple[Array, ...]
    """Per layer (N_i, len(COLUMNS[i]))."""
    balance: Mapping[str, float] = field(default_factory=dict)
    """Factors on the gains that are derived from the robot, where a search found any
    (`balance.gains.derive_gains`)."""

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        frozen = tuple(np.array(p, dtype=float) for p in self.parameters)
        for array, columns in zip(frozen, COLUMNS, strict=True):
            if array.ndim != 2 or array.shape[1] != len(columns):
                raise ValueError(f"a layer has shape {array.shape}, needs {columns}")
            array.setflags(write=False)
        object.__setattr__(self, "parameters", frozen)

    @property
    def closed(self) -> bool:
        """Always: layer 4, roles exchanged, is layer 1."""
        return True

    @property
    def counts(self) -> tuple[int, ...]:
        """Candidates per key moment."""
        return tuple(len(p) for p in self.parameters)

    @property
    def strides(self) -> Array:
        """(N_4, 3) `STRIDE` of each candidate of the last layer."""
        return self.parameters[-1]

    @property
    def step_lengths(self) -> Array:
        """(N_4,) step length that each candidate of the last layer ends with [m]."""
        return self.parameters[-1][:, 0]

    def keep(self, kept: Sequence[NDArray[np.int64]]) -> "StridePoses":
        """Return the set without the candidates that pruning dropped."""
        left = tuple(p[k] for p, k in zip(self.parameters, kept, strict=True))
        return StridePoses(self.robot, self.hip_height, left, self.balance)

    def goal(self, passing: int, landing: int, last: int) -> StepTarget:
        """Return a step's goal: its shapes, and the stride that it ends with."""
        share, rate, lift = self.parameters[1][passing]
        landing_rate, fall_rate = self.parameters[2][landing]
        length, outward, turn = self.parameters[3][last]
        return StepTarget(
            length=float(length),
            width=float(self.robot.reduced.hip_width + outward),
            turn=float(turn),
            share=float(share),
            share_rate=float(rate),
            lift=float(lift),
            landing_rate=float(landing_rate),
            fall_rate=float(fall_rate),
            stops=float(last == STAND),
        )
