"""What physics measured as a step's usual DCM error and slip is what walking shows."""

import statistics
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.analysis.walked_way import Way, Ways
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build import usual_errors
from gaitchain.build.rollout import WalkResult
from gaitchain.build.stride import STRIDE_BUILD
from gaitchain.build.usual_errors import (
    StepErrors,
    errors_of,
    learn_usual,
    learn_usual_off,
)
from gaitchain.build.workers import Crew
from gaitchain.chain.recovery import AHEAD, ERRORS
from gaitchain.gait.library_file import load_library
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command
from gaitchain.sim.world import World
from gaitchain.walker.gait import EndedStep
from gaitchain.walker.walker import Walker

LIBRARY = load_library(files("gaitchain") / "data" / "res.gait")
LEG = LIBRARY.robot.reduced.leg_length


NEAR = World(seed=5, model_error=0.1)


def walked_errors(command, world=NEAR, seconds=6.0, run_in=8):
    """Return each step's largest DCM error [m] and slip [rad], and the usual ones."""
    walker = Walker(LIBRARY)
    backend = MujocoBackend(LIBRARY.robot, world)
    backend.connect(walker.stand)
    walker.command(command)
    found = []
    for _ in range(round(seconds / walker.period_s)):
        steps = walker.gait.steps
        backend.write(walker.step(backend.read()).position)
        ended = walker.gait.ended
        if ended is not None and walker.gait.steps > steps:
            pair = ended.first, ended.last
            usual = LIBRARY.pair_error[pair], LIBRARY.pair_slip[pair]
            found.append((ended.error, ended.slip, *usual))
    assert not backend.fallen
    return np.array(found[run_in:]).T


def walked_in(worlds, command):
    """Return what `walked_errors` does of six worlds."""
    drawn = [worlds.draw(np.random.default_rng((5, i))) for i in range(6)]
    return np.hstack([walked_errors(command, world) for world in drawn])


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.5, 1.0, -1.0])
def test_an_undisturbed_walk_stays_below_the_usual_errors(part):
    """And not far below in the worlds from which they are, though many steps of the
    qualification speed up or turn."""
    low, high = LIBRARY.command_range.vx
    command = Command(part * high if part > 0 else -part * low)
    worst, slip, usual, usual_slip = walked_errors(command)
    assert np.mean(worst <= usual) >= 0.95
    assert (slip < usual_slip + ERRORS[0]).all()
    training = STRIDE_BUILD.training_worlds(LIBRARY.poses, 150.0).but(push_ns=0.0)
    worst, _, usual, _ = walked_in(training.sound(), command)
    assert np.mean(worst <= usual) >= 0.9
    assert np.quantile(worst / usual, 0.9) > 0.65, "what 19 of 20 steps stay below"
    worst, slip, usual, usual_slip = walked_in(training, command)
    off = np.maximum((worst - usual) / LEG, AHEAD * (slip - usual_slip))
    assert np.mean(off <= 0.0) < 0.9, "faults make errors that are not usual"
    disturbed = off >= LIBRARY.usual_off + ERRORS[0]
    assert np.mean(disturbed) <= 0.05


def test_feet_slip_more_than_usual_on_a_slippery_floor():
    command = Command(LIBRARY.command_range.vx[1])
    worlds = [replace(NEAR, friction=0.4, seed=seed) for seed in range(5, 9)]
    _, slip, _, usual = np.hstack([walked_errors(command, w) for w in worlds])
    assert np.mean(slip > usual) > 0.5


def test_long_steps_have_larger_errors():
    lengths = LIBRARY.poses.strides[:, 0]
    straight = np.flatnonzero((LIBRARY.poses.strides[:, 1:] == 0.0).all(axis=1))
    last = max(straight, key=lambda j: lengths[j])
    short = min(straight[1:], key=lambda j: abs(lengths[j]))
    errors = LIBRARY.pair_error
    assert errors[last, last] > 1.5 * errors[short, short]
    assert (errors[1:, 1:] > 0.005 * LEG).all()
    assert (errors < 0.5 * LEG).all()


def test_usual_errors_are_a_quantile_for_each_pair_and_pushes_do_not_count():
    """Known distributions: the median doubles with the last pose, the spread, too."""
    rng, pairs = np.random.default_rng(3), (4, 3)
    median = 0.02 * 2.0 ** np.arange(3) * np.ones((4, 1))
    spread = np.array([0.1, 0.2, 0.4]) * np.ones((4, 1))
    plan, results = [], []
    for i in range(400):
        steps = rng.integers((pairs[0], 1, 1, pairs[1]), size=(12, 4))
        first, last = steps[:, 0], steps[:, 3]
        noise = rng.normal(size=12) * spread[first, last]
        pushed = i % 2 == 0
        error = median[first, last] * np.exp(noise) * (10.0 if pushed else 1.0)
        error[-1] = np.nan  # fell
        plan.append(steps)
        results.append(WalkResult(error, error, error, 2.0 * error, True, pushed))
    usual, slips = errors_of(plan, results).usual(pairs)
    np.testing.assert_allclose(usual, median * np.exp(1.645 * spread), rtol=0.12)
    np.testing.assert_allclose(slips, 2.0 * usual)


