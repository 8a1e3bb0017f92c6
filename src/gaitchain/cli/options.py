"""The options of every verb; light, so that `--help` answers at once."""

import re
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from gaitchain.backends.makes import LEAST_BAUD, MAKES, MOST_BAUD, MakeName
from gaitchain.build.seed_banks import TRIALS
from gaitchain.gait.limits import Limits
from gaitchain.gait.stride.presets import STRIDE_PRESETS
from gaitchain.sim.known_servos import KNOWN_SERVOS
from gaitchain.sim.world import DISTURBANCES, World

_Flag = tyro.conf.FlagCreatePairsOff[bool]
_Stages = Literal[
    "bus", "directions", "offsets", "timing", "imu", "hung", "stand", "shift", "steps"
]
_PORT = Limits(0, 2**16 - 1)
_SEED = Limits(0, TRIALS - 1)  # builds have the larger ones


_SERVO = (
    "Play, friction, torque-speed line and resolution of a servo, as they were "
    "published. Values that were not published are 0 (ideal). Other options override "
    "these."
)


def _world_options() -> type:
    """Make a class with an option for each disturbance that `World` declares."""
    options: list[tuple[str, Any, Any]] = []
    for name, disturbance in DISTURBANCES.items():
        default, text = getattr(World, name), disturbance.help
        if isinstance(default, bool):
            flag = tyro.conf.arg(help=text, help_behavior_hint="")
            options.append((disturbance.option, Annotated[_Flag, flag], False))
        elif disturbance.choices:
            word = tyro.conf.arg(help=text, help_behavior_hint="")
            choice: Any = Literal[disturbance.choices]
            options.append((disturbance.option, Annotated[choice | None, word], None))
        elif disturbance.limits is not None:
            number = tyro.conf.arg(help=text, metavar="FLOAT", help_behavior_hint="")
            kind = Annotated[float | None, number]
            options.append((disturbance.option, kind, None))
    servo = tyro.conf.arg(help=_SERVO, help_behavior_hint="")
    names: Any = Literal[tuple(KNOWN_SERVOS)]
    options.append(("servo", Annotated[names | None, servo], None))
    made = make_dataclass("WorldOptions", options, frozen=True)
    made.__doc__ = """Floor, servos and sensors of the simulation.

    What is not given is nominal in `walk`. In `trial` and `push` the friction is 0.6
    to 1; for a library of strides the model error is up to 0.1, for another one gain
    and mass vary.
    """
    return made


@dataclass(frozen=True)
class LoopOptions:
    """Balance feedback: strides use all rules, key poses the ankles only."""

    feedback: Annotated[_Flag, tyro.conf.arg(help_behavior_hint="(default)")] = False
    """Balance by the sensors, as far as the library can."""
    open_loop: Annotated[_Flag, tyro.conf.arg(help_behavior_hint="")] = False
    """Walk without feedback."""


