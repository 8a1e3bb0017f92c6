"""The sentence of a fall belongs to that fall from its first row on."""

import threading

import pytest
from api_server import small_library
from msgspec.structs import replace
from patience import Deadline
from telemetry_factory import FALLEN, GIVEN_UP, told

from gaitchain.live.messages import Mode, ReplayState
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


def test_a_get_up_that_fails_leaves_the_fall_its_sentence(watch):
    fall(watch, 1.0)
    before = explained(watch)
    for begin_s in (2.0, 5.0):
        for i in range(20):
            watch.take(told(RES, begin_s + 0.1 * i, mode=Mode.GETTING_UP))
        watch.take(told(RES, begin_s + 2.0, **GIVEN_UP))
        assert watch.latest is before
    watch.take(told(RES, 8.0, mode=Mode.RISING))
    fall(watch, 8.1)  # up again, and down again: that is another one
    assert explained(watch).time_s == pytest.approx(8.6)


def test_a_get_up_whose_fall_was_not_seen_is_no_fall(watch):
    """As when the API was started, or a replay sought, in the middle of it."""
    watch.take(told(RES, 1.0, mode=Mode.GETTING_UP))
    watch.take(told(RES, 2.0, **GIVEN_UP))
    assert watch.latest is None


def played(row, jumps=1):
    """A row of a replay that was begun, or sought, so often."""
    replay = ReplayState(1.0, 100.0, 1.0, playing=True, where="a.mcap", jumps=jumps)
    return replace(row, replay=replay)


@pytest.fixture
def replayed(watch):
    """Plays a fall that began at 1 s; returns its sentence."""
    for row in (*rows(1.0), told(RES, 1.5, **FALLEN)):
        watch.take(played(row))
    return explained(watch)


@pytest.mark.parametrize("to_s", [60.0, 0.2])
def test_a_replay_that_is_sought_leaves_the_fall_behind(watch, replayed, to_s):
    other = FALLEN | {"reason": "fell: the trunk leans by 60 deg, limit 50"}
    watch.take(played(told(RES, to_s, **other), 2))
    assert watch.latest is not replayed
    assert watch.latest.time_s == to_s
    assert watch.latest.sentence == (
        "The robot fell: the trunk leans by 60 deg, limit 50. What led to it was not "
        "seen."
    )
    watch.take(played(told(RES, to_s + 0.004, **other), 2))
    assert watch.latest.time_s == to_s


def test_rows_from_before_a_jump_explain_no_fall_after_it(watch, monkeypatch):
    seen = []
    monkeypatch.setattr(watch, "_explain", seen.append)
    for row in rows(1.0):
        watch.take(played(row))
    for row in (*rows(5.0), told(RES, 5.5, **FALLEN)):
        watch.take(played(row, 2))
    watch.close()
    assert [row.time_s for row in seen[0]] == pytest.approx(
        [5.0 + 0.01 * i for i in range(51)]
    )


def test_a_replay_that_is_sought_back_has_no_fall_of_later(watch, replayed):
    watch.take(played(rows(1.0)[0], 2))
    assert watch.latest is None


def test_a_get_up_that_a_replay_is_sought_into_has_no_fall(watch, replayed):
    watch.take(played(told(RES, 60.0, mode=Mode.GETTING_UP), 2))
    watch.take(played(told(RES, 60.1, **GIVEN_UP), 2))
    assert watch.latest is None


def test_a_replay_that_goes_on_keeps_its_fall(watch, replayed):
    """A silence of the log, a loop that began anew in it, and a high speed."""
    for time_s in (60.0, 0.1, 0.6):
        watch.take(played(told(RES, time_s, **FALLEN)))
        assert watch.latest is replayed


@pytest.mark.parametrize(
    ("first", "tells"), [(1, False), (2000, True)], ids=["beginning", "middle"]
)
def test_a_fall_of_which_little_was_seen_says_so(watch, first, tells):
    """As after a replay was sought to just before it: the cause may be earlier."""
    for number, row in enumerate((*rows(8.0), told(RES, 8.5, **FALLEN)), start=first):
        watch.take(replace(row, number=number))
    sentence = explained(watch).sentence
    assert (
        "Only the last 0.50 s before it were seen, and the cause may be in those before"
        in sentence
    ) == tells


def test_a_fall_of_which_enough_was_seen_hints_at_nothing_earlier(watch):
    for number, row in enumerate((*rows(4.0, 450), told(RES, 8.5, **FALLEN)), 2000):
        watch.take(replace(row, number=number))
    assert "Only the last" not in explained(watch).sentence
