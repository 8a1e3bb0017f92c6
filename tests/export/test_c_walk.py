"""Exported C against the walker in Python, fed with the sensors of walks in physics."""

import ctypes
import importlib
import re
import subprocess
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from leg_makes import SEVEN, make_robot
from other_robots import without_joint
from planned_library import planned_library

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import CommandError, ExportError
from gaitchain.export import c_types
from gaitchain.export.c_library import export_c
from gaitchain.export.c_trial import try_c
from gaitchain.export.c_walker import CWalker
from gaitchain.export.compiler import STRICT, compile_c
from gaitchain.export.program import Program
from gaitchain.gait.library_file import load_library
from gaitchain.gait.qualification import Qualification
from gaitchain.messages import GRAVITY, Array, Command, Sensors
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.identified import Identified
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

NEAR = 1e-9  # rad; asked for is 1e-5
SECOND = 100
RES = files("gaitchain") / "data" / "res.gait"
# All that the code takes from outside.
MATHS = {"acos", "atan2", "cos", "cosh", "exp", "hypot", "remainder", "sin", "sincos"}
MATHS |= {"sinh", "sqrt", "tan", "ceil", "fabs", "memcpy", "memset", "memmove"}
UPRIGHT = np.zeros(3), np.array([0.0, 0.0, GRAVITY])  # gyro, accelerometer
PUSHED_S = 20.0
# The last one is too much for a step: it falls, and C has to go on like Python.
PUSHES = (
    Push(4.0, 0.0, 8.0),
    Push(4.0, 90.0, 14.0),
    Push(60.0, 60.0, PUSHED_S),
)


@pytest.fixture(scope="module")
def shipped():
    return load_library(RES)


@pytest.fixture(scope="module")
def walkers(shipped, tmp_path_factory):
    return Walker(shipped), CWalker(shipped, tmp_path_factory.mktemp("c"))


def random_command(span, rng):
    crouch = rng.choice([0.0, 0.5, 1.0, 2.0]) * span.crouch[0]
    drawn = span.draw(rng).scaled(rng.choice([0.0, 0.6, 1.0, 1.5]))
    return replace(drawn, crouch=float(crouch))


def spoiled(sensors, tick):
    """Return sensors that lack a number now and then, with loads in some walks.

    In between their clock lacks one, too, or stands, and the gyro jumps: alone, or as
    after a punch.
    """
    if tick % 450 == 222 or 900 <= tick < 903:
        gyro = sensors.angular_velocity.copy()
        gyro[1] += 7.0 if tick >= 900 else 39.5
        sensors = replace(sensors, angular_velocity=gyro)
    if tick % 450 == 444:
        sensors = replace(sensors, acceleration=np.full(3, 400.0))
    if tick % 300 == 117:
        sensors = replace(sensors, time=np.nan)
    if 250 < tick % 700 < 350:
        sensors = replace(sensors, time=0.0)
    if tick % 400 == 333:
        position = sensors.joint_position.copy()
        position[tick % len(position)] = np.nan
        sensors = replace(sensors, joint_position=position, time=np.inf)
    if tick % 500 < 250:
        return replace(sensors, foot_load=None)
    return sensors


def unspoiled(sensors, _tick):
    return sensors


def difference(here, there):
    """Return the largest one of two periods' targets; NaN where one has a NaN."""
    names = ("position", "velocity", "torque", "stiffness", "damping")
    motors = [
        np.abs(getattr(here.motors, name) - getattr(there.motors, name))
        for name in names
    ]
    # Not `max` of Python, which leaves a NaN out.
    return float(np.max([np.abs(here.position - there.position), *motors]))


def compare(walker, in_c, backend, ticks, commands, first_bad=False, spoil=spoiled):
    """Walk in physics by Python's targets; return the largest difference of C's."""
    worst = 0.0
    for tick in range(ticks):
        if tick in commands:
            done, same = walker.command(commands[tick]), in_c.command(commands[tick])
            assert (*same.motion, same.crouch) == pytest.approx(
                (*done.motion, done.crouch), abs=1e-12
            )
        sensors = spoil(backend.read(), 333 if first_bad and not tick else tick)
        targets, others = walker.step(sensors), in_c.step(sensors)
        assert np.isfinite(targets.position).all()
        worst = np.maximum(worst, difference(targets, others))
        assert worst < NEAR, (tick, walker.gait.state)
        assert bool(targets.status) == bool(others.status)
        assert in_c.standing == walker.standing
        backend.write(targets.position)
    assert in_c.place == pytest.approx(np.array(walker.place), abs=1e-6)
    return worst


