"""The queue between who publishes and who listens."""

import queue
import threading

import pytest
from patience import PATIENCE_S
from ros_peers import until

from gaitchain.backends.ros.link import Mailbox


@pytest.fixture
def go_on():
    event = threading.Event()
    yield event
    event.set()


def test_a_full_box_loses_the_oldest_and_counts(go_on):
    handled, busy = queue.Queue(), threading.Event()

    def handle(letter):
        busy.set()
        go_on.wait(PATIENCE_S)
        handled.put(letter)
        return True

    box = Mailbox(handle, "slow")
    box.put(0)
    assert busy.wait(PATIENCE_S)
    for letter in range(1, 101):
        box.put(letter)
    assert (box.put_in, box.lost) == (101, 92)
    go_on.set()
    box.close(PATIENCE_S)
    assert list(handled.queue) == [0, *range(93, 101)]


def test_what_fails_is_lost_and_the_next_is_handled(caplog):
    handled = queue.Queue()

    def handle(letter):
        handled.put(letter)
        if letter == "raise":
            raise ZeroDivisionError
        return letter == "good"

    box = Mailbox(handle, "box")
    for letter in ("raise", "bad", "good"):
        box.put(letter)
    box.close(PATIENCE_S)
    assert list(handled.queue) == ["raise", "bad", "good"]
    assert (box.put_in, box.lost) == (3, 2)
    assert "box: lost raise" in caplog.text


def test_a_woken_box_is_handled_although_empty():
    handled = queue.Queue()

    def handle(letter):
        handled.put(letter)
        return True

    box = Mailbox(handle, "box")
    box.wake()
    assert handled.get(timeout=PATIENCE_S) is None
    box.close(PATIENCE_S)
    box.put(1)
    assert (box.put_in, box.lost) == (1, 1)


def test_closing_waits_for_nobody_that_hangs(go_on):
    box = Mailbox(lambda _: go_on.wait(PATIENCE_S), "hangs")
    box.put(1)
    box.close(0.01)
    assert not go_on.is_set()
    go_on.set()
    until(lambda: not any(t.name == "hangs" for t in threading.enumerate()))