@dataclass(frozen=True)
class ReportOptions:
    """Output of the verb."""

    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Write the results as JSON; - writes them to standard output, and nothing else
    there: what a person beside a robot is told and asked goes to standard error."""
    quiet: Annotated[_Flag, tyro.conf.arg(help_behavior_hint="")] = False
    """Print no tables, notes or progress. Errors are still printed."""


_WorldOptions = _world_options()
_NOMINAL = _WorldOptions()
# Without the group's name before each option.
if TYPE_CHECKING:
    InWorld = object
else:
    InWorld = Annotated[_WorldOptions, tyro.conf.OmitArgPrefixes]
Pushes = Annotated[str | None, tyro.conf.arg(help=DISTURBANCES["push"].help)]
Punches = Annotated[str | None, tyro.conf.arg(help=DISTURBANCES["punches"].help)]
_LOW = "Hips lower by this, as far as `inspect` says that they go; less at speed [m]."
Crouch = Annotated[float, tyro.conf.arg(metavar="FLOAT", help=_LOW)]
Loop = Annotated[LoopOptions, tyro.conf.OmitArgPrefixes]
Report = Annotated[ReportOptions, tyro.conf.OmitArgPrefixes]
_A_LIBRARY = "A library that `gaitchain build` wrote; `res` comes with gaitchain."
_LIBRARY = tyro.conf.arg(metavar="LIBRARY", help=_A_LIBRARY)
_OPTIONAL = tyro.conf.arg(metavar="[LIBRARY]", help=_A_LIBRARY)
_LOGS = tyro.conf.arg(metavar="LOG [LOG ...]", help_behavior_hint="(required)")
_SEEDED = tyro.conf.arg(help="Seed of all that is drawn; the same one gives the same.")
Seed = Annotated[int, _SEED, _SEEDED]
Library = Annotated[str, tyro.conf.Positional, _LIBRARY]
OwnLibrary = Annotated[str | None, tyro.conf.Positional, _OPTIONAL]
UsualLibrary = Annotated[str, tyro.conf.Positional, _OPTIONAL]
_DRAWN = tyro.conf.arg(
    metavar="[LIBRARY]",
    help="Library of key poses that Figures 8 to 11 walk; built if there is none. "
    "`res` is one of strides.",
)
Robot = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(
        metavar="ROBOT",
        help="Built-in robot, name that `robots` lists, or TOML, MJCF or URDF file.",
    ),
]
Profile = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="FILE",
        help="TOML file that says what the robot's MJCF or URDF leaves open.",
    ),
]
Picture = Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="FILE")]
_PRESETS = (
    "Candidate poses: default (the paper's walk), table1 (Table I as printed), "
    + ", ".join(f"{name} ({preset.help})" for name, preset in STRIDE_PRESETS.items())
    + ". A robot of boxes has the first by default, any other one "
    + f"{next(iter(STRIDE_PRESETS))}."
)
Workers = Annotated[
    int | None,
    Limits(1, 4096),
    tyro.conf.arg(metavar="INT", help="Processes.", help_behavior_hint="(all cores)"),
]
Backend = Annotated[
    Literal["loky", "dask", "ray"],
    tyro.conf.arg(
        help="Where walks run: processes here, or a cluster (extras `dask`, `ray`)."
    ),
]
_ROBOT_BACKENDS = (
    f"mujoco, mock, {' or '.join(f'{make}:PORT' for make in MAKES)} (emulated for "
    "emulated servos), ros (Zenoh's router on this computer), "
    "ros:zenoh:tcp/HOST:PORT, ros:ws://HOST:PORT; ros-effort in place of ros sends "
    "torques besides."
)
Address = Annotated[
    str | None,
    tyro.conf.arg(
        help="Address of a running cluster; without it one is started on this machine."
    ),
]


@dataclass(frozen=True)
class Walk:
    """Walk a schedule in physics; write the figures, plots and a 3-D replay.

    Without a library it builds one (RES: under a minute on two cores; a robot from
    MJCF or URDF: some minutes) and keeps it in the output folder for the next time.
    """

    library: OwnLibrary = None
    robot: str | None = None
    """Robot to build a library of, as `build` takes it; RES by default. With a library:
    the robot that it must be for."""
    profile: Profile = None
    schedule: str | None = None
    """Segments "speed@cycles": m/s, and cycles of two steps or "half" for one step; the
    paper's walk "0.04@half,0.08@2,0.02@half" by default. For a library of
    strides "vx,vy,yaw@seconds;..." in m/s and rad/s; by default all that it can do. A
    fourth number before the @ lowers the hips [m]."""
    waypoints: str | None = None
    """Instead of a schedule: places "x,y,yaw;..." in m and deg from where the robot
    stands (0 ahead, 90 to the left); it stands at each, or gives it up after 60 s and
    twice the time of the way at full speed. Of a library of strides only."""
    crouch: Crouch = 0.0
    push: Pushes = None
    punches: Punches = None
    out: Path = Path("runs/walk")
    """Folder for walk.json, walk.png, walk.html, walk.rec and the library."""
    seed: Annotated[int, _SEED] = 0
    """Seed of the library that is built, and of the world."""
    policy: Literal["look_ahead", "greedy"] = "look_ahead"
    """Choose the next pose by the way ahead, or by the next edge alone (the paper)."""
    workers: Workers = None
    loop: Loop = LoopOptions()
    world: InWorld = _NOMINAL
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Build:
    """Draw key poses, train the chain in physics, prune and qualify it; save it.

    An interrupted build goes on where it was. The exit code is 1 if physics does not
    pass the library.
    """

    robot: Robot
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="FILE")]
    """The library to write, such as res.gait."""
    profile: Profile = None
    identified: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Library that `gaitchain identify` wrote: build for the robot as it was found, and
    with that library's preset if none is given."""
    servo_gain: float | None = None
    """Part of the file's servo stiffness and damping to walk with; by default all of
    it; half or twice where no walk holds with that, and walks do with the other."""
    preset: Annotated[str | None, tyro.conf.arg(help=_PRESETS)] = None
    seed: Seed = 0
    cost: Literal["physics", "planned"] = "physics"
    """Train on walks in physics, or on the planned ZMP alone (Eq. 3)."""
    training: Literal["batch", "sequential"] = "batch"
    """All walks at once, in any order: key poses by expected costs, strides by weighted
    counts; or the paper's Eq. 5-6, walk by walk."""
    epsilon: float | None = None
    """Least pose inner distance of the key poses that are kept (Eq. 2)."""
    walks: int = 200
    """Random walks to train on."""
    search: int | None = None
    """Generations of the search for step time, crouch, swing and balance, each some
    20 s on two cores; 6 by default for a robot read from its model, else none."""
    search_s: float | None = None
    """Time that the search may take [s]; no limit by default."""
    step_s: float | None = None
    """T, one step [s]: by default 3 for the paper's walk; for brisk 0.36 for
    a robot of boxes with legs as long as RES's, or as the search finds."""
    speed_limit: float | None = None
    """Joint speed that the walk may use [deg/s]; the robot's own by default, or inf."""
    backend: Backend = "loky"
    address: Address = None
    workers: Workers = None
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Inspect:
    """Show what was found of a robot and why, or a library with its verdicts."""

    what: Annotated[str, tyro.conf.Positional]
    """Robot, as `build` takes it, or gait library; res.gait is the one that comes with
    gaitchain."""
    profile: Profile = None
    output: Picture = None
    """Picture of what was found in MJCF or URDF; in runs/inspect by default."""
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Robots:
    """List the robots that are known by name, with licences and how to get them."""

    report: Report = ReportOptions()


