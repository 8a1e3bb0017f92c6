"""The gate of a build: its rounds, as whoever watches sees them."""

from gaitchain.build.gate import gate
from gaitchain.build.workers import Crew
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
