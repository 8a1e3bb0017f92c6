"""Rolls of a toy robot in physics."""

import numpy as np
import pytest
from lying_robot import keeps_its_limits

from gaitchain.gait.get_up import TimedPose, Way
from gaitchain.getup.fallen_robot import FallenRobot, Subject, fallen_robot
from gaitchain.getup.rolling import ENOUGH, OTHERS, RollSearch, roll_of, rolls_over


@pytest.fixture(scope="module")
def subject(toy_path, toy_library):
    return Subject(toy_path, toy_library)


@pytest.mark.parametrize(("side", "ahead"), [("front", 1.0), ("back", -1.0)])
def test_rolls_end_on_the_other_side(subject, side, ahead):
    search, robot = RollSearch(subject, side, 1, 1), fallen_robot(subject)
    found = [roll for _ in range(3) for roll in search._rolls()]
    assert found
    ends = []
    for roll in found:  # from where none was tried
        robot.lie(side, (3, 1))
        assert -ahead * robot.look().ahead > 0.8
        ends.append(ahead * robot.move(Way(roll, 0, 1))[-1].ahead)
    assert np.median(ends) > 0.8
    asleep = (TimedPose(1.0, tuple(robot.stand)),)
    assert not rolls_over(subject, side, asleep, ((3, 1),))


def test_a_roll_keeps_the_limits_and_ends_straight(toy_path, toy_library):
    robot = FallenRobot(toy_path, toy_library)
    moved = {row for pair in robot.pairs for row in (pair.left, pair.right)}
    joints = len(moved.union(robot.leg_rows))
    numbers = np.random.default_rng(2).normal(0.0, 3.0, (3, joints))
    assert keeps_its_limits(robot, roll_of(robot, numbers))


def test_the_way_that_stands_most_often_is_taken(subject, monkeypatch):
    told = []
    search = RollSearch(subject, "front", 1, 1)
    rolls = [(TimedPose(float(number), (0.0,)),) for number in (1, 2, 3)]
    stood = {1.0: 5, 2.0: ENOUGH, 3.0: OTHERS}
    monkeypatch.setattr(search, "_rolls", lambda: rolls)
    monkeypatch.setattr(search, "_stood", lambda poses: stood[poses[0].seconds])
    rest = Way((TimedPose(9.0, (1.0,)),), OTHERS, OTHERS)
    found = search.run(rest, lambda *words: told.append(words))
    assert found == Way((*rolls[1], *rest.poses), ENOUGH, OTHERS)
    assert told == [("over from the front", 0, 12), ("over from the front", 12, 12)]
    stood.update({2.0: 1, 3.0: 0})
    assert search.run(rest, lambda *_: None).stood == 5
