"""Who may drive, and what the driver last asked for."""

from gaitchain.live.messages import Drive, Errand, GoTo
from gaitchain.messages import Command

COMMAND_S = 0.5
"""A command older than this stops the walk [s]."""
LEASE_S = 3.0
"""A driver that is silent for so long loses the lease [s]."""


class DriverLease:
    """The first driver holds it until it lets go or is silent."""

    def __init__(self) -> None:
        """Nobody drives."""
        self.driver = ""
        self.asked = Command()
        """What the driver last asked for; a stop when that is too old."""
        self.errand: Errand | None = None
        """What the driver sent the robot to do, which no command has ended yet."""
        self._stopped: Errand | None = None  # that somebody ended by a stop
        self.timed_out = False
        """Whether the latest command was stopped for its age."""
        self._heard_s = self._commanded_s = 0.0
        self._barred = False  # somebody said stop; the driver has to ask for one first

    def acquire(self, driver: str, now_s: float) -> bool:
        """Return whether a driver holds the lease, giving it to one if nobody does."""
        if self.driver not in ("", driver):
            return False
        self.driver, self._heard_s = driver, now_s
        return True

    def drive(self, wish: Drive, now_s: float) -> bool:
        """Take a command; return False if another one drives."""
        if not self.acquire(wish.driver, now_s):
            return False
        self._commanded_s = now_s
        self.timed_out, self._stopped = False, None
        command = wish.command
        self._barred = self._barred and not command.stops
        self.asked = self._halted if self._barred else command
        self.errand = None
        return True

    def send(self, errand: Errand) -> bool:
        """Take an errand of the driver; False if it is the one that a stop has ended.

        Who repeats it all the time would make the robot walk on; a command, or another
        errand, is deliberate.
        """
        if errand == self._stopped:
            return False
        if errand != self.errand:
            self.asked, self.errand, self._stopped = self._halted, errand, None
        return True

    def let_go(self, driver: str) -> None:
        """End the lease if this driver holds it; the command becomes a stop."""
        if driver == self.driver:
            self.driver, self.asked, self._barred = "", Command(), False
            self.errand = self._stopped = None

    def stop(self, *, limp: bool = False) -> None:
        """Let the command be a stop until the driver has asked for a stop as well.

        Args:
            limp: whether the robot is as low as it was no more, so that it stands at
                its usual height when it is up again; otherwise it stays as low.
        """
        self.asked, self._barred = Command() if limp else self._halted, True
        self._stopped, self.errand = self.errand or self._stopped, None

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
            self.driver, self.asked, self._barred = "", self._halted, False
            self.errand = self._stopped = None

    @property
    def _halted(self) -> Command:
        """A stop that leaves the robot as low as it was asked to be."""
        if isinstance(self.errand, GoTo):
            return Command(crouch=self.errand.crouch)
        return self.asked.halted  # footsteps are made as low as the robot was before