def idle(walker, in_c, ticks, commands, noise=0.0):
    """Walk with servos that do at once what they are asked; compare as `compare`.

    `noise` is that of gyro and accelerometer [rad/s, m/s^2].
    """
    position, worst, rng = walker.stand, 0.0, np.random.default_rng(4)
    rates = np.zeros(len(position))
    for tick in range(ticks):
        if tick in commands:
            walker.command(commands[tick])
            in_c.command(commands[tick])
        imu = (axes + noise * rng.normal(size=3) for axes in UPRIGHT)
        sensors = Sensors(walker.period_s * tick, position, rates, *imu)
        targets, others = walker.step(sensors), in_c.step(sensors)
        worst = np.maximum(worst, difference(targets, others))
        rates = (targets.position - position) / walker.period_s
        position = targets.position
    assert walker.gait.steps > 3
    return worst


def test_the_comparison_sees_targets_that_are_no_number(walkers):
    walker, _ = walkers
    targets = walker.step(Sensors(0.0, walker.stand, *np.zeros((1, 12)), *UPRIGHT))
    lost = replace(targets.motors, torque=np.full(12, np.nan))
    assert difference(targets, targets) == 0.0
    assert not difference(targets, replace(targets, motors=lost)) < NEAR
    walker.reset()


@pytest.mark.slow
def test_c_does_what_python_does(shipped, walkers, tmp_path, capsys):
    """Random commands, pushes, a fall, bad sensors, and a walk after a reset."""
    walker, in_c = walkers
    rng, span = np.random.default_rng(5), shipped.command_range
    world = World(push=PUSHES, foot_sensors=True)
    backend = MujocoBackend(shipped.robot, world)
    end = round(PUSHED_S) * SECOND
    commands = {t: random_command(span, rng) for t in range(SECOND, end, 180)}
    commands |= {60: Command(np.nan), 70: Command(crouch=-0.1), 80: Command(9.0)}
    commands |= {82: Command(-1e308), 84: Command(0.1), 86: Command(1e308)}
    commands |= {90: Command(), 7 * SECOND: Command(0.5 * span.vx[1])}
    backend.connect(walker.stand)
    backend.start_clock()
    worst = compare(walker, in_c, backend, end + 3 * SECOND, commands)
    assert abs(backend.tilt[0]) > 0.5 or abs(backend.tilt[1]) > 0.5
    walker.reset()
    in_c.reset()
    backend.connect(walker.stand)
    worst = np.maximum(worst, compare(walker, in_c, backend, SECOND, {}))
    for name, text in export_c(shipped).items():
        (tmp_path / name).write_text(text, "utf-8")
    trial = try_c(tmp_path)
    with capsys.disabled():
        print(f"\nC against Python: {worst:.1e} rad; {trial}")


@pytest.mark.parametrize(
    ("impulse_ns", "direction_deg"),
    [(9.0, 0.0), (16.0, 0.0), (16.0, 90.0), (20.0, -90.0)],
)
def test_a_push_while_it_stands(shipped, walkers, impulse_ns, direction_deg):
    """It sways and settles, or steps at once with the foot that has to."""
    walker, in_c = walkers
    walker.reset()
    in_c.reset()
    push = Push(impulse_ns, direction_deg, 1.0)
    backend = MujocoBackend(shipped.robot, World(push=(push,)))
    backend.connect(walker.stand)
    backend.start_clock()
    stop = {0: Command()}
    assert compare(walker, in_c, backend, 4 * SECOND, stop, first_bad=True) < NEAR
    assert (walker.gait.steps > 0) == (impulse_ns > 10.0)
    assert 0.0 < in_c.carried_out <= 1.0


