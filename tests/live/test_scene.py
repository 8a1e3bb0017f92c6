"""Scenes of the loop's telemetry, against the simulator and by the joints alone."""

import math
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from planned_library import planned_library
from scipy.spatial.transform import Rotation
from telemetry_factory import seen, told, walked

from gaitchain.analysis.walk_metrics import support_region
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.zmp import to_world
from gaitchain.live.messages import Going
from gaitchain.live.scene import Stage
from gaitchain.live.telemetry_record import record_of
from gaitchain.messages import Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.turn import quaternion
from gaitchain.sim.model import build_model
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker

RES = load_box_robot("res")
MODEL = build_model(RES)
HALF = 0.5 * RES.reduced.hip_width


@pytest.fixture(scope="module")
def walk():
    """Telemetry of 4 s with its truth, and the simulator's own words for each row."""
    walker, backend = Walker(planned_library(RES)), MujocoBackend(RES)
    backend.connect(walker.stand)
    for _ in range(100):
        backend.write(walker.step(backend.read()).position)
    rows, said = [], []
    for row in walked(walker, backend, 450):
        rows.append(row)
        if len(rows) == 50:
            walker.command(Command(0.3))
        yaws = backend.foot_yaws()
        feet = np.column_stack([backend.foot_positions()[:, :2], yaws])
        said.append((feet, backend.zmp()))
    return rows, said


def test_a_scene_is_where_the_simulator_has_everything(walk):
    stage, record = Stage(RES), record_of(RES, walk[0])
    for i, (row, (feet, zmp)) in enumerate(zip(*walk, strict=True)):
        scene = stage.scene(row)
        assert scene.trunk == row.truth.qpos[:7]
        np.testing.assert_allclose(scene.feet, feet, atol=1e-12)
        np.testing.assert_allclose(scene.zmp, zmp, atol=1e-9)
        np.testing.assert_allclose(scene.soles, record.soles[i], atol=1e-12)
        region = support_region(RES, record, i, feet)
        np.testing.assert_allclose(scene.region, region, atol=1e-9)
        left = row.support in {"ls", "lr", "stand"}
        planned = to_world(np.array(row.planned_zmp), feet[0 if left else 1], left)
        np.testing.assert_allclose(scene.planned_zmp, planned, atol=1e-12)
    assert {row.support for row in walk[0]} == {"stand", "ls", "lr", "rs", "rl"}
    assert scene.trunk[0] > 0.5


def test_between_rows_with_truth_the_robot_does_not_jump(walk):
    """The loop tells the truth less often than where the joints are."""
    rows, _ = walk
    stage, whole = Stage(RES), Stage(RES)
    for i, row in enumerate(rows):
        shown = stage.scene(row if i % 5 == 0 else replace(row, truth=None))
        real = whole.scene(row)
        np.testing.assert_allclose(shown.trunk, real.trunk, atol=0.01)
        np.testing.assert_allclose(shown.feet, real.feet, atol=0.03)
        np.testing.assert_allclose(shown.soles, real.soles, atol=0.03)


def test_a_truth_of_long_ago_or_of_another_run_is_forgotten(walk):
    row = walk[0][-1]
    stage, bare = Stage(RES), replace(row, truth=None)
    expected = Stage(RES).scene(bare)
    for apart_s in (0.6, -0.1):
        stage.scene(row)
        late = stage.scene(replace(bare, time_s=row.time_s + apart_s))
        assert late.trunk == expected.trunk
    assert stage.scene(bare).trunk == expected.trunk
    assert stage.scene(row).trunk != expected.trunk


def simulated(trunk, joints):
    data = mujoco.MjData(MODEL)
    data.qpos[:7], data.qpos[7:] = trunk, joints
    mujoco.mj_kinematics(MODEL, data)
    feet = [data.body(f"{side}_foot") for side in ("left", "right")]
    return [(foot.xpos.copy(), foot.xmat.reshape(3, 3).copy()) for foot in feet]


@settings(max_examples=40)
@given(
    st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12),
    st.sampled_from(["", "stand", "ls", "lr", "rs", "rl"]),
)
def test_a_real_robot_stands_on_its_support_foot(joints, support):
    """The trunk is where MuJoCo, given it, finds that sole flat on the floor."""
    row = told(RES, joint_position=tuple(joints), support=support)
    scene = Stage(RES).scene(row)
    right = support.startswith("r")
    found = simulated(scene.trunk, joints)
    at, turn = found[right]
    np.testing.assert_allclose(turn, np.eye(3), atol=1e-9)
    expected = [0.0, -HALF if right else HALF, RES.reduced.ankle_height]
    np.testing.assert_allclose(at, expected, atol=1e-9)
    for (x, y, yaw), (place, axes) in zip(scene.feet, found, strict=True):
        np.testing.assert_allclose((x, y), place[:2], atol=1e-9)
        heading = math.atan2(axes[1, 0], axes[0, 0])
        assert math.remainder(yaw - heading, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(scene.zmp).all()
    np.testing.assert_allclose(scene.soles[right][0][1], expected[1] - 0.065)
    corners = len(scene.region)
    assert corners == 4 if support in {"ls", "rs"} else bool(corners) == bool(support)


def test_a_joint_that_does_not_answer_is_drawn_where_it_was_told_to_be():
    target = tuple(np.linspace(-0.3, 0.3, 12).tolist())
    silent = (*target[:3], math.nan, *target[4:])
    stage = Stage(RES)
    asked = stage.scene(told(RES, joint_position=target, joint_target=target))
    shown = stage.scene(told(RES, joint_position=silent, joint_target=target))
    assert (shown.trunk, shown.soles) == (asked.trunk, asked.soles)
    # Neither known: as standing.
    nothing = told(RES, joint_position=(math.nan,) * 12, joint_target=())
    assert stage.scene(nothing).trunk == stage.scene(told(RES)).trunk


def test_a_robot_whose_physics_broke_has_no_region():
    walker, backend = Walker(planned_library(RES)), MujocoBackend(RES)
    backend.connect(walker.stand)
    row = seen(walker, backend, 0.0, walker.stand)
    broken = replace(row.truth, place=(math.nan,) * 6)
    assert Stage(RES).scene(replace(row, truth=broken)).region == ()


def test_scenes_need_no_simulator():
    code = "import sys, gaitchain.live.scene; assert 'mujoco' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 1e-3, 1e-9]))
def test_the_quaternion_of_a_turn_is_scipys(seed, part):
    """Of any turn, and of those near half a turn about an axis."""
    exact = np.random.default_rng(seed).normal(size=4) * [part, 1.0, part, 1.0]
    turn = Rotation.from_quat(exact, scalar_first=True)
    found = Rotation.from_quat(quaternion(turn.as_matrix()), scalar_first=True)
    assert (found * turn.inv()).magnitude() < 1e-14


def test_the_goal_is_as_far_from_the_support_foot_as_the_steps_tell():
    stage, here = Stage(RES), told(RES, 1.0)
    assert stage.scene(here).goal is None
    goal = Place(1.5, 2.0, 1.0)
    stood = {"feet": (Place(1.0, 2.1), Place(1.0, 1.9))}
    going = Going(goal, 1, 0, 0.5, 1.0, arrived=False)
    left, right = stage.scene(here).feet
    for support, foot, aside in (("stand", left, -0.1), ("rs", right, 0.1)):
        sent = told(RES, 1.0, support=support, going=going, **stood)
        expected = foot[0] + 0.5, foot[1] + aside, foot[2] + 1.0
        assert stage.scene(sent).goal == pytest.approx(expected)
