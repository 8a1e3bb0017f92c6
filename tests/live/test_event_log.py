"""What goes on for a while is two events, whatever numbers are in its text."""

import pytest
from live_robot import Live, SteppedClock

from gaitchain.errors import BackendError
from gaitchain.live.event_log import EventLog
from gaitchain.live.messages import Note


def texts(log):
    return [event.text for event in log.take()]


@pytest.fixture
def clock():
    return SteppedClock()


def test_a_silence_that_grows_is_told_at_its_beginning_and_its_end(clock):
    log, told = EventLog(clock), []
    for tick in range(103):
        log.add_spell("link", f"no servo has answered for {0.17 + 0.01 * tick:.2f} s")
        told += texts(log)
        clock.time_s += 0.01
    assert told == ["no servo has answered for 0.17 s"]
    clock.time_s += 1.0
    assert texts(log) == ["over, 103 times in 1.02 s: no servo has answered for 1.19 s"]
    log.add_spell("link", "no servo has answered for 0.17 s")
    assert texts(log) == ["no servo has answered for 0.17 s"]  # a new one


def test_what_was_found_once_has_no_end(clock):
    log = EventLog(clock)
    log.add_spell("overrun", "the loop was late by 0.20 s")
    assert len(texts(log)) == 1
    clock.time_s += 5.0
    assert texts(log) == []


def test_other_servos_are_another_event(clock):
    log = EventLog(clock)
    for number in (3, 4, 3):
        log.add_spell("link", f"no answer from left_knee (id {number})")
    assert len(texts(log)) == 2


def test_many_different_texts_are_bounded(clock):
    log, told = EventLog(clock), 0
    for number in range(1000):
        log.add_spell("link", f"id {number}")
        told += len(log.take())
    assert told == 1000
    assert len(log._spells) <= 32


def test_a_mode_that_comes_after_a_flood_is_told(clock):
    """The log and `explain` know modes by their events alone."""
    log = EventLog(clock)
    log.add("mode", "stopped to rising")
    for number in range(25):
        log.add("world", f"payload of {number} kg")
    log.add("mode", "rising to off")
    told = [event.kind for event in log.take()]
    assert told == ["mode", *20 * ["world"], "mode"]


def test_refusals_that_differ_are_told_though_they_come_at_once(clock):
    log = EventLog(clock)
    said = ["start by me refused: it stands", "rest by me refused: it walks"]
    for _ in range(50):
        for text in said:
            log.add_refusal(text)
        clock.time_s += 0.1
    assert texts(log) == said
    clock.time_s += 6.0
    log.add_refusal(said[0])
    assert texts(log) == said[:1]


def test_who_asks_again_is_answered_again(clock):
    """Though it is no new event; of a flood a few are."""
    log = EventLog(clock)
    for _ in range(3):
        log.add_refusal("start by me refused: it stands")
        assert log.take_refused() == ("start by me refused: it stands",)
    assert texts(log) == ["start by me refused: it stands"]
    for tick in range(100):
        log.add_refusal(f"start by driver{tick} refused: me drives")
    assert len(log.take_refused()) == 8
    assert log.take_refused() == ()


def test_refusals_that_all_differ_are_bounded(clock):
    log, told = EventLog(clock), 0
    for tick in range(6000):
        log.add_refusal(f"start by driver{tick} refused: me drives")
        told += len(log.take())
        clock.time_s += 0.01
    assert 60 <= told <= 65
    assert len(log._refused) <= 32


def test_a_backend_whose_errors_count_time_makes_two_events():
    live = Live().run(0.5)
    ticks = iter(range(1000))

    def silent(sensors):
        raise BackendError(f"no servo has answered for {0.01 * next(ticks):.2f} s")

    sound, live.robot.spoil = live.robot.spoil, silent
    live.run(1.0)
    live.robot.spoil = sound
    live.run(2.0)
    first, end = live.happened("link")
    assert first == "no servo has answered for 0.00 s"
    assert end == "over, 100 times in 0.99 s: no servo has answered for 0.99 s"


def test_links_that_other_parts_tell_of_are_bounded_as_well():
    live = Live().run(0.1)
    for tick in range(50):
        live.ask(Note("link", f"ROS: nothing heard for {0.5 * tick:.1f} s"))
        live.run(0.01)
    assert live.happened("link") == ["ROS: nothing heard for 0.0 s"]


def test_what_a_node_repeats_is_told_at_its_beginning_and_its_end():
    live = Live().run(0.1)
    refused = Note("command", "path on /gaitchain/path refused: pose 1 is in map")
    for _ in range(100):
        live.ask(refused)
        live.run(0.02)
    live.run(2.0)
    first, end = live.happened("command")
    assert first == refused.text
    assert end.startswith("over, 100 times in")
