"""What each verb can be told; light, so that `--help` answers at once."""

from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from gaitchain.cli.calibrate_options import Calibrate
from gaitchain.sim.world import DISTURBANCES, World

_Flag = tyro.conf.FlagCreatePairsOff[bool]


def _world_options() -> type:
    """Make a class with an option for each disturbance that `World` declares."""
    options: list[tuple[str, Any, Any]] = []
    for name, disturbance in DISTURBANCES.items():
        default, text = getattr(World, name), disturbance.help
        if isinstance(default, bool):
            flag = tyro.conf.arg(help=text, help_behavior_hint="")
            options.append((disturbance.option, Annotated[_Flag, flag], False))
        elif disturbance.limits is not None:
            number = tyro.conf.arg(help=text, metavar="FLOAT", help_behavior_hint="")
            kind = Annotated[float | None, number]
            options.append((disturbance.option, kind, None))
    made = make_dataclass("WorldOptions", options, frozen=True)
    made.__doc__ = """What the floor, the servos and the sensors are like.

    What is not given is nominal in `walk`. In `trial` and `push` the friction is 0.6
    to 1, and the links of a dynamic library's robot are off by up to 0.1; gain and mass
    vary for another one's.
    """
    return made


@dataclass(frozen=True)
class LoopOptions:
    """Whether the robot balances: strides with all there is, key poses by ankles."""

    feedback: Annotated[_Flag, tyro.conf.arg(help_behavior_hint="(default)")] = False
    """Balance by the sensors, as far as the library can."""
    open_loop: Annotated[_Flag, tyro.conf.arg(help_behavior_hint="")] = False
    """Walk without feedback."""


_WorldOptions = _world_options()
_NOMINAL = _WorldOptions()
# Without the group's name before each option.
if TYPE_CHECKING:
    InWorld = object
else:
    InWorld = Annotated[_WorldOptions, tyro.conf.OmitArgPrefixes]
Pushes = Annotated[str | None, tyro.conf.arg(help=DISTURBANCES["push"].help)]
Loop = Annotated[LoopOptions, tyro.conf.OmitArgPrefixes]


@dataclass(frozen=True)
class Walk:
    """Walk a schedule in physics; write the figures, plots and a 3-D replay.

    Without a library it builds one (RES: under a minute on two cores; a robot from
    MJCF or URDF: some minutes) and keeps it in the output folder for the next time.
    """

    robot: str | None = None
    """Built-in robot, name that `robots` lists, or a robot's TOML, MJCF or URDF file;
    RES by default. With a library: the robot that it must be for."""
    profile: Path | None = None
    """TOML file that says what the robot's MJCF or URDF leaves open."""
    library: Path | None = None
    """A library that `gaitchain build` wrote."""
    schedule: str | None = None
    """Segments "speed@cycles": m/s, and cycles of two steps or "half" for one step; the
    paper's walk "0.04@half,0.08@2,0.02@half" by default. For a dynamic library
    "vx,vy,yaw@seconds;..." in m/s and rad/s; by default all that it can do."""
    push: Pushes = None
    out: Path = Path("runs/walk")
    """Folder for walk.json, walk.png, walk.html and the library."""
    seed: int = 0
    """Seed of the library that is built, and of the world."""
    policy: Literal["look_ahead", "greedy"] = "look_ahead"
    """Choose the next pose by the way ahead, or by the next edge alone (the paper)."""
    loop: Loop = LoopOptions()
    world: InWorld = _NOMINAL


@dataclass(frozen=True)
class Build:
    """Draw key poses, train the chain in physics, prune and qualify it; save it."""

    robot: Annotated[str, tyro.conf.Positional]
    """Built-in robot, name that `robots` lists, or robot's TOML, MJCF or URDF file."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The library to write, such as res.gait."""
    profile: Path | None = None
    """TOML file that says what the robot's MJCF or URDF leaves open."""
    preset: str | None = None
    """Candidate poses: default (the paper's walk, for robots of boxes) or brisk
    (dynamic). A robot of boxes has the first by default, any other one the second."""
    seed: int = 0
    cost: Literal["physics", "planned"] = "physics"
    """Train on walks in physics, or on the planned ZMP alone (Eq. 3)."""
    training: Literal["batch", "sequential"] = "batch"
    """Order-free counts, or the paper's Eq. 5-6."""
    epsilon: float | None = None
    """Least pose inner distance of the poses that are kept (Eq. 2)."""
    walks: int = 200
    """Random walks to train on."""
    search: int | None = None
    """Generations of the search for step time, crouch, step height and balance, each
    some 25 s on two cores; 5 by default for a robot read from its model, else none."""
    search_s: float | None = None
    """Time that the search may take [s]; no limit by default."""
    step_s: float | None = None
    """T, one step [s]: by default 3 for the paper's walk; for brisk 0.36 for
    a robot of boxes with legs as long as RES's, or as the search finds."""
    speed_limit: float | None = None
    """Joint speed that the walk may use [deg/s]; the robot's own by default, or inf."""


