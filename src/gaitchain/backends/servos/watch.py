"""Monitor the servos during a walk: errors, temperatures, missing answers."""

import time
from collections.abc import Iterator, Mapping, Sequence
from statistics import median

import numpy as np

from gaitchain.backends.servos.bus import Heard, ServoBus
from gaitchain.backends.servos.make import Make
from gaitchain.backends.servos.setup import ServoSetup
from gaitchain.messages import Array

# Missed answers in a row, while others answered, that mean off the bus.
_MISSED_MOST = 3
_RETRY_S = 0.25  # interval of requests to servos that are off the bus
_NEAR_C = 5.0  # distance to the limit from which a temperature is reported [K]
_SAGGED = 0.85  # of the highest supply so far, from which a lower one is reported


class ServoWatch:
    """The status of the servos on one bus; arrays are in the joints' order."""

    def __init__(
        self,
        labels: Mapping[int, str],
        setups: Sequence[ServoSetup],
        make: Make,
    ) -> None:
        """Begin without errors.

        Args:
            labels: name of each servo in messages, by id.
            setups: the servos' settings.
            make: make of the servos.
        """
        self._make = make
        self.engaged = False
        """Whether all torques should be on."""
        self.lapsed = False
        """Whether the servos got no packets for longer than their watchdog time."""
        self._labels, self._ids = dict(labels), list(labels)
        self._order = list(labels)
        self._limits = {
            n: s.temperature_limit for n, s in zip(labels, setups, strict=True)
        }
        self._missed = dict.fromkeys(labels, 0)
        self._errors = dict.fromkeys(labels, 0)
        self._torque = dict.fromkeys(labels, False)
        self._tripped: set[int] = set()
        self._heat = dict.fromkeys(labels, np.nan)
        self._volts: dict[int, float] = {}
        self._highest_v = 0.0
        self.supply_v: float | None = None
        """Median of what the servos measure of their supply, None while unknown [V]."""
        self._alerts: list[int] = []
        self._turn, self._retried_s = 0, 0.0

    @property
    def present(self) -> list[int]:
        """Ids to read: all that are on the bus, or all if none is, silent ones last."""
        there = [n for n in self._order if self._missed[n] < _MISSED_MOST]
        return there or list(self._order)

    @property
    def tripped(self) -> bool:
        """Whether a bus watchdog has stopped a servo."""
        return self.lapsed or bool(self._tripped)

    @property
    def temperatures(self) -> Array:
        """(n,) temperatures, NaN where unknown [deg C]."""
        return np.array([self._heat[number] for number in self._ids])

    def engage(self) -> None:
        """Record that all torques are on and all watchdogs armed."""
        self.engaged, self.lapsed = True, False
        self._torque = dict.fromkeys(self._ids, True)
        self._tripped.clear()

    def hear(self, heard: Heard) -> None:
        """Count each servo's missed answers in a row, unless no servo answered."""
        answers = heard.answers
        self._order = heard.in_order(self._order)
        if not answers:
            return
        self._missed |= dict.fromkeys(answers, 0)
        self._missed |= {number: self._missed[number] + 1 for number in heard.silent}
        self._alerts = [number for number, answer in answers.items() if answer.alert]

    def look(self, bus: ServoBus) -> None:
        """Read the status of one servo, in turn; servos that report an error first.

        Raises:
            BackendError: the port is lost.
        """
        news = [number for number in self._alerts if not self._errors[number]]
        if news:
            self._ask(bus, news[0], state=True)
            return
        self._turn += 1
        round_, at = divmod(self._turn, len(self._ids))
        number = self._ids[at]
        if self._missed[number] >= _MISSED_MOST:
            if time.monotonic() - self._retried_s < _RETRY_S:
                return
            self._retried_s = time.monotonic()
        self._ask(bus, number, state=round_ % 2 == 0 or self._missed[number] > 0)

    def _ask(self, bus: ServoBus, number: int, *, state: bool) -> None:
        make = bus.make
        answer = bus.read(number, make.state if state else make.supply)
        if answer is None:
            return
        self._missed[number] = 0
        if not state:
            self._heat[number], self._volts[number] = make.supply_state(answer.data)
            self.supply_v = median(self._volts.values())
            self._highest_v = max(self._highest_v, self.supply_v)
            return
        found = make.status(answer.data)
        self._errors[number], self._torque[number] = found.errors, found.torque
        self._tripped.discard(number)
        if found.tripped:
            self._tripped.add(number)

    def fault(self) -> str:
        """Return which servos turned their torque off, and why; empty if none."""
        faults = []
        for number, label in self._labels.items():
            if self.engaged and not self._torque[number]:
                why = ", ".join(self._make.error_words(self._errors[number]))
                faults.append(f"{label} has let go{': ' if why else ''}{why}")
        return "; ".join(faults)

    def note(self) -> str:
        """Return the present problems, the worst first; empty if none."""
        notes = [self._alike(ids, words) for words, ids in self._wrong().items()]
        volts = self.supply_v
        if volts is not None and volts < _SAGGED * self._highest_v:
            notes.append(
                f"the supply has {volts:.1f} V, and had {self._highest_v:.1f} V: "
                "charge or change the battery, or look at its cables"
            )
        return "; ".join(notes)

    def _wrong(self) -> dict[str, list[int]]:
        """Return the servos of each problem, the worst problem first."""
        wrong: dict[tuple[int, str], list[int]] = {}
        for number in self._labels:
            for grade, words in self._problems(number):
                wrong.setdefault((grade, words), []).append(number)
        return {words: wrong[grade, words] for grade, words in sorted(wrong)}

    def _problems(self, number: int) -> Iterator[tuple[int, str]]:
        """Yield the problems of one servo, with their grades; 0 is the worst."""
        if self._missed[number] >= _MISSED_MOST:
            yield 0, " does not answer"
            return
        if errors := self._make.error_words(self._errors[number]):
            yield 1, f": {', '.join(errors)}"
        if number in self._tripped:
            yield 2, " was stopped by its bus watchdog"
        elif self.engaged and not self._torque[number]:
            yield 2, " has let go"
        heat, limit = self._heat[number], self._limits[number]
        if heat >= limit - _NEAR_C:
            yield 3, f" has {heat:.0f} deg C, lets go at {limit}"

    def _alike(self, ids: Sequence[int], words: str) -> str:
        """Say of which servos a problem is: of all of them at once, or of each."""
        if len(ids) == len(self._ids) > 1:
            return f"each servo{words}"
        return "; ".join(f"{self._labels[number]}{words}" for number in ids)
