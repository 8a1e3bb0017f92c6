"""The loop: timed commands come when they are due, and the robot stops after them."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gaitchain.analysis.fall_cause import explain
from gaitchain.analysis.record_file import load_record, save_record
from gaitchain.analysis.rules import Rule
from gaitchain.analysis.simulated_walk import run_schedule, run_unrecorded
from gaitchain.analysis.walk_metrics import summarise
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

STEP = 300  # ticks of a step of the paper's


class Told(Walker):
    """A walker that notes when it was told what."""

    def __init__(self, library):
        self.said, self.now = [], 0.0
        super().__init__(library)

    def command(self, command):
        self.said.append((round(self.now, 6), command))
        return super().command(command)

    def step(self, sensors):
        # The loop has let the robot settle for a second.
        self.now = sensors.time - 1.0 + 0.01
        return super().step(sensors)


@pytest.fixture(scope="module")
def speed(library):
    return round(sum(library.speed_range) / 2.0, 3)


@pytest.fixture(scope="module")
def walked(library, speed):
    walker = Told(library)
    schedule = (
        Segment(Command(speed / 2.0), 2.0),
        Segment(Command(speed), 4.5),
    )
    return run_schedule(walker, MujocoBackend(library.robot), schedule), walker


def test_commands_come_when_they_are_due(walked, speed):
    record, walker = walked
    expected = ((0.0, Command(speed / 2.0)), (2.0, Command(speed)), (6.5, Command()))
    assert record.commands == expected
    assert tuple(walker.said) == expected


def test_the_walk_ends_standing_for_a_second(walked):
    record, walker = walked
    assert record.fell_at_s is None
    assert walker.standing
    *_, end = record.step_ticks
    assert len(record.time_s) == end + 100
    assert set(record.support[end:]) == {"stand"}
    assert "stand" not in record.support[:end]


def test_steps_begin_where_the_walker_begins_them(walked):
    """A step of the paper's takes 3 s; the stop comes in the third one."""
    record, walker = walked
    assert [b - a for a, b in pairwise(record.step_ticks)] == [STEP] * walker.gait.steps
    assert record.step_ticks[0] == 0
    for tick in record.step_ticks[:-1]:
        assert record.key_pose[tick, 0] == 1


def test_the_record_keeps_its_commands(walked, tmp_path):
    record, _ = walked
    save_record(record, tmp_path / "walk.rec")
    assert load_record(tmp_path / "walk.rec").commands == record.commands


def test_a_robot_that_does_not_stop_is_not_waited_for(library, speed):
    """Three steps of 3 s, and the second in which it should stand."""

    class Deaf(Walker):
        def command(self, command):
            return super().command(Command(speed))

    schedule = (Segment(Command(speed), 1.0),)
    record = run_schedule(Deaf(library), MujocoBackend(library.robot), schedule)
    assert len(record.time_s) == 100 + 3 * STEP + 100
    assert record.step_ticks[-1] == len(record.time_s)


def test_a_fall_ends_the_record(library, speed):
    world = World(push=(Push(60.0, 90.0, at_s=1.0),))
    schedule = (Segment(Command(speed), 4.0), Segment(Command(0.0), 4.0))
    record = run_schedule(
        Walker(library), MujocoBackend(library.robot, world), schedule
    )
    assert record.fell_at_s == pytest.approx(0.01 * len(record.time_s))
    assert 1.0 < record.fell_at_s < 4.0
    assert record.commands == ((0.0, Command(speed)),)
    assert record.events == ((1.0, "a push of 60 N s to 90 deg"),)
    assert record.step_ticks[-1] == len(record.time_s)
    fell = run_unrecorded(
        Walker(library), MujocoBackend(library.robot, world), schedule
    ).fell_at_s
    assert fell == record.fell_at_s


