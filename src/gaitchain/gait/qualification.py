"""What physics said of a library: the gate of its build, and a grid of worlds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import IntArray


@dataclass(frozen=True)
class GateReport:
    """Random schedules, walked in rounds until one round of them holds."""

    passed: bool
    rounds: int
    schedules: int
    """In each round."""
    survived: int
    """In the last round."""
    feedback: bool
    """Whether they were walked with feedback."""
    worlds: Mapping[str, Any] = field(default_factory=dict)
    """How much the physics varied, as `sim.world_range.WorldRange`."""


@dataclass(frozen=True)
class CellReport:
    """What came of one world of a grid."""

    name: str
    kind: str
    """Of its disturbance, or "nominal" or "corner"."""
    required: bool
    numbers: tuple[tuple[str, float], ...]
    """Disturbances and levels where they are not nominal."""
    runs: int
    """Walks of commands."""
    passes: int
    groups: Mapping[str, tuple[int, int]]
    """Walks, and those that held, of each group of commands."""
    steps: tuple[int, int]
    """Different steps that were walked, and those that ever fell."""


@dataclass(frozen=True)
class GridReport:
    """What a grid of worlds says of a library as a whole."""

    passed: bool
    """Whether the commands held, and the steps that are left make a walk."""
    rounds: int
    share: float
    """Part of the walks in a required world that must hold."""
    cells: tuple[CellReport, ...]
    taken_out: tuple[tuple[int, int], ...]
    """First and last pose of the steps that fell too often."""


@dataclass(frozen=True)
class Qualification:
    """What was tested in physics, and what passed."""

    gate: GateReport | None = None
    grid: GridReport | None = None

    @property
    def passed(self) -> bool:
        """Whether every test that was made passed, the gate among them."""
        gate, grid = self.gate, self.grid
        return gate is not None and gate.passed and (grid is None or grid.passed)

    def to_json(self) -> Any:
        """Return plain values."""
        return msgspec.to_builtins(self)

    @classmethod
    def from_json(cls, plain: Any) -> "Qualification":
        """Read what `to_json` gave.

        Raises:
            ValueError: something is missing or of another type.
        """
        return msgspec.convert(plain, cls)


@dataclass(frozen=True, eq=False)
class GridVerdict:
    """What a grid of worlds says about each step (`qualify.qualify_grid`)."""

    runs: IntArray
    """(N_1, N_4) how often the step was walked in a world that is required."""
    passes: IntArray
    """(N_1, N_4) how often the robot kept standing."""
    forbidden: NDArray[np.bool_]
    """(N_1, N_4) steps that are taken out."""
