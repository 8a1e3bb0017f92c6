"""What each verb can be told; light, so that `--help` answers at once."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


@dataclass(frozen=True)
class Walk:
    """Walk a speed schedule in physics; write the figures, plots and a 3-D replay.

    Without a library it builds one (under a minute on two cores) and keeps it in the
    output folder for the next time.
    """

    robot: str | None = None
    """Built-in robot, or a robot's TOML file; RES by default. With a library: the
    robot that it must be for."""
    library: Path | None = None
    """A library that `gaitchain build` wrote."""
    schedule: str = "0.04@half,0.08@2,0.02@half"
    """Segments "speed@cycles": m/s, and cycles of two steps or "half" for one step."""
    out: Path = Path("runs/walk")
    """Folder for walk.json, walk.png, walk.html and the library."""
    seed: int = 0
    """Seed of the library that is built."""
    policy: Literal["look_ahead", "greedy"] = "look_ahead"
    """Choose the next pose by the way ahead, or by the next edge alone (the paper)."""
    open_loop: bool = False
    """Walk without feedback. So far there is no other way: the flag changes nothing."""


@dataclass(frozen=True)
class Build:
    """Draw key poses, train the chain in physics, prune and qualify it; save it."""

    robot: Annotated[str, tyro.conf.Positional]
    """Built-in robot, or a robot's TOML file."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The library to write, such as res.gait."""
    preset: str = "default"
    """Candidate poses: default."""
    seed: int = 0
    cost: Literal["physics", "planned"] = "physics"
    """Train on walks in physics, or on the planned ZMP alone (Eq. 3)."""
    training: Literal["batch", "sequential"] = "batch"
    """Order-free counts, or the paper's Eq. 5-6."""
    epsilon: float = 0.5
    """Least pose inner distance of the poses that are kept (Eq. 2)."""
    walks: int = 200
    """Random walks to train on."""


@dataclass(frozen=True)
class Inspect:
    """Show a robot's numbers with their sources, or a library with its verdicts."""

    what: Annotated[str, tyro.conf.Positional]
    """Built-in robot, robot's TOML file, or gait library."""


@dataclass(frozen=True)
class Trial:
    """Walk random speed schedules within the library's range, with starts and stops.

    Friction, servo gain and mass differ from run to run. The exit code is 1 if any
    run falls.
    """

    library: Annotated[Path, tyro.conf.Positional]
    """A library that `gaitchain build` wrote."""
    runs: int = 40
    seed: int = 1
    json: Path | None = None
    """Write the figures here."""
    open_loop: bool = False
    """Walk without feedback. So far there is no other way: the flag changes nothing."""


@dataclass(frozen=True)
class Explain:
    """Say why a walk fell: which rule broke first, by how much, and what to turn."""

    run: Annotated[Path, tyro.conf.Positional]
    """The folder of a walk, or its walk.rec."""
    out: Path | None = None
    """Picture of the timeline; timeline.png beside the record by default."""
    json: Path | None = None
    """Write the findings here."""


@dataclass(frozen=True)
class Figures:
    """Draw Figures 6 to 11 as PNG, with the numbers behind them as JSON."""

    out: Path = Path("runs/figures")
    """Folder for the files."""
    only: str = "6,7,8,9,10,11"
    """Which figures, separated by commas."""
    seeds: int = 20
    """Chains that Figures 6 and 7 average over."""
    library: Path | None = None
    """The library that Figures 8 to 11 walk; built if there is none."""
    seed: int = 0
    """Seed of the library that is built."""


@dataclass(frozen=True)
class Bench:
    """Measure speeds against each other in one run, so that the machine cancels out."""

    json: Path | None = None
    """Write the figures here."""


Options = Walk | Build | Inspect | Trial | Explain | Figures | Bench
VERBS: dict[str, type[Options]] = {
    verb.__name__.lower(): verb
    for verb in (Walk, Build, Inspect, Trial, Explain, Figures, Bench)
}
