"""The grid: cells, covers, what is taken out."""

from dataclasses import replace

import numpy as np
import pytest

from gaitchain.build.grid import (
    DYNAMIC_GRID,
    EVERY_STEP,
    PAPER_GRID,
    Grid,
    GridRun,
    Levels,
    grid_world,
    plan_jobs,
)
from gaitchain.build.qualify import _ROUNDS, default_grid, qualify_grid
from gaitchain.build.trial import draw_world
from gaitchain.build.workers import Crew
from gaitchain.cli.libraries import shipped_library
from gaitchain.errors import LibraryError
from gaitchain.gait.library_file import library_bytes, load_library, save_library
from gaitchain.gait.qualification import GridVerdict
from gaitchain.gait.schedule import check_schedule, counts_steps
from gaitchain.proof import split_walks
from gaitchain.proof.proof_walks import BANK
from gaitchain.sim.disturbance import Exposure
from gaitchain.sim.world import DISTURBANCES
from gaitchain.walker.policy_table import safe_pairs
from gaitchain.walker.walker import Walker

pytestmark = pytest.mark.slow

TINY = Grid((), corners=False)
MILD = Grid((Levels("friction", (0.5,)),), corners=False)
SHIPPED = load_library(shipped_library()).as_built()


def tell(stage, done, total):
    pass


def test_one_disturbance_at_a_time_and_two_corners():
    cells = DYNAMIC_GRID.cells()
    assert cells[0].kind == "nominal" and cells[0].required
    assert len({cell.name for cell in cells}) == len(cells)
    for cell in cells[1:-2]:
        # Stiction is a part of dry friction: without it there is none.
        needed = ["dry_friction"] if cell.kind == "stiction" else []
        assert [kind for kind, _ in cell.numbers] == [*needed, cell.kind]
    for cell in cells[-2:]:
        assert cell.kind == "corner" and not cell.required
        assert {kind for kind, _ in cell.numbers} == {
            lv.kind for lv in DYNAMIC_GRID.levels if lv.required
        }
    by_name = {cell.name: cell for cell in cells}
    assert by_name["bus delay 10 ms"].required
    assert not by_name["friction 0.2"].required
    assert not by_name["contact time 5 ms"].required
    assert by_name["slope +1 deg"].numbers == (("slope_deg", 1.0),)
    assert by_name["stiction 60 %"].numbers == (
        *(("dry_friction", 0.02), ("stiction", 0.6)),
    )


def test_what_disturbs_servos_or_sensors_is_trained_and_required():
    """At some mild level, every one of them (`World`)."""
    faults = {name: d.strides for name, d in DISTURBANCES.items() if d.fault}
    assert len(faults) > 15
    for name, exposure in faults.items():
        assert exposure.trained is not None, name
        assert exposure.required, name


def test_of_walks_trained_as_in_the_paper_no_fault_is_required():
    """Each is walked, at its mild level, beside what it needs."""
    faults = {name for name, d in DISTURBANCES.items() if d.fault} - {"delay_s"}
    cells = [cell for cell in PAPER_GRID.cells() if cell.kind in faults]
    assert len(cells) > 15
    for cell in cells:
        if DISTURBANCES[cell.kind].key_poses == Exposure():
            assert not cell.required
            assert cell.numbers[-1][1] in DISTURBANCES[cell.kind].strides.required
    (stiction,) = (cell for cell in cells if cell.kind == "stiction")
    assert [kind for kind, _ in stiction.numbers] == ["dry_friction", "stiction"]
    brief = {cell.kind for cell in PAPER_GRID.quick().cells()}
    assert brief & faults <= {"noise", "servo_gain", "torque_limit"}


