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
    assert " m/s 2 of 2 do; what broke first: " in said
    assert "(turn " in said
    assert "With one change hold, of 2: servos twice as stiff, 2" in said
    assert "friction" not in said.partition("With one change")[2]


@pytest.mark.slow
def test_where_no_change_helps_that_is_said(brisk):
    said = str(refusal(replace(brisk, steady=NOWHERE), crew()))
    assert " m/s 0 of 2 do; what broke first: no rule" in said
    assert "no more with servos half as stiff, " in said


@pytest.mark.slow
def test_other_gains_are_worth_a_build_where_walks_hold_with_them(brisk):
    worlds = crew(servo_gain=(0.2, 0.2), model_error=0.0)
    stiff = brisk.robot.with_servo_gain(10.0)  # ten times a fifth of half: all of it
    poses = replace(brisk.poses, robot=stiff)
    refused = refusal(replace(brisk, poses=poses, steady=NOWHERE), worlds)
    assert refused.servo_gain == 0.5


def test_without_a_step_from_a_stand_that_is_said(brisk):
    fallen = replace(brisk, pair_passes=np.zeros_like(brisk.pair_passes))
    refused = refusal(fallen, crew())
    assert refused.servo_gain is None
    said = str(refused)
    assert "no step from a stand that can be repeated" in said
    walked = int((brisk.pair_runs > 0).sum())
    assert f"fell in {walked} of {walked} different steps" in said
