"""Speed schedules: the text, its limits, and random ones."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.errors import CommandError
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.schedule import (
    PAPER_WALK,
    Segment,
    check_schedule,
    counts_steps,
    format_schedule,
    parse_schedule,
    random_steps,
    step_commands,
)
from gaitchain.messages import Command

# Speeds as people write them: up to six digits.
SPEEDS = st.builds(lambda n, e: n * 10.0**-e, st.integers(0, 999_999), st.just(5))
SEGMENTS = st.builds(
    lambda speed, steps: Segment(Command(speed), steps=steps),
    SPEEDS,
    st.integers(1, 10_000),
)
SCHEDULES = st.lists(SEGMENTS, min_size=1, max_size=5).map(tuple)


def test_the_papers_walk():
    schedule = parse_schedule(PAPER_WALK)
    assert schedule == (
        Segment(Command(0.04), steps=1),
        Segment(Command(0.08), steps=4),
        Segment(Command(0.02), steps=1),
    )
    speeds = [command.vx for command in step_commands(schedule)]
    assert speeds == [0.04, 0.08, 0.08, 0.08, 0.08, 0.02, 0.0]
    assert format_schedule(schedule) == PAPER_WALK


@given(SCHEDULES)
def test_what_is_written_is_read_again(schedule):
    again = parse_schedule(format_schedule(schedule))
    assert [s.steps for s in again] == [s.steps for s in schedule]
    for new, old in zip(again, schedule, strict=True):
        assert new.command.vx == pytest.approx(old.command.vx, rel=1e-5)
    assert parse_schedule(format_schedule(again)) == again


@given(SCHEDULES)
def test_one_command_per_step_and_a_stop(schedule):
    commands = step_commands(schedule)
    assert len(commands) == sum(s.steps for s in schedule) + 1
    assert commands[-1] == Command(0.0)


@pytest.mark.parametrize(
    ("text", "steps"),
    [("0.1@0.5", 1), (" 0.1 @ half ", 1), ("0.1@1.5", 3), ("1e-1@2", 4), ("0@1", 2)],
)
def test_spellings(text, steps):
    (segment,) = parse_schedule(text)
    assert segment.steps == steps
    assert segment.command.vx == (0.0 if text == "0@1" else 0.1)


@pytest.mark.parametrize(
    "text",
    [
        "",
        ",",
        "0.04",
        "@2",
        "0.04@",
        "0.04@two",
        "fast@2",
        "0.04@half,,0.08@2",
        "0.04@half,",
        "0.04@half;0.08@2",
        "0.0.4@2",
        "0.04@1.5.2",
        "0.04@.",
        "e@2",
        "nan@2",
        "0.04 m/s@2",
    ],
)
def test_malformed_text_shows_the_grammar(text):
    with pytest.raises(CommandError, match="speed@cycles") as refusal:
        parse_schedule(text)
    assert PAPER_WALK in str(refusal.value)


@pytest.mark.parametrize("cycles", ["0", "0.3", "0.75", "1.9", "5000.5", "99999999999"])
def test_impossible_cycles_say_what_is_possible(cycles):
    with pytest.raises(CommandError, match=r"multiple of 0\.5, 0\.5 to 5000"):
        parse_schedule(f"0.04@half,0.08@{cycles}")


@pytest.mark.parametrize("speed", ["-0.1", "1e999"])
def test_impossible_speeds(speed):
    with pytest.raises(CommandError, match="0 m/s or more"):
        parse_schedule(f"{speed}@2")


@given(st.text(max_size=20) | st.text("0123456789.@,halfe+- ", max_size=20))
def test_any_text_is_read_or_refused(text):
    try:
        schedule = parse_schedule(text)
    except CommandError:
        return
    if counts_steps(schedule):
        assert all(s.command.vx >= 0.0 and s.steps >= 1 for s in schedule)
    else:
        assert all(s.duration_s > 0.0 and s.steps == 0 for s in schedule)


@pytest.mark.parametrize("text", ["0.04@half,0.2@2", "0.01@2", "0.3@half"])
def test_speeds_out_of_range_name_the_range(text):
    with pytest.raises(CommandError, match=r"walks 0\.030 to 0\.100 m/s"):
        check_schedule(parse_schedule(text), CommandRange((0.03, 0.1)))


@pytest.mark.parametrize("text", ["0.03@1,0.1@2", "0.01@half,0.05@2,0@1", PAPER_WALK])
def test_speeds_in_range_pass(text):
    check_schedule(parse_schedule(text), CommandRange((0.03, 0.1)))


def test_no_way_ahead_is_none_for_steps_either():
    with pytest.raises(CommandError, match=r"0\.004 m/s in the schedule"):
        check_schedule(parse_schedule("0.004@2"), CommandRange((-0.1, 0.0)))


def test_standing_only_is_refused():
    with pytest.raises(CommandError, match="only stands"):
        check_schedule(parse_schedule("0@3,0@half"), CommandRange((0.03, 0.1)))


@given(st.integers(0, 2**32 - 1), st.floats(0.005, 0.05), st.floats(0.0, 0.2))
def test_random_steps(seed, low, width):
    high = low + width
    # A range may be too narrow to hold any whole millimetre per second.
    some_fit = math.ceil(1000.0 * low) <= math.floor(1000.0 * high)
    schedule = random_steps(np.random.default_rng(seed), low, high)
    again = random_steps(np.random.default_rng(seed), low, high)
    assert schedule == again
    assert schedule[0].steps == schedule[-1].steps == 1
    assert 2 <= len(schedule) - 2 <= 4
    assert all(s.steps in (2, 4) for s in schedule[1:-1])
    speeds = [s.command.vx for s in schedule]
    # Whole millimetres per second; inner segments may stand in between.
    for i, speed in enumerate(speeds):
        assert speed == round(1000.0 * speed) / 1000.0
        stands = speed == 0.0 and 1 < i < len(speeds) - 2
        if some_fit:
            assert stands or low <= speed <= high
        else:
            assert stands or abs(speed - low) < 1e-3
    check_schedule(schedule, CommandRange((low, high)))
    assert parse_schedule(format_schedule(schedule)) == schedule
    assert step_commands(schedule)[-1].vx == 0.0


@given(st.floats(0.0, 10.0), st.integers(1, 9999))
def test_steps_keep_all_digits(speed, steps):
    schedule = (Segment(Command(speed), steps=steps),)
    assert parse_schedule(format_schedule(schedule), steps=True) == schedule


def test_random_steps_vary_and_sometimes_stand():
    drawn = [random_steps(np.random.default_rng(n), 0.02, 0.1) for n in range(60)]
    assert len(set(drawn)) > 50
    stopping = [any(s.command.vx == 0.0 for s in schedule) for schedule in drawn]
    assert 0 < sum(stopping) < len(drawn)
