"""The riser: which way it takes, when it tries again, and when it gives up."""

import numpy as np
import pytest

from gaitchain.errors import CommandError
from gaitchain.gait.get_up import GetUp, TimedPose, Way
from gaitchain.messages import GRAVITY, Sensors
from gaitchain.walker.riser import STANDS_WITHIN, TRIES, Riser, Rising

FRONT, BACK = (0.5, -0.5), (-0.7, 0.7)
STAND = (0.1, 0.1)
DOWN = {"front": (-GRAVITY, 0.0, 0.0), "back": (GRAVITY, 0.0, 0.0)}
UPRIGHT, SHAKEN = (0.0, 0.0, GRAVITY), (30.0, 0.0, 0.0)
MOST_TICKS = 10_000


def way(angles):
    return Way((TimedPose(0.4, angles), TimedPose(0.6, STAND)), 20, 20)


def riser(*sides, period_s=0.01):
    ways = {"front": way(FRONT), "back": way(BACK)}
    known = {side: ways[side] for side in sides or ways}
    return Riser(GetUp("toy", "f", ("left", "right"), STAND, known), period_s)


def sensors(acceleration, joints=STAND):
    angles = np.array(joints)
    return Sensors(0.0, angles, np.zeros(2), np.zeros(3), np.array(acceleration))


def play(rises, feels, joints=STAND):
    """Step to the end; return the targets."""
    rises.begin(np.zeros(2))
    targets = []
    while rises.state in (Rising.STRAIGHTENING, Rising.GETTING_UP):
        targets.append(rises.step(sensors(feels(rises), joints)))
        assert len(targets) < MOST_TICKS
    return np.array(targets)


@pytest.mark.parametrize(("side", "pose"), [("front", FRONT), ("back", BACK)])
def test_it_takes_the_way_from_what_it_lies_on(side, pose):
    rises = riser()

    def feels(one):
        return UPRIGHT if one.state is Rising.GETTING_UP else DOWN[side]

    targets = play(rises, feels)
    assert (rises.state, rises.side, rises.tries) == (Rising.UP, side, 1)
    assert np.abs(targets - pose).max(axis=1).min() < 1e-12
    np.testing.assert_allclose(targets[-1], STAND)
    fastest = np.abs(np.diff(targets, axis=0)).max()
    assert fastest < 0.04  # no jump: 1.2 rad in 0.4 s
    assert rises.step(sensors(UPRIGHT)) == pytest.approx(STAND)


@pytest.mark.parametrize("period_s", [0.01, 0.004])
def test_it_takes_as_long_at_every_rate(period_s):
    """1.5 s to the lying pose, 1 s of rest, the way of 1 s, and 1 s of standing."""
    rises, states = riser(period_s=period_s), []

    def feels(one):
        states.append(one.state)
        return UPRIGHT if one.state is Rising.GETTING_UP else DOWN["front"]

    targets = play(rises, feels)
    assert rises.state is Rising.UP
    assert len(targets) * period_s == pytest.approx(4.5, abs=3.0 * period_s)
    lay_s = states.count(Rising.STRAIGHTENING) * period_s
    assert lay_s == pytest.approx(2.5, abs=3.0 * period_s)


def test_a_knock_is_not_how_it_lies():
    """One sample, at the moment of the choice, among those of a fifth of a second."""
    rises = riser()

    def feels(one):
        knocked = one._next == len(one._rows) and one.state is Rising.STRAIGHTENING
        lies = UPRIGHT if one.state is Rising.GETTING_UP else DOWN["front"]
        return UPRIGHT if knocked else lies

    play(rises, feels)
    assert (rises.side, rises.state, rises.tries) == ("front", Rising.UP, 1)


def test_it_has_to_begin_before_it_steps():
    with pytest.raises(CommandError, match="after `begin`"):
        riser().step(sensors(UPRIGHT))


def test_it_tries_again_and_then_gives_up():
    rises = riser()
    play(rises, lambda _: DOWN["back"])
    assert (rises.state, rises.tries) == (Rising.GIVEN_UP, TRIES)
    assert rises.note == f"given up: it does not stand after {TRIES} tries"


def test_it_rolls_over_and_takes_the_other_way():
    rises = riser()
    play(rises, lambda one: DOWN["front" if one.tries == 1 else "back"])
    assert rises.side == "back"


def test_a_side_without_a_way_is_named():
    rises = riser("front")
    play(rises, lambda _: DOWN["back"])
    assert rises.note == "given up: no way from the back is known"


def test_it_waits_for_rest_but_not_for_ever():
    rises = riser()
    targets = play(rises, lambda _: SHAKEN)
    assert rises.state is Rising.GIVEN_UP
    assert rises.side is None
    np.testing.assert_allclose(targets[-1], STAND)


def test_who_stands_already_is_up():
    rises = riser()
    play(rises, lambda _: UPRIGHT)
    assert (rises.state, rises.side) == (Rising.UP, None)


@pytest.mark.parametrize("joints", [(2.0, 2.0), (0.1, 0.1 + 1.01 * STANDS_WITHIN)])
def test_who_kneels_or_sits_upright_is_not_up(joints):
    """Its joints do not reach the pose that it was to stand in."""
    rises = riser()
    play(rises, lambda _: UPRIGHT, joints)
    assert (rises.state, rises.tries) == (Rising.GIVEN_UP, TRIES)
    rises = riser()

    def feels(one):
        return UPRIGHT if one.state is Rising.GETTING_UP else DOWN["front"]

    play(rises, feels, joints)
    assert (rises.state, rises.side) == (Rising.GIVEN_UP, "front")


@pytest.mark.parametrize("silent", [np.nan, 1e30])
def test_a_joint_that_gives_with_the_weight_or_says_nothing_is_up(silent):
    rises = riser()
    play(rises, lambda _: UPRIGHT, (0.1 + 0.99 * STANDS_WITHIN, silent))
    assert rises.state is Rising.UP


def test_who_lies_in_another_pose_than_it_stands_in_is_not_up_there():
    bent = (0.1, 0.2 + STANDS_WITHIN)
    known = {"front": way(FRONT), "back": way(BACK)}
    rises = Riser(GetUp("toy", "f", ("left", "right"), bent, known))
    play(rises, lambda _: UPRIGHT, bent)
    assert rises.state is Rising.GIVEN_UP


def test_measurements_that_are_no_numbers_do_not_count():
    rises = riser()
    bad = iter([(np.nan, 0.0, 0.0), (1e30, 0.0, 0.0)] * MOST_TICKS)
    play(rises, lambda one: next(bad) if one.tries > 2 else DOWN["front"])
    assert rises.side == "front"
    assert np.isfinite(rises.step(sensors((np.nan,) * 3))).all()


def test_without_a_way_it_is_refused():
    with pytest.raises(CommandError, match="toy: no way to get up was found"):
        Riser(GetUp("toy", "f", ("left",), (0.0,), {}))
