"""Trials and the gate in the robot's own model: the toy's file, and others' files."""

import os
import shutil
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from commands import call
from planned_library import planned_library
from toy_file import toy
from toy_robot import Builder, Toy, tie_hip_pitches
from verdicts import PASSED

from gaitchain.build import command_envelope
from gaitchain.build.command_envelope import hold_own
from gaitchain.build.gate import gate_own
from gaitchain.build.own_model import (
    describe_own_model,
    own_digest,
    own_fault,
    own_model,
    run_own_trials,
    speed_along,
)
from gaitchain.build.trial import Trial, TrialRun
from gaitchain.build.workers import Crew
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import ChainError, CommandError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.schedule import Segment
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World

AHEAD = (Segment(Command(0.2), 4.0),)
CREW = Crew(1, lambda *news: None)


def config(path, runs=2):
    return BuildConfig(robot=str(path), preset="brisk", own_runs=runs)


def test_the_model_is_the_files_with_a_floor(toy_path, toy_library):
    model = own_model(toy_path, toy_library.robot, World())
    file = mujoco.MjModel.from_xml_path(str(toy_path))
    assert (model.njnt, model.nu) == (file.njnt, file.nu)
    assert model.ngeom == file.ngeom + 1
    assert model.opt.timestep == file.opt.timestep
    np.testing.assert_allclose(model.body_mass, file.body_mass)
    floor = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    np.testing.assert_array_equal(model.geom_friction[floor], 0.0)
    np.testing.assert_allclose(model.opt.gravity, [0.0, 0.0, -9.81])


def test_links_differ_and_floors_slope_as_the_world_says(toy_path, toy_library):
    world = World(model_error=0.1, slope_deg=3.0, seed=4)
    model = own_model(toy_path, toy_library.robot, world)
    file = mujoco.MjModel.from_xml_path(str(toy_path))
    part = model.body_mass[1:] / file.body_mass[1:]
    assert np.abs(part - 1.0).max() <= 0.1 + 1e-9
    assert (part != 1.0).all(), "of links whose shapes weigh, too"
    assert model.opt.gravity[0] == pytest.approx(-9.81 * np.sin(np.radians(3.0)))


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
@pytest.mark.parametrize(
    "weighed", ['inertiafromgeom="true"', 'settotalmass="9"', 'inertiagrouprange="0 0"']
)
def test_links_weigh_what_mujoco_makes_of_the_file(toy_library, tmp_path, weighed):
    file = tmp_path / "weighed.xml"
    file.write_text(toy().replace('angle="radian"', f'angle="radian" {weighed}'))
    expected = mujoco.MjModel.from_xml_path(str(file))
    model = own_model(file, toy_library.robot, World())
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        found, wanted = getattr(model, name), getattr(expected, name)
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-15)
    off = own_model(file, toy_library.robot, World(model_error=0.1, seed=4))
    moving = expected.body_mass > 1e-3
    assert (off.body_mass != expected.body_mass)[moving].all()


def test_a_file_without_actuators_gets_them(toy_path, toy_library, tmp_path):
    """As a URDF, or a model whose actuators are in another file."""
    text = toy_path.read_text("utf-8")
    bare = tmp_path / "bare.xml"
    begin, end = text.index("<actuator>"), text.index("</actuator>")
    bare.write_text(text[:begin] + text[end + len("</actuator>") :], "utf-8")
    model = own_model(bare, toy_library.robot, World())
    driven = {model.joint(j).name for j in model.actuator_trnid[:, 0]}
    assert driven == {*toy_library.robot.legs.joint_names, *toy_library.robot.legs.held}


FINGER = """<body name="finger" pos="0 0 0.3"><joint name="finger" axis="0 1 0"
 armature="0"/>
<inertial mass="0.01" pos="0 0 -0.01" diaginertia="1e-6 1e-6 1e-6"/></body>"""


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


