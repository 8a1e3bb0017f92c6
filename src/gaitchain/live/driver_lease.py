"""Who may drive, and what the driver last asked for."""

from collections import deque

from gaitchain.live.messages import Drive, Errand, GoTo
from gaitchain.messages import Command

COMMAND_S = 0.5
"""A command older than this stops the walk [s]."""
LEASE_S = 3.0
"""A driver that is silent for so long loses the lease [s]."""
_BARRED = 32  # drivers; names are free, so the first of more is forgotten


class DriverLease:
    """The first driver holds it until it lets go or is silent."""

    def __init__(self) -> None:
        """Nobody drives."""
        self.driver = ""
        self.asked = Command()
        """What the driver last asked for; a stop when that is too old."""
        self.errand: Errand | None = None
        """What the driver sent the robot to do, which no command has ended yet."""
        self.timed_out = False
        """Whether the latest command was stopped for its age."""
        self._heard_s = self._commanded_s = 0.0
        self._latest = ""  # driver; who was just lost may be back in a moment
        # Somebody stopped them, and they have not asked for a stop as well.
        self._barred = deque[str](maxlen=_BARRED)

    def acquire(self, driver: str, now_s: float) -> bool:
        """Return whether a driver holds the lease, giving it to one if nobody does."""
        if self.driver not in ("", driver):
            return False
        self.driver, self._latest, self._heard_s = driver, driver, now_s
        return True

    def bars(self, driver: str) -> bool:
        """Return whether a stop is in force for a driver, until its zero command."""
        return driver in self._barred

    def drive(self, wish: Drive, now_s: float) -> bool:
        """Take a command; return False if another one drives."""
        command = wish.command
        if command.stops and self.bars(wish.driver):
            self._barred.remove(wish.driver)
        if not self.acquire(wish.driver, now_s):
            return False
        self._commanded_s = now_s
        self.timed_out = False
        self.asked = self._halted if self.bars(wish.driver) else command
        self.errand = None
        return True

    def send(self, errand: Errand) -> None:
        """Take an errand of the driver, who must not be barred.

        After a stop no other errand is more deliberate than the same one: who plans a
        way again and again would make the robot walk on.
        """
        if errand != self.errand:
            self.asked, self.errand = self._halted, errand

    def let_go(self, driver: str) -> None:
        """End the lease if this driver holds it; the command becomes a stop."""
        if driver == self.driver:
            self.driver, self.asked, self.errand = "", Command(), None

    def stop(self, *, limp: bool = False) -> None:
        """Let the command be a stop until the driver has asked for a stop as well.

        Letting go, or being lost, does not end that: a driver that comes back goes on
        sending what it sent.

        Args:
            limp: whether the robot is as low as it was no more, so that it stands at
                its usual height when it is up again; otherwise it stays as low.
        """
        self.asked, self.errand = Command() if limp else self._halted, None
        if self._latest and not self.bars(self._latest):
            self._barred.append(self._latest)

    def drop(self) -> None:
        """Forget an errand that cannot be done."""
        self.errand = None

    def expire(self, now_s: float) -> None:
        """Stop a command that is too old; end lease and errand of a silent driver.

        The robot stays as low as it is: nobody knows what is above it.
        """
        silent_s = now_s - self._heard_s
        if silent_s < 0.0:  # the clock went back
            self._heard_s = self._commanded_s = now_s
        if now_s - self._commanded_s > COMMAND_S and not self.asked.stops:
            self.asked, self.timed_out = self.asked.halted, True
        if silent_s > LEASE_S:
            self.driver, self.asked, self.errand = "", self._halted, None

    @property
    def crouch(self) -> float:
        """How low the driver last asked the robot to be, on its errand or else [m]."""
        if isinstance(self.errand, GoTo):
            return self.errand.crouch
        return self.asked.crouch  # footsteps are made as low as the robot was before

    @property
    def _halted(self) -> Command:
        """A stop that leaves the robot as low as it was asked to be."""
        return Command(crouch=self.crouch)
