"""How commands share a range: parts, shares, a wheel that is pulled, refusals."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.errors import CommandError
from gaitchain.gait.command_range import CommandRange
from gaitchain.messages import Command

LOW = CommandRange((-0.2, 0.4), crouch=(0.1, 0.04))
NO_WAY = CommandRange((0.0, 0.5), (-0.2, 0.1))
SLOW = CommandRange((0.02, 0.1))
ENDS = st.tuples(
    st.just(0.0) | st.floats(-1.0, -0.01), st.just(0.0) | st.floats(0.01, 1.0)
)
RANGES = st.builds(CommandRange, ENDS, ENDS, ENDS)
PULLS = st.tuples(*[st.just(0.0) | st.floats(-1.0, 1.0)] * 3)
MOST = st.floats(0.01, 1.0)


@given(RANGES, PULLS, MOST)
def test_a_wheel_asks_in_its_direction_for_its_share_at_most(span, pulls, most):
    """Oracle: the corner of the cross polytope in each direction, as vectors."""
    corners = [ends[pull > 0.0] for pull, ends in zip(pulls, span.ends, strict=True)]
    wish = np.abs(pulls) * corners
    known = sum(abs(p) for p, c in zip(pulls, corners, strict=True) if c)
    expected = wish * min(1.0, most / known if known else 1.0)
    steered = span.steer(pulls, most)
    assert steered.motion == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert span.share(steered) == pytest.approx(min(known, most))
    assert span.clamp(steered) == (steered, "")


@given(RANGES, PULLS, st.integers(0, 2), st.sampled_from([-1.0, 1.0]))
def test_what_remains_beside_a_command_is_walked_and_no_more(span, pulls, axis, sign):
    """Oracle: a command is clamped if and only if it is beyond the range."""
    pulls = [0.0 if a == axis else pull for a, pull in enumerate(pulls)]
    beside = span.steer(pulls)
    rest = span.beside(beside).ends[axis][sign > 0.0]
    assert rest * sign >= 0.0
    both = list(beside.motion)
    both[axis] = rest
    assert span.share(Command(*both)) <= 1.0 + 1e-9
    both[axis] = rest + 0.01 * sign
    assert span.clamp(Command(*both))[1] != ""


@given(RANGES, PULLS)
def test_parts_are_those_that_were_asked_for(span, pulls):
    parts = span.parts(span.at(pulls))
    for part, pull, (low, high) in zip(parts, pulls, span.ends, strict=True):
        known = high > 0.0 if pull > 0.0 else low < 0.0
        assert part == pytest.approx(pull if known else 0.0)
    assert span.share(span.at(pulls)) == pytest.approx(sum(map(abs, parts)))


def test_there_is_no_part_where_there_is_no_way():
    assert NO_WAY.parts(Command(-0.1, -0.1, 0.1)) == (-math.inf, -0.5, math.inf)
    assert math.isinf(NO_WAY.share(Command(0.25, math.nan)))
    assert SLOW.parts(Command(0.05)) == (0.5, 0.0, 0.0)


@pytest.mark.parametrize(
    ("span", "command", "says"),
    [
        (CommandRange((-0.41182, 0.56465)), Command(0.565), r"-0\.411 to 0\.564 m/s"),
        (SLOW, Command(-0.01), r"^-0\.01 m/s ahead: .* 0\.020 to 0\.100 m/s"),
        (NO_WAY, Command(0.1, 0.0, 0.1), r"^0\.1 rad/s to the left: .* 0\.000 to 0\.0"),
        (NO_WAY, Command(math.nan), "^nan m/s ahead: "),
        (NO_WAY, Command(crouch=0.01), "^crouch 0.01 m: this library does not crouch"),
        (LOW, Command(crouch=-0.01), r"^crouch -0.01 m: .* goes 0 to 0\.100 m lower"),
        (LOW, Command(crouch=math.nan), "^crouch nan m: this library goes 0 to"),
    ],
)
def test_a_number_beyond_its_limits_is_refused_with_them(span, command, says):
    with pytest.raises(CommandError, match=says):
        span.check_each(command)


def test_what_will_be_clamped_is_not_refused():
    CommandRange((-0.41182, 0.56465)).check_each(Command(0.564))
    SLOW.check_each(Command(0.01))  # slower than any walk
    SLOW.check_each(Command(0.0))
    NO_WAY.check_each(Command(0.5, 0.1))  # twice what can be done at once
    LOW.check_each(Command(0.4, crouch=0.1))  # less is left at this speed


@pytest.mark.parametrize(
    ("speed", "most"), [(0.0, 0.1), (0.2, 0.07), (0.4, 0.04), (-0.2, 0.04)]
)
def test_less_crouch_is_left_at_speed(speed, most):
    assert LOW.deepest(Command(speed)) == pytest.approx(most)
    done, note = LOW.clamp(Command(speed, crouch=0.2))
    assert done == Command(speed, crouch=pytest.approx(most))
    assert f"{most:.3f} m" in note
    assert LOW.clamp(replace(done, crouch=0.99 * most))[1] == ""
    assert LOW.room(Command(speed), 0.99 * most) == 1.0


@pytest.mark.parametrize("crouch", [-0.001, 0.11, math.nan, math.inf])
def test_a_schedule_is_refused_a_crouch_that_is_none(crouch):
    LOW.check(Command(0.4, crouch=0.1))
    with pytest.raises(CommandError, match=r"^crouch .* 0 to 0\.100 m lower"):
        LOW.check(Command(0.4, crouch=crouch))


AHEAD_ALONE = st.tuples(st.floats(0.01, 0.5), st.floats(0.5, 1.0))
BACK_ALONE = AHEAD_ALONE.map(lambda ends: (-ends[1], -ends[0]))


@given(RANGES, ENDS | AHEAD_ALONE | BACK_ALONE, st.integers(0, 2**32 - 1))
def test_what_is_drawn_is_allowed(span, ahead, seed):
    """Also where a library has a slowest walk ahead or back, as of key poses."""
    span = replace(span, vx=ahead)
    span.check(span.draw(np.random.default_rng(seed)))


def test_draws_are_even_from_the_slowest_walk_to_the_fastest():
    """Oracle: the mean and the deviation of an even distribution."""
    rng, span = np.random.default_rng(0), CommandRange((0.04, 0.1))
    speeds = [span.draw(rng).vx for _ in range(4000)]
    assert 0.039 <= min(speeds) < 0.042 and 0.098 < max(speeds) <= 0.1
    assert np.mean(speeds) == pytest.approx(0.07, abs=0.001)
    assert np.std(speeds) == pytest.approx(0.06 / math.sqrt(12.0), abs=0.001)


def test_draws_of_a_range_with_0_stay_as_builds_had_them():
    span = CommandRange((-0.2, 0.4), (-0.1, 0.1), (-0.5, 0.3))
    drawn = [span.draw(np.random.default_rng(seed)).motion for seed in (2, 3)]
    assert drawn == [(0.08, 0.034, -0.19), (0.271, 0.01, -0.039)]


@given(RANGES, st.tuples(*[st.floats(-0.02, 0.02)] * 3))
def test_what_a_check_passes_is_walked_and_not_stopped(span, motion):
    """Oracle: each component goes a way that the range has."""
    command = Command(*motion)
    known = [
        v == 0.0 or (hi > 0.0 if v > 0.0 else lo < 0.0)
        for v, (lo, hi) in zip(motion, span.ends, strict=True)
    ]
    try:
        span.check(command)
    except CommandError:
        return
    assert all(known)
    assert span.clamp(command)[0].stops == command.stops


def test_a_direction_that_is_missing_is_refused_with_those_there_are():
    message = (
        r"^0\.004 rad/s to the left: this library walks 0\.000 to 0\.500 m/s ahead, "
        r"-0\.200 to 0\.100 m/s to the left, and 0$"
    )
    with pytest.raises(CommandError, match=message):
        NO_WAY.check(Command(0.1, 0.0, 0.004))
    with pytest.raises(CommandError, match="walks in no direction"):
        CommandRange((0.0, 0.0)).check(Command(0.001))
    NO_WAY.check(Command(0.504))
    with pytest.raises(CommandError, match=r"^nan m/s ahead"):
        NO_WAY.check(Command(math.nan))


def test_a_command_too_large_to_add_up_stops_with_a_note():
    done, note = NO_WAY.clamp(Command(1e308, 1e308))
    assert done == Command()
    assert "(1e+308, 1e+308, 0.0) is no command: stop" in note
    assert NO_WAY.clamp(Command(-0.0)) == (Command(), "")


def test_who_is_low_has_no_room_for_speed():
    assert LOW.room(Command(0.4), 0.07) == pytest.approx(0.5)
    assert LOW.room(Command(-0.1), 0.07) == 1.0
    assert LOW.room(Command(0.4), 0.1) == 0.0
    assert LOW.room(Command(0.0, 0.1), 0.1) == 1.0


@pytest.mark.parametrize("fast", [0.1, 0.04])
def test_a_crouch_beyond_its_end_by_a_last_digit_walks_on(fast):
    """As where the range's own end is written with nine digits."""
    span = replace(LOW, crouch=(0.1, fast))
    most = span.deepest(Command(0.3))
    done, note = span.clamp(Command(0.3, crouch=most * (1.0 + 5e-10)))
    assert (done.crouch, note) == (most, "")
    assert span.room(done, done.crouch) == pytest.approx(1.0)
    if fast == 0.1:
        assert span.room(done, 0.1 + 1e-9) == 1.0


