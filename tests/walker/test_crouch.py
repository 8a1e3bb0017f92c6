"""A commanded crouch in physics: how low the hips go, and what the legs allow."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.command_range import inward
from gaitchain.gait.stride.crouch import deepest_crouch
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.robot.box_robot import box_robot
from gaitchain.walker.footsteps import Footstep
from gaitchain.walker.keypose_generator import KeyposeGenerator
from gaitchain.walker.walker import Walker

CLOSE_M = 0.004
LOW_M = 0.06
GRAVITY = 9.81


@pytest.fixture(scope="module")
def supple(brisk):
    """RES with the knees of a person: its own end at 80 deg and leave it 6 mm."""
    reduced = replace(brisk.robot.reduced, joint_angle_limit=math.radians(130.0))
    return replace(brisk, poses=replace(brisk.poses, robot=box_robot(reduced)))


@pytest.fixture(scope="module")
def stiff(supple):
    """The same with ankles that leave little at speed."""
    library = replace(supple)
    crouch = supple.command_range.crouch[0], 0.03
    vars(library)["command_range"] = replace(supple.command_range, crouch=crouch)
    return library


class Lowered:
    """A robot in physics that is told how low to go."""

    def __init__(self, library):
        self.walker = Walker(library)
        self.backend = MujocoBackend(library.robot)
        self.backend.connect(self.walker.stand)
        self.heights = []
        self.up = self.run(1.5, Command())

    def run(self, seconds, command):
        """Return the hips' mean height over the last three steps' time [m]."""
        self.walker.command(command)
        heights = []
        for _ in range(round(seconds / CONTROL_PERIOD_S)):
            self.backend.write(self.walker.step(self.backend.read()).position)
            assert not self.backend.fallen
            heights.append(self.backend.data.qpos[2])
        self.heights += heights
        last = 6.0 * self.walker.library.timing.step
        return float(np.mean(heights[-round(0.5 * last / CONTROL_PERIOD_S) :]))


def test_the_hips_go_as_low_as_asked_and_come_up_again(supple):
    speed = 0.5 * supple.command_range.vx[1]
    robot = Lowered(supple)
    walking = robot.run(5.0, Command(speed))
    assert walking - robot.run(6.0, Command(speed, crouch=LOW_M)) == pytest.approx(
        LOW_M, abs=CLOSE_M
    )
    moved = robot.backend.data.qpos[0]
    assert robot.run(4.0, Command(crouch=LOW_M)) == pytest.approx(
        robot.up - LOW_M, abs=CLOSE_M
    )
    assert robot.walker.standing
    assert moved > 0.5 * 11.0 * speed
    assert robot.run(6.0, Command()) == pytest.approx(robot.up, abs=CLOSE_M)


def test_it_goes_down_smoothly_in_a_stand(supple):
    robot = Lowered(supple)
    begin, rate = (
        len(robot.heights),
        0.5 * math.sqrt(GRAVITY / supple.robot.reduced.leg_length),
    )
    robot.run(4.0, Command(crouch=LOW_M))
    speeds = np.diff(robot.heights[begin:]) / CONTROL_PERIOD_S
    assert -speeds.min() == pytest.approx(LOW_M * rate / math.e, rel=0.25)
    assert speeds.max() < 0.1 * -speeds.min(), "it never goes up on the way"
    assert robot.walker.standing


def test_who_is_low_walks_no_faster_than_its_legs_can_from_there(stiff):
    most = stiff.command_range
    robot = Lowered(stiff)
    deep = replace(Command(), crouch=most.crouch[0])
    low = robot.run(4.0, deep)
    robot.walker.command(Command(most.vx[1]))
    for _ in range(round(3.0 / CONTROL_PERIOD_S)):
        robot.backend.write(robot.walker.step(robot.backend.read()).position)
        if robot.walker.gait.steps:
            break
    gait = robot.walker.gait
    speed = gait.state.asked[0] / stiff.timing.step
    assert 0.0 < speed < 0.95 * most.vx[1]
    assert most.deepest(Command(speed)) == pytest.approx(
        gait._walk.state.crouch, abs=CLOSE_M
    )
    assert robot.up - low == pytest.approx(most.crouch[0], abs=CLOSE_M)


def test_too_low_is_clamped_and_said(stiff):
    walker, most = Walker(stiff), stiff.command_range
    slow, fast = most.crouch
    assert walker.command(Command(crouch=1.0)) == Command(crouch=slow)
    assert (
        walker.note == f"crouch 1 m: the legs leave {inward(slow):.3f} m at this speed"
    )
    done = walker.command(Command(most.vx[1], crouch=slow))
    assert done == Command(most.vx[1], crouch=pytest.approx(fast))
    assert "at this speed" in walker.note
    assert walker.command(Command(crouch=0.5 * slow)).crouch == 0.5 * slow
    assert walker.note == ""


@pytest.mark.parametrize("bad", [-0.1, math.nan, -math.inf])
def test_what_is_no_crouch_is_said_and_left_out(supple, bad):
    walker = Walker(supple)
    assert walker.command(Command(0.1, crouch=bad)) == Command(0.1)
    assert f"crouch {bad:g} m is not 0 or more" in walker.note


def test_key_poses_do_not_crouch(library):
    done, note = KeyposeGenerator(library).clamp(Command(0.06, crouch=0.05))
    assert done == Command(0.06)
    assert note == "crouch 0.05 m: key poses do not crouch"


def test_a_crouch_ends_where_the_legs_do(supple):
    poses, legs = supple.poses, supple.robot.legs
    assert supple.command_range.crouch[0] == deepest_crouch(poses, 0.0)
    far = [deepest_crouch(poses, stride) for stride in (0.0, 0.2, 0.4)]
    assert far == sorted(far, reverse=True)

    def with_legs(**changes):
        robot = replace(supple.robot, legs=replace(legs, **changes))
        return deepest_crouch(replace(poses, robot=robot), 0.0)

    assert with_legs(torque_limit=0.2 * legs.torque_limit) < far[0]
    assert with_legs(torque_limit=np.full_like(legs.torque_limit, 1.0)) == 0.0
    assert with_legs(upper=0.7 * legs.upper, lower=0.7 * legs.lower) < far[0]


def test_footsteps_are_made_as_low_as_it_is_and_as_their_length_allows(stiff):
    low = stiff.command_range.crouch[0]
    half = 0.5 * stiff.poses.stance
    walker = Walker(stiff)
    walker.command(Command(crouch=low))
    walker.follow_steps([Footstep(True, 0.0, half)])
    assert walker.commanded == Command(crouch=low)
    long = float(stiff.poses.strides[:, 0].max())
    steps = [Footstep(True, 0.5 * long, half), Footstep(False, long, -half)]
    walker.follow_steps([*steps, Footstep(True, long, half)])
    speed = Command(0.5 * long / stiff.timing.step)
    expected = stiff.command_range.deepest(speed)
    assert 0.03 < expected < low
    assert walker.commanded.crouch == pytest.approx(expected)