@dataclass(frozen=True)
class Trial:
    """Walk many schedules over all that the library can do, each in its own world.

    The exit code is 1 if any run falls.
    """

    library: Library
    runs: Annotated[int, Limits(1, 10**6)] = 40
    """Number of walks."""
    seed: Seed = 1
    schedule: str = "random"
    """Walked in every run, as `walk` takes it; "random" draws one for each: of steps
    with starts and stops, for a library of strides a new command every 2 s."""
    seconds: Annotated[float, Limits(1.0, 3600.0)] = 30.0
    """Length of random schedules, for a library of strides [s]."""
    crouch: Crouch = 0.0
    own_model: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The robot's MJCF or URDF: walk in it with every joint, actuator and contact that
    it has, in place of the skeleton that builds walk. Only its falls are known then,
    and its speed in a schedule of one command."""
    robot_hidden: Annotated[int | None, _SEED] = None
    """Seed of a robot that differs from its file in gains, delay, play, friction,
    offsets, CoM and IMU, in ways that are not told. Its walks are all it shows."""
    push: Pushes = None
    punches: Punches = None
    workers: Workers = None
    loop: Loop = LoopOptions()
    world: InWorld = _NOMINAL
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Qualify:
    """Walk every step and command on a grid of worlds; take out the steps that fall.

    Friction, servo gain, torque limit, masses, bus delay, sensor noise, blocks, slope,
    pushes, load, and faults of servos, bus, encoders and IMU. With --bound it walks
    random schedules in the mild ones of these worlds instead, until it is sure that
    fewer steps end in a fall, or more. The verdict goes into the library. An
    interrupted run goes on where it was. The exit code is 1 if it does not pass.
    """

    library: Library
    output: Picture = None
    """The library to write; in place by default."""
    quick: _Flag = False
    """Only the nominal world and one mild level of each disturbance."""
    seeds: Annotated[int, Limits(1, 1000)] = 1
    """Walks of each command, and covers of all steps, in each world."""
    map: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Picture of the pass rates, a row for each world."""
    bound: Annotated[float | None, Limits(1e-9, 0.1)] = None
    """Test whether there are fewer falls per step than this, such as 1e-4. Choose it
    before the first walk: bounds tried before are told if they are in the library, in
    that of -o, or in the interrupted run beside it; those of another -o are not
    known."""
    confidence: Annotated[float, Limits(0.5, 0.999999)] = 0.95
    """How sure that verdict is to be."""
    seconds: Annotated[float, Limits(2.0, 3600.0)] = 60.0
    """Length of each walk for the bound [s]."""
    most_steps: Annotated[int | None, Limits(1, 10**12)] = None
    """Steps after which the test for the bound ends without a verdict; by default 20
    times those that it takes if nobody falls."""
    pages: Annotated[Path | None, tyro.conf.arg(name="report", metavar="DIR")] = None
    """Folder for report.html, what was shown for a bound, how surely, and what was not,
    and report.json. What it withstands of pushes, how it stops and how it falls is
    measured for it as well."""
    splitting: Annotated[float | None, Limits(0.01, 2.0)] = None
    """Instead of the test: an estimate of rates too small for it, by multilevel
    splitting, of walks of 10 s that are pushed each second up to this part of m sqrt(g
    h). --seconds, --most-steps and --report are the test's, and refused."""
    report_walks: Annotated[int, Limits(2, 1000)] = 12
    """Walks that are pushed from each of four sides for the report."""
    backend: Backend = "loky"
    address: Address = None
    workers: Workers = None
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Push:
    """Push the walking robot from every side; find the impulse at which half fall."""

    library: Library
    vx: float = 0.3
    """Speed of the walk [m/s]."""
    runs: Annotated[int, Limits(1, 10**6)] = 20
    """Worlds and moments of the gait for each side."""
    directions: Annotated[int, Limits(1, 360)] = 8
    """Sides, evenly spaced."""
    body: str = "trunk"
    """Body that is pushed; any draws one for each run, by its part of the mass."""
    seed: Seed = 1
    output: Picture = None
    """Picture of all sides."""
    workers: Workers = None
    loop: Loop = LoopOptions()
    world: InWorld = _NOMINAL
    report: Report = ReportOptions()


