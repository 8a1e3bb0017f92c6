"""The presets of strides, each declared once: an entry of this table is all of it.

The names that `--preset` and `BuildConfig` take, the help, and what is drawn
(`draw.draw_strides`) and built (`build.stride`) come from here. This module loads
nothing heavy, so that `--help` answers at once.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class StridePreset:
    """What the candidates of one preset are: how far steps go, and how they are made.

    Lengths are parts of the leg. Strides longer than a robot can repeat are shortened
    to what it can (`build.stride_feasibility`).
    """

    help: str
    """A few words, for `--help`."""
    counts: tuple[int, int, int, int] = (40, 12, 8, 40)
    """Candidates per layer; of the strides at most as many."""
    ahead: float = 0.7
    """Longest stride ahead, where the robot can make it."""
    back: float = 0.32
    """Longest stride back, likewise."""
    outward: float = 0.2
    """Furthest that a foot lands further out than the hips are wide."""
    turn_out: float = 0.4
    """Most that a foot is turned out in a step [rad]."""
    turn_in: float = 0.12
    """Most that it is turned in [rad]."""
    shape: Mapping[str, Any] = field(default_factory=dict)
    """Numbers of `StrideShape` in place of those that a robot steps with otherwise."""


STRIDE_PRESETS: Mapping[str, StridePreset] = {
    "brisk": StridePreset(help="strides at speed, every way"),
}
"""By name; the first is taken for a robot that was read from its model."""