def test_a_robot_as_it_was_identified(shipped, tmp_path):
    """Offsets of the encoders and a tilted IMU are taken back in C, too."""
    rng, joints = np.random.default_rng(2), len(shipped.robot.legs.joint_names)
    found = Identified(
        gain=rng.uniform(0.9, 1.1, joints),
        offset=rng.uniform(-0.03, 0.03, joints),
        com=np.zeros(3),
        tilt=np.array([0.02, -0.03, 0.01]),
    )
    robot = replace(shipped.robot, identified=found)
    library = replace(shipped, poses=replace(shipped.poses, robot=robot))
    walker, in_c = Walker(library), CWalker(library, tmp_path, flags=["-O1"])
    assert idle(walker, in_c, 4 * SECOND, {60: Command(0.2)}) < NEAR
    assert "MOUNTED 1" in (tmp_path / "gait.c").read_text("utf-8")


def test_another_control_period(shipped, tmp_path):
    """What is learned in a stand is weighed by seconds, in C, too."""
    walker = Walker(shipped, period_s=0.004)
    in_c = CWalker(shipped, tmp_path, period_s=0.004, flags=["-O1"])
    assert idle(walker, in_c, 1000, {250: Command(0.2), 600: Command()}) < NEAR


def test_a_period_of_numpy_is_written_as_a_number(shipped):
    header = export_c(shipped, np.float64(0.008))["gait.h"]
    assert "#define GAIT_PERIOD_S 0.008 " in header


@pytest.mark.parametrize("period_s", [0.0, -0.01, np.nan, 0.5, None])
def test_a_period_that_no_walker_takes_is_refused(shipped, period_s):
    with pytest.raises(CommandError, match="control period"):
        export_c(shipped, period_s)


def test_a_robot_whose_own_steps_differ_much(shipped, tmp_path):
    restless = replace(shipped, usual_spread=0.2)
    CWalker(restless, tmp_path, flags=["-O1"])
    table = (tmp_path / "gait.c").read_text("utf-8").split("UNREST_ERRORS")[1]
    written = re.findall(r"[-+.0-9e]+", table.split("{")[1].split("}")[0])
    assert tuple(map(float, written)) == Walker(restless).gait.step_size.errors


def test_a_walk_that_calms_down_between_long_stands(shipped, walkers):
    """After a push it steps smaller for a while; stands teach over 5 s, then over 1 s.

    The push comes 4 s after the first command, more than ten steps before the stop.
    """
    walker, in_c = walkers
    walker.reset()
    in_c.reset()
    backend = MujocoBackend(shipped.robot, World(push=(Push(9.0, 60.0, 10.0),)))
    backend.connect(walker.stand)
    backend.start_clock()
    ahead = Command(0.6 * shipped.command_range.vx[1])
    commands = {0: Command(), 6 * SECOND: ahead, 16 * SECOND: Command()}
    ticks = 23 * SECOND
    assert compare(walker, in_c, backend, ticks, commands, spoil=unspoiled) < NEAR
    assert walker.standing


def with_seven_joints():
    return make_robot(SEVEN, np.random.default_rng(1))


@pytest.mark.parametrize(
    ("robot", "joints"),
    [
        (lambda: without_joint(load_box_robot("res"), 0), 10),
        (lambda: without_joint(load_box_robot("res"), 5), 10),
        (with_seven_joints, 14),
    ],
    ids=["no hip yaw", "no ankle roll", "seven"],
)
def test_a_robot_with_other_legs(robot, joints, tmp_path):
    """Nothing in C is made for one robot, nor for legs of six joints."""
    library = planned_library(robot())
    # As if it could go lower than RES: too low for full speed, so it comes up first.
    span = replace(library.command_range, crouch=(0.03, 0.01))
    vars(library)["command_range"] = span
    walker, in_c = Walker(library), CWalker(library, tmp_path, flags=["-O1"])
    low = Command(0.1 * span.vx[1], crouch=span.crouch[0])
    commands = {60: low, 350: Command(span.vx[1], crouch=low.crouch), 550: Command()}
    assert idle(walker, in_c, 7 * SECOND, commands, noise=0.05) < NEAR
    header = (tmp_path / "gait.h").read_text("utf-8")
    assert f"#define GAIT_JOINTS {joints}\n" in header


