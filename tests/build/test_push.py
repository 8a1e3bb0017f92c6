"""Pushes: bisection, the median and its interval, the same for any workers."""

import math
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.push import (
    MOST,
    RESOLUTION,
    PushedWalk,
    PushResult,
    PushTest,
    _bisect,
    impulse_unit_ns,
    judge,
    run_pushes,
    size_of,
)
from gaitchain.build.trial import draw_world
from gaitchain.cli import run
from gaitchain.figures import robustness
from gaitchain.figures.robustness import plot_pushes
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command
from gaitchain.sim.push import Push
from gaitchain.walker.walker import Walker

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def speed(library):
    return round(sum(library.speed_range) / 2.0, 3)


@pytest.fixture(scope="module")
def pushed(library, speed):
    return list(run_pushes(PushedWalk(library, speed), 2, 3, directions=2, workers=1))


@given(st.floats(0.001, MOST - 0.1))
def test_bisection_finds_the_limit(limit):
    found = _bisect(lambda impulse: impulse >= limit)
    assert abs(found - limit) <= RESOLUTION


def test_bisection_at_its_ends():
    assert _bisect(lambda _: True) == 0.0  # it falls all by itself
    assert _bisect(lambda _: False) == MOST


def test_any_number_of_workers_gives_the_same(library, speed, pushed):
    again = run_pushes(PushedWalk(library, speed), 1, 3, directions=2, workers=2)
    assert list(again) == pushed[::2]


def test_every_side_has_the_same_runs(pushed):
    assert [(t.direction_deg, t.run) for t in pushed] == [
        (0.0, 0), (0.0, 1), (180.0, 0), (180.0, 1),
    ]  # fmt: skip
    assert pushed[0].at_s == pushed[2].at_s != pushed[1].at_s == pushed[3].at_s
    assert all(6.0 <= test.at_s <= 12.0 for test in pushed)  # two steps, and two more


def test_the_robot_falls_after_more_and_not_after_less(library, speed, pushed):
    test = pushed[1]
    world = draw_world(library, (3, 1), np.random.default_rng((3, 1)))
    fell, step_ns = [], RESOLUTION * impulse_unit_ns(library)
    for impulse in (test.critical_ns - step_ns, test.critical_ns + step_ns):
        push = Push(impulse, test.direction_deg, test.at_s)
        backend = MujocoBackend(library.robot, replace(world, push=(push,)))
        walk = (Segment(Command(speed), test.at_s + 6.1),)
        fell.append(run_unrecorded(Walker(library), backend, walk).fell_at_s)
    assert fell[0] is None
    assert fell[1] > test.at_s


def critical_at(side, *critical):
    return [PushTest(i, side, 5.0, value) for i, value in enumerate(critical)]


def test_half_of_the_runs_fall_at_the_median():
    tests = critical_at(0.0, 4.0, 8.0, 6.0, 5.0, 7.0) + critical_at(90.0, 5.0, 5.0)
    ahead, left = judge(tests)
    assert (ahead.direction_deg, ahead.impulse_ns) == (0.0, 6.0)
    assert ahead.interval_ns == (4.0, 8.0)
    assert (left.direction_deg, left.impulse_ns) == (90.0, 5.0)
    assert np.isnan(left.interval_ns).all(), "both may be on one side of the median"
    assert ahead.critical_ns == (4.0, 8.0, 6.0, 5.0, 7.0)


@settings(max_examples=20)
@given(st.lists(st.floats(0.0, 100.0), min_size=5, max_size=30))
def test_the_interval_holds_the_median(critical):
    (result,) = judge(critical_at(0.0, *critical))
    low, high = result.interval_ns
    assert min(critical) <= low <= high <= max(critical)
    assert low <= result.impulse_ns <= high


@pytest.mark.parametrize("n", [5, 8, 20])
def test_the_interval_has_the_true_median_as_often_as_it_says(n):
    """By a skew law whose median is known; the least that binomials leave is 0.9."""
    rng = np.random.default_rng(n)
    held = [
        low <= np.log(2.0) <= high
        for drawn in rng.exponential(size=(400, n))
        for low, high in [judge(critical_at(0.0, *drawn))[0].interval_ns]
    ]
    assert 0.87 < np.mean(held) < 0.99


def test_runs_that_no_push_felled_or_that_fell_alone_are_counted():
    (result,) = judge(critical_at(0.0, 0.0, 0.0, 0.0, 50.0, MOST * 71.0))
    assert (result.fell_alone, result.withstood(71.0)) == (3, 1)
    assert result.impulse_ns == 0.0


def test_more_runs_make_the_interval_smaller():
    few, many = (
        judge(critical_at(0.0, *np.linspace(10.0, 30.0, n)))[0].interval_ns
        for n in (6, 200)
    )
    assert few[1] - few[0] > 2.0 * (many[1] - many[0])


def test_the_scale_of_impulses(library):
    mass, height, scale = size_of(library)
    assert mass == library.robot.reduced.mass
    assert 0.4 < height < 0.7
    assert scale == pytest.approx(mass * math.sqrt(9.81 * height))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "0.2 m/s, with feedback\npush on trunk [N s]"),
        (("--body", "left_foot", "--open-loop"), "open loop\npush on left_foot [N s]"),
        (("--body", "any"), "push on a body drawn for each run [N s]"),
    ],
)
def test_the_picture_says_what_was_pushed(words, said, tmp_path, monkeypatch):
    titles, draw = [], robustness.drawing

    @contextmanager
    def noted(*size):
        with draw(*size) as figure:
            yield figure
            titles.append(figure.axes[0].get_title())

    monkeypatch.setattr(robustness, "drawing", noted)
    walk = "--vx", "0.2", "--runs", "1", "--directions", "1", "--workers", "1"
    assert run(["push", "res", *walk, *words, "-o", str(tmp_path / "p.png")]) == 0
    assert said in titles[0]


@pytest.mark.parametrize("sides", [1, 8])
def test_the_picture(sides, tmp_path):
    tests = [t for i in range(sides) for t in critical_at(360.0 * i / sides, 5.0, 7.0)]
    plot_pushes(judge(tests), "RES", 71.0, tmp_path / "new" / "push.png")
    assert (tmp_path / "new" / "push.png").stat().st_size > 20_000


@pytest.mark.parametrize(("end", "cut"), [(19.0, False), (20.0, False), (300.0, True)])
def test_the_picture_holds_the_intervals_or_says_that_they_go_on(
    end, cut, tmp_path, monkeypatch
):
    """They were cut off at the hardest run, without a word."""
    draw, seen = robustness.drawing, []

    @contextmanager
    def noted(*size):
        with draw(*size) as figure:
            yield figure
            (axes,) = figure.axes
            names = [text.get_text() for text in axes.get_legend().get_texts()]
            seen.append((axes.get_ylim()[1], names))

    monkeypatch.setattr(robustness, "drawing", noted)
    runs = 6.0, 10.0
    sides = [PushResult(0.0, 8.0, (5.0, 9.0), runs)]
    sides += [PushResult(90.0, 8.0, (4.0, end), runs)]
    sides += [PushResult(180.0, math.nan, (math.nan, math.nan), runs)]
    plot_pushes(sides, "RES", 71.0, tmp_path / "push.png")
    ((rim, names),) = seen
    assert rim == pytest.approx(1.05 * min(end, 20.0))
    assert ("90 % interval, beyond the rim too" in names) is cut
    assert ("90 % interval" in names) is not cut
