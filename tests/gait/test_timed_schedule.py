"""Timed schedules: the text, what a library can do at once, and random ones."""

import math
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.errors import CommandError
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.schedule import (
    PAPER_WALK,
    SHORTEST_S,
    Segment,
    check_schedule,
    counts_steps,
    due_commands,
    format_schedule,
    lowered,
    parse_schedule,
    random_commands,
    show_walk,
)
from gaitchain.messages import Command

MOST = CommandRange(vx=(-0.2, 0.5), vy=(-0.1, 0.1), yaw_rate=(-0.6, 0.4))
NUMBERS = st.floats(-1e3, 1e3) | st.integers(-5, 5).map(float)
SEGMENTS = st.builds(
    Segment, st.builds(Command, NUMBERS, NUMBERS, NUMBERS), st.floats(0.01, 3600.0)
)
SCHEDULES = st.lists(SEGMENTS, min_size=1, max_size=5).map(tuple)
RANGES = st.builds(
    lambda ends: CommandRange(*((-low, high) for low, high in ends)),
    st.lists(
        st.tuples(st.just(0.0) | st.floats(0.01, 1.0), st.floats(0.01, 1.0)),
        min_size=3,
        max_size=3,
    ),
)


def asked(text):
    return [segment.command for segment in parse_schedule(text, steps=False)]


@given(SCHEDULES)
def test_what_is_written_is_read_again_to_the_last_digit(schedule):
    text = format_schedule(schedule)
    assert not counts_steps(parse_schedule(text))
    assert parse_schedule(text) == schedule
    assert parse_schedule(text, steps=False) == schedule


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ("0.3,0,0@5", Command(0.3)),
        ("0.3,-0.1@5", Command(0.3, -0.1)),
        ("0.3@5;", Command(0.3)),
        (" -0.2 , 0.1 , -.5 @ 5 ", Command(-0.2, 0.1, -0.5)),
        ("1e-1,0,0@5e0", Command(0.1)),
    ],
)
def test_spellings(text, command):
    assert parse_schedule(text, steps=False) == (Segment(command, 5.0),)


def test_commas_and_semicolons_tell_the_kinds_apart():
    assert counts_steps(parse_schedule(PAPER_WALK))
    assert parse_schedule("0.1@2") == (Segment(Command(0.1), steps=4),)
    assert parse_schedule("0.1@2", steps=False) == (Segment(Command(0.1), 2.0),)
    assert not counts_steps(parse_schedule("0.1,0@2"))
    assert not counts_steps(parse_schedule("0.1@2;0.2,0,0.1@3"))


def test_the_other_kind_is_refused_with_the_grammar_that_is_meant():
    with pytest.raises(CommandError, match="vx,vy,yaw@seconds") as refusal:
        parse_schedule(PAPER_WALK, steps=False)
    assert "cycles" not in str(refusal.value)
    with pytest.raises(CommandError, match="speed@cycles") as refusal:
        parse_schedule("0.3,0,0.1@2", steps=True)
    assert "seconds" not in str(refusal.value)


@pytest.mark.parametrize(
    "text", ["0.3,0;0.2@3", "1,2,3,4,5@6", "0.3,0@", "a,b@2", ";", "0.3,0@2;;0.1,0@2"]
)
def test_malformed_text_shows_both_grammars(text):
    with pytest.raises(CommandError, match="vx,vy,yaw@seconds") as refusal:
        parse_schedule(text)
    assert PAPER_WALK in str(refusal.value)


@pytest.mark.parametrize("time", ["0", "-1", "3601", "nan", "inf"])
def test_impossible_times(time):
    with pytest.raises(CommandError, match=r"0\.01 to 3600 s"):
        parse_schedule(f"0.3,0@{time}", steps=False)


@pytest.mark.parametrize("speed", ["nan", "inf", "-1e999"])
def test_impossible_speeds(speed):
    with pytest.raises(CommandError, match="finite"):
        parse_schedule(f"0,{speed}@2", steps=False)


@given(st.text("0123456789.@,;e+- ", max_size=20))
def test_any_text_is_read_or_refused(text):
    try:
        schedule = parse_schedule(text, steps=False)
    except CommandError:
        return
    assert all(math.isfinite(sum(astuple(s.command))) for s in schedule)
    assert parse_schedule(format_schedule(schedule), steps=False) == schedule


def test_a_fourth_number_lowers_the_hips():
    text = "0.3,0,0,0.05@2;0.1@1"
    low, high = parse_schedule(text, steps=False)
    assert low.command == Command(0.3, crouch=0.05)
    assert format_schedule((low, high)) == "0.3,0,0,0.05@2;0.1,0,0@1"
    crouched = [s.command.crouch for s in lowered((low, high), 0.02)]
    assert crouched == [0.05, 0.02]
    assert lowered((high,), 0.0) == (high,)


