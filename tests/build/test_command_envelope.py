"""Steady walks at the ends of the range: what falls is no longer commanded."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from gaitchain.build import command_envelope
from gaitchain.build.workers import Crew
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library_file import library_bytes, load_library
from gaitchain.messages import Command


@dataclass
class Walked:
    """One steady walk, as far as `hold_steady` looks at it."""

    fell: bool
    speed_mps: float
    yaw_drift_deg: float = 0.0


def quiet(stage, done, total):
    del stage, done, total


@pytest.fixture
def untried(brisk):
    return replace(brisk, steady=None)


def held_below(limit, monkeypatch, library, slow=1.0):
    """Let every walk ahead faster than a limit fall, or have a part of its speed."""
    asked = []

    def trials(trial, runs, seed, workers, first):
        command = trial.schedule[0].command
        if not first:
            asked.append((command, seed))
        speed = max(abs(command.vx), abs(command.vy))
        beyond = command.vx > limit
        walked = Walked(beyond and slow == 1.0, speed * (slow if beyond else 1.0))
        return iter([walked] * runs)

    monkeypatch.setattr(command_envelope, "run_trials", trials)
    return command_envelope.hold_steady(library, Crew(1, quiet)), asked


def test_an_end_that_falls_is_drawn_in_until_it_holds(untried, monkeypatch):
    most = untried.command_range.vx[1]
    held, asked = held_below(0.79 * most, monkeypatch, untried)
    assert held.command_range.vx[1] == pytest.approx(0.75 * most)
    assert held.command_range.vx[0] == untried.command_range.vx[0]
    assert held.command_range.vy == untried.command_range.vy
    np.testing.assert_array_equal(held.allowed_pairs, untried.allowed_pairs)
    seeds = [seed for _, seed in asked]
    assert len(set(seeds)) == len(seeds), "each walk in worlds of its own"


def test_after_a_fall_the_others_need_not_walk(untried, monkeypatch):
    walked, told = {}, []

    def trials(trial, runs, seed, workers, first):
        command = trial.schedule[0].command
        walked.setdefault(command, []).extend(range(first, first + runs))
        fell = command.vx > 0.0 and first == 4
        speed = max(abs(command.vx), abs(command.vy))
        return (Walked(fell and i == 1, speed) for i in range(runs))

    monkeypatch.setattr(command_envelope, "run_trials", trials)
    crew = Crew(1, lambda stage, done, total: told.append((done, total)))
    held = command_envelope.hold_steady(untried, crew)
    assert held.command_range.vx[1] == 0.0
    for command, numbers in walked.items():
        assert numbers == list(range(8 if command.vx > 0.0 else 24))
    assert told[-1][0] == told[-1][1]


@pytest.mark.parametrize(("begins", "kept"), [(12, 0.85), (8, 0.0)])
def test_who_falls_seldom_at_any_speed_keeps_what_held_twelve(
    begins, kept, untried, monkeypatch
):
    """From 0.85 of the end on, where the others fall at once."""
    most = untried.command_range.vx[1]

    def trials(trial, runs, seed, workers, first):
        command = trial.schedule[0].command
        speed = max(abs(command.vx), abs(command.vy))
        begin = begins if command.vx < 0.87 * most else 0
        fell = command.vx > 0.0 and first >= begin
        return iter([Walked(fell, speed)] * runs)

    monkeypatch.setattr(command_envelope, "run_trials", trials)
    held = command_envelope.hold_steady(untried, Crew(1, quiet))
    assert held.command_range.vx[1] == pytest.approx(kept * most)
    assert held.command_range.vx[0] == untried.command_range.vx[0]


@pytest.mark.parametrize(("part", "kept"), [(0.89, 0.75), (0.91, 1.0)])
def test_an_end_that_is_not_reached_is_drawn_in_too(part, kept, untried, monkeypatch):
    most = untried.command_range.vx[1]
    held, _ = held_below(0.79 * most, monkeypatch, untried, slow=part)
    assert held.command_range.vx[1] == pytest.approx(kept * most)


def test_who_is_slow_at_any_speed_keeps_its_fastest_command(untried, monkeypatch):
    """Less of the command would only make it slower still."""
    held, asked = held_below(-np.inf, monkeypatch, untried, slow=0.8)
    assert held.command_range == untried.command_range
    ahead = untried.command_range.vx[1]
    assert min(c.vx for c, _ in asked if c.vx > 0.0) >= 0.5 * ahead - 1e-9


def test_who_is_fastest_below_the_end_gets_that_command(untried, monkeypatch):
    most = untried.command_range.vx[1]

    def trials(trial, runs, seed, workers, first):
        command = trial.schedule[0].command
        speed = max(abs(command.vx), abs(command.vy))
        if command.vx > 0.0:  # the speed rises to 0.8, and falls beyond
            part = command.vx / most
            speed = 0.85 * most * min(part, 1.6 - part)
        return iter([Walked(False, speed)] * runs)

    monkeypatch.setattr(command_envelope, "run_trials", trials)
    held = command_envelope.hold_steady(untried, Crew(1, quiet))
    assert held.command_range.vx[1] == pytest.approx(0.8 * most)


def test_who_turns_less_than_asked_is_asked_for_less(untried, monkeypatch):
    most = untried.command_range.yaw_rate[1]

    def trials(trial, runs, seed, workers, first):
        command = trial.schedule[0].command
        # A tenth of the 10 s, the 2 s in which it accelerates, and some more.
        short = -0.32 * np.degrees(command.yaw_rate) * 10.0
        drift = short if abs(command.yaw_rate) > 0.79 * most else 0.0
        speed = max(abs(command.vx), abs(command.vy))
        return iter([Walked(False, speed, drift)] * runs)

    monkeypatch.setattr(command_envelope, "run_trials", trials)
    monkeypatch.setattr(command_envelope, "_SECONDS", 10.0)
    held = command_envelope.hold_steady(untried, Crew(1, quiet))
    assert held.command_range.yaw_rate[1] == pytest.approx(0.75 * most)
    assert held.command_range.vx == untried.command_range.vx


def test_walks_that_hold_change_no_range(untried, monkeypatch):
    held, asked = held_below(np.inf, monkeypatch, untried)
    assert held.command_range == untried.command_range
    assert len(asked) == sum(end != 0.0 for span in held.steady.ends for end in span)


def held_with(falls, monkeypatch, library):
    """Reduce the range where walks fall as `falls(kind, command)` says.

    Random schedules reach all ends of the range.
    """
    asked = {kind: [] for kind in command_envelope.HARD}

    def trials(trial, runs, seed, workers):
        ((kind, level),) = trial.fixed.items()
        assert level == command_envelope.HARD[kind]
        if trial.schedule is None:
            asked[kind].append(seed)
            span = trial.library.command_range
            ends = (Command(vx) for vx in span.vx)
            fell = any(falls(kind, end) for end in ends)
            return (Walked(fell and i == 3, 0.0) for i in range(runs))
        command = trial.schedule[0].command
        asked[kind].append(seed)
        return iter([Walked(falls(kind, command), 0.0)] * runs)

    monkeypatch.setattr(command_envelope, "run_trials", trials)
    return command_envelope.hold_hard(library, Crew(1, quiet)).command_range, asked


def test_the_end_that_falls_is_drawn_in_until_schedules_hold(untried, monkeypatch):
    span = untried.command_range
    limits = {"friction": 0.85 * span.vx[1], "delay_s": 0.7 * span.vx[1]}

    def falls(kind, command):
        return command.vx > limits.get(kind, np.inf)

    held, asked = held_with(falls, monkeypatch, untried)
    assert held.vx == (span.vx[0], pytest.approx(0.9**4 * span.vx[1]))
    assert (held.vy, held.yaw_rate) == (span.vy, span.yaw_rate)
    ends = sum(end != 0.0 for span in held.ends for end in span)
    turns = [(len(seeds) - 1) // (1 + ends) for seeds in asked.values()]
    assert turns == [0, 0, 2, 2]
    for seeds in asked.values():
        assert len(set(seeds)) == len(seeds), "each end and turn in its own worlds"


def test_who_falls_at_any_speed_is_not_made_slower_for_it(untried, monkeypatch):
    held, asked = held_with(lambda kind, _: kind == "friction", monkeypatch, untried)
    assert held == untried.command_range
    assert len(asked["payload"]) == 1 < len(asked["friction"])


def test_where_no_end_falls_slower_is_no_help(untried, monkeypatch):
    """As where a sway grows at half of the speed alone."""

    monkeypatch.setattr(command_envelope, "_falls_at_ends", lambda *_: {(0, 1): 0})
    held, asked = held_with(lambda kind, _: kind == "delay_s", monkeypatch, untried)
    assert len(asked["delay_s"]) == 1
    assert held == untried.command_range


def slowed_where(falls, monkeypatch, library, turn=0):
    """Slow down where walks fall as `falls(command)` says."""
    crew, seeds = Crew(1, quiet), []

    def trials(trial, runs, seed, workers):
        assert trial.worlds is crew.worlds and not trial.fixed
        seeds.append(seed)
        return iter([Walked(falls(trial.schedule[0].command), 0.0)] * runs)

    monkeypatch.setattr(command_envelope, "run_trials", trials)
    slower = command_envelope.slow_weakest(library, turn, 0.8, crew)
    return slower.command_range, seeds


def test_who_falls_turning_walks_ahead_as_fast(untried, monkeypatch):
    span = untried.command_range
    slower, seeds = slowed_where(lambda c: c.yaw_rate > 0.0, monkeypatch, untried)
    low, high = span.yaw_rate
    assert slower == replace(span, yaw_rate=(low, pytest.approx(0.8 * high)))
    _, later = slowed_where(lambda c: False, monkeypatch, untried, turn=1)
    assert not set(seeds) & set(later), "each reduction in worlds of its own"


@pytest.mark.parametrize("fell", [False, True])
def test_who_falls_alike_everywhere_is_slowed_everywhere(fell, untried, monkeypatch):
    slower, _ = slowed_where(lambda _: fell, monkeypatch, untried)
    most = np.array(untried.command_range.ends[:3])
    assert np.array(slower.ends[:3]) == pytest.approx(0.8 * most)


def test_where_nothing_holds_the_way_is_closed(untried, monkeypatch):
    held, _ = held_below(0.0, monkeypatch, untried)
    assert held.command_range.vx[1] == 0.0


def test_the_range_is_kept_in_the_file(untried, tmp_path):
    library = replace(untried, steady=CommandRange((-0.01, 0.02), (0.0, 0.01)))
    path = tmp_path / "a.gait"
    path.write_bytes(library_bytes(library))
    assert load_library(path).steady == library.steady
    assert load_library(path).command_range.vx[1] <= 0.02


def test_the_paper_walks_as_they_were_built(library):
    crew = Crew(1, quiet)
    for hold in (command_envelope.hold_steady, command_envelope.hold_hard):
        assert hold(library, crew) is library


def test_builds_of_other_seeds_walk_in_other_worlds(untried, monkeypatch):
    """Else every build would be judged in the same few worlds."""
    seeds = []
    for seed in (0, 1, 2**29 - 1):
        config = replace(untried.config, seed=seed)
        _, asked = held_below(0.0, monkeypatch, replace(untried, config=config))
        seeds.append({number for _, number in asked})
    assert not (seeds[0] & seeds[1] | seeds[1] & seeds[2] | seeds[0] & seeds[2])
    gates = 2**32 + 5 * 2**29
    assert min(map(min, seeds)) > gates
