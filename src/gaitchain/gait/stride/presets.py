"""The presets of strides; an entry of the table declares a preset completely.

The names for `--preset` and `BuildConfig`, the help, and what is drawn
(`draw.draw_strides`) and built (`build.stride`) follow from it. This module imports
nothing heavy, so that `--help` is fast.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Reach:
    """The furthest strides; lengths are parts of the leg."""

    ahead: float = 0.7
    """Longest stride ahead."""
    back: float = 0.32
    """Longest stride back."""
    outward: float = 0.45
    """Largest lateral distance of the ankles at landing beyond the hip width."""
    turn_out: float = 0.8
    """Largest outward turn of the foot in a step [rad]."""
    turn_in: float = 0.12
    """Largest inward turn of the foot in a step [rad]."""


@dataclass(frozen=True, kw_only=True)
class StridePreset:
    """Range of the candidates' strides, and the shape of the steps."""

    help: str
    """Short description for `--help`."""
    most: int = 40
    """Upper limit on the number of strides."""
    reach: Reach = Reach()
    """The furthest strides that are tried; those that the robot cannot repeat are
    shortened (`build.stride_feasibility`)."""
    shape: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `StrideShape` that replace the default shape of the robot's kind."""


STRIDE_PRESETS: Mapping[str, StridePreset] = {
    "brisk": StridePreset(help="strides at speed, every way"),
}
"""By name; the first is taken for a robot that was read from its model."""
