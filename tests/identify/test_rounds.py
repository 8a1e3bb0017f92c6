"""A fit that is interrupted goes on with the round that it was in."""

from dataclasses import replace

import numpy as np
import pytest
from exercise_log import log_of
from servo_bench import RES

from gaitchain.build.jobs import keeping
from gaitchain.build.journal import Journal
from gaitchain.identify import hung_fit, stand_fit
from gaitchain.identify.fit import motion_fit
from gaitchain.identify.motion_fit import Belief, MotionFit
from gaitchain.identify.parameters import Parameters
from gaitchain.identify.rounds import Rounds
from gaitchain.live.exercise import Motion, exercise
from gaitchain.robot.identified import Identified

NUMBERS = tuple[np.ndarray, list[np.ndarray]]


def drawn_with(journal, count):
    """Return the draws of some rounds, how many were drawn anew, and the ticks."""
    ticks, anew = [], []
    rounds = Rounds(np.random.default_rng(1), lambda: ticks.append(1))

    def draw():
        anew.append(1)
        return rounds.rng.normal(size=3), [rounds.rng.normal(size=(2, 2))]

    with keeping(journal):
        found = [rounds.run(draw, NUMBERS) for _ in range(count)]
    return found, len(anew), len(ticks)


def test_rounds_that_are_kept_leave_the_same_draws_to_the_next(tmp_path):
    whole, anew, ticks = drawn_with(Journal(tmp_path / "whole", "a"), 5)
    assert (anew, ticks) == (5, 5)
    drawn_with(Journal(tmp_path / "part", "a"), 3)
    again, anew, ticks = drawn_with(Journal(tmp_path / "part", "a"), 5)
    assert (anew, ticks) == (2, 5)
    for (flat, (square,)), (other, (its,)) in zip(whole, again, strict=True):
        np.testing.assert_array_equal(flat, other)
        np.testing.assert_array_equal(square, its)


@pytest.mark.slow
@pytest.mark.parametrize("support", ["held", "standing"])
def test_an_interrupted_fit_ends_as_one_that_was_not(tmp_path, monkeypatch, support):
    few = {"SEARCHES": 2, "REPLAYS": 40, "SURE_REPLAYS": 76, "SMOOTH": 1}
    few |= {"CLIMBS": 2, "CROWD": 12}
    for module in hung_fit, stand_fit:
        for name in few.keys() & vars(module).keys():
            monkeypatch.setattr(module, name, few[name])
    (targets,) = (m.targets[300:400] for m in exercise(RES) if m.support == support)
    softer = replace(Identified.of_file(12), gain=np.full(12, 0.8))
    (part,) = log_of(Motion(support, targets), softer).parts
    parameters = Parameters(RES.legs.joint_names)
    motion = motion_fit(RES, part, parameters, 1)
    size = len(parameters.all)
    belief = Belief(np.zeros(size), 0.01 * parameters.correlation())
    made, replays = [], MotionFit._replays
    monkeypatch.setattr(
        MotionFit, "_replays", lambda fit, of: made.append(len(of)) or replays(fit, of)
    )

    def fitted(path):
        made.clear()
        ticks, rng = [], np.random.default_rng(0)
        with keeping(Journal(path, "a")):
            found = motion.fit(belief, rng, lambda: ticks.append(1))
        return found, sum(made), len(ticks)

    whole, replayed, ticks = fitted(tmp_path / "whole")
    (header, first, *_) = (tmp_path / "whole").read_bytes().splitlines(keepends=True)
    (tmp_path / "part").write_bytes(header + first)
    again, fewer, same = fitted(tmp_path / "part")
    assert replayed - fewer >= 40
    assert same == ticks
    for found, other in zip(whole, again, strict=True):
        np.testing.assert_array_equal(found, other)
