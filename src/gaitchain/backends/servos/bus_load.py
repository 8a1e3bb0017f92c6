"""How long the packets of a control period keep the bus, by bytes, delays and turns.

In each period all servos are read, then the IMU and the status of one servo, and all
goals are written; a write is not answered.
"""

from dataclasses import dataclass, field, replace

from gaitchain.backends.servos.make import Make
from gaitchain.backends.servos.port import BITS
from gaitchain.errors import BackendError

SHARE = 0.8
"""Largest part of a period; the rest is the walker's, and for gaps between bytes."""
TURN_S = 1e-3
"""From the end of a request to an answer's first byte at the program, and back [s]. The
least setting of an FTDI adapter's latency timer (FTDI, AN232B-04), which other adapters
with frames of USB full speed, 1 ms, do not beat. An assumption, until measured."""
LEAST_HZ = 20
"""Least rate of control periods that `serve` takes, `cli.options.Serve.rate` [Hz]."""


@dataclass(frozen=True)
class BusLoad:
    """The packets of one control period."""

    servos: int
    baud: int
    """[bit/s]"""
    delay_s: float = 0.0
    """Mean return delay of the servos [s]."""
    fast: bool = False
    """Whether all servos answer a read in one packet."""
    imu_bytes: int = 0
    """Data of a read of the IMU; 0 without an IMU."""
    make: Make = field(kw_only=True)
    turn_s: float = TURN_S
    """From the end of a request to its answer at the program, without delay_s [s]."""

    @property
    def read_s(self) -> float:
        """Time of a read of all servos [s]."""
        wire, size = self.make.wire, self.make.present.size
        answers = self.servos * (wire.frame + size)
        if self.fast:
            answers = wire.fast_size(self.servos, self.make.present)
        sent = wire.request + self.servos
        return self._line_s(sent + answers) + self.servos * self.delay_s + self.turn_s

    @property
    def write_s(self) -> float:
        """Time of a write of all goals [s]."""
        return self._line_s(
            self.make.wire.request + self.servos * (1 + self.make.goal.size)
        )

    @property
    def look_s(self) -> float:
        """Time of a read of one servo's status [s]."""
        return self._single_s(self.make.state.size)

    @property
    def imu_s(self) -> float:
        """Time of a read of the IMU, which is taken to delay answers as the servos."""
        return self._single_s(self.imu_bytes) if self.imu_bytes else 0.0

    @property
    def period_s(self) -> float:
        """Time of all packets of a control period [s]."""
        return self.read_s + self.imu_s + self.look_s + self.write_s

    def check(self, period_s: float, name: str) -> None:
        """Check that the packets fit in `SHARE` of a control period.

        Args:
            period_s: control period [s].
            name: the bus, for the message.

        Raises:
            BackendError: they do not; the message says what would fit.
        """
        if self.period_s <= SHARE * period_s:
            return
        imu = " and the imu" if self.imu_bytes else ""
        raise BackendError(
            f"{name}: reading and writing {self.servos} servos{imu} takes "
            f"{1e3 * self.period_s:.1f} ms at {self.baud} bit/s ({self._parts()}), "
            f"allowed: {SHARE:.0%} of the period of {1e3 * period_s:g} ms; "
            f"{'; '.join(self._remedies(period_s))}"
        )

    def most_servos(self, period_s: float) -> int:
        """Return how many servos fit in `SHARE` of a control period [s]."""
        fitting = (
            count
            for count in range(self.make.wire.last_id + 1, 0, -1)
            if replace(self, servos=count).period_s <= SHARE * period_s
        )
        return next(fitting, 0)

    def least_baud(self, period_s: float) -> int | None:
        """Return the least usual rate [bit/s] at which they fit; None if none is."""
        fitting = (
            baud
            for baud in sorted(self.make.bauds)
            if replace(self, baud=baud).period_s <= SHARE * period_s
        )
        return next(fitting, None)

    def most_hz(self) -> float:
        """Return the largest rate of control periods in which they fit [Hz]."""
        return SHARE / self.period_s

    def _line_s(self, count: int) -> float:
        """Return the transmission time of so many bytes [s]."""
        return count * BITS / self.baud

    def _single_s(self, size: int) -> float:
        """Return the time of a read of so many bytes from one device [s]."""
        return (
            self._line_s(self.make.wire.request + self.make.wire.frame + size)
            + self.delay_s
            + self.turn_s
        )

    def _parts(self) -> str:
        """Say what takes how long."""
        turns = 3 if self.imu_bytes else 2
        parts = {
            "read": self.read_s - self.turn_s,
            "imu": self.imu_s - self.turn_s if self.imu_bytes else 0.0,
            "status of one": self.look_s - self.turn_s,
            "write": self.write_s,
            f"{turns} turns of the adapter": turns * self.turn_s,
        }
        told = [
            f"{name} {1e3 * time_s:.1f}" for name, time_s in parts.items() if time_s
        ]
        return ", ".join(told)

    def _remedies(self, period_s: float) -> list[str]:
        """Say what would fit, and what else shortens it."""
        found = [f"{self.most_servos(period_s)} servos would fit"]
        if self.most_hz() >= LEAST_HZ:
            found.append(f"or these with --rate {int(self.most_hz())}")
        baud = self.least_baud(period_s)
        if baud is not None:
            found.append(f"or at {baud} bit/s: {self.make.baud_register}")
        if self.delay_s > 0.0:
            saved_s = self.period_s - replace(self, delay_s=0.0).period_s
            found.append(
                f"{self.make.delay_register} of 0 saves {1e3 * saved_s:.1f} ms"
            )
        if self.make.wire.knows_fast and not self.fast:
            saved_s = self.period_s - replace(self, fast=True).period_s
            found.append(
                f"firmware that answers fast sync reads saves {1e3 * saved_s:.1f} ms"
            )
        return found
