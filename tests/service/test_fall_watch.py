"""The sentence of a fall belongs to that fall from its first row on."""

import threading

import pytest
from api_server import small_library
from patience import Deadline
from telemetry_factory import FALLEN, told

from gaitchain.service.fall_watch import FallWatch

RES = small_library().robot
SOUGHT = "Its cause is being looked for."


@pytest.fixture
def watch():
    watch = FallWatch(small_library())
    yield watch
    watch.close()


def rows(begin_s, count=50):
    return [told(RES, begin_s + 0.01 * i) for i in range(count)]


def fall(watch, begin_s):
    for row in rows(begin_s):
        watch.take(row)
    watch.take(told(RES, begin_s + 0.5, **FALLEN))


def explained(watch):
    deadline = Deadline()
    while SOUGHT in watch.latest.sentence:
        assert not deadline.passed()
    return watch.latest


def test_a_later_fall_never_has_the_sentence_of_the_one_before(watch):
    fall(watch, 1.0)
    first = explained(watch)
    assert first.time_s == pytest.approx(1.5)
    hold = threading.Event()
    watch._worker.submit(hold.wait)  # as long as explaining may take
    fall(watch, 20.0)
    now = watch.latest
    assert now.time_s == pytest.approx(20.5)
    assert now.sentence.endswith(SOUGHT)
    hold.set()
    assert explained(watch).time_s == pytest.approx(20.5)


def test_an_explanation_that_comes_late_replaces_no_later_fall(watch):
    hold = threading.Event()
    watch._worker.submit(hold.wait)
    fall(watch, 1.0)
    fall(watch, 20.0)
    hold.set()
    assert explained(watch).time_s == pytest.approx(20.5)


def test_a_fall_that_a_restarted_loop_remembers_is_no_new_one(watch):
    fall(watch, 1.0)
    before = explained(watch)
    watch.take(told(RES, 0.01, **FALLEN))
    assert watch.latest is before
