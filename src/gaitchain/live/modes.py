"""What the robot does, as a mode: requests and troubles change it, it aims the joints.

Every change is told with its reason. A fall or an emergency stop turns the torque off;
any other trouble makes the robot hold still.
"""

import logging
import math
from typing import TYPE_CHECKING

import numpy as np

from gaitchain.backends.base import Backend
from gaitchain.errors import BackendError, CommandError
from gaitchain.live import messages as ask
from gaitchain.live.driver_lease import COMMAND_S, Wheel
from gaitchain.live.event_log import Diary
from gaitchain.live.guard import Trouble
from gaitchain.live.joint_motion import Fence, Glide
from gaitchain.live.messages import Mode, Request
from gaitchain.live.retry import Retry
from gaitchain.messages import Array, Command, Sensors
from gaitchain.robot.box_robot import anatomy_of
from gaitchain.walker.walker import Walker

if TYPE_CHECKING:
    from gaitchain.backends.mujoco import MujocoBackend

SETTLE_S = 1.0
"""Standing still before the walker is asked, and again before it may walk [s]."""
_BLOCKED = math.radians(5.0)
LIMP = (Mode.OFF, Mode.STOPPED)
"""Modes with the torque off."""
_DriverAsks = ask.Start | ask.Rest | ask.Reset | ask.PushRobot
_FROM = {
    ask.Start: (Mode.OFF,),
    ask.Rest: (Mode.STANDING, Mode.RISING, Mode.SAFE),
    ask.Reset: (Mode.SAFE, Mode.STOPPED),
    ask.PushRobot: tuple(Mode),
}
_log = logging.getLogger(__name__)


