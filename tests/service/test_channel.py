"""Requests on their way to the loop: what an emergency stop overtakes."""

import threading
from contextlib import closing

import pytest
import zmq
from patience import PATIENCE_S, Deadline
from planned_library import planned_res
from telemetry_factory import told

from gaitchain.live.messages import (
    Drive,
    EmergencyStop,
    GetUp,
    GoTo,
    LetGo,
    Note,
    Recall,
    Reset,
    Shutdown,
    Start,
    Stop,
    encode,
)
from gaitchain.service.channel import Listener, LoopEnd
from gaitchain.walker.place import Place

RES = planned_res().robot
MOVES = Reset("me"), Start("me"), GetUp("me"), Drive("me", 0.1), GoTo("me", (Place(),))
HARMLESS = Stop("me"), LetGo("me"), Note("part", "said"), Recall(), Shutdown()


class Asked:
    """A loop's end, of which the test knows what has arrived."""

    def __init__(self, end):
        self.end = end
        for socket in (end._requests, end._emergency):
            socket.close()
        self._requests, end._requests = self._pair("requests")
        self._emergency, end._emergency = self._pair("emergency")

    def _pair(self, name):
        """Two ends in one process: what was sent is there."""
        pull, push = (self.end._context.socket(kind) for kind in (zmq.PULL, zmq.PUSH))
        pull.bind(f"inproc://{name}")
        push.connect(f"inproc://{name}")
        return push, pull

    def ask(self, *requests):
        for request in requests:
            stops = isinstance(request, EmergencyStop)
            (self._emergency if stops else self._requests).send(encode(request))


@pytest.fixture
def asked(tmp_path):
    with closing(LoopEnd(tmp_path)) as end:
        yield Asked(end)


def test_what_was_asked_before_an_emergency_stop_does_not_undo_it(asked):
    asked.ask(*MOVES, *HARMLESS, EmergencyStop("you"))
    assert asked.end.requests() == [EmergencyStop("you"), *HARMLESS]


def test_a_long_queue_does_not_undo_it_in_the_next_period(asked):
    asked.ask(*[Recall()] * 60, *MOVES, EmergencyStop("you"))
    assert asked.end.requests() == [EmergencyStop("you"), *[Recall()] * 60]
    assert asked.end.requests() == []


def test_what_is_asked_after_it_is_taken(asked):
    asked.ask(EmergencyStop("you"))
    asked.end.requests()
    asked.ask(*MOVES)
    assert asked.end.requests() == [*MOVES]


def test_the_first_row_of_a_loop_reaches_the_log_that_it_waited_for(tmp_path):
    """A socket that connects again takes up to 0.1 s: a row of each 4 ms was lost."""
    heard, deadline = [], Deadline()

    def listen():
        with closing(Listener(tmp_path, logs=True)) as log:
            while len(heard) < 4 and not deadline.passed():
                heard.extend(row.number for row in [log.next(0.1)] if row is not None)

    listening = threading.Thread(target=listen)
    listening.start()
    for loop in range(2):  # the second one as after the first was killed
        with closing(LoopEnd(tmp_path)) as end:
            assert end.await_log(PATIENCE_S)
            for number in (1, 2):
                end.publish(told(RES, number=number))
            while len(heard) < 2 * loop + 2 and not deadline.passed():
                listening.join(0.01)
    listening.join()
    assert heard == [1, 2, 1, 2]


def test_a_loop_does_not_wait_for_a_log_that_does_not_come(tmp_path):
    with closing(LoopEnd(tmp_path)) as end, closing(Listener(tmp_path)):
        assert not end.await_log(0.3)
