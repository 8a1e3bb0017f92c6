"""Tell errands that are but repeated to a loop that has begun anew."""

import math
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import NamedTuple

from gaitchain.live.driver_lease import LEASE_S
from gaitchain.live.messages import Errand, GoTo, Telemetry

_DRIVERS = 32  # names are free, so the first of more is forgotten


class _Asked(NamedTuple):
    """What a driver asked for last."""

    errand: Errand
    at_s: float
    loop_s: float
    """The loop's own time then."""
    stale: bool


class StaleErrands:
    """What drivers ask for again and again, and whether the loop began anew since.

    The numbers of such an errand are of places that are no more: the robot was put up
    elsewhere, or counts from there. Who asks for it after a pause means the new ones.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        """Nobody has asked for anything.

        Args:
            now: a clock [s].
        """
        self._now = now
        self._asked = OrderedDict[str, _Asked]()

    def asks(self, errand: Errand, telemetry: Telemetry | None) -> bool:
        """Take what a driver asks for; return whether it is stale.

        Args:
            errand: of the driver.
            telemetry: the newest; None while the loop is silent.
        """
        now_s, before = self._now(), self._asked.pop(errand.driver, None)
        loop_s, stale = -math.inf, False
        same = before is not None and _places(before.errand) == _places(errand)
        if before and same and now_s - before.at_s < LEASE_S:
            loop_s, stale = before.loop_s, before.stale
        if telemetry is not None:
            loop_s, stale = telemetry.time_s, stale or telemetry.time_s < loop_s
        self._asked[errand.driver] = _Asked(errand, now_s, loop_s, stale)
        while len(self._asked) > _DRIVERS:
            self._asked.popitem(last=False)
        return stale

    def forget(self, driver: str) -> None:
        """Take it that a driver asked for something else."""
        self._asked.pop(driver, None)


def _places(errand: Errand) -> tuple[object, ...]:
    """Return where an errand leads; how low the robot walks there is no other place."""
    return errand.places if isinstance(errand, GoTo) else errand.steps
