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
from gaitchain.service.api_feed import Feed, _better
from gaitchain.service.channel import LoopEnd
from gaitchain.service.fall_watch import FallWatch

RES = small_library().robot
TRUTH = Truth((), (), (), (), (), (), (), (), (), False)


def replay(*, playing):
    return ReplayState(at_s=1.0, length_s=9.0, speed=1.0, playing=playing)


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
    deadline, pause, recalled = Deadline(), threading.Event(), ()
    with closing(LoopEnd(folder)) as loop:
        for row in count(number):
            loop.publish(told(RES, number=row, recalled=recalled))
            if until():
                return
            asked = Recall() in loop.requests()
            recalled = (first,) if asked and not deaf else ()
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
