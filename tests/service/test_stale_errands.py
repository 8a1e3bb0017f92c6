"""Which errands are but repeated to a loop that has begun anew."""

from servo_bench import RES
from telemetry_factory import told

from gaitchain.live.driver_lease import LEASE_S
from gaitchain.live.messages import GoTo
from gaitchain.service.stale_errands import StaleErrands
from gaitchain.walker.place import Place

AHEAD = Place(1.0, 0.0)


class Asking:
    """A driver who asks for the same again and again, and a clock."""

    def __init__(self):
        self.now_s = 100.0
        self.errands = StaleErrands(lambda: self.now_s)

    def asks(self, loop_s, after_s=0.5, place=AHEAD, driver="me"):
        """Return whether it is stale; of a silent loop `loop_s` is None."""
        self.now_s += after_s
        row = None if loop_s is None else told(RES, loop_s)
        return self.errands.asks(GoTo(driver, (place,)), row)


def test_an_errand_goes_on_while_the_loop_does():
    me = Asking()
    assert not any(me.asks(0.5 * i) for i in range(20))


def test_it_stays_stale_through_the_silence_and_after_it():
    me = Asking()
    me.asks(50.0)
    assert not any(me.asks(None) for _ in range(20)), "nobody is there to take it"
    assert all(me.asks(0.5 * i) for i in range(200)), "also when as old as the other"


def test_who_pauses_or_wants_something_else_means_it():
    me = Asking()
    me.asks(50.0)
    assert me.asks(1.0)
    assert not me.asks(5.0, after_s=LEASE_S)
    assert me.asks(0.1)
    lower = GoTo("me", (AHEAD,), 0.01)
    assert me.errands.asks(lower, told(RES, 0.2)), "it is the same place"
    assert not me.asks(1.0, place=Place(2.0, 0.0))
    assert not me.asks(1.5)


def test_drivers_are_told_apart_and_forgotten_at_last():
    me = Asking()
    me.asks(50.0)
    assert not me.asks(1.0, driver="you")
    assert me.asks(1.5)
    me.errands.forget("me")
    assert not me.asks(2.0)
    for i in range(1000):
        me.asks(2.0, after_s=0.0, driver=f"driver {i}")
    assert len(me.errands._asked) <= 32
