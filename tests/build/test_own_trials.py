"""Trials in a robot's own model, and what the gate says of it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from commands import call
from planned_library import planned_library
from toy_file import toy
from verdicts import PASSED

from gaitchain.build import command_envelope
from gaitchain.build.command_envelope import hold_own
from gaitchain.build.gate import gate_own
from gaitchain.build.own_model import own_model
from gaitchain.build.own_trials import (
    changes_since_gate,
    describe_own_model,
    own_fault,
    run_own_trials,
    speed_along,
)
from gaitchain.build.trial import Trial, TrialRun
from gaitchain.build.workers import Crew
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import ChainError, CommandError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library_file import save_library
from gaitchain.gait.schedule import Segment
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World

AHEAD = (Segment(Command(0.2), 4.0),)
FINGER = """<body name="finger" pos="0 0 0.3"><joint name="finger" axis="0 1 0"
 armature="0"/>
<inertial mass="0.01" pos="0 0 -0.01" diaginertia="1e-6 1e-6 1e-6"/></body>"""
CREW = Crew(1, lambda *news: None)


def config(path, runs=2):
    return BuildConfig(robot=str(path), preset="brisk", own_runs=runs)


def test_a_servo_that_shakes_its_joint_is_told_before_any_walk(toy_library, tmp_path):
    """MuJoCo would put the robot back, again and again, and nobody would fall."""
    text = toy()
    first = text.index("<body", text.index("<freejoint"))
    text = text[:first] + FINGER + text[first:]
    servo = '<position joint="finger" kp="100"/></actuator>'
    file = tmp_path / "shaking.xml"
    file.write_text(text.replace("</actuator>", servo), "utf-8")
    with pytest.raises(CommandError, match=r"servo of finger shakes it .*armature"):
        describe_own_model(file, toy_library)
    trial = Trial(toy_library, schedule=AHEAD, require_qualified=False)
    (walk,) = run_own_trials(trial, file, 1, 3, 1)
    assert walk.fell
    assert walk.cause.startswith("the physics diverged at ")
    assert walk.speed_mps is None


@pytest.fixture
def few_steady_walks(monkeypatch):
    """Walk on for 4 s, once at each end of the range, before the schedules.

    Of the parts of the range the largest and the least are left.
    """
    monkeypatch.setattr(command_envelope, "_OWN_RUNS", 1)
    monkeypatch.setattr(command_envelope, "_SECONDS", 4.0)
    ends = command_envelope.PARTS[0], command_envelope.PARTS[-1]
    monkeypatch.setattr(command_envelope, "PARTS", ends)


@pytest.mark.slow
@pytest.mark.usefixtures("few_steady_walks")
def test_the_gate_says_how_many_links_pass_through_each_other(hulled, toy_library):
    gated = gate_own(toy_library, config(hulled), CREW)
    own = gated.qualification.own
    assert (own.passed, own.survived) == (True, 2)
    assert own.model.parted == own_model(hulled, toy_library.robot, World()).nexclude
    assert own.model.parted > 0


def test_trials_tell_falls_and_speed_whatever_the_workers(toy_path, toy_library):
    trial = Trial(toy_library, schedule=AHEAD)
    one, two = (list(run_own_trials(trial, toy_path, 2, 5, w)) for w in (1, 2))
    assert one == two
    for run in one:
        assert not run.fell
        assert run.speed_mps == pytest.approx(0.2, rel=0.15)
        assert run.distance_m > 0.4
    assert one[0].distance_m != one[1].distance_m, "each in a world of its own"


@pytest.mark.parametrize("rate", [-0.7, 0.0, 0.7])
@pytest.mark.parametrize("wanted", [Command(0.2), Command(-0.2), Command(0.0, 0.1)])
def test_speeds_are_those_along_the_command(rate, wanted):
    """On a circle too, of which the way between two places is a chord."""
    moved = Command(0.15, 0.05, rate)
    times = np.arange(1001) * CONTROL_PERIOD_S
    turned = 0.3 + rate * times
    facing = turned - 0.5 * rate * CONTROL_PERIOD_S
    ahead = np.exp(1j * facing) * (moved.vx + 1j * moved.vy) * CONTROL_PERIOD_S
    place, zero = np.cumsum(ahead), np.zeros(len(times))
    half = 0.5 * turned
    quaternion = np.cos(half), zero, zero, np.sin(half)
    track = np.stack([place.real, place.imag, zero, *quaternion], axis=1)
    told = Command(wanted.vx, wanted.vy, rate)
    way = np.sign(wanted.vx) * moved.vx + np.sign(wanted.vy) * moved.vy
    found = speed_along(track, (Segment(told, 10.0),))
    assert found == pytest.approx(way, rel=1e-3)
    assert speed_along(track, (Segment(Command(0.0, 0.0, 0.7), 10.0),)) is None


def test_worlds_have_what_is_simulated_of_them(toy_path, toy_library):
    (run,) = run_own_trials(Trial(toy_library, schedule=AHEAD), toy_path, 1, 3, 1)
    nominal = vars(World())
    told = {name for name, value in vars(run.world).items() if value != nominal[name]}
    assert told == {"model_error", "seed"}


def test_servos_that_cannot_hold_it_let_it_fall(toy_path, toy_library):
    trial = Trial(toy_library, schedule=AHEAD, fixed={"servo_gain": 0.1})
    (run,) = run_own_trials(trial, toy_path, 1, 5, 1)
    assert run.fell
    assert run.cause.startswith("fell at ")
    assert run.speed_mps is None


@pytest.mark.parametrize(
    ("fixed", "said"),
    [
        ({"blocks_m": 0.01}, "--blocks is not possible in the robot's own model"),
        ({"friction": 0.4}, "possible are --slope, --gain, --model-error"),
    ],
)
def test_disturbances_that_a_file_does_not_have_are_refused(
    toy_path, toy_library, fixed, said
):
    with pytest.raises(CommandError, match=said):
        run_own_trials(Trial(toy_library, fixed=fixed), toy_path, 1, 1, 1)


def test_another_robots_file_is_refused(toy_path, toy_library, tmp_path):
    other = tmp_path / "other.xml"
    other.write_text(toy().replace("left_", "links_"), "utf-8")
    with pytest.raises(CommandError, match="not the file that the library of toy"):
        run_own_trials(Trial(toy_library), other, 1, 1, 1)


@pytest.mark.slow
@pytest.mark.usefixtures("few_steady_walks")
def test_the_gate_says_what_was_walked(toy_path, toy_library, tmp_path, capsys):
    gated = gate_own(toy_library, config(toy_path), CREW)
    own = gated.qualification.own
    assert (own.passed, own.schedules, own.survived) == (True, 2, 2)
    assert own.model.joints == own.model.actuators == 14
    assert own.model.timestep_s == 0.002
    assert own.model.friction == 1.0
    assert own.model.integrator == ""
    assert gated.qualified
    assert changes_since_gate(toy_path, gated) == ""
    assert changes_since_gate(toy_path, toy_library) == ""  # none was walked
    slippery = tmp_path / "toy.xml"
    floor = toy().replace('size="0.09', 'friction="0.2" solref="0.03 1" size="0.09')
    slippery.write_text(floor, "utf-8")
    save_library(gated, tmp_path / "toy.gait")
    words = "--own-model", slippery, "--runs", 1, "--workers", 1
    walk = "--schedule", "0.1,0,0@1"
    _, out, err = call(capsys, "trial", tmp_path / "toy.gait", *words, *walk)
    said = " ".join((out + err).split())
    assert (
        "friction of the soles 0.2 (1), time constant of the contacts [ms] 30 (" in said
    )


@pytest.mark.slow
@pytest.mark.usefixtures("few_steady_walks")
def test_damping_that_the_files_integrator_cannot_take_is_walked_and_said(
    toy_library, tmp_path
):
    """At the file's 2 ms it would shake; the arms' servos keep the file's gains."""
    file = tmp_path / "stiff.xml"
    text = toy().replace('_shoulder" kp="300.0" kv="6"', '_shoulder" kp="300" kv="80"')
    file.write_text(text, "utf-8")
    gated = gate_own(toy_library, config(file), CREW)
    own = gated.qualification.own
    assert own.passed
    assert own.model.integrator.startswith("implicitfast: at 2 ms the file's lets ")
    assert "_shoulder shake" in own.model.integrator
    assert "at most 2 holds" in own.model.integrator


