"""Steady walks at the ends of the range: what falls is taken out."""

from dataclasses import dataclass

import numpy as np

from gaitchain import steady
from gaitchain.qualify import Crew


@dataclass
class Walked:
    """One steady walk, as far as `hold_steady` looks at it."""

    fell: bool
    last_step: tuple[int, int]


def quiet(stage, done, total):
    del stage, done, total


def fastest_pair(library):
    """The stride that the fastest steady walk is made of."""
    vx = library.command_range.vx[1] * library.timing.step
    straight = (library.poses.strides[:, 1:] == 0.0).all(axis=1)
    off = np.where(straight, np.abs(library.poses.step_lengths - vx), np.inf)
    return int(np.argmin(off))


def test_a_stride_that_falls_on_and_on_is_no_longer_commanded(brisk, monkeypatch):
    stride = fastest_pair(brisk)
    most = brisk.command_range.vx[1]

    def trials(library, runs, seed, *, schedule, **kwargs):
        del seed, kwargs
        fast = schedule[0].command.vx > most - 1e-6
        return iter([Walked(fast, (stride, stride))] * runs)

    monkeypatch.setattr(steady, "run_trials", trials)
    held = steady.hold_steady(brisk, Crew(1, quiet))
    assert not held.allowed_pairs[stride, stride]
    assert held.command_range.vx[1] < most
    others = brisk.allowed_pairs.copy()
    others[stride, stride] = False
    np.testing.assert_array_equal(held.allowed_pairs, others)


def test_walks_that_hold_change_nothing(brisk, monkeypatch):
    asked = []

    def trials(library, runs, seed, *, schedule, **kwargs):
        del library, seed, kwargs
        asked.append(schedule[0].command)
        return iter([Walked(False, (0, 0))] * runs)

    monkeypatch.setattr(steady, "run_trials", trials)
    assert steady.hold_steady(brisk, Crew(1, quiet)) is brisk
    span = brisk.command_range
    assert {c.vx for c in asked} >= set(span.vx)
    assert {c.vy for c in asked} >= set(span.vy)
    assert {c.yaw_rate for c in asked} >= set(span.yaw_rate)


def test_a_library_of_key_poses_is_left_alone(library):
    assert steady.hold_steady(library, Crew(1, quiet)) is library
