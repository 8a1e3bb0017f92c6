"""Trials: the same for any workers, each run repeatable, worlds that vary."""

from dataclasses import replace

import numpy as np
import pytest

from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.analysis.walk_metrics import summarise
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build import trial
from gaitchain.build.rollout import WorldRange
from gaitchain.build.stride import MODEL_ERROR
from gaitchain.build.trial import Trial, draw_world, run_trials
from gaitchain.build.workers import available_cores
from gaitchain.errors import LibraryError
from gaitchain.gait.qualification import Qualification
from gaitchain.gait.schedule import format_schedule, parse_schedule, random_steps
from gaitchain.walker.walker import Walker

pytestmark = pytest.mark.slow

NOMINAL = WorldRange(friction=(0.8, 0.8), servo_gain=(1.0, 1.0), mass=(1.0, 1.0))


@pytest.fixture(scope="module")
def runs(library):
    return list(run_trials(Trial(library), 3, 4, 1))


def test_any_number_of_workers_gives_the_same_runs(library, runs):
    assert list(run_trials(Trial(library), 3, 4, 2)) == runs
    assert list(run_trials(Trial(library), 1, 4, 1)) == runs[:1]


def test_runs_are_numbered_and_differ(library, runs):
    assert [run.seed for run in runs] == [(4, 0), (4, 1), (4, 2)]
    assert len({run.schedule for run in runs}) == 3
    other = next(iter(run_trials(Trial(library), 1, 5, 1)))
    assert other.schedule != runs[0].schedule


def test_schedules_are_within_the_librarys_range(library, runs):
    low, high = library.speed_range
    for run in runs:
        for segment in parse_schedule(run.schedule):
            speed = segment.command.vx
            assert speed == 0.0 or low - 1e-3 <= speed <= high + 1e-3


def test_the_seed_repeats_a_single_run(library, runs):
    """Schedule, then world, from the run's own seed."""
    run = runs[1]
    rng = np.random.default_rng(run.seed)
    schedule = random_steps(rng, *library.speed_range)
    world = WorldRange().draw(rng)
    backend = MujocoBackend(library.robot, world)
    record = run_schedule(Walker(library), backend, schedule)
    summary = summarise(library.robot, record, schedule)
    assert run.schedule == format_schedule(schedule)
    assert run.fell == summary.fell
    assert run.cause == summary.cause
    assert run.distance_m == summary.distance_m
    assert run.speed_error_mps == summary.speed_error_mps


def test_worlds_vary_as_asked(library, runs):
    (nominal,) = run_trials(Trial(library, worlds=NOMINAL), 1, 4, 1)
    assert nominal.schedule == runs[0].schedule
    assert nominal.distance_m != runs[0].distance_m


def test_the_policy_is_passed_on(library, runs, monkeypatch):
    asked = []

    def noted(*given, **options):
        asked.append(options.get("policy", given[1] if len(given) > 1 else None))
        return Walker(*given, **options)

    monkeypatch.setattr(trial, "Walker", noted)
    (run,) = run_trials(Trial(library, policy="greedy"), 1, 4, 1)
    assert run.schedule == runs[0].schedule
    assert asked == ["greedy"]


def test_weak_servos_fall_with_a_cause(library):
    weak = NOMINAL.but(servo_gain=(0.1, 0.1))
    (run,) = run_trials(Trial(library, worlds=weak), 1, 4, 1)
    assert run.fell
    assert run.cause.startswith("fell ")


def test_an_unqualified_library_is_tried_only_on_request(library):
    draft = replace(library, qualification=Qualification())
    with pytest.raises(LibraryError, match="not qualified"):
        list(run_trials(Trial(draft), 1, 4, 1))
    (run,) = run_trials(Trial(draft, require_qualified=False), 1, 4, 1)
    assert run.seed == (4, 0)


def test_available_cores():
    assert available_cores() >= 1


def test_a_given_schedule_is_walked_in_every_run(library):
    speed = round(sum(library.speed_range) / 2.0, 3)
    schedule = parse_schedule(f"{speed}@1")
    walked = list(run_trials(Trial(library, schedule=schedule), 2, 4, 1))
    assert {run.schedule for run in walked} == {format_schedule(schedule)}
    assert walked[0].world.friction != walked[1].world.friction


def test_given_numbers_hold_in_every_world(library, runs):
    """What is not given stays as it was drawn."""
    fixed = {"friction": 0.9, "model_error": 0.05}
    walked = list(run_trials(Trial(library, fixed=fixed), 2, 4, 1))
    for run, before in zip(walked, runs, strict=False):
        assert run.schedule == before.schedule
        assert run.world == replace(before.world, **fixed)
        assert run.distance_m != before.distance_m


def test_the_world_is_drawn_from_the_runs_own_seed(library, runs):
    seeds = [run.world.seed for run in runs]
    assert len(set(seeds)) == 3
    for run in runs:
        rng = np.random.default_rng(run.seed)
        random_steps(rng, *library.speed_range)
        assert draw_world(library, run.seed, rng) == run.world
    assert all(0.6 <= run.world.friction <= 1.0 for run in runs)
    assert {run.world.model_error for run in runs} == {0.0}


def test_strides_have_model_errors_and_nominal_servos(brisk):
    worlds = [draw_world(brisk, (3, i), np.random.default_rng(i)) for i in range(5)]
    assert {w.model_error for w in worlds} == {MODEL_ERROR}
    assert {(w.servo_gain, w.mass, w.push) for w in worlds} == {(1.0, 1.0, ())}
    assert len({w.friction for w in worlds}) == len({w.seed for w in worlds}) == 5


def test_the_figures_are_those_of_the_walk(library, runs):
    run = runs[0]
    schedule = parse_schedule(run.schedule)
    record = run_schedule(
        Walker(library), MujocoBackend(library.robot, run.world), schedule
    )
    summary = summarise(library.robot, record, schedule)
    for name in ("speed_mps", "yaw_drift_deg", "lateral_drift_m", "stop_s"):
        assert getattr(run, name) == getattr(summary, name)
    assert run.zmp_rms_m is None  # the paper's walks plan none


@pytest.mark.parametrize("text", ["0.3,0,0@4", None])
def test_without_all_figures_the_walk_and_the_others_are_the_same(brisk, text):
    schedule = parse_schedule(text) if text else None
    trial = Trial(brisk, schedule=schedule, seconds=6.0, require_qualified=False)
    full = list(run_trials(trial, 2, 7, 1))
    lean = list(run_trials(replace(trial, figures=False), 2, 7, 1))
    assert [replace(run, stop_s=None, zmp_rms_m=None) for run in full] == lean
    assert any(run.speed_mps for run in lean)


def test_steps_without_all_figures_fall_as_with_them(library):
    trial = Trial(library, fixed={"servo_gain": 0.3})
    full = list(run_trials(trial, 2, 4, 1))
    lean = list(run_trials(replace(trial, figures=False), 2, 4, 1))
    assert [run.last_step for run in lean] == [run.last_step for run in full]
    assert [run.distance_m for run in lean] == [run.distance_m for run in full]
    assert all(run.cause.startswith("fell at ") for run in lean)