ODD_NAMES = (
    *("RES **// v2", "RES /* v2", "RES */ v2 //", "hip??/", "RES\\", 'the "left" hip'),
    *("h\u00fcfte", "\U0001f600", "\x7f7", "\x017", "a\tb\r\n", "\u202e#define"),
)


def test_any_name_of_a_robot_and_its_joints_compiles(shipped, tmp_path):
    """In a comment it may be written otherwise, as a text it is the same."""
    legs = replace(shipped.robot.legs, joint_names=ODD_NAMES)
    legs = replace(legs, held=dict.fromkeys(ODD_NAMES, 0.1))
    reduced = replace(shipped.robot.reduced, name=" ".join(ODD_NAMES))
    robot = replace(shipped.robot, reduced=reduced, legs=legs)
    library = replace(shipped, poses=replace(shipped.poses, robot=robot))
    code = CWalker(library, tmp_path, flags=["-O0"]).code
    names = (ctypes.c_char_p * len(ODD_NAMES)).in_dll(code, "gait_joint_names")
    assert [name.decode("utf-8") for name in names] == list(ODD_NAMES)


def test_it_compiles_as_strict_c99_and_allocates_nothing(shipped, tmp_path):
    for name, text in export_c(shipped).items():
        (tmp_path / name).write_text(text, "utf-8")
    code = tmp_path / "gait.o"
    compile_c([tmp_path / "gait.c"], code, *STRICT, "-Os", "-c")
    listed = subprocess.run(["nm", code], capture_output=True, text=True, check=True)
    symbols = [line.split()[-2:] for line in listed.stdout.splitlines()]
    assert {name for kind, name in symbols if kind == "U"} <= MATHS
    # Nothing that changes lies outside the state that a program hands in.
    assert not [name for kind, name in symbols if kind in "bBC"]
    assert {name for kind, name in symbols if kind == "T"} == {
        "gait_start",
        "gait_reset",
        "gait_set_command",
        "gait_step",
        "gait_standing",
        "gait_carried_out",
        "gait_where",
    }


@pytest.mark.parametrize("flag", ["-Ofast", "-ffinite-math-only"])
def test_flags_that_know_no_nan_are_refused(flag, shipped, tmp_path):
    """With them a lost encoder made all targets NaN, with status 0."""
    for name, text in export_c(shipped).items():
        (tmp_path / name).write_text(text, "utf-8")
    with pytest.raises(ExportError, match="without -ffast-math"):
        compile_c([tmp_path / "gait.c"], tmp_path / "gait.o", flag, "-c")


def test_the_runner_names_the_python_that_it_is_made_of():
    text = (files("gaitchain.export") / "c" / "gait.c").read_text("utf-8")
    named = re.findall(r"/\* (gaitchain(?:\.[a-z_]+)+)\.([A-Z]\w+)", text)
    assert len(named) >= 8
    for module, name in named:
        assert hasattr(importlib.import_module(module), name)


def test_other_libraries_are_refused(library, shipped):
    with pytest.raises(ExportError, match="strides only"):
        export_c(library)
    with pytest.raises(ExportError, match="not qualified"):
        export_c(replace(shipped, qualification=Qualification()))


def grows(values: Array, more: Array) -> Array:
    for _ in range(3):
        values = values + more
    return values


def keeps(values: Array, more: Array) -> Array:
    for _ in range(3):
        made = values + more
        values = made
    return values


def sorts(values: Array) -> float:
    return sorted(values)[0]


def hides(values: Array) -> Array:
    return np.empty(round(values[0]))


@pytest.mark.parametrize(
    ("function", "why"),
    [
        (grows, "of itself in a loop"),
        (keeps, "under another name in a loop"),
        (sorts, "no value"),
        (hides, "no value"),
    ],
)
def test_what_is_not_of_the_subset_is_refused(function, why):
    row = c_types.Array((3,))
    with pytest.raises(ExportError, match=why):
        Program().translate(function, *[row] * function.__code__.co_argcount)
