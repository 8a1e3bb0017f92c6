"""A robot that was identified: kept in files, simulated as it is, and walked right."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_build import SMALLEST, few_steady_walks

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.grid import DYNAMIC_GRID, GridJob, grid_world
from gaitchain.build.own_trials import run_own_trials
from gaitchain.build.pipeline import build_library
from gaitchain.build.stride import STRIDE_BUILD
from gaitchain.build.trial import Trial, run_trials
from gaitchain.cli import run
from gaitchain.cli.build import identified_robot
from gaitchain.errors import CommandError, RobotFileError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library_file import library_bytes, load_library, save_library
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command, Sensors
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.identified import (
    UNSURE,
    Identified,
    identified_from,
    unsure_numbers,
)
from gaitchain.robot.storage import robot_arrays, robot_facts, robot_from
from gaitchain.robot.turn import turn_matrix
from gaitchain.sim.model import build_model
from gaitchain.sim.push import Push
from gaitchain.sim.robot_faults import backlash_of, likely_robot
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.walker.mounting import Mounting
from gaitchain.walker.walker import Walker

RES = load_box_robot("res")
STEP = (Segment(Command(0.2), 2.0),)
RNG = np.random.default_rng(3)
COUNT = unsure_numbers(12)
SIZES = np.concatenate(
    [
        *(np.full(30, 0.02), np.full(12, 0.02), np.full(12, 0.02), np.full(12, 1e-3)),
        [1e-3, 0.02, 2e-3, 0.02, 2e-3],
    ]
)
"""Of what is unknown of each number, small enough that none becomes negative."""
FOUND = Identified(
    gain=RNG.uniform(0.7, 1.3, 12),
    offset=RNG.uniform(-0.03, 0.03, 12),
    com=np.array([0.01, -0.02, 0.005]),
    tilt=np.array([0.02, -0.03, 0.01]),
    damping=RNG.uniform(0.8, 1.2, 12),
    backlash_deg=RNG.uniform(0.3, 0.8, 12),
    dry_friction=RNG.uniform(0.01, 0.03, 12),
    delay_s=0.012,
    stiction=0.4,
    viscous_friction=0.03,
    trunk_mass=1.2,
    imu_delay_s=0.021,
    unknown=SIZES[:, None] * np.tril(RNG.uniform(-1.0, 1.0, (COUNT, COUNT))),
)
MINE = RES.as_identified(FOUND)


@pytest.fixture(scope="module")
def library():
    own = load_library("src/gaitchain/data/res.gait")
    return replace(own, poses=replace(own.poses, robot=MINE))


def test_legs_have_what_was_found():
    legs, plain = MINE.legs, RES.legs
    np.testing.assert_allclose(legs.stiffness, plain.stiffness * FOUND.gain)
    np.testing.assert_allclose(
        legs.damping - plain.joint_damping,
        (plain.damping - plain.joint_damping) * FOUND.gain * FOUND.damping,
    )
    np.testing.assert_allclose(
        legs.friction_loss, FOUND.dry_friction * plain.torque_limit
    )
    assert legs.trunk_mass == pytest.approx(1.2 * plain.trunk_mass)
    np.testing.assert_allclose(legs.trunk_inertia, 1.2 * plain.trunk_inertia)
    np.testing.assert_allclose(legs.trunk_com - plain.trunk_com, FOUND.com)
    assert MINE.nominal is RES
    assert RES.nominal is RES
    again = MINE.as_identified(Identified.of_file(12))
    np.testing.assert_array_equal(again.legs.stiffness, plain.stiffness)
    assert MINE.fingerprint != RES.fingerprint != again.fingerprint


def test_facts_and_arrays_are_the_robot_again():
    facts = json.loads(json.dumps(robot_facts(MINE)))
    again = robot_from(facts, robot_arrays(MINE))
    assert again == MINE
    assert again.fingerprint == MINE.fingerprint
    assert again.nominal == RES
    assert "turnaround_s" not in FOUND.facts(), "nothing tells how late its bus is"
    timed = RES.as_identified(replace(FOUND, turnaround_s=0.004))
    facts = json.loads(json.dumps(robot_facts(timed)))
    assert robot_from(facts, robot_arrays(timed)).identified.turnaround_s == 0.004


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gain", [1.0] * 11),
        ("offset", [math.nan] * 12),
        ("com", 0.0),
        ("delay_s", "late"),
        ("delay_s", -0.01),
        ("gain", [1.0] * 11 + [0.0]),
        ("damping", -1.0),
        ("damping", [1.0] * 11),
        ("backlash_deg", [0.1] * 11 + [-0.1]),
        ("trunk_mass", 0.0),
        ("imu_delay_s", -0.01),
        ("turnaround_s", -0.01),
        ("turnaround_s", None),
        ("play", 0.1),
        pytest.param("delay_s", 10**400, id="huge"),
        ("com", {}),
        ("unknown", 0.0),
        ("unknown", "much"),
        ("unknown", [[1.0, 2.0], [3.0]]),
        ("unknown", [[math.nan] * 30] * 30),
        ("unknown", [[0.0] * 31] * 31),
    ],
)
def test_damaged_facts_are_refused(name, value):
    with pytest.raises(RobotFileError, match=f"identified .*{name}"):
        identified_from({**FOUND.facts(), name: value}, 12)


def test_a_missing_number_is_named_and_not_those_that_may_be():
    facts = {name: value for name, value in FOUND.facts().items() if name != "tilt"}
    with pytest.raises(RobotFileError, match="tilt") as refused:
        identified_from(facts, 12)
    assert "turnaround" not in str(refused.value)


@pytest.mark.parametrize(
    "sd",
    [-0.1, math.nan, math.inf, pytest.param(10**400, id="huge"), "much", [0.1], None],
)
def test_damaged_deviations_of_before_are_refused(sd):
    facts = {n: value for n, value in FOUND.facts().items() if n != "unknown"}
    facts |= {"gain_sd": 0.06, "offset_sd": 0.01, "com_sd": sd, "tilt_sd": 0.02}
    with pytest.raises(RobotFileError, match=r"identified (deviations are|unknown is)"):
        identified_from(facts, 12)


def test_facts_of_before_have_one_number_for_all_joints():
    facts = {**FOUND.facts(), "backlash_deg": 0.4, "damping": 1.1, "dry_friction": 0.0}
    del facts["trunk_mass"], facts["imu_delay_s"]
    del facts["unknown"]
    facts |= {"gain_sd": 0.06, "offset_sd": 0.01, "com_sd": 0.004, "tilt_sd": 0.02}
    one = identified_from(facts, 12)
    sd = dict.fromkeys(UNSURE, 0.0)
    sd |= {"gain": 0.06, "offset": 0.01, "com": 0.004, "tilt": 0.02}
    assert one.deviations == pytest.approx(sd)
    np.testing.assert_array_equal(one.unknown, np.diag(np.diag(one.unknown)))
    np.testing.assert_array_equal(one.backlash_deg, np.full(12, 0.4))
    np.testing.assert_array_equal(one.damping, np.full(12, 1.1))
    assert (one.trunk_mass, one.imu_delay_s) == (1.0, 0.0)


def test_its_library_is_a_file_like_any_other(library, tmp_path):
    path = tmp_path / "mine.gait"
    save_library(library, path)
    again = load_library(path, RES)
    assert again.robot == MINE
    assert library_bytes(again) == library_bytes(library)


def test_the_simulator_shows_what_was_identified():
    """Of a robot that is held still: angles, gravity, and what weighs where."""
    backend = MujocoBackend(MINE)
    stand = np.array(RES.legs.stand)
    backend.connect(stand)
    seen = backend.read()
    np.testing.assert_allclose(seen.joint_position, stand, atol=1e-12)
    np.testing.assert_allclose(backend.joints, stand - FOUND.offset, atol=1e-12)
    quaternion = build_model(MINE).site("imu").quat
    turn = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    np.testing.assert_allclose(turn, turn_matrix(FOUND.tilt), atol=1e-9)
    assert backend.world.delay_s == FOUND.delay_s
    mine, plain = (build_model(robot).body("trunk") for robot in (MINE, RES))
    np.testing.assert_allclose(mine.ipos - plain.ipos, FOUND.com, atol=1e-12)
    assert mine.mass == pytest.approx(1.2 * plain.mass)


def test_each_servo_has_its_own_play_and_friction():
    """Without a torque to turn it, a joint rests anywhere within its play."""
    plain, stand = Identified.of_file(12), np.array(RES.legs.stand)
    worn = replace(plain, backlash_deg=np.where(np.arange(12) == 3, 2.0, 0.0))
    sags = []
    for found in (plain, worn):
        backend = MujocoBackend(RES.as_identified(found), World(held=True))
        backend.connect(stand)
        for _ in range(200):
            backend.write(stand)
        sags.append(np.abs(backend.joints - stand))
    more = np.degrees(sags[1] - sags[0])
    assert more[3] == pytest.approx(1.0, abs=0.1), "half of it, to the side of gravity"
    assert np.abs(np.delete(more, 3)).max() < 0.1
    loss = MujocoBackend(MINE).model.dof_frictionloss[6:]
    np.testing.assert_allclose(loss, FOUND.dry_friction * RES.legs.torque_limit)


@pytest.mark.parametrize(("late_s", "periods"), [(0.004, 0), (0.006, 1), (0.021, 2)])
def test_an_imu_is_late_by_the_nearest_number_of_periods(late_s, periods):
    found = replace(Identified.of_file(12), imu_delay_s=late_s)
    world = MujocoBackend(RES.as_identified(found), World(imu_delay_s=0.01)).world
    assert world.imu_delay_s == pytest.approx(0.01 * (1 + periods))


@pytest.mark.parametrize(
    ("period_s", "late_s", "shown_s"),
    [(0.008, 0.005, 0.008), (0.002, 0.006, 0.006), (0.004, 0.0055, 0.004)],
)
def test_an_imu_is_late_by_periods_of_the_simulation(period_s, late_s, shown_s):
    """They were rounded to those of 10 ms, and so to none."""
    found = replace(Identified.of_file(12), imu_delay_s=late_s)
    backend = MujocoBackend(RES.as_identified(found), World(), period_s=period_s)
    assert backend.world.imu_delay_s == pytest.approx(shown_s)


def test_a_world_adds_to_what_was_identified():
    world = World(delay_s=0.004, backlash_deg=0.1)
    assert MujocoBackend(MINE, world).world.delay_s == pytest.approx(0.016)
    np.testing.assert_allclose(
        backlash_of(MINE, world), np.radians(FOUND.backlash_deg + 0.1), atol=1e-12
    )


def test_the_sum_is_at_most_what_a_world_may_have():
    """Of each of its faults; the world that was given keeps its limits and messages."""
    found = {"delay_s": 0.012, "imu_delay_s": 0.02}
    found |= {"stiction": 0.5, "viscous_friction": 0.05}
    robot = RES.as_identified(replace(FOUND, **found))
    most = {name: DISTURBANCES[name].limits.high for name in found}
    world = MujocoBackend(robot, World(**most)).world
    assert {name: getattr(world, name) for name in most} == most
    with pytest.raises(CommandError, match=r"delay_s is 1\.5, must be 0 to 1"):
        MujocoBackend(robot, World(delay_s=1.5))


def test_a_delay_is_not_counted_twice():
    """Of two robots alike, one late by its world, the other by what was identified."""
    late = RES.as_identified(replace(Identified.of_file(12), delay_s=0.02))
    plain = RES.as_identified(Identified.of_file(12))
    ways = []
    for robot, world in ((late, World()), (plain, World(delay_s=0.02))):
        backend = MujocoBackend(robot, world)
        backend.connect(np.zeros(12))
        for _ in range(30):
            backend.write(np.full(12, 0.1))
            ways.append(backend.joints.copy())
    np.testing.assert_allclose(ways[:30], ways[30:], atol=1e-12)


def test_mounting_undoes_what_encoders_and_imu_show():
    """Against scipy's rotations."""
    true = Sensors(0.0, RNG.normal(size=12), np.zeros(12), *RNG.normal(size=(2, 3)))
    turn = Rotation.from_euler("ZYX", FOUND.tilt[::-1]).as_matrix()
    shown = replace(
        true,
        joint_position=true.joint_position + FOUND.offset,
        angular_velocity=turn.T @ true.angular_velocity,
        acceleration=turn.T @ true.acceleration,
    )
    sensed = Mounting(FOUND).sensed(shown)
    for name in ("joint_position", "angular_velocity", "acceleration"):
        np.testing.assert_allclose(getattr(sensed, name), getattr(true, name))