def test_actuators_of_tendons_do_not_pull_at_the_legs(toy_library, tmp_path):
    """As nobody gives them a target, a servo among them would hold knees straight."""
    cord = (
        '<tendon><fixed name="left_knee"><joint joint="left_knee" coef="1"/>'
        '<joint joint="left_ankle" coef="1"/></fixed></tendon><actuator>'
    )
    pull = '<position name="pull" tendon="left_knee" kp="300"/></actuator>'
    sensor = '<sensor><actuatorfrc actuator="pull"/></sensor></mujoco>'
    text = toy().replace("<actuator>", cord).replace("</actuator>", pull)
    file = tmp_path / "corded.xml"
    file.write_text(text.replace("</mujoco>", sensor), "utf-8")
    model = own_model(file, toy_library.robot, World())
    assert (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT).all()
    assert (model.nu, model.nsensor, model.ntendon) == (14, 0, 1)
    told = describe_own_model(file, toy_library)
    assert (told.actuators, told.left_out) == (14, 1)
    assert "1 actuators that pull at legs" in told.describe()


def test_joints_without_a_rotor_get_the_librarys(toy_library, tmp_path):
    """As where it was derived, or is in a profile; the skeleton has it, too."""
    file = tmp_path / "light.xml"
    file.write_text(toy().replace('armature="0.02"', 'armature="0"'), "utf-8")
    legs = toy_library.robot.legs
    model = own_model(file, toy_library.robot, World())
    found = [model.dof_armature[model.joint(n).dofadr[0]] for n in legs.joint_names]
    np.testing.assert_allclose(found, legs.armature.ravel())
    assert model.dof_armature[model.joint("left_shoulder").dofadr[0]] == 0.0


@pytest.mark.parametrize("bare", [False, True])
def test_joints_that_a_coupling_holds_get_no_actuator(tmp_path, bare):
    """It would work against the coupling."""
    builder = Builder(Toy(hip=("yaw", "roll", "pitch", "pitch")))
    tie_hip_pitches(builder, 0.0)
    builder.model()
    followers = {builder.made[leg, "hip_pitch"][0] for leg in range(2)}
    for actuator in list(builder.spec.actuators):
        if bare or actuator.target in followers:
            builder.spec.delete(actuator)
    builder.spec.compile()
    file = tmp_path / "coupled.xml"
    file.write_text(builder.spec.to_xml(), "utf-8")
    robot = load_robot(file)
    model = own_model(file, robot, World())
    driven = {model.joint(j).name for j in model.actuator_trnid[:, 0]}
    assert driven == {*robot.legs.joint_names, *robot.legs.held} - followers
    assert followers <= robot.legs.held.keys()


def test_what_is_simulated_has_a_hash(toy_path, toy_library, tmp_path):
    """By which a build that goes on knows that the file was edited."""
    robot, file = toy_library.robot, tmp_path / "toy.xml"
    shutil.copy(toy_path, file)
    first = own_digest(file, robot)
    assert first == own_digest(toy_path, robot) != ""
    changes = ('<geom friction="0.2"/>', '<geom solref="0.01 1"/>')
    texts = [toy().replace("<default>", f"<default>{change}") for change in changes]
    arms = toy().replace('_shoulder" kp="300.0"', '_shoulder" kp="200"')
    found = {first}
    for second, text in enumerate([*texts, arms], start=1):
        file.write_text(text, "utf-8")
        os.utime(file, (second, second))  # edited later
        assert load_robot(file).fingerprint == robot.fingerprint
        found.add(own_digest(file, robot))
    assert len(found) == 4
    assert own_digest("res", load_box_robot("res")) == ""


@pytest.fixture
def few_steady_walks(monkeypatch):
    """Walk on for 4 s, once at each end of the range, before the schedules.

    Of the parts of the range the largest and the least are left.
    """
    monkeypatch.setattr(command_envelope, "_OWN_RUNS", 1)
    monkeypatch.setattr(command_envelope, "_SECONDS", 4.0)
    ends = command_envelope.PARTS[0], command_envelope.PARTS[-1]
    monkeypatch.setattr(command_envelope, "PARTS", ends)


