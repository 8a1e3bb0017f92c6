"""The gate of a build: its rounds, as whoever watches sees them."""

from dataclasses import replace

import pytest
from planned_library import planned_res

from gaitchain.build.gate import gate
from gaitchain.build.trial import TrialRun
from gaitchain.build.workers import Crew
from gaitchain.gait.qualification import Qualification
from gaitchain.sim.world_range import WorldRange, trained

STAGE = "walking random schedules"


def test_each_round_is_a_stage_of_its_own(toy_library):
    """On servos too soft to stand: off a terminal each stage is told once."""
    stages = []
    worlds = WorldRange(servo_gain=(0.1, 0.1), model_error=0.0)
    crew = Crew(1, lambda stage, *numbers: stages.append(stage), worlds)
    gated = gate(toy_library, 1, 1.0, 0, crew)
    rounds = gated.qualification.gate.rounds
    assert rounds > 1
    told = list(dict.fromkeys(stages))
    assert len(told) >= rounds
    assert told[:2] == [STAGE, f"{STAGE}, round 2"]


def test_rounds_without_faults_say_so(toy_library):
    """They begin anew: else the same stages would come twice, and be told once."""
    stages = []
    worlds = WorldRange(**{**trained(balanced=True), "servo_gain": (0.1, 0.1)})
    crew = Crew(1, lambda stage, *numbers: stages.append(stage), worlds)
    gate(toy_library, 1, 1.0, 0, crew)
    told = list(dict.fromkeys(stages))
    assert told[0] == STAGE
    assert f"servos and sensors as in the file: {STAGE}" in told


@pytest.mark.parametrize(
    ("runs", "share", "need"),
    [(25, 0.28, 7), (100, 0.55, 55), (40, 0.975, 39), (20, 0.975, 20), (4, 1.1, 5)],
)
def test_a_round_needs_no_more_than_the_part_that_is_asked(
    runs, share, need, monkeypatch
):
    """As products of doubles 0.28 of 25 and 0.55 of 100 are more than 7 and 55."""

    def trials(trial, runs, seed, workers):
        for i in range(runs):
            yield TrialRun((seed, i), "", i >= held, None, 0.0, 0.0, (0, 0))

    monkeypatch.setattr("gaitchain.build.gate.run_trials", trials)
    draft = replace(planned_res(), qualification=Qualification())
    crew = Crew(1, lambda *news: None, WorldRange(model_error=0.0))
    for held in (need - 1, min(need, runs)):
        verdict = gate(draft, runs, share, 0, crew).qualification.gate
        assert verdict.passed is (held == need)
