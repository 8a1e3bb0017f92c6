"""The closed loop in physics: it walks, it goes where it is told, it withstands."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gaitchain.analysis.base_motion import own_motion
from gaitchain.analysis.simulated_walk import run_schedule, run_unrecorded
from gaitchain.analysis.walk_metrics import summarise
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.stride_rollout import walk_strides
from gaitchain.gait.schedule import Segment
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

RUN_IN_S, WALK_S = 2.0, 6.0
MILD_NS = 9.0  # 0.12 of m sqrt(g h): brings down walks that feel nothing
SIDES = (0.0, 90.0, 180.0, -90.0)


def survives(library, command, seconds=5.0, world=None, feedback=True):
    walker = Walker(library, feedback=feedback)
    backend = MujocoBackend(library.robot, world)
    return (
        run_unrecorded(walker, backend, (Segment(command, seconds),)).fell_at_s is None
    )


@pytest.mark.parametrize(
    "world",
    [
        World(),
        World(friction=0.6, model_error=0.05, seed=1),
        World(noise=1.0, delay_s=0.01, seed=2),
        World(mass=1.05, servo_gain=0.9, seed=3),
    ],
)
def test_it_walks_in_worlds_that_differ(brisk, world):
    assert survives(brisk, Command(0.3), world=world)


@pytest.fixture(scope="module")
def pushes(brisk):
    """Whether it withstands mild pushes from all sides: with balance, and without."""

    def walk(side, at_s, feedback):
        push = Push(MILD_NS, side, at_s)
        return survives(
            brisk, Command(0.3), world=World(push=(push,)), feedback=feedback
        )

    tests = [(side, at_s) for side in SIDES for at_s in (2.0, 2.46)]
    return [(walk(*test, True), walk(*test, False)) for test in tests]


def test_it_withstands_mild_pushes_from_all_sides(pushes):
    assert all(balanced for balanced, _ in pushes)


def test_the_same_pushes_bring_down_a_walk_that_feels_nothing(pushes):
    assert not all(blind for _, blind in pushes)


@pytest.mark.parametrize("side", [0.0, 45.0, 135.0, 180.0])
def test_pushed_while_it_stands_it_steps_and_stands_again(brisk, side):
    """0.2 of m sqrt(g h) is more than feet that stay where they are can hold."""
    walker, world = Walker(brisk), World(push=(Push(15.0, side, 0.5),))
    backend = MujocoBackend(brisk.robot, world)
    schedule = (Segment(Command(), 5.0),)
    assert run_unrecorded(walker, backend, schedule).fell_at_s is None
    assert walker.standing


@pytest.mark.parametrize("step_s", [0.8, 1.5, 3.0])
def test_slow_strides_too_go_every_way(brisk, step_s):
    library = replace(brisk, timing=StrideShape(step_s=step_s).timing(brisk.robot))
    walker, span = Walker(library), library.command_range
    for axis, (low, high) in zip(("vx", "vy", "yaw_rate"), span.ends, strict=True):
        for speed in (0.5 * low, 0.5 * high):
            walker.reset()
            backend = MujocoBackend(brisk.robot, World(model_error=0.05, seed=4))
            schedule = (Segment(Command(**{axis: speed}), 5.0 * step_s),)
            fell = run_unrecorded(walker, backend, schedule).fell_at_s
            assert fell is None, f"{axis} {speed:.2f}: {fell}"
            assert walker.gait.steps >= 4


def test_a_robot_that_feels_its_soles_walks_over_blocks(brisk):
    world = World(blocks_m=0.01, seed=6, foot_sensors=True)
    assert survives(brisk, Command(0.2), seconds=10.0, world=world)


def test_without_a_push_the_plan_alone_walks(brisk):
    assert survives(brisk, Command(0.3), feedback=False)


@pytest.mark.parametrize(
    "command",
    [
        Command(0.3),
        Command(-0.15),
        Command(0.0, 0.05),
        Command(0.0, -0.05),
        Command(0.0, 0.0, 0.15),
        Command(0.0, 0.0, -0.15),
        Command(0.15, 0.02),
        Command(0.2, 0.0, 0.08),
    ],
)
def test_it_goes_where_it_is_told(brisk, command):
    """Sign and speed of all three, once it is under way, as the robot faces."""
    schedule = (Segment(command, WALK_S),)
    record = run_schedule(Walker(brisk), MujocoBackend(brisk.robot), schedule)
    assert record.fell_at_s is None
    begin, end = (round(t / CONTROL_PERIOD_S) for t in (RUN_IN_S, WALK_S))
    motion = own_motion(record.qpos)
    speeds = (motion[end] - motion[begin]) / (WALK_S - RUN_IN_S)
    asked = np.array([command.vx, command.vy, command.yaw_rate])
    # Of what was not asked for, less than a slow command.
    unasked = np.array([0.02, 0.02, 0.03])
    assert (np.abs(speeds - asked) <= np.maximum(0.25 * np.abs(asked), unasked)).all()


def test_it_stops_and_stays(brisk):
    schedule = (Segment(Command(0.3), 3.0),)
    record = run_schedule(Walker(brisk), MujocoBackend(brisk.robot), schedule)
    summary = summarise(brisk.robot, record, schedule)
    assert not summary.fell
    assert summary.stop_s < 3.0
    assert record.support[-1] == "stand"
    left, right = record.feet[-1]
    c, s = math.cos(left[2]), math.sin(left[2])
    x, y = right[:2] - left[:2]
    assert c * x + s * y == pytest.approx(0.0, abs=0.03)
    assert c * y - s * x == pytest.approx(-brisk.robot.reduced.hip_width, abs=0.03)
    assert summary.max_torque_nm <= brisk.robot.reduced.joint_torque_limit + 1e-9


def test_changes_of_command_bring_it_down_nowhere(brisk):
    commands = (
        Command(0.4),
        Command(-0.2),
        Command(0.0, 0.06),
        Command(0.0, -0.06),
        Command(0.2, 0.0, 0.1),
        Command(0.2, 0.0, -0.1),
        Command(),
        Command(0.4),
    )
    schedule = tuple(Segment(command, 1.7) for command in commands)
    walker = Walker(brisk)
    assert (
        run_unrecorded(walker, MujocoBackend(brisk.robot), schedule).fell_at_s is None
    )


def test_the_lead_of_the_servos_halves_the_tracking_error(brisk):
    """Standing: the joints are nearer to the reference than with bare targets."""
    off = []
    for leading in (True, False):
        walker, backend = Walker(brisk), MujocoBackend(brisk.robot)
        backend.connect(walker.stand)
        for _ in range(200):
            targets = walker.step(backend.read()).position
            backend.write(targets if leading else walker.stand)
        off.append(np.abs(backend.read().joint_position - walker.stand).max())
    assert off[0] < 0.5 * off[1]


def test_physics_measures_every_step_of_a_walk(brisk):
    """Costs, advance and the fall of linked gaits, the left foot first."""
    gait = brisk.gait_of
    ahead = int(np.argmax(brisk.poses.step_lengths * brisk.allowed_pairs[0]))
    walk = np.array([gait[0, ahead], gait[ahead, 1], gait[1, 0]])
    walked = walk_strides(brisk.poses, brisk.timing, walk, World())
    terms, advance, error, slip, fell_in = walked
    assert fell_in is None
    assert ((slip >= 0.0) & (slip < 0.1)).all()
    assert terms.shape == (3, 4)
    assert np.isfinite(terms).all()
    assert (error > 0.0).all()
    assert (terms >= 0.0).all()
    assert advance.sum() == pytest.approx(brisk.poses.step_lengths[ahead], abs=0.05)
    again = walk_strides(brisk.poses, brisk.timing, walk, World())
    np.testing.assert_array_equal(again.terms, terms)
    hard = World(push=(Push(80.0, 90.0, 1.0),))
    pushed = walk_strides(brisk.poses, brisk.timing, walk, hard)
    assert pushed.fell_in is not None