def test_a_walker_sends_what_the_encoders_have_to_show(library):
    walker = Walker(library, require_qualified=False)
    np.testing.assert_allclose(walker.stand - FOUND.offset, walker.gait.stand)
    backend = MujocoBackend(MINE)
    backend.connect(walker.stand)
    targets = walker.step(backend.read())
    assert targets.motors is not None
    sent = targets.position - FOUND.offset
    np.testing.assert_allclose(sent, walker.gait.stand, atol=0.1)
    shift = targets.motors.position - targets.position
    assert np.abs(shift).max() < 0.1


def test_it_is_not_walked_in_its_files_model(library):
    """Where its offsets would be made up for that are not there."""
    trial = Trial(library, require_qualified=False)
    with pytest.raises(CommandError, match="was identified and is not that of"):
        run_own_trials(trial, "res.xml", 1, 1, 1)


def test_a_hidden_robot_is_that_of_the_file(library):
    """Whatever was identified of it before: the same walk by another library."""
    hidden = {"backlash_deg": 0.3, "plant_seed": 5, "model_error": 0.0}
    schedule = (Segment(Command(0.1, 0.0, 0.0), 1.0),)
    plain = replace(library, poses=replace(library.poses, robot=RES))
    same = RES.as_identified(Identified.of_file(12))
    fitted = replace(library, poses=replace(library.poses, robot=same))
    ways = []
    for own in (plain, fitted):
        trial = Trial(
            own, fixed=hidden, schedule=schedule, plant=RES, require_qualified=False
        )
        ways.append(next(run_trials(trial, 1, 1, 1)).distance_m)
    assert ways[0] == pytest.approx(ways[1], abs=1e-3)


