"""A control loop on the simulator, with a clock that is stepped, and its faults."""

from dataclasses import replace
from functools import cache

import numpy as np

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.libraries import shipped_library
from gaitchain.errors import BackendError
from gaitchain.gait.library_file import load_library
from gaitchain.live.loop import ControlLoop
from gaitchain.live.messages import Drive, Event, Telemetry
from gaitchain.live.safe_backend import SafeBackend
from gaitchain.walker.walker import Walker

PERIOD_S = 0.01


@cache
def library():
    return load_library(shipped_library())


class SteppedClock:
    """Goes on only when somebody sleeps."""

    def __init__(self):
        self.time_s = 100.0
        self.jump_s = 0.0

    def now(self):
        return self.time_s + self.jump_s

    def stamp_ns(self):
        return round(1e9 * self.time_s)

    def sleep_until(self, time_s):
        self.time_s = max(self.time_s, time_s - self.jump_s)


class Port:
    """What a loop is asked, and what it told."""

    def __init__(self):
        self.asked, self.told = [], []

    def publish(self, telemetry):
        self.told.append(telemetry)

    def requests(self):
        asked, self.asked = self.asked, []
        return asked


class FaultyRobot(MujocoBackend):
    """The simulator, with whatever goes wrong on real robots."""

    def __init__(self, physical=False, period_s=PERIOD_S):
        super().__init__(library().robot, period_s=period_s)
        self.physical = physical
        self.cut = False
        self.spoil = lambda sensors: sensors
        self.engaged = True
        self.writes, self.released_at = 0, None
        self.fault = ""

    def read(self):
        if self.cut:
            raise BackendError("the bus does not answer")
        return self.spoil(super().read())

    def write(self, position):
        if self.cut:
            raise BackendError("the bus does not answer")
        self.writes += 1
        super().write(position)

    def engage(self):
        self.engaged = True
        super().engage()

    def release(self):
        self.engaged = False
        self.released_at = self.writes
        super().release()

    def health(self):
        return LinkHealth(sent=self.writes, lost=int(self.cut), fault=self.fault)


class Live:
    """A loop with all its ends in hand."""

    def __init__(
        self,
        *,
        backend=None,
        period_s=PERIOD_S,
        clock=None,
        of=None,
        **options,
    ):
        self.clock, self.port = clock or SteppedClock(), Port()
        known = of or library()
        self.robot = backend or FaultyRobot(period_s=period_s)
        self.period_s = period_s
        self.loop = ControlLoop(
            Walker(known, period_s=period_s),
            SafeBackend(self.robot, len(known.robot.legs.stand)),
            self.port,
            self.clock,
            period_s,
            **options,
        )

    @property
    def mode(self):
        return self.loop.modes.mode

    @property
    def last(self) -> Telemetry:
        return self.port.told[-1]

    @property
    def events(self) -> list[Event]:
        return [event for told in self.port.told for event in told.events]

    def happened(self, kind: str) -> list[str]:
        return [event.text for event in self.events if event.kind == kind]

    def ask(self, *requests):
        self.port.asked += requests

    def run(self, seconds, drive=None):
        """Tick on, repeating a command ten times a second."""
        for tick in range(round(seconds / self.period_s)):
            if drive is not None and tick % round(0.1 / self.period_s) == 0:
                self.ask(Drive("me", *drive))
            self.loop.tick()
        return self

    def walking(self):
        """Stand up and walk ahead."""
        return self.run(3.0).run(3.0, drive=(0.3, 0.0, 0.0))


def hide(name, joint=None):
    """Return a fault: no number for one joint, or for a whole sensor."""

    def spoil(sensors):
        values = np.array(getattr(sensors, name))
        values[slice(None) if joint is None else joint] = np.nan
        return replace(sensors, **{name: values})

    return spoil


class Frozen:
    """A fault: the first measurement, over and over."""

    def __init__(self, *, time_goes_on):
        self._first, self._time_goes_on = None, time_goes_on

    def __call__(self, sensors):
        self._first = self._first or sensors
        if self._time_goes_on:
            return replace(self._first, time=sensors.time)
        return self._first