@pytest.mark.parametrize("grid", [DYNAMIC_GRID, PAPER_GRID])
def test_every_disturbance_is_in_the_grid(grid):
    kinds = {"friction", "servo_gain", "torque_limit", "mass", "model_error", "delay_s"}
    kinds |= {"noise", "blocks_m", "slope_deg", "push", "gain_error", "backlash_deg"}
    kinds |= {"dry_friction", "viscous_friction", "no_load", "sag", "jitter_s"}
    kinds |= {"bus_hz", "target_step_deg", "encoder_step_deg", "imu_scale"}
    kinds |= {"encoder_offset_deg", "imu_tilt_deg", "imu_delay_s", "stiction"}
    kinds |= {"imu_offset_m", "gyro_bias_deg_s", "accelerometer_bias"}
    if grid is DYNAMIC_GRID:
        kinds |= {"contact_s", "payload", "punches", "com_m"}
    assert {cell.kind for cell in grid.cells()} == kinds | {"nominal", "corner"}


def test_commands_are_within_the_librarys_range(library, brisk):
    for group, schedule in library.family.courses(library.command_range):
        assert group != EVERY_STEP
        check_schedule(schedule, library.command_range)
    groups = {}
    for group, schedule in brisk.family.courses(brisk.command_range):
        assert not counts_steps(schedule)
        check_schedule(schedule, brisk.command_range)
        groups.setdefault(group, []).append(schedule)
    assert {len(walks) for walks in groups.values()} == {2}
    assert {"ahead", "back", "left", "right", "turn left", "turn right"} < set(groups)


def test_ways_that_are_not_known_are_left_out(brisk):
    along = brisk.allowed_pairs.copy()
    off = brisk.poses.strides[:, 1:].any(axis=1)
    along[off], along[:, off] = False, False
    runs = np.where(along, brisk.pair_runs, 0)
    less = replace(brisk, pair_runs=runs, pair_passes=runs)
    groups = {group for group, _ in less.family.courses(less.command_range)}
    assert {"ahead", "back"} <= groups <= {"ahead", "back", "mixed", "stop and start"}


def test_worlds_are_those_of_their_cells(library):
    levels = (Levels("friction", (0.3,)), Levels("push", (0.1,)))
    jobs = plan_jobs(library, Grid(levels), 5, 0)
    worlds = {}
    for job in jobs:
        world = grid_world(library, job, 5, scale_ns=50.0)
        assert world == grid_world(library, job, 5, scale_ns=50.0)
        worlds.setdefault(job.cell.name, []).append(world)
    assert {w.friction for w in worlds["friction 0.3"]} == {0.3}
    assert {w.friction for w in worlds["nominal"]} == {0.8}
    pushed = worlds["push / m sqrt(g h) 0.1"]
    assert all(w.push for w in pushed)
    assert {p.impulse_ns for w in pushed for p in w.push} == {5.0}
    assert len({p.direction_deg for w in pushed for p in w.push}) > len(pushed)
    assert not any(w.push for w in worlds["friction 0.3"])
    assert all(w.push and w.friction == 0.3 for w in worlds["all mild, first levels"])
    assert len({w.seed for ws in worlds.values() for w in ws}) == len(jobs)


def test_servos_are_as_fast_on_the_grid_as_in_a_trial(library):
    """Both go by what the library was built for."""
    config = replace(library.config, speed_limit_deg_s=77.0)
    slow = replace(library, config=config)
    (job, *_) = plan_jobs(slow, TINY, 5, 0)
    trial = draw_world(slow, (1, 0), np.random.default_rng(0))
    assert grid_world(slow, job, 5, scale_ns=50.0).speed_limit_deg_s == 77.0
    assert trial.speed_limit_deg_s == 77.0


def test_every_step_is_walked_and_every_command(library, qualified):
    found, runs = qualified
    pairs = safe_pairs(library)[0]
    pairs[0, 0] = False
    assert (found.grid.runs[pairs] > 0).all()
    (cell,) = found.qualification.grid.cells
    assert {group for group, _ in library.family.courses(library.command_range)} < set(
        cell.groups
    )
    first = [r for r in runs if r.key[0] == 0]
    assert len(first) == len(plan_jobs(library, TINY, 0, 0))
    assert sum(n[0] for n in cell.groups.values()) == len(first)