def test_a_range_keeps_its_crouch():
    rest = LOW.beside(Command(0.2)), LOW.within(CommandRange((0.0, 0.1)))
    assert [span.crouch for span in rest] == [LOW.crouch] * 2
    assert LOW.steer((1.0, 0.0, 0.0), crouch=0.5).crouch == pytest.approx(0.05)
    assert Command(0.3, crouch=0.05).scaled(0.5) == Command(0.15, crouch=0.05)
    assert Command(0.3, 0.1, 0.2, 0.05).halted == Command(crouch=0.05)


@given(st.integers(-9999, 9999))
def test_numbers_that_are_exact_stay_so_in_both_directions(thousandths):
    end = abs(thousandths) / 1000.0
    both = CommandRange(vx=(-end, end), yaw_rate=(-1.0, 1.0))
    there = both.rounded_at((math.copysign(1.0, thousandths), 0.0, 0.0))
    assert there.motion == (thousandths / 1000.0, 0.0, 0.0)


def test_a_crouch_that_a_message_names_is_accepted():
    """0.00684 m were said to be 0.007 m in some places."""
    span = CommandRange((-0.2, 0.4), crouch=(0.0068363, 0.0068363))
    done, note = span.clamp(Command(crouch=0.007))
    assert done.crouch == 0.0068363
    named = float(re.search(r"leave (\S+) m", note)[1])
    assert span.clamp(Command(crouch=named)) == (Command(crouch=named), "")
    span.check(Command(crouch=named))
