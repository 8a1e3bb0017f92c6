"""A robot that holds no walk is told why, and which change would help."""

from dataclasses import replace

import numpy as np
import pytest

from gaitchain.build import no_walk
from gaitchain.build.no_walk import NoWalkError, check_walks
from gaitchain.build.rollout import WorldRange
from gaitchain.build.workers import Crew
from gaitchain.gait.command_range import CommandRange

NOWHERE = CommandRange((0.0, 0.0))


def crew(**numbers):
    return Crew(1, lambda *news: None, WorldRange(**numbers))


@pytest.fixture(autouse=True)
def few_walks(monkeypatch):
    monkeypatch.setattr(no_walk, "_RUNS", 2)
    monkeypatch.setattr(no_walk, "_SECONDS", 3.0)


def test_who_walks_is_let_pass(brisk):
    check_walks(brisk, crew())


def refusal(library, crew):
    with pytest.raises(NoWalkError) as refused:
        check_walks(library, crew)
    return refused.value


@pytest.mark.slow
def test_soft_servos_are_found(brisk):
    """A seventh of their stiffness lets RES fall; with twice that, it walks."""
    worlds = crew(servo_gain=(0.15, 0.15), model_error=0.0)
    refused = refusal(replace(brisk, steady=NOWHERE, usual_off=0.0), worlds)
    said = str(refused)
    assert said.startswith("Robo-Erectus Senior holds no walk: even at ")
    assert " m/s 2 of 2 walks fall; what broke first: " in said
    assert "(try " in said
    assert "With one change hold, of 2: servos twice as stiff, 2" in said
    assert "friction" not in said.partition("With one change")[2]


@pytest.mark.slow
def test_where_no_change_helps_that_is_said(brisk):
    said = str(refusal(replace(brisk, steady=NOWHERE), crew()))
    assert " m/s 0 of 2 walks fall; what broke first: no rule" in said
    assert "no more with servos half as stiff, " in said


@pytest.mark.slow
def test_other_gains_are_worth_a_build_where_walks_hold_with_them(brisk):
    worlds = crew(servo_gain=(0.2, 0.2), model_error=0.0)
    stiff = brisk.robot.with_servo_gain(10.0)  # ten times a fifth of half: all of it
    poses = replace(brisk.poses, robot=stiff)
    refused = refusal(replace(brisk, poses=poses, steady=NOWHERE), worlds)
    assert refused.servo_gain == 0.5


def fallen(library, gain=1.0):
    """A library that physics passed no step of; its servos differ from the file's."""
    robot = library.robot.with_servo_gain(gain)
    none = np.zeros_like(library.pair_passes)
    poses = replace(library.poses, robot=robot)
    return replace(library, poses=poses, pair_passes=none)


@pytest.mark.slow
def test_without_a_step_from_a_stand_walks_say_why(toy_library):
    """They make the steps that fell, on a hundredth of the stiffness."""
    worlds = crew(servo_gain=(0.01, 0.01), model_error=0.0)
    refused = refusal(fallen(toy_library), worlds)
    said = str(refused)
    walked = int((toy_library.pair_runs > 0).sum())
    assert "no step from a stand that can be repeated" in said
    assert f"fell in {walked} of {walked} different steps. At " in said
    assert " m/s 2 of 2 walks fall; what broke first: " in said
    assert "With one change hold, of 2: servos twice as stiff, 2" in said
    assert refused.servo_gain is not None, "worth another build"


@pytest.mark.slow
def test_gains_are_told_as_parts_of_the_files(toy_library):
    """The servos are twice as stiff already."""
    worlds = crew(servo_gain=(0.01, 0.01), model_error=0.0)
    said = str(refusal(fallen(toy_library, gain=2.0), worlds))
    assert said.startswith(
        "toy holds no walk with servos 2 times as stiff as in its file: physics passed"
    )
    assert "of 2: servos 4 times as stiff as in its file, 2" in said


def test_without_any_step_ahead_no_walk_is_made(toy_library):
    never = replace(fallen(toy_library), pair_runs=np.zeros_like(toy_library.pair_runs))
    refused = refusal(never, crew())
    assert refused.servo_gain is None
    assert "it has no steps ahead of which walks could be made" in str(refused)