@pytest.mark.slow
@pytest.mark.usefixtures("few_steady_walks")
def test_a_library_that_falls_in_the_robots_own_model_is_not_qualified(
    toy_library, tmp_path
):
    """On ice."""
    file = tmp_path / "icy.xml"
    slippery = toy().replace("<geom ", '<geom friction="0.02 0 0" ')
    file.write_text(slippery, "utf-8")
    gated = gate_own(toy_library, config(file), CREW)
    assert not gated.qualification.own.passed
    assert not gated.qualified
    assert gated.qualification.verdict == "NO"


def test_a_robot_that_cannot_be_simulated_as_it_is_keeps_the_skeletons_verdict(
    toy_library, tmp_path
):
    gated = gate_own(toy_library, config(tmp_path / "none.xml"), CREW)
    own = gated.qualification.own
    assert "no such file" in own.fault
    assert own.describe().startswith("NOT WALKED: ")
    assert "not the file that the library" not in own.fault
    assert gated.qualified
    assert gated.qualification.verdict == "yes, but not in the robot's own model"


@pytest.fixture
def rated(tmp_path):
    """The toy with an actuator without a name that takes a speed."""
    file = tmp_path / "rated.xml"
    servo = '<position joint="left_knee"'
    rate = '<intvelocity actrange="-3 3" joint="left_knee"'
    file.write_text(toy().replace(servo, rate), "utf-8")
    return file