def test_what_is_left_unknown_is_drawn_in_training(brisk):
    """As one number; what was identified, of gears too, is not drawn again."""
    poses = replace(brisk.poses, robot=MINE)
    worlds = STRIDE_BUILD.training_worlds(poses, None)
    assert worlds.draw(np.random.default_rng(0)).doubt == 1.0
    assert worlds.harder().numbers["doubt"] == 1.0
    for name in ("backlash_deg", "gain_error", "encoder_offset_deg", "imu_tilt_deg"):
        assert worlds.numbers[name] == 0.0
    plain = STRIDE_BUILD.training_worlds(brisk.poses, None)
    assert plain.numbers.get("doubt", 0.0) == 0.0
    for name in ("servo_gain", "mass"):
        assert worlds.numbers[name] == 1.0 and plain.numbers[name] != 1.0


def test_likely_robots_are_off_as_their_log_ties_them():
    """Mean, covariance and reach of what is drawn are those that were found."""
    doubt = 0.5
    worlds = [World(doubt=doubt, seed=seed) for seed in range(4000)]
    drawn = [likely_robot(MINE, world).identified for world in worlds]
    rows = np.array(list(map(numbers_of, drawn)))
    size = doubt * np.sqrt(np.diag(FOUND.unknown @ FOUND.unknown.T))
    mean = numbers_of(FOUND)
    np.testing.assert_allclose((rows.mean(axis=0) - mean) / size, 0.0, atol=0.07)
    found = np.cov(rows.T) / np.outer(size, size)
    asked = doubt**2 * FOUND.unknown @ FOUND.unknown.T / np.outer(size, size)
    np.testing.assert_allclose(found, asked, atol=0.09)