def test_a_fall_while_it_settles_has_its_own_cause(tmp_path):
    """It stands for two seconds first; with such weak servos its knees give way."""
    walker = Walker(load_library(shipped_library()))
    backend = MujocoBackend(walker.library.robot, World(torque_limit=0.05))
    schedule = (Segment(Command(0.2), 0.5),)
    record = run_schedule(walker, backend, schedule)
    assert record.time_s[0] == -2.0
    assert record.fell_at_s == pytest.approx(record.time_s[-1] + 0.01)
    assert record.fell_at_s < 0.0
    assert record.step_ticks == (len(record.time_s),)
    save_record(record, tmp_path / "walk.rec")
    found = explain(walker.library.robot, load_record(tmp_path / "walk.rec"))
    assert found.sentence.startswith("The robot fell while it settled, ")
    assert found.cause.rule is Rule.TORQUE
    assert "slower" not in found.cause.advice
    summary = summarise(walker.library.robot, record, schedule)
    assert "standing after" not in summary.cause
    assert math.isnan(summary.segments[0].achieved_mps)


def test_a_fall_before_steps_that_are_counted(library, speed):
    backend = MujocoBackend(library.robot, World(torque_limit=0.01))
    schedule = (Segment(Command(speed), steps=2),)
    record = run_schedule(Walker(library), backend, schedule)
    assert record.fell_at_s < 0.0
    assert record.step_ticks[0] == len(record.time_s)
    summary = summarise(library.robot, record, schedule)
    assert summary.cause.startswith("fell")
    assert "while it settled" in summary.cause


def test_without_a_record_the_walk_is_the_same(library, walked, speed):
    """It ends with the schedule: no stop, no settling."""
    backend = MujocoBackend(library.robot)
    schedule = (
        Segment(Command(speed / 2.0), 2.0),
        Segment(Command(speed), 1.5),
    )
    assert run_unrecorded(Walker(library), backend, schedule).fell_at_s is None
    np.testing.assert_array_equal(backend.data.qpos, walked[0].qpos[350])


def test_each_step_tells_what_it_was_off_when_the_next_one_begins():
    shipped = load_library(shipped_library())
    schedule = (Segment(Command(shipped.speed_range[1]), 6.0),)
    pushed = World(push=(Push(6.0, 90.0, at_s=4.0),))
    calm, hit = (
        run_unrecorded(Walker(shipped), MujocoBackend(shipped.robot, world), schedule)
        for world in (World(), pushed)
    )
    assert [step[:2] for step in calm.ended] == list(calm.steps[:-1])
    most, of_hit = (max(step.error for step in w.ended) for w in (calm, hit))
    assert of_hit > 1.5 * most > 0.0


def test_the_papers_schedules_say_their_commands_too(library, speed):
    schedule = (
        Segment(Command(speed), steps=1),
        Segment(Command(speed), steps=2),
        Segment(Command(0.0), steps=1),
    )
    record = run_schedule(Walker(library), MujocoBackend(library.robot), schedule)
    assert record.commands == ((0.0, Command(speed)), (9.0, Command()))
    assert record.step_ticks == (0, STEP, 2 * STEP, 3 * STEP, 4 * STEP)


class Counted(Walker):
    """A walker that notes in which row it began each step."""

    def __init__(self, library):
        self.rows, self.began = 0, []
        super().__init__(library)

    def step(self, sensors):
        before, targets = self.gait.steps, super().step(sensors)
        if self.gait.steps > before:
            self.began.append(self.rows)
        self.rows += 1
        return targets


@pytest.mark.parametrize("step_s", [2.9966, 3.005])
def test_steps_begin_when_the_walker_begins_them_though_they_split_a_period(
    library, speed, step_s
):
    timing = replace(library.timing, step=step_s)
    walker = Counted(replace(library, timing=timing))
    schedule = (Segment(Command(speed), steps=5), Segment(Command(0.0), steps=1))
    record = run_schedule(walker, MujocoBackend(library.robot), schedule)
    settled = walker.rows - len(record.time_s)
    began = [row - settled for row in walker.began]
    assert len(began) == 5
    assert list(record.step_ticks[: len(began)]) == began