def test_verdict_and_table_agree(library, qualified):
    found, _ = qualified
    report = found.qualification.grid
    taken = library.allowed_pairs & ~found.allowed_pairs
    assert np.argwhere(taken).tolist() == list(map(list, report.taken_out))
    assert np.array_equal(found.grid.forbidden, found.grid.passes < found.grid.runs)
    assert found.as_built().qualified
    assert found.qualified is report.passed


def test_the_file_keeps_it_all(library, qualified, tmp_path):
    found, _ = qualified
    save_library(found, tmp_path / "res.gait")
    loaded = load_library(tmp_path / "res.gait")
    assert library_bytes(loaded) == library_bytes(found)
    assert loaded.qualification == found.qualification
    assert np.array_equal(loaded.allowed_pairs, found.allowed_pairs)
    built = loaded.as_built()
    assert library_bytes(built) == library_bytes(library)
    assert [p.name for p in tmp_path.iterdir()] == ["res.gait"]


def test_a_verdict_that_does_not_fit_is_refused(qualified, tmp_path):
    found, _ = qualified
    more = replace(found.grid, passes=found.grid.runs + 1)
    save_library(replace(found, grid=more), tmp_path / "a.gait")
    with pytest.raises(LibraryError, match="more steps held than were walked"):
        load_library(tmp_path / "a.gait")
    small = replace(found.grid, forbidden=found.grid.forbidden[1:])
    save_library(replace(found, grid=small), tmp_path / "b.gait")
    with pytest.raises(LibraryError, match="grid has shape"):
        load_library(tmp_path / "b.gait")


def test_an_interrupted_run_ends_the_same(library, qualified):
    found, runs = qualified
    kept = {run.key: run for run in runs[6:]}  # saves time: another run found these
    before = set(kept)

    def note(run):
        kept[run.key] = run
        if len(kept) == len(before) + 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        qualify_grid(library, TINY, Crew(1, tell), dict(kept), note)
    news = []
    again = qualify_grid(library, TINY, Crew(1, tell), kept, news.append)
    assert library_bytes(again) == library_bytes(found)
    assert {run.key for run in news} == {run.key for run in runs} - set(kept)
    assert len(news) == 4


def test_qualifying_again_starts_from_the_build(library, qualified):
    found, runs = qualified
    done = {run.key: run for run in runs}
    again = qualify_grid(found, TINY, Crew(1, tell), done)
    assert library_bytes(again) == library_bytes(found)


def test_servos_without_torque_fail_what_is_required(library, qualified):
    # The nominal world comes first in every grid, so its walks are the same.
    given = {run.key: run for run in qualified[1] if run.key[0] == 0}
    weak = Grid((Levels("torque_limit", (0.05,)),), corners=False)
    runs = []
    found = qualify_grid(library, weak, Crew(1, tell), given, runs.append)
    report = found.qualification.grid
    cell = next(c for c in report.cells if c.kind == "torque_limit")
    assert cell.passes == 0 < cell.runs
    assert not found.qualified
    assert report.taken_out
    with pytest.raises(LibraryError, match="not qualified"):
        Walker(found)
    beyond = Grid((Levels("torque_limit", (), (0.05,)),), corners=False)
    # What may fail takes nothing out, so that every round walks as `qualified` did.
    given |= {run.key: run for run in runs if run.key[0] == 0}
    given |= {run.key: run for run in qualified[1]}
    passes = qualify_grid(library, beyond, Crew(1, tell), given)
    assert passes.qualified is qualified[0].qualified
    assert len(passes.qualification.grid.taken_out) < len(report.taken_out)