def test_what_robots_with_faults_are_off_by_a_known_law(monkeypatch):
    """Normal, of the same spread in all, about a middle of each robot's own."""
    rng, spread = np.random.default_rng(4), 0.1
    middles = rng.choice([0.0, 0.04], size=200)
    walks = []
    for middle in middles:
        off = middle + spread * rng.normal(size=120)
        error = LIBRARY.pair_error[1, 1] + LEG * off
        ended = [EndedStep(1, 1, each, 0.0) for each in error.tolist()]
        walks.append(usual_errors._Steps(ended))
    fallen = usual_errors._Steps([])
    monkeypatch.setattr(usual_errors, "_walk_on", lambda *_: [fallen, *walks])
    crew = Crew(1, lambda *_: None)
    found = learn_usual_off(LIBRARY, rng, crew)
    # The 0.95 quantile of both kinds together; the 0.9 quantile beyond each one's own.
    law, half = statistics.NormalDist(), 0.5
    at = (found.usual_off - np.unique(middles)) / spread
    assert half * sum(map(law.cdf, at)) == pytest.approx(0.95, abs=0.005)
    own = law.inv_cdf(0.9) - law.inv_cdf(0.75)
    assert found.usual_spread == pytest.approx(spread * own, rel=0.1)
    monkeypatch.setattr(usual_errors, "_walk_on", lambda *_: [fallen])
    assert learn_usual_off(found, rng, crew) is found, "who fell tells nothing"


@pytest.mark.slow
def test_a_walk_that_keeps_on_teaches_what_its_steps_are_off(monkeypatch):
    """Who covered all pairs without an error learns it where a walk repeats them."""
    monkeypatch.setattr(usual_errors, "_RUNS", 2)  # of each command
    pairs = np.argwhere(LIBRARY.allowed_pairs)
    none = np.full(len(pairs), 1e-3)
    covered = StepErrors(pairs, none, none)
    error, slip = covered.usual(LIBRARY.pair_error.shape)
    before = replace(LIBRARY, pair_error=error, pair_slip=slip)
    worlds = STRIDE_BUILD.training_worlds(LIBRARY.poses, 150.0)
    crew = Crew(2, lambda *_: None, worlds)
    after = learn_usual(before, covered, np.random.default_rng(1), crew)
    ahead = (Segment(Command(LIBRARY.command_range.vx[1]), 6.0),)
    backend = MujocoBackend(LIBRARY.robot, NEAR)
    steps = run_unrecorded(Walker(after), backend, ahead).ended[8:]
    assert len(steps) > 5
    for first, last, off, turned in steps:
        assert error[first, last] < off <= after.pair_error[first, last]
        assert slip[first, last] < turned <= after.pair_slip[first, last]


def test_walks_that_turn_teach_nothing_of_what_feet_slide(monkeypatch):
    """A middle between the feet that is measured ahead of where it is turns with it."""

    def walk_on(stage, walk, jobs, crew):
        return [walked_with(segment.command) for _, segment, _ in jobs]

    monkeypatch.setattr(usual_errors, "_walk_on", walk_on)
    none = np.zeros((0, 2), int), np.zeros(0), np.zeros(0)
    crew = Crew(1, lambda *_: None)
    found = learn_usual(LIBRARY, StepErrors(*none), np.random.default_rng(0), crew)
    for slide in found.slides:
        assert slide.each == pytest.approx(1e-3, rel=1e-3)


def walked_with(command):
    """Return a walk whose feet slide by 1 mm a step, and seem to by 5 as it turns."""
    told = 5.0 * command.vx, 5.0 * command.vy
    slid = 18 * (5e-3 if command.yaw_rate else 1e-3)
    way = Way(18, told, (told[0] + slid, told[1]))
    return usual_errors._Steps([EndedStep(1, 1, 0.01, 0.01)], Ways(way, way))


def test_walks_that_all_were_pushed_teach_no_usual_error():
    error = np.array([0.1])
    pushed = WalkResult(error, error, error, error, fell=False, pushed=True)
    found = errors_of([np.zeros((1, 4), int)], [pushed])
    assert not np.any(found.usual((2, 2)))
