"""What the robot does, as a mode: requests and troubles change it, it aims the joints.

Every change is told with its reason. A fall or an emergency stop turns the torque off;
any other trouble makes the robot hold still.
"""

import logging
import math
from typing import TYPE_CHECKING

import numpy as np

from gaitchain.backends import Backend
from gaitchain.boxes import anatomy_of
from gaitchain.errors import BackendError, CommandError
from gaitchain.kinematics import Array
from gaitchain.live import messages as ask
from gaitchain.live.diary import Diary
from gaitchain.live.glide import Fence, Glide
from gaitchain.live.guard import Trouble
from gaitchain.live.messages import Mode, Request
from gaitchain.live.wheel import COMMAND_S, Wheel
from gaitchain.messages import Command, Sensors
from gaitchain.walker import Walker

if TYPE_CHECKING:
    from gaitchain.backends.mujoco import MujocoBackend

SETTLE_S = 1.0
"""Standing still before the walker is asked, and again before it may walk [s]."""
LIMP = (Mode.OFF, Mode.STOPPED)
"""Modes with the torque off."""
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

        Raises:
            BackendError: the robot cannot be reached.
        """
        anatomy = anatomy_of(walker.generator.library.biped)
        self._walker, self._backend, self._diary = walker, backend, diary
        self._simulator = simulator
        self._fence = Fence(anatomy, period_s)
        self.wheel = Wheel()
        self.mode, self.reason, self.status = Mode.OFF, "", ""
        self.command = Command()
        """What is carried out."""
        self.holds = 0
        """How often the robot was taken hold of anew."""
        self._connect(0.0)

    def handle(self, request: Request, sensors: Sensors | None, now_s: float) -> None:
        """Carry out one request.

        Args:
            request: what is asked for; most only by who may drive.
            sensors: the latest that were sound, None if there were none.
            now_s: on the loop's clock [s].
        """
        if isinstance(request, ask.EmergencyStop):
            self._let_fall(f"emergency stop by {request.driver}", now_s)
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
        elif not isinstance(request, ask.Shutdown) and self.wheel.may(
            request.driver, now_s
        ):
            self._obey(request, sensors, now_s)

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
        if self.mode in LIMP or sensors is None:
            return
        if trouble is not None and trouble.fell:
            self._let_fall(trouble.reason, now_s)
        elif trouble is not None and self.mode is not Mode.SAFE:
            self._hold_still(trouble.reason, now_s)
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
            self._diary.tell("command", f"{wish.driver} asked for {numbers}: refused")

    def _obey(
        self,
        request: ask.Start | ask.Rest | ask.Reset | ask.PushRobot,
        sensors: Sensors | None,
        now_s: float,
    ) -> None:
        """Carry out what only the driver may ask."""
        if isinstance(request, ask.Start):
            self._start(sensors, now_s)
        elif isinstance(request, ask.Rest):
            if self.mode in (Mode.STANDING, Mode.RISING, Mode.SAFE):
                self._backend.release()
                self._enter(Mode.OFF, f"{request.driver} let it rest", now_s)
        elif isinstance(request, ask.Reset):
            self._reset(request.driver, now_s)
        else:
            self._push(request)

    def _start(self, sensors: Sensors | None, now_s: float) -> None:
        """Rise from where the joints are now."""
        if self.mode is not Mode.OFF:
            return
        if sensors is None:
            self._diary.tell("sensor", "cannot start: the joints are not measured yet")
            return
        try:
            self._backend.engage()
        except BackendError as error:
            self._diary.tell("link", f"cannot start: {error}")
            return
        self.target = np.array(sensors.joint_position)
        self.holds += 1
        self._glide = Glide(self.target, self._walker.stand)
        self._enter(Mode.RISING, "slowly to the standing pose", now_s)

    def _reset(self, driver: str, now_s: float) -> None:
        """Leave SAFE or STOPPED by taking hold of the robot anew."""
        if self.mode not in (Mode.SAFE, Mode.STOPPED):
            return
        self._backend.release()
        self._diary.tell("mode", f"reset by {driver}")
        try:
            self._connect(now_s)
        except BackendError as error:
            self._enter(Mode.STOPPED, f"{error}; reset to try again", now_s)

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

    def _enter(self, mode: Mode, reason: str, now_s: float) -> None:
        if mode is not self.mode:
            why = f": {reason}" if reason else ""
            self._diary.tell("mode", f"{self.mode.value} to {mode.value}{why}")
        self.mode, self.reason, self._since_s = mode, reason, now_s

    def _connect(self, now_s: float) -> None:
        """Take hold of the robot; a simulated one is put on its feet."""
        stand = self._walker.stand
        self._backend.connect(stand)
        self._walker.reset()
        self.target = np.array(stand)
        self._glide = Glide(stand, stand)
        self.holds += 1
        if self._backend.physical:
            self._enter(Mode.OFF, "torque off; start makes it rise", now_s)
        else:
            self._backend.engage()
            self._enter(Mode.RISING, "settling", now_s)

    def _let_fall(self, reason: str, now_s: float) -> None:
        """Torque off, until a reset."""
        self._backend.release()
        self.wheel.stop()
        self._enter(Mode.STOPPED, reason, now_s)

    def _hold_still(self, reason: str, now_s: float) -> None:
        """Go slowly to the standing pose, or stay where nothing is known."""
        self.wheel.stop()
        self._glide = Glide(self.target, self._walker.stand)
        self._enter(Mode.SAFE, f"{reason}; reset when that is mended", now_s)

    # Joint targets.

    def _glide_on(self, now_s: float) -> None:
        """RISING or SAFE: further on the way to the standing pose."""
        since_s = max(0.0, now_s - self._since_s)
        self._aim(self._glide.at(since_s))
        if self.mode is Mode.RISING and self._glide.done(since_s - SETTLE_S):
            self._walker.reset()
            self._wanted = self.command = self._walker.command(Command())
            self._enter(Mode.STANDING, "", now_s)
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
            self._hold_still(f"the walker failed: {error}", now_s)
            return
        self.status = targets.status
        self._aim(targets.position)
        mode = Mode.STANDING if self._walker.standing else Mode.WALKING
        if mode is not self.mode:
            self._enter(mode, "", now_s)

    def _aim(self, target: Array) -> None:
        self.target, kept_from = self._fence.keep(target, self.target)
        self.status = kept_from or self.status