def test_a_step_that_falls_is_taken_out_and_walked_no_more(brisk):
    """A stride far too long, that the build is made to have passed."""
    strides = brisk.poses.strides.copy()
    absurd = int(np.argmax(strides[:, 0]))
    strides[absurd] = 0.75 * brisk.robot.reduced.leg_length, 0.0, 0.0
    layers = (strides, *brisk.poses.parameters[1:3], strides)
    poses = replace(brisk.poses, parameters=layers)
    some = (strides[:, 0] >= 0.0) & ~strides[:, 1:].any(axis=1)  # fewer walks suffice
    seen = np.where(brisk.allowed_pairs & some & some[:, None], 1, 0)
    seen[some, absurd] = seen[absurd, some] = 1
    lib = replace(brisk, poses=poses, pair_runs=seen, pair_passes=seen, steady=None)
    assert lib.command_range.vx[1] > 0.5
    runs = []
    found = qualify_grid(lib, TINY, Crew(1, tell), note=runs.append)
    out = {run.steps[-1] for run in runs if run.fell and run.key[0] == 0}
    assert any(absurd in pair for pair in out)
    report = found.qualification.grid
    assert out <= {tuple(pair) for pair in report.taken_out}
    assert report.rounds > 1
    assert not any(found.allowed_pairs[pair] for pair in out)
    later = {step for run in runs if run.key[0] > 0 for step in run.steps}
    assert later and not out & later
    assert found.command_range.vx[1] < lib.command_range.vx[1]


def with_falls(falls):
    """Results of all walks: in some rounds the last one falls, each time elsewhere.

    Returns:
        The results, and the steps in which walks fell.
    """
    pairs = [(a, b) for a, b in np.argwhere(SHIPPED.allowed_pairs).tolist() if a and b]
    known, fell_on, left = {}, [], SHIPPED
    for number, seed in enumerate(_ROUNDS):
        jobs = plan_jobs(left, MILD, 0, seed)
        known |= {job.key: GridRun(job.key, pairs[-1:], False) for job in jobs}
        if number in falls:
            fell_on.append(pairs[5 + 7 * number])
            known[jobs[-1].key] = GridRun(jobs[-1].key, fell_on[-1:], True)
        out = np.zeros_like(SHIPPED.allowed_pairs)
        for step in fell_on:
            out[step] = True
        left = replace(SHIPPED, grid=GridVerdict(1 * out, 0 * out, out))
    return known, fell_on


@pytest.mark.parametrize(
    ("falls", "rounds", "passes"),
    [((), 1, True), ((0, 1, 2), 4, True), ((0, 1, 2, 3), 4, False)],
)
def test_what_passes_has_walked_without_what_was_taken_out(
    falls, rounds, passes, tmp_path
):
    """A round may remove steps only if another one walks what is left."""
    known, fell_on = with_falls(falls)
    found = qualify_grid(SHIPPED, MILD, Crew(1, tell), known)
    report = found.qualification.grid
    assert set(report.taken_out) == set(fell_on)
    assert (report.rounds, report.settled) == (rounds, passes)
    assert report.passed is found.qualified is passes
    save_library(found, tmp_path / "r.gait")
    again = load_library(tmp_path / "r.gait")
    assert again.qualification == found.qualification
    assert library_bytes(again) == library_bytes(found)
    assert ("settled" in found.qualification.to_json()["grid"]) is not passes


def test_rounds_have_seeds_that_neither_proof_nor_splitting_has():
    assert len(set(_ROUNDS)) == len(_ROUNDS)
    assert {BANK, split_walks._BANK, split_walks._ALONE}.isdisjoint(_ROUNDS)


def test_quick_is_part_of_the_whole(library, brisk):
    for lib in (library, brisk):
        whole = default_grid(lib).cells()
        quick = default_grid(lib, quick=True)
        assert set(quick.cells()) < set(whole), "and worlds are those of their names"
        assert set(whole[-2:]) < set(quick.cells())
        assert len({cell.numbers for cell in quick.cells()}) == len(quick.cells())
        assert quick.cells()[0].kind == "nominal"
        assert default_grid(lib, seeds=3).seeds == 3