class Conductor:
    """The modes of one robot."""

    def __init__(
        self,
        walker: Walker,
        backend: Backend,
        diary: Diary,
        period_s: float,
        simulator: "MujocoBackend | None" = None,
    ) -> None:
        """Take hold of a robot: a simulated one stands, a real one stays limp.

        Args:
            walker: in its library's order of joints.
            backend: the robot.
            diary: where what happens is told.
            period_s: control period [s].
            simulator: the backend, if it is one that can be pushed.
        """
        anatomy = anatomy_of(walker.library.biped)
        self._walker, self._backend, self._diary = walker, backend, diary
        self._simulator = simulator
        self._fence, self._period_s = Fence(anatomy, period_s), period_s
        self.wheel, self._retry = Wheel(), Retry()
        self.mode, self.reason, self.status = Mode.OFF, "", ""
        self.command = Command()
        """What is carried out."""
        self.holds = 0
        """How often the robot was taken hold of anew."""
        self._connect()

    def handle(self, request: Request, now_s: float) -> None:
        """Carry out one request.

        Args:
            request: what is asked for; most only by who may drive.
            now_s: on the loop's clock [s].
        """
        if isinstance(request, ask.EmergencyStop):
            self._let_fall(f"emergency stop by {request.driver}")
        elif isinstance(request, ask.Stop):
            self.wheel.stop()
        elif isinstance(request, ask.LetGo):
            self.wheel.let_go(request.driver)
        elif isinstance(request, ask.Note):
            self._diary.tell(request.kind, request.text)
        elif isinstance(request, ask.Recall):
            self._diary.recall()
        elif isinstance(request, ask.Drive):
            self._drive(request, now_s)
        elif not isinstance(request, ask.Shutdown):
            if self.wheel.may(request.driver, now_s):
                self._obey(request)
            else:
                self._refuse(request, f"{self.wheel.driver} drives")

    def age(self, now_s: float) -> None:
        """Stop walking when no command has come for too long."""
        driver, drives = self.wheel.driver, not self.wheel.asked.stops
        self.wheel.age(now_s)
        if drives and self.wheel.timed_out:
            self._diary.tell(
                "command",
                f"no command of {driver} for {COMMAND_S:g} s: the robot stops walking",
            )

    def act(
        self, sensors: Sensors | None, trouble: Trouble | None, now_s: float
    ) -> None:
        """Let a trouble change the mode, and the mode choose the joint targets."""
        self.status = "" if sensors is not None else "nothing measured yet"
        if self.mode in LIMP:
            if self._retry.due(now_s):
                self._connect()
            return
        if trouble is not None and trouble.fell:
            self._let_fall(trouble.reason)
        elif trouble is not None and self.mode is not Mode.SAFE:
            self._hold_still(trouble.reason, sensors)
        elif sensors is None:
            return
        elif self.mode in (Mode.STANDING, Mode.WALKING):
            self._walk(sensors, now_s)
        elif trouble is None:
            self._glide_on(now_s)

    # Requests.

    def _drive(self, wish: ask.Drive, now_s: float) -> None:
        numbers = wish.vx, wish.vy, wish.yaw_rate
        if all(map(math.isfinite, numbers)):
            self.wheel.drive(wish, now_s)
        else:
            self._diary.refuse(f"{wish.driver} asked for {numbers}: refused")

    def _obey(self, request: _DriverAsks) -> None:
        """Carry out what only the driver may ask."""
        modes = _FROM[type(request)]
        if self.mode not in modes:
            why = f"the robot is {self.mode.value}, not {' or '.join(modes)}"
            self._refuse(request, why)
        elif isinstance(request, ask.Start):
            self._start()
        elif isinstance(request, ask.Rest):
            self._backend.release()
            self._enter(Mode.OFF, f"{request.driver} let it rest")
        elif isinstance(request, ask.Reset):
            self._backend.release()
            self._diary.tell("mode", f"reset by {request.driver}")
            self._connect()
        else:
            self._push(request)

    def _refuse(self, request: _DriverAsks, why: str) -> None:
        what = type(request).__name__.removesuffix("Robot").lower()
        self._diary.refuse(f"{what} by {request.driver} refused: {why}")

    def _start(self) -> None:
        """Rise from where the joints are now."""
        try:
            self._backend.engage()
            here = self._backend.read().joint_position
            if not np.isfinite(here).all():
                raise BackendError("not every joint says where it is")
        except BackendError as error:
            self._backend.release()
            self._diary.tell("link", f"cannot start: {error}")
            return
        self.target = np.array(here)
        self.holds += 1
        self._glide_from(self.target)
        self._enter(Mode.RISING, "slowly to the standing pose")

    def _push(self, wish: ask.PushRobot) -> None:
        what = f"a push of {wish.impulse_ns:g} N s to {wish.direction_deg:g} deg"
        if self._simulator is None:
            self._diary.tell("push", "only a simulated robot can be pushed from here")
            return
        try:
            self._simulator.push(wish.impulse_ns, wish.direction_deg)
        except CommandError as error:
            self._diary.tell("push", f"refused: {error}")
        else:
            self._diary.tell("push", what)

    # From mode to mode.

    def _enter(self, mode: Mode, reason: str) -> None:
        if mode is not self.mode:
            why = f": {reason}" if reason else ""
            self._diary.tell("mode", f"{self.mode.value} to {mode.value}{why}")
        self.mode, self.reason = mode, reason

    def _connect(self) -> None:
        """Take hold of the robot, or try later; a simulated one is put on its feet."""
        self.target = np.array(self._walker.stand)
        self._glide_from(self.target)
        try:
            self._backend.connect(self.target)
            if not self._backend.physical:
                self._backend.engage()
        except BackendError as error:
            again_s = self._retry.failed(self._diary.time_s())
            why = f"not connected: {error}; it is tried again after {again_s:g} s"
            self._enter(Mode.STOPPED, why)
            return
        self._retry.over()
        self._walker.reset()
        self.holds += 1
        if self._backend.physical:
            self._enter(Mode.OFF, "torque off; start makes it rise")
        else:
            self._enter(Mode.RISING, "settling")

    def _let_fall(self, reason: str) -> None:
        """Torque off, until a reset."""
        self._backend.release()
        self._retry.over()
        self.wheel.stop()
        self.command = Command()
        self._enter(Mode.STOPPED, reason)

    def _hold_still(self, reason: str, sensors: Sensors | None) -> None:
        """Go slowly to the standing pose, or stay where nothing is known."""
        self.wheel.stop()
        self.command = Command()
        here = self.target if sensors is None else sensors.joint_position
        off = np.abs(self.target - here) > _BLOCKED  # nothing is pressed any further
        self.target = np.where(off, here, self.target)
        self._glide_from(self.target)
        self._enter(Mode.SAFE, f"{reason}; reset when that is mended")

    def _glide_from(self, start: Array) -> None:
        self._glide, self._glided_s = Glide(start, self._walker.stand), 0.0

    # Joint targets.

    def _glide_on(self, now_s: float) -> None:
        """RISING or SAFE: further on the way to the standing pose."""
        # Period by period: a pause on the way must not be caught up with.
        self._glided_s += self._period_s
        self._aim(self._glide.at(self._glided_s))
        if self.mode is Mode.RISING and self._glide.done(self._glided_s - SETTLE_S):
            self._walker.reset()
            self._wanted = self.command = self._walker.command(Command())
            self._enter(Mode.STANDING, "")
            self._stood_s = now_s

    def _walk(self, sensors: Sensors, now_s: float) -> None:
        """Let the walker choose the targets."""
        learns = now_s - self._stood_s < SETTLE_S  # the vertical, standing still
        wanted = Command() if learns else self.wheel.asked
        try:
            if wanted != self._wanted:
                self._wanted, self.command = wanted, self._walker.command(wanted)
            targets = self._walker.step(sensors)
        except Exception as error:  # a robot must not be left alone with its momentum
            _log.exception("the walker failed")
            self._hold_still(f"the walker failed: {error}", sensors)
            return
        self.status = targets.status
        self._aim(targets.position)
        mode = Mode.STANDING if self._walker.standing else Mode.WALKING
        if mode is not self.mode:
            self._enter(mode, "")

    def _aim(self, target: Array) -> None:
        self.target, kept_from = self._fence.keep(target, self.target)
        self.status = kept_from or self.status