@dataclass(frozen=True)
class GetUp:
    """Search how a robot gets up after a fall, in its own model, arms and all.

    From its front and from its back: key poses from lying to standing, found in physics
    with nothing known of the robot but its file. Then it falls at random and gets up as
    it would online. An interrupted search goes on where it was. The exit code is 1 if
    it does not stand after 9 of 10 falls onto each side, or has no way from one.
    """

    library: Library
    model: Annotated[Path, tyro.conf.Positional]
    """The robot's MJCF or URDF, as its library was built from."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="FILE")]
    """What was found, JSON."""
    sides: Literal["both", "front", "back"] = "both"
    """What it lies on."""
    generations: Annotated[int, Limits(1, 10**4)] = 150
    """Of the search from each side; it ends where it has found a way."""
    ways: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Try what was found before, and search nothing."""
    runs: Annotated[int, Limits(1, 10**5)] = 20
    """Falls onto each side."""
    seed: Seed = 1
    replay: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Web page of the first fall onto each side."""
    workers: Workers = None
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Explain:
    """Say why a walk fell: which rule broke first, by how much, and what to try."""

    run: Annotated[Path, tyro.conf.Positional]
    """The folder of a walk, its walk.rec, or a log that `serve` wrote (.mcap)."""
    output: Picture = None
    """Picture of the timeline; by default timeline.png beside the record of a walk,
    NAME.timeline.png beside a log NAME.mcap."""
    fall: int | None = None
    """Which fall of a log, 1 for the first; the last one by default."""
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Export:
    """Write a library as code, or as motions in the files that other projects read.

    With `--to c` a walker in C99 with its tables, without allocation, of strides only
    (preset `brisk`); where there is a C compiler it is tried here, and times and memory
    are printed. With every other format reference motions over the whole command range,
    walked in physics in the nominal world; if one of them falls, the exit code is 1 and
    nothing is written.
    """

    library: Library
    to: Literal["c", "npz", "csv", "mjlab", "open-duck"]
    """c: gait.h, gait.c and demo.c; npz: one file of all motions; csv: a table for each
    command; mjlab: an npz for each, for its MotionLoader; open-duck:
    polynomial_coefficients.pkl of Open Duck Playground."""
    output: Picture = None
    """File to write, for c, csv and mjlab a folder; in runs/export by default."""
    no_try: _Flag = False
    """Of c: only write the files."""
    grid: str = "5,3,3"
    """Odd numbers of speeds ahead, aside and around, from limit to limit."""
    seconds: float = 10.0
    """Length of each motion, after three seconds of run-in: from a cycle of the walk to
    600 [s]."""
    own_model: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The robot's MJCF or URDF: walk in it and write all its joints and bodies, arms
    too, in its order, as mjlab needs them; else those of the legs, and the trunk."""
    rate: Literal[10, 20, 25, 50, 100] = 50
    """Frames a second [Hz]."""
    workers: Workers = None
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Calibrate:
    """Find which servo moves which joint and where its zero is, with torque off.

    A person moves the robot by hand as the questions say; no motor is turned on for it.
    With `--check` a calibration is compared with the bus instead; the exit code is 1 if
    something differs. With `--exercise` a robot that is calibrated moves by itself, at
    most for a minute, and writes the log that `gaitchain identify` reads.
    """

    library: Library
    port: str | None = None
    """Serial port of the servos, such as /dev/ttyUSB0; with `--exercise` also emulated,
    for emulated ones."""
    output: Picture = None
    """The calibration to write, such as robot.toml."""
    check: Path | None = None
    """The calibration to compare with the bus."""
    exercise: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Log to write: the robot swings its hung legs, and sways on both feet."""
    preview: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Web page to write before any motor moves: the same motions, simulated, in 3-D."""
    view: Annotated[int | None, Limits(0, 65535, whole=True)] = None
    """Port of a page that plays each motion before you begin it, and then shows the
    targets as they are sent; 0 for a free one."""
    calibration: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Calibration of the servos that exercise."""
    robot_hidden: Annotated[int | None, _SEED] = None
    """Let a simulated robot exercise instead, the hidden one of this seed, see
    `trial`."""
    make: MakeName = "dynamixel"
    """Make of the servos; feetech is the STS series."""
    baud: Annotated[int | None, Limits(LEAST_BAUD, MOST_BAUD, whole=True)] = None
    """Rate of the bus [bit/s]; the usual ones are tried by default."""
    ids: str | None = None
    """Servos to look for, such as "1-12,20"; all by default."""
    pose: Literal["straight", "standing"] = "straight"
    """Pose that says where the joints are: straight legs, or the library's stand."""
    limits: _Flag = False
    """Narrow the joints' limits to what the person moves them through."""
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Doctor:
    """Take a robot into service in stages, each with a go or a no-go and what to do.

    Bus and ids, directions, offsets, timing against what the library was qualified
    with, IMU, then under the walker: hung, standing, shifting, first slow steps. The
    torque is off between stages and at any end. The exit code is 0 after a go of the
    last stage, and 1 after a no-go or where that stage was skipped or not reached.
    """

    library: Library
    port: str
    """Serial port of the servos, such as /dev/ttyUSB0; emulated for emulated ones."""
    calibration: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Calibration of the servos, as `gaitchain calibrate` writes it."""
    begin: Annotated[_Stages, tyro.conf.arg(name="from")] = "bus"
    """First stage, where those before it have passed."""
    rate: Annotated[float, Limits(20.0, 1000.0)] = 100.0
    """Control periods a second [Hz]."""
    yes: _Flag = False
    """Ask nothing: nobody looks, and what only eyes can see is not checked. Real servos
    are examined as far as the robot hangs, with nobody there to catch it."""
    view: Annotated[int | None, Limits(0, 65535, whole=True)] = None
    """Port of a page, for this computer alone, that shows the robot in 3-D as it is
    asked to move, and which joint should turn; 0 for a free one."""
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Identify:
    """Find out from a robot's own log how it differs from its file; fit a library.

    As the simulator's replay of the log shows it: gain, damping, play, dry friction and
    zero of each joint; delay, static and viscous friction, one number for all servos;
    mass and CoM of the trunk; how the IMU is mounted, and how late it is. Not
    estimated: the masses of the legs, which stay as in the file. The steps of the
    library are then qualified for that robot. The exit code is 1 if they fail. An
    interrupted command goes on where it was.
    """

    library: Library
    logs: Annotated[tuple[Path, ...], tyro.conf.Positional, _LOGS]
    """Logs that `gaitchain calibrate --exercise` wrote."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="FILE")]
    """The library to write, such as mine.gait."""
    picture: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Picture of the log and its replays."""
    workers: Workers = None
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Figures:
    """Draw Figures 6 to 11 as PNG, with the numbers behind them as JSON."""

    library: Annotated[str | None, tyro.conf.Positional, _DRAWN] = None
    out: Path = Path("runs/figures")
    """Folder for the files."""
    only: str = "6,7,8,9,10,11"
    """Which figures, separated by commas."""
    seeds: Annotated[int, Limits(2, 10**4)] = 20
    """Chains that Figures 6 and 7 average over."""
    seed: Annotated[int, _SEED] = 0
    """Seed of the library that is built."""
    workers: Workers = None
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Bench:
    """Measure speeds in one run: their ratios do not depend on the computer's speed."""

    report: Report = ReportOptions()


