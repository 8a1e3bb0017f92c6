"""The services that ROS nodes call: start, stop, rest, reset, get up, emergency stop.

Each is a std_srvs/srv/Trigger under /gaitchain. It succeeds once the robot is in the
mode that was asked for, not when the request was sent, and fails with the reason where
the loop refuses it.
"""

import math
import threading
from collections.abc import Callable

from gaitchain.backends.ros import RosLink
from gaitchain.backends.ros.messages import TriggerResponse
from gaitchain.live.messages import (
    EmergencyStop,
    GetUp,
    Mode,
    Request,
    Reset,
    Rest,
    Start,
    Stop,
    Telemetry,
    refusal,
)

WAIT_S = 3.0
"""Within this time the mode has to change [s]."""
_HEARD_S = 0.5  # within which the loop has read a request, on a busy computer too
# Telemetry rows that may have been sent before the loop read the request.
_UNHEARD = 2
_ALL = frozenset(Mode)
_UP = frozenset({Mode.RISING, Mode.STANDING, Mode.WALKING})
_Kind = type[Start | Stop | Rest | Reset | GetUp | EmergencyStop]
SERVICES: dict[str, tuple[_Kind, frozenset[Mode]]] = {
    "start": (Start, _UP),
    "stop": (Stop, _ALL - {Mode.WALKING, Mode.RISING, Mode.GETTING_UP}),
    "rest": (Rest, frozenset({Mode.OFF})),
    "reset": (Reset, _ALL - {Mode.SAFE, Mode.STOPPED}),
    "get_up": (GetUp, frozenset({Mode.GETTING_UP})),  # for seconds, so it is seen
    "emergency_stop": (EmergencyStop, frozenset({Mode.STOPPED})),
}
"""Request of each service, and the modes in which it has been carried out."""


class RosServices:
    """Answers the calls of one link."""

    def __init__(
        self, link: RosLink, ask: Callable[[Request], bool], driver: str
    ) -> None:
        """Announce the services.

        Args:
            link: to the ROS network.
            ask: passes a request on; False if the loop takes none.
            driver: who asks.
        """
        self._ask, self._driver = ask, driver
        self._news = threading.Condition()
        self._latest: Telemetry | None = None
        self._refused: dict[str, tuple[int, str]] = {}  # row and why, by service
        self._rows = 0
        for name in SERVICES:
            link.serve(f"/gaitchain/{name}", self._answer(name))

    def take(self, telemetry: Telemetry) -> None:
        """Take the newest telemetry, all of it, as each tells of refusals once."""
        with self._news:
            self._latest, self._rows = telemetry, self._rows + 1
            for text in telemetry.refused:
                self._note_refusal(text)
            self._news.notify_all()

    def _note_refusal(self, text: str) -> None:
        for name, (kind, _) in SERVICES.items():
            begins = refusal(kind(self._driver))
            if text.startswith(begins):
                self._refused[name] = self._rows, text.removeprefix(begins)

    def _answer(self, name: str) -> Callable[[], TriggerResponse]:
        return lambda: self._call(name)

    def _call(self, name: str) -> TriggerResponse:
        """Ask, and wait until the robot is in one of the modes, or it is refused."""
        kind, wanted = SERVICES[name]
        with self._news:
            before = self._rows
        if not self._ask(kind(self._driver)):
            return TriggerResponse(False, "the control loop takes no requests")
        with self._news:
            since = self._rows + self._on_their_way(wanted)
            done = self._news.wait_for(
                lambda: self._why_not(name, before) or self._is(wanted, since), WAIT_S
            )
            latest, why_not = self._latest, self._why_not(name, before)
        if latest is None:
            return TriggerResponse(False, "the control loop is silent")
        if why_not:
            return TriggerResponse(False, f"refused: {why_not}")
        told = f"{latest.mode}: {latest.reason}" if latest.reason else str(latest.mode)
        if done:
            return TriggerResponse(True, told)
        within = f"not carried out within {WAIT_S:g} s; the robot is {told}"
        return TriggerResponse(False, within)

    def _on_their_way(self, wanted: frozenset[Mode]) -> int:
        """Return how many rows may come that were built before a request was heard.

        Where the robot is in such a mode already, only time tells that nothing refuses
        the request.
        """
        latest = self._latest
        if latest is None or latest.mode not in wanted:
            return _UNHEARD
        return max(_UNHEARD, math.ceil(_HEARD_S / latest.pace.period_s))

    def _is(self, wanted: frozenset[Mode], since: int) -> bool:
        """Return whether the robot is in one of the modes, by a row after that one."""
        latest = self._latest
        return self._rows > since and latest is not None and latest.mode in wanted

    def _why_not(self, name: str, since: int) -> str:
        """Return why the loop refused a call, by a row after that one."""
        row, why = self._refused.get(name, (0, ""))
        return why if row > since else ""
