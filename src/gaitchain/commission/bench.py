"""What every stage works with: the robot's library, its servos, and a person. Ours."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from gaitchain.backends.servos.backend import ServoBackend
from gaitchain.backends.servos.bus_load import BusLoad
from gaitchain.backends.servos.calibration import LOW_PWM, Calibration
from gaitchain.backends.servos.make import make_named
from gaitchain.build.progress import Progress
from gaitchain.commission.screen import NoScreen, Screen
from gaitchain.gait.library import GaitLibrary
from gaitchain.live.clock import Clock
from gaitchain.live.joint_mover import JointMover
from gaitchain.live.servo_ranges import within_servos
from gaitchain.robot.robot import Robot
from gaitchain.walker.mounting import Mounting

_OFF, _UNKNOWN = "the torque is off", "whether all torque is off is not known"
Outcome = Literal["go", "no-go", "skipped"]


@dataclass(frozen=True)
class Verdict:
    """How a stage ended."""

    outcome: Outcome
    said: str
    """What was found."""
    todo: str = ""
    """What to do about it."""
    measured: Mapping[str, Any] = field(default_factory=dict)
    """Figures, with their units in the names."""


class Fault(NamedTuple):
    """One thing that is wrong."""

    why: str
    todo: str
    """What to do about this one."""


def no_go(faults: Sequence[Fault], measured: Mapping[str, Any]) -> Verdict:
    """Return the verdict on what is wrong, with what to do about each, once."""
    said = "; ".join(fault.why for fault in faults)
    todo = "; ".join(dict.fromkeys(fault.todo for fault in faults))
    return Verdict("no-go", said, todo, measured)


class Person(Protocol):
    """Who stands beside the robot."""

    @property
    def present(self) -> bool:
        """Whether anybody looks; otherwise nothing is asked."""

    def ready(self, text: str, meanwhile: Callable[[], None] | None = None) -> None:
        """Ask for something to be done by hand, and wait until it is.

        Args:
            text: what to do.
            meanwhile: called again and again until it is done.
        """

    def confirms(
        self, question: str, meanwhile: Callable[[], None] | None = None
    ) -> bool:
        """Ask whether something is so; True if nobody is present.

        Args:
            question: to be answered by yes or no.
            meanwhile: called again and again until the answer comes.
        """


@dataclass
class Bench:
    """A robot that is commissioned."""

    library: GaitLibrary
    calibration: Calibration
    port: str
    rate_hz: float
    person: Person
    progress: Progress = lambda stage, done, total: None
    """Called with what is done, how far it is, and of how much."""
    screen: Screen = field(default_factory=NoScreen)
    """Shows the robot as it should be."""
    clock: Clock = field(default_factory=Clock)
    watchdog_s: float = 0.2
    """Time without packets after which the servos stop by themselves [s]."""
    emulated: bool = False
    """Whether the servos have no body, so that there is nothing to balance."""
    not_let_go: str = ""
    """Servos that may hold on after the latest stage."""
    torque: str = _UNKNOWN
    """What is known of all torques since then."""
    load: BusLoad = field(init=False)
    """Packets of a control period, as known since the servos were last connected."""

    def __post_init__(self) -> None:
        """Take the packets of a period as the calibration tells them."""
        own = self.calibration
        make = make_named(own.make)
        self.load = BusLoad(len(own.joints), own.baud, make=make)

    @property
    def period_s(self) -> float:
        """Control period [s]."""
        return 1.0 / self.rate_hz

    @contextmanager
    def robot(self, most_pwm: float = LOW_PWM) -> Iterator[ServoBackend]:
        """Connect the servos, and turn their torque off at the end, whatever happens.

        Args:
            most_pwm: torque limit, where the calibration has a higher one [%].

        Raises:
            BackendError: the servos are not as calibrated, or the bus is too slow.
        """
        legs = self.library.robot.legs
        backend = ServoBackend(
            self.port,
            self.calibration,
            legs.joint_names,
            self.period_s,
            watchdog_s=self.watchdog_s,
        )
        backend.limit_torque(most_pwm)
        try:
            backend.connect(np.asarray(legs.stand))
            yield backend
        finally:
            backend.close()
            self.load = backend.load
            self.not_let_go = backend.may_hold
            self.torque = _UNKNOWN if backend.not_let_go else _OFF

    def within(self, backend: ServoBackend) -> Robot:
        """Return the library's robot with the ranges that its servos give its joints.

        Raises:
            BackendError: see `within_servos`.
        """
        return within_servos(self.library.robot, backend, self._mounting)

    def mover(
        self, backend: ServoBackend, what: str, *, upright: bool = False
    ) -> JointMover:
        """Return what moves the joints of a connected robot; see `JointMover`.

        Targets and measurements are those of the robot's file.
        """
        mover = JointMover(
            self.within(backend),
            backend,
            self.clock,
            self.period_s,
            what=what,
            upright=upright,
            sent=self.screen.show,
        )
        mover.mounting = self._mounting
        return mover

    @property
    def _mounting(self) -> Mounting | None:
        """How the encoders of an identified robot are mounted, which no file tells."""
        found = self.library.robot.identified
        return None if found is None else Mounting(found)
