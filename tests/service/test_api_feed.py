"""Which telemetry is shown: the newest one, with the truth where that is as new."""

from api_server import small_library
from telemetry_factory import told

from gaitchain.backends.base import Truth
from gaitchain.live.messages import ReplayState
from gaitchain.service.api_feed import _better

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
