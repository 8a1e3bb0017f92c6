"""Odometry by legs and gyro, beside where the simulator has the trunk."""

import math
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.state import Attitude
from gaitchain.gait.library_file import load_library
from gaitchain.gait.slide import Slide, Slides
from gaitchain.gait.zmp import Support
from gaitchain.messages import Command
from gaitchain.walker.leg_odometry import LegOdometry
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker


@pytest.fixture(scope="module")
def library():
    return load_library(resources.files("gaitchain") / "data" / "res.gait")


@pytest.fixture(scope="module")
def walk(library):
    """Six seconds ahead and to the left: odometry and truth of each period."""
    walker, backend = Walker(library), MujocoBackend(library.robot)
    walker.keep_odometry()
    backend.connect(walker.stand)
    for _ in range(100):
        backend.write(walker.step(backend.read()).position)
    began = np.array([*backend.data.qpos[:2], backend.heading])
    told, real = [], []
    for tick in range(600):
        if tick == 0:
            walker.command(Command(0.4, 0.0, 0.3))
        backend.write(walker.step(backend.read()).position)
        told.append(walker.odometry)
        real.append([*backend.data.qpos[:3], backend.heading])
    return walker, began, told, np.array(real)


def test_it_follows_the_trunk(walk):
    _, began, told, real = walk
    gone = np.linalg.norm(np.diff(real[:, :2], axis=0), axis=1).sum()
    assert gone > 1.5
    cos, sin = math.cos(began[2]), math.sin(began[2])
    ahead = (real[:, :2] - began[:2]) @ np.array([[cos, -sin], [sin, cos]])
    start = np.array(told[0].place[:2]) - ahead[0]
    off = np.array([o.place[:2] for o in told]) - ahead - start
    assert np.linalg.norm(off, axis=1).max() < 0.015 * gone
    yaw = np.unwrap([o.attitude[2] for o in told]) - np.unwrap(real[:, 3])
    assert np.abs(yaw).max() < math.radians(5.0)
    height = [o.place[2] for o in told]
    np.testing.assert_allclose(height, real[:, 2], atol=0.015)


def test_the_place_never_jumps(walk):
    _, _, told, real = walk
    moves = np.linalg.norm(np.diff([o.place[:2] for o in told], axis=0), axis=1)
    true = np.linalg.norm(np.diff(real[:, :2], axis=0), axis=1)
    assert moves.max() < true.max() + 0.005


def test_the_covariance_grows_with_the_way(walk):
    _, _, told, _ = walk
    for o in told:
        xx, xy, yy, xt, yt, tt = o.covariance
        full = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
        assert np.linalg.eigvalsh(full).min() > -1e-12
    sums = [o.covariance[0] + o.covariance[2] for o in told]
    assert sums[-1] > sums[300] > sums[100]
    assert told[-1].distance > told[300].distance > 0.0


def test_the_covariance_is_that_of_the_documented_drift(library):
    """docs/ros2.md: 0.8 % of the way, 0.5 % aside, 0.1 deg a metre, 0.7 % of a turn."""
    odometry, ahead = LegOdometry(library, 0.01), np.array([0.01, 0.0])
    veer = math.radians(0.1)
    for _ in range(200):
        odometry._grow(ahead, 0.0)
    found = odometry.latest
    xx, _, yy, _, _, tt = found.covariance
    assert found.distance == pytest.approx(2.0)
    assert math.sqrt(xx) == pytest.approx(math.hypot(0.005, 0.008 * 2.0), rel=0.01)
    aside = math.hypot(0.005, 0.005 * 2.0, 0.5 * veer * 2.0**2)
    assert math.sqrt(yy) == pytest.approx(aside, rel=0.01)
    assert math.sqrt(tt) == pytest.approx(math.hypot(veer, veer * 2.0), rel=0.01)
    for _ in range(100):
        odometry._grow(np.zeros(2), 0.03)
    turned = math.hypot(veer, veer * 2.0, 0.007 * 3.0)
    assert math.sqrt(odometry.latest.covariance[5]) == pytest.approx(turned, rel=0.01)


def test_a_reset_begins_anew(walk, library):
    walker = walk[0]
    walker.reset()
    fresh = LegOdometry(library, 0.01).latest
    assert walker.odometry == fresh
    assert fresh.place[:2] == pytest.approx((0.0, 0.0), abs=0.1)
    assert fresh.distance == 0.0


@pytest.mark.parametrize("support", [None, Support.LEFT_SINGLE])
def test_odometry_that_begins_on_the_way_does_not_jump(library, support):
    """All the heading of before counted as motion of the first control period."""
    at, stand = Place(2.0, -1.0, 2.5), np.asarray(library.robot.legs.stand)
    odometry = LegOdometry(library, 0.01, at)
    middle = LegOdometry(library, 0.01).latest.place[:2]
    for _ in range(3):
        odometry.update(stand, Attitude(yaw=2.5), support)
    found = odometry.latest
    assert found.place[:2] == pytest.approx(at.moved(*middle)[:2], abs=1e-6)
    assert np.abs(found.velocity).max() < 1e-4
    assert found.covariance[5] < math.radians(0.5) ** 2


