"""The paper's gait for a robot that was read from a file, in physics."""

import dataclasses

import numpy as np
import pytest
from other_robots import with_legs

from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.analysis.walk_metrics import summarise
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.pose_joints import PoseJoints
from gaitchain.build.gait_build import Draw
from gaitchain.build.keypose import KEY_POSE_BUILD
from gaitchain.build.keypose_sway import most_sway
from gaitchain.build.pipeline import build_library
from gaitchain.build.workers import Crew
from gaitchain.chain.sampling import draw_walks
from gaitchain.errors import UnreachableError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.presets import CROUCH
from gaitchain.gait.keypose.primitives import compose
from gaitchain.gait.keypose.weight_shift import weight_shift
from gaitchain.gait.library_file import load_library, save_library
from gaitchain.gait.schedule import parse_schedule
from gaitchain.messages import CONTROL_PERIOD_S, Command, Sensors
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

RES = load_box_robot("res")
READ = with_legs(RES, RES.legs)  # RES as if a file had described it
CREW = Crew(1, lambda *news: None)
SMALL = BuildConfig(
    preset="default",
    poses_per_layer=(4, 6, 8, 4),
    walks=6,
    steps_per_walk=4,
    qualification_walks=12,
    gate_runs=1,
    gate_share=0.0,
)


def drawn(robot, **changes):
    config = dataclasses.replace(SMALL, **changes)
    rng = np.random.default_rng(0)
    return KEY_POSE_BUILD.draw(Draw(config, robot, rng, rng, CREW))


@pytest.fixture(scope="module")
def library(once):
    return once("read_key_poses", lambda: build_library(SMALL, robot=READ)[0])


@pytest.mark.slow
def test_its_stand_is_angles_and_its_targets_bear_the_weight(library):
    walker = Walker(library, require_qualified=False, feedback=False)
    off = []
    for targets in (walker.standing_targets.position, walker.stand):
        backend = MujocoBackend(READ)
        backend.connect(walker.stand)
        for _ in range(round(2.0 / CONTROL_PERIOD_S)):
            backend.write(targets)
        off.append(np.abs(backend.read().joint_position - walker.stand).max())
    assert off[0] < 0.2 * off[1]


def with_rolls(low):
    """READ whose hips roll inward by less."""
    legs = READ.legs
    lower, upper = legs.lower.copy(), legs.upper.copy()
    lower[1], upper[7] = low, -low
    return with_legs(READ, dataclasses.replace(legs, lower=lower, upper=upper))


def test_the_largest_sway_is_that_of_the_joints():
    """With limits of 10 deg at the hip roll, 0.95 of which a plan may use."""
    robot = with_rolls(-np.radians(10.0))
    found = np.degrees(most_sway(PoseJoints(robot)))
    assert found == pytest.approx(9.5, abs=0.2)


def test_a_robot_that_cannot_sway_is_refused_with_the_number():
    with pytest.raises(UnreachableError, match=r"allow 2\.\d deg of sway, .* bring"):
        drawn(with_rolls(-np.radians(3.0)))


@pytest.mark.parametrize("step_s", [0.8, 3.0])
def test_times_of_a_step_leave_the_weight_time(step_s):
    shift = weight_shift(READ, 0.5, step_s)
    narrow = with_legs(READ, READ.legs, sole_width=0.05)
    longer = weight_shift(narrow, 0.5, step_s)
    assert shift.timing.step == longer.timing.step == step_s
    assert longer.timing.double_support >= shift.timing.double_support
    assert longer.sway > shift.sway  # further over a narrow sole
    assert 0.2 * step_s <= shift.timing.double_support <= 0.551 * step_s


def test_the_weight_is_over_the_support_sole_while_a_foot_is_up():
    """By the CoM of the simulator's model, at every key pose of single support."""
    found = drawn(READ)
    joints = PoseJoints(READ)
    backend = MujocoBackend(READ)
    half = 0.5 * READ.reduced.sole_width
    for layer in range(3):
        for q in found.poses.q[layer]:
            backend.connect(joints.angles(q, left_support=True))
            off = backend.data.subtree_com[1][1] - backend.foot_positions()[0, 1]
            assert abs(off) < half


@pytest.mark.parametrize("seed", [0, 1])
def test_random_gaits_walk_as_far_as_planned(seed):
    found = drawn(READ)
    walk = draw_walks(found.edges, 1, 6, np.random.default_rng(seed))[0]
    poses, timing = found.poses, found.timing
    walked = KEY_POSE_BUILD.roll_out(poses, timing, walk, World())
    terms, advance = walked.terms, walked.advance
    assert walked.fell_in is None
    # The body moves with both feet: half of each step's lengths before and after.
    lengths = poses.step_lengths[walk[:, 3]]
    assert advance.sum() == pytest.approx(lengths.sum(), rel=0.15)
    assert np.all(terms[:, 1] < 0.5)  # joints within 3 deg / sqrt(2) of the plan


@pytest.mark.slow
def test_a_built_library_walks_in_physics(library):
    """Held-out world, more than six steps; every joint within its own range."""
    most = library.command_range
    speed = 0.5 * sum(most.vx)
    schedule = parse_schedule(f"{speed:.3f}@3,{speed:.3f}@half", steps=True)
    walker = Walker(library, require_qualified=False)
    backend = MujocoBackend(library.robot, World(friction=0.8))
    record = run_schedule(walker, backend, schedule)
    summary = summarise(library.robot, record, schedule)
    assert not summary.fell
    assert summary.distance_m > 4 * speed * library.timing.step
    legs = library.robot.legs
    assert np.all(record.target >= legs.lower - 1e-12)
    assert np.all(record.target <= legs.upper + 1e-12)


@pytest.mark.slow
def test_the_panel_names_the_joints_of_the_robot(library):
    walker = Walker(library, require_qualified=False)
    walker.command(Command(library.command_range.vx[1]))
    stand, level = walker.stand, np.array([0.0, 0.0, 9.81])
    for tick in range(2):
        time_s = tick * CONTROL_PERIOD_S
        walker.step(Sensors(time_s, stand, np.zeros_like(stand), np.zeros(3), level))
    panel = walker.gait.panel
    names = [*panel.frontal, *panel.sagittal]
    assert sorted(names) == sorted(library.robot.legs.joint_names)
    assert set(panel.sagittal) == set(library.robot.legs.sagittal)


@pytest.mark.slow
def test_the_library_is_read_back_as_written(library, tmp_path):
    path = tmp_path / "read.gait"
    save_library(library, path)
    again = load_library(path, READ)
    assert not again.robot.boxes
    for one, other in zip(again.poses.q, library.poses.q, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_it_stands_with_its_weight_over_one_leg(library):
    height = CROUCH * READ.reduced.leg_length
    upright = compose(READ, np.array([0.0, height, 0.0, 0.0, 0.0]))
    stand = library.poses.q[0][STAND]
    assert stand[5] > 0.0
    np.testing.assert_allclose(stand[:5], upright[:5], atol=1e-12)


@pytest.mark.slow
def test_the_paper_walk_of_another_robot_is_a_part_of_its_range(library):
    most = library.command_range
    shown = library.family.demonstration(most)
    speeds = [segment.command.vx for segment in shown]
    assert most.vx[0] <= max(speeds) <= most.vx[1]
    assert speeds[0] / speeds[1] == pytest.approx(0.5, rel=0.01)
