"""Key poses of a dynamic walk: strides, and how the swing foot passes between them.

Layers 1 and 4 hold *strides*: the landing of a step, which is the start of the next.
Layers 2 and 3 hold the motion of the swing foot at kp_2 and kp_3, relative to the path
between two strides, so that one fits any pair of them. A library has one of each: which
of several is taken has no effect in physics (`docs/experiments.md`). The pelvis is not
a candidate's parameter: it moves as a pendulum over the ZMP (`balance.step_plan`).
The primitives are the paper's, Move (pelvis), Lift (swing foot) and Swing (pelvis
sideways, and the foot in a side step), and Turn, our extension.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.family import STAND
from gaitchain.gait.step_target import StepTarget
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

STRIDE = ("length", "outward", "turn")
"""Landing ankle ahead of the support ankle [m], lateral distance of the ankles beyond
the stance [m], outward turn of the foot [rad]. The primitives Move, Swing, Turn."""
_USUAL_ERROR = 0.03  # legs; until physics has measured the DCM error of a step
PASSING_COLUMNS = ("share", "share_rate", "lift")
"""At kp_2: part of the path completed, its rate per single support, foot height [m].
The primitive Lift."""
ARRIVAL_COLUMNS = ("share_rate", "fall_rate")
"""At kp_3: paths per single support along it, lifts per single support downward. The
primitive Lift."""
COLUMNS = (STRIDE, PASSING_COLUMNS, ARRIVAL_COLUMNS, STRIDE)
"""Names of the columns of each layer's parameters."""


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
    """Factors on the gains that are derived from the robot, from a search or a preset
    (`balance.gains.derive_gains`)."""
    stance: float = 0.0
    """Lateral distance of the standing ankles [m]; 0 takes that of the robot's file."""

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        frozen = tuple(np.array(p, dtype=float) for p in self.parameters)
        for array, columns in zip(frozen, COLUMNS, strict=True):
            if array.ndim != 2 or array.shape[1] != len(columns):
                raise ValueError(f"a layer has shape {array.shape}, needs {columns}")
            array.setflags(write=False)
        object.__setattr__(self, "parameters", frozen)
        own = self.robot.reduced.hip_width
        object.__setattr__(self, "stance", self.stance or own)

    @property
    def closed(self) -> bool:
        """True: layer 4 with the legs' roles exchanged is layer 1."""
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
        """(N_4,) step length of each candidate of the last layer [m]."""
        return self.parameters[-1][:, 0]

    def keep(self, kept: Sequence[NDArray[np.int64]]) -> "StridePoses":
        """Return the set of the candidates with these indices, per layer."""
        left = tuple(p[k] for p, k in zip(self.parameters, kept, strict=True))
        return replace(self, parameters=left)

    def step_target(self, kp_2: int, kp_3: int, stride: int) -> StepTarget:
        """Return the target of a step from its two shapes and its last stride.

        Its usual error is that of a robot that was not measured; the next step's
        feet are as far apart as those of the standing robot.
        """
        share, rate, lift = self.parameters[1][kp_2]
        landing_rate, fall_rate = self.parameters[2][kp_3]
        length, outward, turn = self.strides[stride]
        return StepTarget(
            length=float(length),
            width=float(self.stance + outward),
            turn=float(turn),
            share=float(share),
            share_rate=float(rate),
            lift=float(lift),
            landing_rate=float(landing_rate),
            fall_rate=float(fall_rate),
            stops=float(stride == STAND),
            usual_error=_USUAL_ERROR * self.robot.reduced.leg_length,
            next_width=self.stance,
        )

    def step_targets(self, steps: Iterable[Sequence[int]]) -> list[StepTarget]:
        """Return the targets of steps that follow each other.

        Args:
            steps: for each the indices of its two shapes and its last stride.
        """
        alone = [self.step_target(*step) for step in steps]
        widths = [target.width for target in alone[1:]]
        return [
            target._replace(next_width=width)
            for target, width in zip(alone, widths, strict=False)
        ] + alone[len(widths) :]