@dataclass(frozen=True)
class Inspect:
    """Show what was found of a robot and why, or a library with its verdicts."""

    what: Annotated[str, tyro.conf.Positional]
    """Built-in robot, name that `robots` lists, robot's TOML, MJCF or URDF file, or
    gait library."""
    profile: Path | None = None
    """TOML file that says what the robot's MJCF or URDF leaves open."""
    out: Path | None = None
    """Picture of what was found in MJCF or URDF; in runs/inspect by default."""


@dataclass(frozen=True)
class Robots:
    """List the robots that are known by name, with licences and how to get them."""

    json: Path | None = None
    """Write the list here."""


@dataclass(frozen=True)
class Trial:
    """Walk many schedules over all that the library can do, each in its own world.

    The exit code is 1 if any run falls.
    """

    library: Annotated[Path, tyro.conf.Positional]
    """A library that `gaitchain build` wrote."""
    runs: int = 40
    seed: int = 1
    schedule: str = "random"
    """Walked in every run, as `walk` takes it; "random" draws one for each: of steps
    with starts and stops, for a dynamic library a new command every 2 s."""
    seconds: float = 30.0
    """Length of a dynamic library's random schedules [s]."""
    push: Pushes = None
    json: Path | None = None
    """Write the figures here."""
    workers: int | None = None
    """Processes; all cores by default."""
    loop: Loop = LoopOptions()
    world: InWorld = _NOMINAL


@dataclass(frozen=True)
class Qualify:
    """Walk every step and command on a grid of worlds; take out the steps that fall.

    Friction, servo gain, torque limit, masses, bus delay, sensor noise, blocks, slope,
    pushes. The verdict goes into the library. An interrupted run goes on where it was.
    The exit code is 1 if the library does not pass.
    """

    library: Annotated[Path, tyro.conf.Positional]
    """A library that `gaitchain build` wrote."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """The library to write; in place by default."""
    quick: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Only the nominal world and one mild level of each disturbance."""
    seeds: int = 1
    """Walks of each command, and covers of all steps, in each world."""
    map: Path | None = None
    """Picture of the pass rates, a row for each world."""
    json: Path | None = None
    """Write the figures here."""
    workers: int | None = None
    """Processes; all cores by default, all of a cluster's."""
    backend: Literal["loky", "dask", "ray"] = "loky"
    """Who walks: processes of this machine, or a cluster (extras `dask`, `ray`)."""
    address: str | None = None
    """Of a running cluster; without it one is started on this machine."""


@dataclass(frozen=True)
class Push:
    """Push the walking robot from every side; find the impulse at which half fall."""

    library: Annotated[Path, tyro.conf.Positional]
    """A library that `gaitchain build` wrote."""
    vx: float = 0.3
    """Speed of the walk [m/s]."""
    runs: int = 20
    """Worlds and moments of the gait for each side."""
    directions: int = 8
    """Sides, evenly spaced."""
    seed: int = 1
    json: Path | None = None
    """Write the figures here."""
    out: Path | None = None
    """Picture of all sides."""
    workers: int | None = None
    """Processes; all cores by default."""
    loop: Loop = LoopOptions()
    world: InWorld = _NOMINAL


@dataclass(frozen=True)
class Explain:
    """Say why a walk fell: which rule broke first, by how much, and what to turn."""

    run: Annotated[Path, tyro.conf.Positional]
    """The folder of a walk, its walk.rec, or a log that `serve` wrote (.mcap)."""
    out: Path | None = None
    """Picture of the timeline; timeline.png beside the record by default."""
    json: Path | None = None
    """Write the findings here."""
    fall: int | None = None
    """Which fall of a log, 1 for the first; the last one by default."""


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


_Walks = Walk | Build | Inspect | Robots | Trial | Qualify | Push
Options = _Walks | Explain | Calibrate | Figures | Bench
VERBS: dict[str, type[Options]] = {
    verb.__name__.lower(): verb
    for verb in (
        *(Walk, Build, Inspect, Robots, Trial),
        *(Qualify, Push, Explain, Calibrate, Figures, Bench),
    )
}