def numbers_of(found):
    """Return all numbers of which something may be unknown, in one row."""
    return np.concatenate([np.atleast_1d(getattr(found, name)) for name in UNSURE])


def test_what_libraries_of_before_knew_exactly_is_exact():
    """They have a covariance of gains, offsets, CoM and tilt alone."""
    before = 0.02 * np.tril(np.ones((30, 30)))
    facts = {**FOUND.facts(), "unknown": before.tolist()}
    one = identified_from(facts, 12)
    np.testing.assert_array_equal(one.unknown[:30, :30], before)
    assert not one.unknown[30:].any() and not one.unknown[:, 30:].any()
    off = one.moved(np.ones(COUNT))
    assert off.delay_s == FOUND.delay_s and off.trunk_mass == FOUND.trunk_mass
    np.testing.assert_array_equal(off.backlash_deg, FOUND.backlash_deg)
    assert np.abs(off.gain - FOUND.gain).max() > 0.01


def test_the_simulated_robot_is_another_that_is_as_likely():
    """Servos, encoders, masses and IMU; the same one by the same seed of the plant."""
    stand = np.array(RES.legs.stand)

    def seen(world):
        backend = MujocoBackend(MINE, world)
        backend.connect(stand)
        return (
            np.array(backend.model.actuator_biasprm[:, 1]),  # -kp
            np.array(backend.model.body("trunk").ipos),
            np.array(backend.model.site("imu").quat),
            backend.read().joint_position - backend.joints,
            np.array(backend.model.body("trunk").mass),
            np.array(backend.model.dof_frictionloss),
            1e2 * np.array([backend.world.delay_s, backend.world.viscous_friction]),
        )

    sure, other = seen(World(seed=3)), seen(World(seed=3, doubt=1.0))
    same = seen(World(seed=4, plant_seed=3, doubt=1.0))
    for exact, drawn, again in zip(sure, other, same, strict=True):
        assert np.abs(drawn - exact).max() > 1e-3
        np.testing.assert_allclose(again, drawn, rtol=0.0, atol=1e-12)


def test_what_nobody_identified_is_not_doubted():
    with pytest.raises(
        CommandError, match=r"doubt is 1, must be 0: nothing was identified"
    ):
        MujocoBackend(RES, World(doubt=1.0))


