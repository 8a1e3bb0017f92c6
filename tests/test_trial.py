"""Trials: the same for any workers, each run repeatable, worlds that vary."""

from dataclasses import replace

import numpy as np
import pytest

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.control import run_schedule
from gaitchain.errors import LibraryError
from gaitchain.measure import summarise
from gaitchain.physics import WorldRange
from gaitchain.schedule import format_schedule, parse_schedule, random_schedule
from gaitchain.trial import available_cores, run_trials
from gaitchain.walker import Walker

NOMINAL = WorldRange(friction=(0.8, 0.8), servo_gain=(1.0, 1.0), mass=(1.0, 1.0))


@pytest.fixture(scope="module")
def runs(library):
    return list(run_trials(library, 3, seed=4, workers=1))


def test_any_number_of_workers_gives_the_same_runs(library, runs):
    assert list(run_trials(library, 3, seed=4, workers=2)) == runs
    assert list(run_trials(library, 2, seed=4, workers=1)) == runs[:2]


def test_runs_are_numbered_and_differ(library, runs):
    assert [run.seed for run in runs] == [(4, 0), (4, 1), (4, 2)]
    assert len({run.schedule for run in runs}) == 3
    other = next(iter(run_trials(library, 1, seed=5, workers=1)))
    assert other.schedule != runs[0].schedule


def test_schedules_are_within_the_librarys_range(library, runs):
    low, high = library.speed_range
    for run in runs:
        for segment in parse_schedule(run.schedule):
            speed = segment.speed_mps
            assert speed == 0.0 or low - 1e-3 <= speed <= high + 1e-3


def test_the_seed_repeats_a_single_run(library, runs):
    """Schedule, then world, from the run's own seed."""
    run = runs[1]
    rng = np.random.default_rng(run.seed)
    schedule = random_schedule(rng, *library.speed_range)
    world = WorldRange().draw(rng)
    backend = MujocoBackend(library.biped, world)
    record = run_schedule(Walker(library), backend, schedule)
    summary = summarise(library.biped, record, schedule)
    assert run.schedule == format_schedule(schedule)
    assert run.fell == summary.fell
    assert run.cause == summary.cause
    assert run.distance_m == summary.distance_m
    assert run.speed_error_mps == pytest.approx(summary.speed_error_mps, nan_ok=True)


def test_worlds_vary_as_asked(library, runs):
    nominal = list(run_trials(library, 2, seed=4, workers=1, worlds=NOMINAL))
    assert [run.schedule for run in nominal] == [run.schedule for run in runs[:2]]
    assert [run.distance_m for run in nominal] != [run.distance_m for run in runs[:2]]


def test_the_policy_is_passed_on(library, runs):
    (run,) = run_trials(library, 1, seed=4, workers=1, policy="greedy")
    assert run.schedule == runs[0].schedule


def test_weak_servos_fall_with_a_cause(library):
    weak = replace(NOMINAL, servo_gain=(0.1, 0.1))
    (run,) = run_trials(library, 1, seed=4, workers=1, worlds=weak)
    assert run.fell
    assert run.cause.startswith("fell ")


def test_an_unqualified_library_is_tried_only_on_request(library):
    draft = replace(library, qualification={})
    with pytest.raises(LibraryError, match="not qualified"):
        list(run_trials(draft, 1, seed=4, workers=1))
    (run,) = run_trials(draft, 1, seed=4, workers=1, require_qualified=False)
    assert run.seed == (4, 0)


def test_available_cores():
    assert available_cores() >= 1