def test_commands_come_in_time_and_a_stop_after_them():
    first, second = asked("0.3@1.5;0,0,0.2@0.25")
    schedule = parse_schedule("0.3@1.5;0,0,0.2@0.25", steps=False)
    assert due_commands(schedule, 0.0) == [
        (0.0, first),
        (1.5, second),
        (1.75, Command()),
    ]


@pytest.mark.parametrize(
    ("text", "value", "limit"),
    [
        ("0.6@2", "0.6 m/s ahead", "-0.200 to 0.500"),
        ("-0.3@2", "-0.3 m/s ahead", "-0.200 to 0.500"),
        ("0,0.2@2", "0.2 m/s to the left", "-0.100 to 0.100"),
        ("0,0,0.5@2", "0.5 rad/s to the left", "-0.600 to 0.400"),
        ("0.1@2;0,0,-1@2", "-1 rad/s to the left", "-0.600 to 0.400"),
    ],
)
def test_numbers_out_of_range_are_named(text, value, limit):
    with pytest.raises(CommandError) as refusal:
        check_schedule(parse_schedule(text, steps=False), MOST)
    assert value in str(refusal.value)
    assert limit in str(refusal.value)


def test_too_much_at_once_is_refused_with_what_can_be_done():
    with pytest.raises(CommandError, match="at most 1") as refusal:
        check_schedule(parse_schedule("0.4,0,0.3@2", steps=False), MOST)
    less = str(refusal.value).split("give ")[1].split(" or less")[0]
    check_schedule(parse_schedule(f"{less}@2", steps=False), MOST)
    assert MOST.share(asked(f"{less}@2")[0]) == pytest.approx(1.0, abs=0.03)


def test_what_rounds_to_the_ends_passes():
    check_schedule(
        parse_schedule("0.504@2;-0.2@1;0.25,0.05@1;0@3;0,0,-0.6@1", steps=False), MOST
    )


def test_standing_only_is_refused():
    with pytest.raises(CommandError, match="only stands"):
        check_schedule(parse_schedule("0@3;0,0,0@2", steps=False), MOST)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0@1", 0.0),
        ("0.25@1", 0.5),
        ("-0.1@1", 0.5),
        ("0.25,-0.05,-0.6@1", 2.0),
        ("0,0,0.4@1", 1.0),
    ],
)
def test_shares_add_up(text, expected):
    assert MOST.share(asked(text)[0]) == pytest.approx(expected)
    assert CommandRange((0.0, 0.5)).share(Command(vy=0.1)) == math.inf


@given(st.integers(0, 2**32 - 1), RANGES, st.floats(1.0, 40.0), st.floats(0.5, 5.0))
def test_random_stepss_can_be_walked(seed, most, seconds, every_s):
    drawn = random_commands(np.random.default_rng(seed), most, seconds, every_s)
    assert drawn == random_commands(np.random.default_rng(seed), most, seconds, every_s)
    assert sum(s.duration_s for s in drawn) == pytest.approx(seconds, abs=SHORTEST_S)
    assert all(s.duration_s == every_s for s in drawn[:-1])
    for segment in drawn:
        assert most.share(segment.command) <= 1.0
        for value in astuple(segment.command):
            assert value == round(1000.0 * value) / 1000.0
    if not all(s.command.stops for s in drawn):
        check_schedule(drawn, most)
    assert parse_schedule(format_schedule(drawn)) == drawn


def test_random_commands_fill_the_range_evenly():
    """In a cross polytope, the part of the most grows like the cube of the volume."""
    drawn = random_commands(np.random.default_rng(0), MOST, seconds=8000.0)
    commands = np.array([s.command.motion for s in drawn])
    shares = np.array([MOST.share(s.command) for s in drawn])
    for part in (0.25, 0.5, 0.75):
        assert np.mean(shares < part) == pytest.approx(part**3, abs=0.03)
    ahead = np.mean(commands > 0.0, axis=0)
    np.testing.assert_allclose(ahead, [0.5 / 0.7, 0.5, 0.4], atol=0.03)


def test_a_range_without_sideways_draws_none():
    drawn = random_commands(np.random.default_rng(1), CommandRange((0.0, 0.3)), 40.0)
    assert {(s.command.vy, s.command.yaw_rate) for s in drawn} == {(0.0, 0.0)}
    assert min(s.command.vx for s in drawn) >= 0.0
    assert max(s.command.vx for s in drawn) > 0.2


def test_the_walk_that_shows_off_goes_every_way():
    shown = show_walk(MOST)
    check_schedule(shown, MOST)
    directions = np.sign([s.command.motion for s in shown])
    assert set(directions[:, 0]) == set(directions[:, 1]) == {-1.0, 0.0, 1.0}
    assert set(directions[:, 2]) == {-1.0, 0.0, 1.0}
    only_ahead = show_walk(CommandRange((0.0, 0.5)))
    assert all(s.command.vx > 0.0 for s in only_ahead)
    check_schedule(only_ahead, CommandRange((0.0, 0.5)))