def test_inspect_tells_an_identified_robot_and_how_well_it_is_known(tmp_path, capsys):
    plain = load_library("src/gaitchain/data/res.gait")
    sd = np.repeat(
        [0.061, np.radians(0.57), 0.0042, np.radians(1.25), 0.11, 0.31, 0.012],
        [12, 12, 3, 3, 12, 12, 12],
    )
    found = replace(FOUND, unknown=np.diag([*sd, 0.0023, 0.35, 0.021, 0.034, 0.0047]))
    poses = replace(plain.poses, robot=RES.as_identified(found))
    mine, figures = tmp_path / "mine.gait", tmp_path / "found.json"
    save_library(replace(plain, poses=poses), mine)
    assert run(["inspect", str(mine), "--json", str(figures)]) == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "identified by its own log, which leaves unknown (1 sd): servo gain" in said
    for amount in ("gain 6.1 %", "0.57 deg", "4.2 mm", "1.25 deg", "0.31 deg"):
        assert amount in said
    for amount in ("backlash 0.31 deg", "targets 2.3 ms", "trunk 3.4 %", "IMU 4.7 ms"):
        assert amount in said
    assert json.loads(figures.read_text("utf-8"))["identified"] == found.facts()
    assert run(["inspect", "res.gait", "--json", str(figures)]) == 0
    assert "identified" not in capsys.readouterr().out
    assert json.loads(figures.read_text("utf-8"))["identified"] is None


@pytest.mark.parametrize("words", [["trial", "res"], ["push", "res"], ["walk"]])
def test_a_doubt_of_what_nobody_identified_is_told_before_any_work(
    words, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert run([*words, "--doubt", "1"]) == 2
    assert capsys.readouterr().err == (
        "gaitchain: --doubt: doubt is 1, must be 0: nothing was identified of "
        "Robo-Erectus Senior; take a library that `gaitchain identify` wrote\n"
    )
    assert not list(tmp_path.iterdir())


def test_numbers_that_are_drawn_are_possible_ones():
    """Factors stay above zero, amounts at it."""
    wild = replace(FOUND, unknown=10.0 * np.eye(COUNT))
    drawn = [wild.moved(np.full(COUNT, x)) for x in (-3.0, 0.0, 3.0)]
    for one in drawn:
        assert identified_from(one.facts(), 12) == one
    assert drawn[0].gain.min() > 0.0 and drawn[0].trunk_mass > 0.0
    assert drawn[0].delay_s == drawn[0].backlash_deg.max() == 0.0
    assert drawn[1] == wild


def test_what_is_left_unknown_is_drawn_in_grid_and_proof(library):
    cells = [cell for cell in DYNAMIC_GRID.cells() if cell.required]
    for i, cell in enumerate(cells):
        world = grid_world(library, GridJob((0, i), cell, "", STEP), 3, 50.0)
        asked = dict(cell.numbers)
        assert world.doubt == 1.0
        assert world.gain_error == asked.get("gain_error", 0.0)
        plain = replace(library, poses=replace(library.poses, robot=RES))
        without = grid_world(plain, GridJob((0, i), cell, "", STEP), 3, 50.0)
        assert without.doubt == 0.0


def test_pushes_do_not_take_away_what_was_identified():
    backend = MujocoBackend(MINE, World())
    backend.set_pushes(Push(10.0, 0.0, 1.0))
    backend.connect(np.array(RES.legs.stand))
    assert backend.world.delay_s == FOUND.delay_s
    assert backend.world.imu_delay_s == pytest.approx(0.02)
    assert [push.impulse_ns for push in backend.world.push] == [10.0]


@pytest.mark.slow
def test_a_build_is_for_the_robot_as_it_was_found(tmp_path):
    """As little of one as there can be; it is not gated in its file's model."""
    with few_steady_walks():
        built = build_library(SMALLEST, robot=MINE)[0]
    assert built.robot == MINE
    assert built.qualification.gate is not None
    assert built.qualification.own is None
    path = tmp_path / "mine.gait"
    save_library(built, path)
    assert identified_robot(BuildConfig(), path) == MINE
    assert identified_robot(BuildConfig(), None) == RES


def test_a_build_needs_what_was_identified(tmp_path, capsys):
    words = ["build", "res", "-o", str(tmp_path / "a.gait"), "--identified"]
    for library in ("src/gaitchain/data/res.gait", "res"):
        assert run([*words, library]) == 2
        said = capsys.readouterr().err
        assert "give a library that `gaitchain identify` wrote" in said
    assert run([*words, "nobody"]) == 2
    assert "nobody: no such file; give a library" in capsys.readouterr().err