def test_what_keeps_the_own_model_from_being_walked_is_known_early(toy_path, rated):
    assert own_fault(toy_path, load_robot(toy_path)) == ""
    assert own_fault("res", load_box_robot("res")) == ""
    assert own_fault(rated, load_robot(rated)) == (
        f"A library will not be walked in the robot's own model: {rated} cannot be "
        "simulated as it is: the model's actuator of joint 'left_knee' takes a speed, "
        "not an angle; make it a <position/>."
    )


@pytest.fixture
def weak(tmp_path):
    """The toy with knees that cannot carry it."""
    file = tmp_path / "weak.xml"
    knee = r'(<position joint="\w+_knee" .*?)forcerange="-60 60"'
    file.write_text(re.sub(knee, r'\1forcerange="-1 1"', toy()), "utf-8")
    return file


def test_a_robot_that_falls_as_it_stands_is_told_early(weak, toy_library):
    """No library of it could be walked; what its file has is for a person to see."""
    said = own_fault(weak, load_robot(weak))
    assert re.match(
        r"In the robot's own model it does nothing but stand and falls, at 0\.\d\d s: "
        "compare the servos, masses and contacts of the file with what was found",
        said,
    ), said
    walked = replace(toy_library.poses, robot=load_robot(weak))
    describe_own_model(weak, replace(toy_library, poses=walked))  # that is no error


def test_a_build_says_so_before_it_begins(rated, capsys, monkeypatch):
    def stop(*_):
        raise ChainError("the build itself")

    monkeypatch.setattr("gaitchain.cli.build.build_library", stop)
    monkeypatch.setenv("COLUMNS", "400")
    _, out, err = call(capsys, "build", rated, "-o", rated.with_suffix(".gait"))
    assert "A library will not be walked in the robot's own model: " in out
    assert "'left_knee' takes a speed" in out and "the build itself" in err


@pytest.mark.slow
def test_inspect_says_so(rated, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "400")
    code, out, _ = call(capsys, "inspect", rated, "-o", tmp_path / "seen.png")
    assert code == 0
    assert "- A library will not be walked in the robot's own model: " in out
    assert "'left_knee' takes a speed" in out


def test_boxes_and_zero_runs_are_left_alone(toy_path, toy_library):
    assert gate_own(toy_library, config(toy_path, runs=0), CREW) is toy_library
    boxes = planned_library(load_box_robot("res"))
    assert gate_own(boxes, config("res"), CREW) is boxes
    untested = replace(toy_library, qualification=replace(PASSED, gate=None))
    assert gate_own(untested, config(toy_path), CREW) is untested


def test_the_range_ends_at_what_the_robots_own_model_holds(
    toy_path, toy_library, monkeypatch
):
    """The toy's falls there beyond 0.6 of its speed ahead."""
    most = toy_library.command_range.vx[1]

    def trials(trial, file, runs, seed, workers):
        assert (file, workers) == (str(toy_path), 1)
        (segment,) = trial.schedule
        fell = segment.command.vx > 0.6 * most
        for i in range(runs):
            yield TrialRun((seed, i), "", fell, None, None, 0.0, (0, 0))

    monkeypatch.setattr("gaitchain.build.command_envelope.run_own_trials", trials)
    held = hold_own(toy_library, str(toy_path), CREW).command_range
    assert held.vx[1] == pytest.approx(0.6 * most)
    assert held.vx[0] == toy_library.command_range.vx[0]