@dataclass(frozen=True)
class Serve:
    """Walk live: a page to watch and steer the robot, an API, a safety layer, a log.

    Ctrl-C stops the walk and ends it. Without a library, RES walks in simulation.
    """

    library: UsualLibrary = "res"
    backend: Annotated[str, tyro.conf.arg(help=_ROBOT_BACKENDS)] = "mujoco"
    own_model: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The robot's MJCF or URDF: simulate it with every joint, actuator and contact that
    it has, in place of the skeleton that builds walk; 100 Hz by default."""
    get_up: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """How it gets up after a fall, as `gaitchain get-up` found it; with --own-model."""
    calibration: Path | None = None
    """Servos' calibration, as `gaitchain calibrate` writes it."""
    rate: Annotated[float | None, Limits(20.0, 1000.0)] = None
    """Control periods a second: 250 in simulation, 100 with motors, by default [Hz]. In
    simulation a period is a whole number of time steps of 2 ms, as at 500, 250, 125,
    100 or 50 Hz."""
    host: str = "127.0.0.1"
    """Address to listen on; others than this computer's own need a token."""
    port: Annotated[int, _PORT] = 8700
    """Port of the page and the API; 0 finds a free one."""
    token: str | None = None
    """Token that every client needs to watch or drive. Lists of processes show it: give
    --token-file, or the environment variable GAITCHAIN_TOKEN, instead."""
    token_file: Path | None = None
    """File whose first line is the token; - for standard input."""
    log: Path | None = None
    """MCAP file to write; a new one in runs/serve by default."""
    no_log: _Flag = False
    """Write no log."""
    log_size: Annotated[float, Limits(1.0, 100_000.0, unit="MB")] = 512.0
    """Size from which the log goes on in the next file [MB]."""
    log_files: Annotated[int, Limits(1, 10_000, whole=True)] = 8
    """Files that the log may have; then the oldest one is removed. Files of logs before
    it do not count and stay."""
    ros: str | None = None
    """Let ROS 2 watch and drive as well: zenoh, zenoh:tcp/HOST:PORT, ws://HOST:PORT."""
    ros_stamped: _Flag = False
    """Take commands as TwistStamped over a rosbridge; Zenoh takes both types."""
    open_loop: _Flag = False
    """Walk without feedback; needed for a robot without an IMU."""
    seed: Annotated[int, _SEED] = 0
    """Seed of the simulated world."""
    browser: _Flag = False
    """Open the page in this computer's browser."""
    report: Report = ReportOptions()


