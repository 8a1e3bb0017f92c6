"""Which telemetry is shown: the newest, with a truth as new; and which events."""

import threading
from contextlib import closing
from itertools import count

import pytest
from api_server import small_library
from patience import Deadline
from telemetry_factory import BEGAN_NS, told

from gaitchain.backends.base import Truth
from gaitchain.live.messages import Event, Recall, ReplayState
from gaitchain.service import api_feed
from gaitchain.service.api_feed import Feed, _better
from gaitchain.service.channel import LoopEnd
from gaitchain.service.fall_watch import FallWatch

RES = small_library().robot
TRUTH = Truth((), (), (), (), (), (), (), (), (), False)


def replay(*, playing, jumps=1):
    return ReplayState(1.0, 9.0, 1.0, playing=playing, jumps=jumps)


def test_a_row_without_truth_waits_for_the_next_one_with_it():
    before, now = told(RES, 1.0, truth=TRUTH), told(RES, 1.004)
    assert _better(before, now) is before
    assert _better(before, told(RES, 1.2)).time_s == 1.2


def test_a_replay_that_is_paused_on_a_row_without_truth_is_shown():
    before = told(RES, 1.0, truth=TRUTH, replay=replay(playing=True))
    paused = told(RES, 1.004, replay=replay(playing=False))
    assert _better(before, paused) is paused
    moving = told(RES, 1.004, replay=replay(playing=True))
    assert _better(before, moving) is before


def live(folder, first, until, number, deaf=0):
    """Be a loop whose first event was told to nobody, until something is so.

    Its rows count from a number; it does not hear as many requests as it is deaf to.
    """
    deadline, pause, recalled = Deadline(), threading.Event(), None
    with closing(LoopEnd(folder)) as loop:
        for row in count(number):
            loop.publish(told(RES, number=row, recalled=recalled))
            if until():
                return
            asked = Recall() in loop.requests()
            recalled = (first,) if asked and not deaf else None
            deaf -= asked and deaf > 0
            pause.wait(0.004)
            assert not deadline.passed()


@pytest.mark.parametrize("deaf", [0, 2])
def test_every_loop_is_asked_for_what_it_said_to_nobody(tmp_path, deaf):
    """Of two loops, each of which begins on a clock and with a number of its own.

    A request that goes to the first as it ends is lost, too.
    """
    first, second = (Event(0.0, BEGAN_NS + n, "mode", "it stands") for n in (1, 2))
    feed = Feed(tmp_path, FallWatch(small_library()), 1.0)
    feed.start()
    with closing(feed):
        live(tmp_path, first, lambda: len(feed.events) == 1, 5000)
        live(tmp_path, second, lambda: len(feed.events) == 2, 1, deaf)
    assert [event.stamp_ns for event in feed.events] == [BEGAN_NS + 1, BEGAN_NS + 2]


def happened(*at):
    """Events so late, each named by its time."""
    return tuple(Event(s, BEGAN_NS + round(1e9 * s), "world", str(s)) for s in at)


@pytest.fixture
def feed(tmp_path):
    """Takes rows one by one."""
    watch = FallWatch(small_library())
    yield Feed(tmp_path, watch, 1.0)
    watch.close()


def told_by(feed):
    return [(event.number, float(event.text)) for event in feed.events]


def test_events_of_lost_rows_come_before_what_happened_after_them(feed):
    for number in (1, 2, 5, 6):
        feed.hear(told(RES, number=number, events=happened(float(number))))
    assert told_by(feed) == [(1, 1.0), (2, 2.0)]
    assert feed.misses
    past, now = happened(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), happened(7.0)
    feed.hear(told(RES, number=7, recalled=past, events=now))
    assert told_by(feed) == [(n, float(n)) for n in range(1, 8)]
    assert not feed.misses


def test_what_a_loop_said_that_ended_comes_before_what_the_next_one_says(feed):
    feed.hear(told(RES, number=5, events=happened(5.0)))
    feed.hear(told(RES, number=1))
    feed.hear(told(RES, number=2, recalled=happened(6.0, 7.0)))
    assert told_by(feed) == [(1, 5.0), (2, 6.0), (3, 7.0)]


def test_events_are_not_held_for_ever_where_nobody_repeats_those_before(
    feed, monkeypatch
):
    feed.hear(told(RES, number=5, events=happened(5.0)))
    assert feed.events == ()
    monkeypatch.setattr(api_feed, "_HELD_S", 0.0)
    feed.hear(told(RES, number=6, events=happened(6.0)))
    assert told_by(feed) == [(1, 5.0), (2, 6.0)]
    assert feed.misses


def played(number, *at, jumps=1, **changes):
    """A row of a log in which events of such times happened."""
    now = replay(playing=True, jumps=jumps)
    return told(RES, number=number, events=happened(*at), replay=now, **changes)


def test_a_replay_whose_rows_are_not_all_shown_misses_nothing(feed):
    feed.hear(played(5, 5.0, recalled=()))
    feed.hear(played(9, 9.0))
    assert told_by(feed) == [(1, 5.0), (2, 9.0)]
    assert not feed.misses


def test_a_replay_that_is_sought_has_the_events_up_to_there_alone(feed):
    feed.hear(played(5, 5.0, recalled=()))
    feed.hear(played(9, 9.0))
    feed.hear(played(7, 7.0, jumps=2))  # whose row with what was before it was lost
    assert feed.events == ()
    assert feed.misses
    feed.hear(played(8, 8.0, jumps=2, recalled=happened(5.0, 7.0)))
    assert told_by(feed) == [(3, 5.0), (4, 7.0), (5, 8.0)]
    assert not feed.misses
    feed.hear(played(1, jumps=3, recalled=()))  # where nothing has happened yet
    assert feed.events == ()
    assert not feed.misses
