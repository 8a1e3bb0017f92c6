"""What feet slide is learned from walks, and counts in the robot's place."""

from dataclasses import replace
from importlib.resources import files
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.analysis.walked_way import Way, Ways, walk_measured
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.usual_slide import learn_slides
from gaitchain.gait.library_file import load_library
from gaitchain.gait.schedule import Segment
from gaitchain.gait.slide import Slide, Slides
from gaitchain.messages import Command
from gaitchain.walker.walker import Walker

LIBRARY = load_library(files("gaitchain") / "data" / "res.gait")
AHEAD = Command(vx=0.3)
BEND = st.floats(-0.7, 0.7)  # 1/m
SLIDES = st.builds(Slide, st.floats(-0.003, 0.003), BEND, BEND, BEND)


def way_with(slide, steps, told):
    x, y = (part / steps for part in told)
    along = slide.each + (slide.ahead if x > 0.0 else slide.back) * x * x
    true = told[0] + steps * along, told[1] + steps * slide.left * y * abs(y)
    return Way(steps, told, true)


def walks_with(slides):
    """Walks in all directions, of robots whose feet slide just so."""
    told = product((-1.0, -0.4, 0.0, 0.5, 1.2), (-0.6, 0.0, 0.7))
    return [
        Ways(*(way_with(slide, 18 + n % 3, way) for slide in slides))
        for n, way in enumerate(told)
    ]


@given(SLIDES, SLIDES)
def test_what_slides_in_the_same_way_is_learned(steps, trunk):
    found = learn_slides(walks_with((steps, trunk)))
    np.testing.assert_allclose(found, (steps, trunk), atol=1e-4)


@given(SLIDES, st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_a_step_slides_as_it_is_learned(slide, x, y):
    way = way_with(slide, 1, (x, y))
    off = np.subtract(way.true, way.told)
    np.testing.assert_allclose(slide.of_step(x, y), off, atol=1e-12)


def test_a_walk_that_slipped_says_little():
    slides = Slide(0.001, 0.3, 0.2, -0.1), Slide(-0.0005, 0.0, -0.2, 0.1)
    walks = walks_with(slides)
    slipped = [way._replace(true=(way.true[0] - 0.3, way.true[1])) for way in walks[4]]
    walks[4] = Ways(*slipped)
    found = np.array(learn_slides(walks))
    np.testing.assert_allclose(found[:, 0], np.array(slides)[:, 0], atol=2e-4)
    np.testing.assert_allclose(found[:, 1:], np.array(slides)[:, 1:], atol=0.06)


def test_few_walks_teach_nothing():
    assert learn_slides(walks_with((Slide(0.001), Slide()))[:7]) == Slides()


def test_no_walk_aside_teaches_nothing_of_it():
    """What a straight walk drifts is no way; some by fast steps, as is usual."""
    rng = np.random.default_rng(3)
    walks = []
    for ahead in np.repeat((-0.9, -0.4, 0.0, 0.6, 1.2), 10):
        told, off = rng.normal(0.0, 0.004, 2), rng.normal(0.0, 0.008, 2)
        bent = 0.3 * ahead * abs(ahead) / 18
        true = ahead + bent + 0.018 + off[0], told[1] + off[1]
        way = Way(18, (ahead + told[0], told[1]), true)
        walks.append(Ways(way, way))
    for slide in learn_slides(walks):
        assert abs(slide.left) < 0.05
        assert slide.ahead == pytest.approx(0.3, abs=0.1)
        assert slide.back == pytest.approx(-0.3, abs=0.1)
        assert slide.each == pytest.approx(0.001, abs=2e-4)


def walked(library, command=AHEAD, seconds=5.0):
    walker = Walker(library)
    backend = MujocoBackend(library.robot)
    start = backend.foot_positions().mean(axis=0)
    _, ways = walk_measured(walker, backend, Segment(command, seconds))
    return walker, ways, backend.foot_positions().mean(axis=0) - start


@pytest.fixture(scope="module")
def plain():
    return walked(replace(LIBRARY, slides=Slides()))


def test_a_way_is_measured_and_walked(plain):
    """Up to the last step that ended; a straight walk's way is where it came to."""
    walker, ways, gone = plain
    for way in ways:
        assert way.steps == ways.steps.steps > 8
        assert way.told == pytest.approx(way.true, abs=0.03 * gone[0])
        assert 0.6 * gone[0] < way.true[0] < gone[0]
    assert walker.place.x > ways.steps.told[0]


def test_a_way_aside_and_around_is_in_the_headings_of_its_steps():
    _, ways, _ = walked(LIBRARY, Command(vy=0.1, yaw_rate=0.5), 8.0)
    for way in ways:
        assert way.true[1] > 0.3
        assert abs(way.true[0]) < 0.1
        assert way.told == pytest.approx(way.true, abs=0.04)


@pytest.mark.parametrize("vx", [0.3, -0.2])
def test_the_usual_slide_counts_in_both_places(vx):
    """Of a robot that does not balance by it: it walks the same, and counts more."""
    slide = Slide(0.002, 0.5, -1.5, 0.3)
    slides, ahead = Slides(slide, slide), Command(vx)
    walker, ways, _ = walked(replace(LIBRARY, slides=Slides()), ahead, 8.0)
    slid, slid_ways, _ = walked(replace(LIBRARY, slides=slides), ahead, 8.0)
    for way, more in zip(ways, slid_ways, strict=True):
        assert more.true == way.true
        added = np.subtract(more.told, way.told)
        due = way.steps * np.array(slide.of_step(*np.divide(way.told, way.steps)))
        # The trunk's is smoothed, and begins late.
        np.testing.assert_allclose(added, due, rtol=0.1, atol=1e-3)
        assert abs(due[0]) > 0.04
    assert (slid.place.x - walker.place.x) * vx > 0.005
    left, right = (feet[0] for feet in slid.feet), (feet[0] for feet in walker.feet)
    assert np.ptp(np.subtract(list(left), list(right))) < 1e-4
