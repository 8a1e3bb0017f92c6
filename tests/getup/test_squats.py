"""Squats against MuJoCo: where the CoM is, and whether a robot rests in them."""

import mujoco
import numpy as np
import pytest
from planned_library import planned_library

from gaitchain.discover.loaded_robot import load_robot
from gaitchain.gait.get_up import TimedPose, Way
from gaitchain.getup.fallen_robot import FallenRobot
from gaitchain.getup.squats import Squats

PARTS = (0.2, 0.5, 0.8)


@pytest.fixture(scope="module")
def robot(toy_path, toy_library):
    return FallenRobot(toy_path, toy_library)


@pytest.mark.parametrize("knee", ["", 'range="-1.5 2.2"', 'range="-2.9 2.2"'])
def test_knees_bend_the_way_that_leads_down(toy_path, tmp_path, knee):
    """Also where their limits are further the other way, or none."""
    file = tmp_path / "toy.xml"
    file.write_text(toy_path.read_text().replace('range="0 2.2"', knee))
    robot = FallenRobot(file, planned_library(load_robot(file)))
    (row,) = [
        number
        for number, name in enumerate(robot.backend.joint_names)
        if name == "left_knee"
    ]
    bends = [robot.squats.at(part)[row] for part in np.linspace(0.0, 1.0, 7)]
    assert (np.diff(bends) * np.sign(robot.stand[row]) > 0.0).all()
    heights = []
    for part in (0.0, 0.3, 0.6):
        robot.backend.connect(robot.squats.at(part))
        heights.append(robot.look().high)
    assert heights[0] == pytest.approx(1.0)
    assert (np.diff(heights) < -0.02).all()


@pytest.mark.parametrize("part", PARTS)
def test_the_com_is_over_flat_feet_as_in_a_stand(robot, part):
    model, data = robot.backend.model, robot.backend.data
    seen = []
    for angles in (robot.stand, robot.squats.at(part)):
        robot.backend.connect(angles)
        mujoco.mj_kinematics(model, data)
        foot = model.jnt_bodyid[model.joint("left_tilt").id]
        sole = data.xmat[foot].reshape(3, 3)
        com = sole.T @ (data.subtree_com[robot.backend.in_model.base] - data.xpos[foot])
        seen.append((com[0], robot.look().high))
    (stands, high), (squats, low) = seen
    assert squats == pytest.approx(stands, abs=0.02 * robot.height)
    assert low < high - 0.1 * part
    assert robot.squats.part_of(low) == pytest.approx(part, abs=0.1)


@pytest.mark.parametrize("part", PARTS)
def test_a_robot_rests_in_a_squat_and_rises_from_it(robot, part):
    robot.backend.connect(robot.stand)
    down = [robot.squats.at(part * share) for share in (0.25, 0.5, 0.75, 1.0)]
    squat = Way(tuple(TimedPose(0.5, tuple(row)) for row in down), 0, 1)
    rests = robot.move(squat)[-1]
    assert rests.speed < 0.05
    assert rests.high < 1.0 - 0.1 * part
    up = Way(tuple(TimedPose(0.5, tuple(row)) for row in down[::-1]), 0, 1)
    robot.move(up, np.array(down[-1]))
    assert robot.move(Way((TimedPose(0.5, tuple(robot.stand)),), 0, 1), down[0])[
        -1
    ].stands


def test_squats_keep_the_limits_and_are_the_same_on_both_sides(robot):
    for part in np.linspace(0.0, 1.0, 21):
        angles = robot.squats.at(part)
        assert (angles >= robot.lower - 1e-9).all()
        assert (angles <= robot.upper + 1e-9).all()
        for pair in robot.pairs:
            left, right = angles[pair.left], angles[pair.right]
            stands = robot.stand[pair.left], robot.stand[pair.right]
            assert right - stands[1] == pytest.approx(pair.sign * (left - stands[0]))
    np.testing.assert_array_equal(robot.squats.at(0.0), robot.stand)


def test_legs_that_do_not_bend_by_three_joints_only_stand(robot):
    limits = robot.lower, robot.upper
    squats = Squats(robot.backend, robot.stand, limits, robot._feet, None)
    for part in (0.0, 0.5, 1.0):
        np.testing.assert_array_equal(squats.at(part), robot.stand)
    assert squats.part_of(0.5) == pytest.approx(squats.part_of(1.0))
