"""Candidate key poses of each key moment, composed of primitives.

Layer i holds the candidates of key moment kp_i. A candidate is its primitive
parameters and their rates; pose and velocity follow (Eq. 1). In a *closed* set,
candidate j of layer 4 with the legs' roles exchanged is candidate j of layer 1, and
candidate 0 of both is the standing pose: a step from it is the first half step, a
step to it the last one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.keypose.primitives import (
    PARAMETERS,
    compose,
    compose_rates,
)
from gaitchain.gait.motion import StepMotion, Timing
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class KeyPoses:
    """The candidates of each key moment, composed of primitives."""

    robot: Robot
    parameters: tuple[Array, ...]
    """Per layer (N_i, 5) primitive `PARAMETERS`."""
    rates: tuple[Array, ...]
    """Per layer (N_i, 5) time derivatives of the parameters."""
    closed: bool
    """Whether layer 4 with the legs' roles exchanged is layer 1."""
    q: tuple[Array, ...] = field(init=False)
    """Per layer (N_i, 7) poses [rad], computed from the parameters."""
    dq: tuple[Array, ...] = field(init=False)
    """Per layer (N_i, 7) velocities [rad/s], computed from the rates."""

    def __post_init__(self) -> None:
        q = tuple(compose(self.robot, p) for p in self.parameters)
        pairs = zip(self.parameters, self.rates, strict=True)
        dq = tuple(compose_rates(self.robot, p, r) for p, r in pairs)
        for name, arrays in (
            ("parameters", self.parameters),
            ("rates", self.rates),
            ("q", q),
            ("dq", dq),
        ):
            frozen = tuple(np.array(a, dtype=float) for a in arrays)
            for array in frozen:
                array.setflags(write=False)
            object.__setattr__(self, name, frozen)

    @property
    def counts(self) -> tuple[int, ...]:
        """Candidates per key moment."""
        return tuple(len(p) for p in self.parameters)

    @property
    def foot_x(self) -> tuple[Array, ...]:
        """Per layer (N_i,) swing ankle ahead of the support ankle, x6 of the paper."""
        return tuple(p[:, PARAMETERS.index("foot_x")] for p in self.parameters)

    @property
    def step_lengths(self) -> Array:
        """(N_4,) step length of each candidate of the last layer [m]."""
        return self.foot_x[-1]

    def motion(self, gait: Sequence[int], timing: Timing) -> StepMotion:
        """Return the motion of a step through its four key poses.

        Args:
            gait: (4,) indices of the key poses, one per layer.
            timing: of the step.
        """
        q, dq = (
            np.stack([rows[n] for rows, n in zip(layers, gait, strict=True)])
            for layers in (self.q, self.dq)
        )
        return StepMotion(timing.key_times, q, dq)

    def keep(self, kept: Sequence[NDArray[np.int64]]) -> "KeyPoses":
        """Return the set of the candidates with these indices, per layer."""
        return KeyPoses(
            self.robot,
            tuple(p[k] for p, k in zip(self.parameters, kept, strict=True)),
            tuple(r[k] for r, k in zip(self.rates, kept, strict=True)),
            self.closed,
        )