@dataclass(frozen=True)
class Replay:
    """Play a log in the browser: the page of `serve`, with a bar to seek in it."""

    log: Annotated[Path, tyro.conf.Positional]
    """A log that `serve` wrote (.mcap); it needs no other file."""
    robot: str | None = None
    """MJCF or URDF file from which its robot is drawn in its own shapes. A file that
    the log names is not read, as anybody may have written the log; a name that
    `gaitchain robots` lists is."""
    profile: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The profile with which that file was built."""
    port: Annotated[int, _PORT] = 8700
    """Port of the page; 0 finds a free one."""
    no_browser: _Flag = False
    """Only print the address of the page."""
    report: Report = ReportOptions()


@dataclass(frozen=True)
class WarmUp:
    """Compile what walks online, so that no later start has to wait for it.

    To be run once after an install or an update; it says where the machine code is.
    What is compiled already is not compiled again.
    """

    library: UsualLibrary = "res"
    report: Report = ReportOptions()


_Tries = Trial | Qualify | Push | GetUp
Simulates = Walk | Build | _Tries | Identify | Figures | Export
Shows = Inspect | Robots | Explain | Bench | Replay
_OnServos = Calibrate | Doctor
Options = Simulates | Shows | _OnServos | Serve | WarmUp


def verb_of(kind: type) -> str:
    """Return the verb of an options class, as it is typed."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", kind.__name__).lower()


VERBS: dict[str, type[Options]] = {
    verb_of(verb): verb
    for verb in (
        *(Walk, Build, Inspect, Robots, Trial, Qualify, Push, GetUp, Explain),
        *(Export, Calibrate, Doctor, Identify, Figures, Bench, Serve, Replay, WarmUp),
    )
}
"""Options class of each verb; the module of `cli` with its name, - as _, runs it."""