@pytest.mark.parametrize("yaw", [1.5, None])
def test_after_a_fall_it_goes_on_where_the_feet_were(library, yaw):
    odometry, legs = LegOdometry(library, 0.01), library.robot.legs
    stand, leaned = np.asarray(legs.stand), Attitude(pitch=0.7, yaw=0.5)
    middle = odometry.latest.place[0]  # over the feet, of who stands upright
    odometry.update(stand, Attitude(yaw=0.5), None)
    before = odometry.latest
    odometry.update(stand, leaned, None)
    assert math.dist(odometry.latest.place[:2], before.place[:2]) > 0.1
    odometry.rise(yaw)
    after = odometry.latest
    assert after.attitude == (0.0, 0.0, 0.5 if yaw is None else yaw)
    assert math.dist(after.place[:2], (0.0, 0.0)) < 0.1 + abs(middle)
    unsure = 0.5 * (after.covariance[0] + after.covariance[2])
    assert math.sqrt(unsure) > 0.3 * library.robot.reduced.leg_length
    turned = math.sqrt(after.covariance[5])
    assert (turned < math.radians(5.0)) == (yaw is not None)
    odometry.rise(yaw)  # and again
    twice = np.array(odometry.latest.covariance)[[0, 2, 5]]
    once = np.array(after.covariance)[[0, 2, 5]]
    assert (twice > 1.8 * once).all()


def test_a_foot_that_rolls_over_its_toes_carries_the_trunk(library):
    """The front edge stands still, so the stiff robot turns about it."""
    odometry = LegOdometry(library, 0.01)
    stand = np.asarray(library.robot.legs.stand)
    pitches, places = np.linspace(0.03, 0.13, 51), []
    for pitch in pitches:
        odometry.update(stand, Attitude(pitch=float(pitch)), None)
        places.append(odometry.latest.place)
    x, _, z = np.array(places).T
    edge = (x[0] ** 2 + z[0] ** 2 - x[-1] ** 2 - z[-1] ** 2) / (2.0 * (x[0] - x[-1]))
    radius = np.hypot(x - edge, z)
    np.testing.assert_allclose(radius, radius[0], atol=1e-6)
    turned = np.arctan2(x - edge, z)
    np.testing.assert_allclose(turned - turned[0], pitches - pitches[0], atol=1e-5)


@pytest.mark.parametrize("late", [False, True])
def test_a_foot_counts_once_it_stands(library, late):
    """Not while both are planned to, and not after that where it is late."""
    odometry = LegOdometry(replace(library, slides=Slides()), 0.01)
    stand = np.asarray(library.robot.legs.stand)
    for _ in range(5):
        odometry.update(stand, Attitude(), Support.LEFT_SINGLE)
    began = odometry.latest.place
    right = slice(8, 11)  # hip, knee and ankle; its sole stays level
    bend = np.array([0.03, 0.05, -0.08] if late else [0.03, -0.05, 0.02])
    swung = stand.copy()
    for _ in range(3):
        swung[right] += bend  # higher than the other one, or lower
        odometry.update(swung, Attitude(), Support.LEFT_TO_RIGHT)
    assert odometry.latest.place[:2] == pytest.approx(began[:2], abs=1e-12)
    swung[right] += bend
    odometry.update(swung, Attitude(), Support.RIGHT_SINGLE)
    moved = math.dist(odometry.latest.place[:2], began[:2])
    assert (moved < 1e-12) == late


def test_the_usual_slide_is_of_steps_alone(library):
    """A robot that comes to rest, or is pushed as it stands, makes none."""
    slides = Slides(trunk=Slide(each=0.01))
    odometry = LegOdometry(replace(library, slides=slides), 0.01)
    stand, period = np.asarray(library.robot.legs.stand), library.timing.step / 0.01
    began = odometry.latest.place[0]
    for _ in range(100):
        odometry.update(stand, Attitude(), Support.LEFT_TO_RIGHT, stepping=False)
        odometry.update(stand, Attitude(), None)
    assert odometry.latest.place[0] == pytest.approx(began, abs=1e-12)
    for _ in range(round(2 * period)):
        odometry.update(stand, Attitude(), Support.LEFT_SINGLE)
    assert odometry.latest.place[0] - began == pytest.approx(0.02, rel=0.02)


def test_steps_are_neither_the_first_shift_nor_the_rest(library):
    walker, backend, seen = Walker(library), MujocoBackend(library.robot), set()
    backend.connect(walker.stand)
    for tick in range(700):
        if tick == 100:
            walker.command(Command(0.2))
        if tick == 300:
            walker.command(Command())
        backend.write(walker.step(backend.read()).position)
        gait = walker.gait
        seen.add((gait.standing, gait.settling, gait.stepping))
        assert not gait.stepping or gait.steps > 0
    assert seen == {
        (True, False, False),
        (False, True, False),
        (False, False, True),
        (False, False, False),
    }