HULL = '<geom type="sphere" size="0.2" pos="0 0 -0.1" mass="0"/></body>'


@pytest.fixture
def hulled(tmp_path):
    """Shapes of the arms reach into each other and into the thighs, as hulls may."""
    file = tmp_path / "hulled.xml"
    thin = 'fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.3"/></body>'
    text = toy()
    assert text.count(thin) == 2
    fat = thin.replace("</body>", HULL)
    file.write_text(text.replace(thin, fat), "utf-8")
    return file


def test_links_that_overlap_as_it_stands_pass_through_each_other(
    hulled, toy_path, toy_library
):
    robot = toy_library.robot
    model = own_model(hulled, robot, World())
    apart = {frozenset(pair) for pair in _excluded(model)}
    assert frozenset(("left_arm", "right_arm")) in apart
    assert frozenset(("left_arm", "left3")) in apart
    assert frozenset(("left_arm", "left6")) not in apart, "these can meet"
    assert not _excluded(own_model(toy_path, robot, World()))


def test_pairs_that_the_file_excludes_stay_excluded(tmp_path, toy_library):
    """Also of a robot that a scene attaches by a prefix, with the scene's own."""
    robot, scene = tmp_path / "robot.xml", tmp_path / "scene.xml"
    own = '<contact><exclude body1="left_arm" body2="left3"/></contact></mujoco>'
    robot.write_text(toy().replace("</mujoco>", own), "utf-8")
    scene.write_text(
        '<mujoco><asset><model name="robot" file="robot.xml"/></asset><worldbody>'
        '<geom type="plane" size="1 1 1"/><frame><attach model="robot" body="torso" '
        'prefix="r_"/></frame></worldbody><contact><exclude body1="r_left_arm" '
        'body2="r_left6"/></contact></mujoco>',
        "utf-8",
    )
    assert _excluded(own_model(robot, toy_library.robot, World())) == [
        ("left_arm", "left3")
    ]
    attached = _excluded(own_model(scene, load_robot(scene), World()))
    assert attached == [("r_left_arm", "r_left3"), ("r_left_arm", "r_left6")]


@pytest.mark.slow
@pytest.mark.usefixtures("few_steady_walks")
def test_the_gate_says_how_many_links_pass_through_each_other(hulled, toy_library):
    gated = gate_own(toy_library, config(hulled), CREW)
    own = gated.qualification.own
    assert (own.passed, own.survived) == (True, 2)
    assert own.model.parted == len(_excluded(_model(hulled, toy_library)))


def _model(file, library):
    return own_model(file, library.robot, World())


def _excluded(model):
    pairs = [divmod(int(s), 1 << 16) for s in model.exclude_signature]
    return [(model.body(a).name, model.body(b).name) for a, b in pairs]


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
def test_the_gate_says_what_was_walked(toy_path, toy_library):
    gated = gate_own(toy_library, config(toy_path), CREW)
    own = gated.qualification.own
    assert (own.passed, own.schedules, own.survived) == (True, 2, 2)
    assert own.model.joints == own.model.actuators == 14
    assert own.model.timestep_s == 0.002
    assert own.model.friction == 1.0
    assert own.model.integrator == ""
    assert gated.qualified


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
        f"{rated} cannot be simulated as it is: the model's actuator of joint "
        "'left_knee' takes a speed, not an angle; make it a <position/>"
    )


def test_a_build_says_so_before_it_begins(rated, capsys, monkeypatch):
    def stop(*_):
        raise ChainError("the build itself")

    monkeypatch.setattr("gaitchain.cli.build.build_library", stop)
    monkeypatch.setenv("COLUMNS", "400")
    _, out, err = call(capsys, "build", rated, "-o", rated.with_suffix(".gait"))
    assert "it will not be walked in the robot's own model: " in out
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
