"""The modes of a robot: requests and troubles change them, they set the joint targets.

Every change is an event with its reason. A fall or an emergency stop turns the torque
off; any other trouble makes the robot hold still.
"""

import logging
import math
from dataclasses import astuple, replace

import numpy as np

from gaitchain.errors import BackendError, CommandError
from gaitchain.live import messages as ask
from gaitchain.live.driver_lease import COMMAND_S, LEASE_S, DriverLease
from gaitchain.live.event_log import EventLog
from gaitchain.live.getting_up import GettingUp
from gaitchain.live.guard import Trouble
from gaitchain.live.joint_motion import JointLimiter, SmoothMove
from gaitchain.live.messages import Mode, Request, TroubleKind
from gaitchain.live.safe_backend import Backoff, SafeBackend
from gaitchain.live.trip import Trip
from gaitchain.messages import Array, Command, MotorTargets, Sensors
from gaitchain.walker.riser import Rising
from gaitchain.walker.walker import Walker

SETTLE_S = 1.0
"""Standing still before the walker is asked, and again before it may walk [s]."""
_BLOCKED = math.radians(5.0)
_LONGEST = 1000  # characters of a note: it is kept, sent on and logged
LIMP = (Mode.OFF, Mode.STOPPED)
"""Modes with the torque off."""
_DriverAsks = (
    ask.Start
    | ask.Rest
    | ask.Reset
    | ask.GetUp
    | ask.PushRobot
    | ask.Disturb
    | ask.Errand
)
_STOPPED = "a stop is in force; send a zero command first"
BALANCED = (Mode.STANDING, Mode.WALKING)
"""Modes in which the walker balances the robot."""
_FROM = {
    ask.GoTo: BALANCED,
    ask.FollowSteps: BALANCED,
    ask.Start: (Mode.OFF,),
    ask.Rest: (Mode.STANDING, Mode.RISING, Mode.SAFE),
    ask.Reset: (Mode.SAFE, Mode.STOPPED),
    ask.GetUp: (Mode.STOPPED,),
    ask.PushRobot: tuple(Mode),
    ask.Disturb: tuple(Mode),
}
_log = logging.getLogger(__name__)


class ModeMachine:
    """The modes of one robot."""

    def __init__(
        self,
        walker: Walker,
        backend: SafeBackend,
        events: EventLog,
        period_s: float,
        *,
        connected: bool,
    ) -> None:
        """Begin limp; `reconnect` takes hold of the robot.

        Args:
            walker: in its library's order of joints.
            backend: the robot.
            events: where what happens is noted.
            period_s: control period [s].
            connected: whether the backend is connected already.
        """
        legs = walker.library.robot.legs
        self._walker, self._backend, self._events = walker, backend, events
        self._period_s, found = period_s, walker.library.robot.identified
        self._offset = 0.0 if found is None else found.offset
        self._limiter = JointLimiter(legs, period_s, offset=self._offset)
        self.lease, self._backoff = DriverLease(), Backoff()
        self.mode, self.reason, self.status = Mode.OFF, "", ""
        self.trouble: TroubleKind | None = None
        self.command = Command()
        """What is carried out."""
        self._wanted: Command | ask.Errand | None = self.command
        self._joint_names = tuple(legs.joint_names)
        self.up = GettingUp(backend, self._joint_names)
        """The way up, which has all joints while the mode is GETTING_UP."""
        self.trip = Trip(walker)
        """The way that the walker is on, if the driver sent it on one."""
        self.target = np.array(walker.stand)
        """(2 n,) joint targets of this control period [rad]."""
        self.motors: MotorTargets | None = None
        """The same for motor drivers; None while no gait moves the joints."""
        self._stand = walker.standing_targets.position
        self._move, self._moved_s = SmoothMove(self.target, self._stand), 0.0
        self._stood_s = 0.0
        self._rose = False  # from a fall: its place goes on
        self.times_connected = 0
        """How often the robot was connected or started anew."""
        self._connected = connected
        self.held: Trouble | None = None
        """What stopped the robot in a loop before this one: it stays stopped."""
        self.lying: Trouble | None = None
        """That the limp robot lies there, as the guard finds."""

    def handle(self, request: Request, now_s: float) -> None:
        """Carry out one request.

        Args:
            request: what is asked for; most only by who may drive.
            now_s: on the loop's clock [s].
        """
        if isinstance(request, ask.EmergencyStop):
            reason = f"emergency stop by {request.driver}"
            self._torque_off(Trouble(TroubleKind.EMERGENCY_STOP, reason))
        elif isinstance(request, ask.Stop):
            self._stop(request)
        elif isinstance(request, ask.LetGo):
            self.lease.let_go(request.driver)
        elif isinstance(request, ask.Note):
            again = request.kind in ("link", "command")  # as often as a node repeats it
            note = self._events.add_spell if again else self._events.add
            note(request.kind, request.text[:_LONGEST])
        elif isinstance(request, ask.Recall):
            self._events.recall()
        elif isinstance(request, ask.Drive):
            self._drive(request, now_s)
        elif not isinstance(request, ask.Shutdown | ask.Play):
            self._grant(request, now_s)

    def reconnect(self, now_s: float) -> None:
        """Take hold of the robot at the beginning, and again where that failed."""
        if self.mode in LIMP and self._backoff.due(now_s):
            self._connect()

    def expire(self, now_s: float) -> None:
        """Stop walking when no command has come for too long."""
        driver, drives = self.lease.driver, not self.lease.asked.stops
        goes = self.lease.errand is not None
        self.lease.expire(now_s)
        if goes and self.lease.errand is None:
            silent = f"nothing of {driver} for {LEASE_S:g} s"
            self._events.add("command", f"{silent}: the robot ends its way")
        if drives and self.lease.timed_out:
            self._events.add(
                "command",
                f"no command of {driver} for {COMMAND_S:g} s: the robot stops walking",
            )

    def act(
        self, sensors: Sensors | None, trouble: Trouble | None, now_s: float
    ) -> None:
        """Let a trouble change the mode, and the mode choose the joint targets."""
        self.status = "" if sensors is not None else "nothing measured yet"
        self.motors = None
        if self.mode in LIMP:
            return
        if trouble is not None and (
            trouble.kind is TroubleKind.FALL or self.mode is Mode.GETTING_UP
        ):
            self._torque_off(trouble)
        elif trouble is not None and self.mode is not Mode.SAFE:
            self._hold_still(trouble, sensors)
        elif sensors is None:
            return
        elif self.mode is Mode.GETTING_UP:
            self._get_up()
        elif self.mode in BALANCED:
            self._walk(sensors, now_s)
        elif trouble is None:
            self._move_on(now_s)

    def lie(self, read: Sensors) -> None:
        """Let the walker follow how a robot turns that it does not balance.

        It may fall: limp by an emergency stop or at rest, or as it rises.

        Args:
            read: as measured, NaN or absurd where nothing sound came.
        """
        if self.mode not in BALANCED:
            self._walker.lie(read)

    # Requests.

    def _stop(self, request: ask.Stop) -> None:
        """Stop walking, or getting up: limp on the floor, it can get up again."""
        if self.mode is Mode.GETTING_UP:
            reason = f"getting up was stopped by {request.driver}"
            self._torque_off(Trouble(TroubleKind.FALL, reason))
        else:
            self.lease.stop()

    def _drive(self, wish: ask.Drive, now_s: float) -> None:
        numbers = astuple(wish.command)
        if not all(map(math.isfinite, numbers)):
            self._refuse(wish, f"{numbers} are not all finite")
            return
        self.lease.drive(wish, now_s)
        if self.lease.bars(wish.driver):
            self._refuse(wish, _STOPPED)

    def _grant(self, request: _DriverAsks, now_s: float) -> None:
        """Obey the driver; whom a stop bars from errands does not keep the wheel."""
        if isinstance(request, ask.Errand) and self.lease.bars(request.driver):
            self._refuse(request, _STOPPED)
        elif self.lease.acquire(request.driver, now_s):
            self._obey(request)
        else:
            self._refuse(request, f"{self.lease.driver} drives")

    def _obey(self, request: _DriverAsks) -> None:
        """Carry out what only the driver may ask."""
        modes = _FROM[type(request)]
        if self.mode not in modes:
            why = f"the robot is {self.mode.value}, not {' or '.join(modes)}"
            self._refuse(request, why)
        elif isinstance(request, ask.Start):
            self._start(request)
        elif isinstance(request, ask.Rest):
            self._go_limp()
            self._enter(Mode.OFF, f"{request.driver} let it rest")
        elif isinstance(request, ask.Reset):
            self._backend.release()
            self._events.add("mode", f"reset by {request.driver}")
            self._connect()
        elif isinstance(request, ask.GetUp):
            self._begin_to_get_up(request)
        elif isinstance(request, ask.PushRobot):
            self._push(request)
        elif isinstance(request, ask.GoTo | ask.FollowSteps):
            self.lease.send(request)
        else:
            self._disturb(request)

    def _refuse(self, request: _DriverAsks | ask.Drive, why: str) -> None:
        self._events.add_refusal(f"{ask.refusal(request)}{why}")

    def _start(self, request: ask.Start) -> None:
        """Rise from where the joints are now, unless it lies on the floor."""
        if self.lying is not None:
            ways = "let it get up, or set it up" if self.up.able else "set it up"
            reason = f"{self.lying.reason}; {ways} and reset"
            self._torque_off(self.lying._replace(reason=reason))
            return
        if beyond := self._limiter.beyond(self._stand):
            why = f"the standing pose is out of reach: {beyond}; calibrate it again"
            self._refuse(request, why)
            return
        try:
            self._backend.engage()
            here = self._backend.where(self._joint_names)
        except BackendError as error:
            self._backend.release()
            self._events.add("link", f"cannot start: {error}")
            return
        self.target = here
        self.times_connected += 1
        self._move_from(here)
        self._rose = False
        self._enter(Mode.RISING, "slowly to the standing pose")

    @property
    def can_get_up(self) -> bool:
        """Whether it lies there and knows a way up."""
        lies = self.trouble in (TroubleKind.FALL, TroubleKind.LYING)
        return self.mode is Mode.STOPPED and lies and self.up.able

    def _begin_to_get_up(self, request: ask.GetUp) -> None:
        if not self.can_get_up:
            why = (
                "it has not fallen"
                if self.up.able
                else "no way up is known; give `serve` --own-model and --get-up"
            )
            self._refuse(request, why)
            return
        try:
            self.up.begin()
        except BackendError as error:
            self._backend.release()
            self._events.add("link", f"cannot get up: {error}")
            return
        self._enter(Mode.GETTING_UP, self.up.note)

    def _push(self, wish: ask.PushRobot) -> None:
        simulator = self._backend.simulator
        if simulator is None:
            self._refuse(wish, "only a simulated robot can be pushed from here")
            return
        try:
            done = simulator.push(
                wish.impulse_ns, wish.direction_deg, wish.elevation_deg, wish.body
            )
        except CommandError as error:
            self._refuse(wish, str(error))
        else:
            self._events.add("push", str(done))

    def _disturb(self, wish: ask.Disturb) -> None:
        simulator = self._backend.simulator
        if simulator is None:
            self._refuse(wish, "only a simulated robot can be disturbed from here")
            return
        before = simulator.disturbances
        try:
            simulator.disturb(wish.changed(before))
        except CommandError as error:
            self._refuse(wish, str(error))
        else:
            for what in simulator.disturbances.changes_from(before):
                self._events.add("world", what)

    def note_punches(self) -> None:
        """Note the punches that have begun in this control period."""
        simulator = self._backend.simulator
        for push in () if simulator is None else simulator.take_punches():
            self._events.add("push", f"punch: {push}")

    # From mode to mode.

    def _enter(
        self, mode: Mode, reason: str, trouble: TroubleKind | None = None
    ) -> None:
        if mode is not self.mode:
            why = f": {reason}" if reason else ""
            self._events.add("mode", f"{self.mode.value} to {mode.value}{why}")
        self.mode, self.reason, self.trouble = mode, reason, trouble

    def _connect(self) -> None:
        """Take hold of the robot, or try later; a simulated one is put on its feet."""
        connected, self._connected = self._connected, False
        self.target = np.array(self._walker.stand)
        self._move_from(self.target)
        try:
            if not connected:
                self._backend.connect(self.target)
            legs = self._walker.library.robot.legs
            bounds = self._backend.limits
            self._limiter = JointLimiter(legs, self._period_s, bounds, self._offset)
            if not self._backend.physical:
                self._backend.engage()
        except BackendError as error:
            again_s = self._backoff.failed(self._events.time_s())
            why = f"not connected: {error}; it is tried again after {again_s:g} s"
            self._enter(Mode.STOPPED, why, TroubleKind.LINK)
            return
        self._backoff.cancel()
        self._walker.reset()
        self._rose = False
        self.times_connected += 1
        held, self.held = self.held, None
        if held is not None:
            self._torque_off(held)
        elif self._backend.physical:
            self._enter(Mode.OFF, "torque off; start makes it rise")
        else:
            self._enter(Mode.RISING, "settling")

    def _torque_off(self, trouble: Trouble) -> None:
        """Turn the torque off until a reset."""
        self._go_limp()
        self.up.end()
        self._backoff.cancel()
        self._enter(Mode.STOPPED, trouble.reason, trouble.kind)

    def _go_limp(self) -> None:
        """Turn the torque off and forget the commands.

        After a new start the robot waits for one.
        """
        self._backend.release()
        self._forget_commands()

    def _forget_commands(self) -> None:
        self.lease.stop(limp=True)
        self.trip.end()
        self.command = Command()

    def _hold_still(self, trouble: Trouble, sensors: Sensors | None) -> None:
        """Go slowly to the standing pose, or stay where nothing is known."""
        self._forget_commands()
        here = self.target if sensors is None else sensors.joint_position
        off = np.abs(self.target - here) > _BLOCKED  # a blocked joint pushes no more
        self.target = np.where(off, here, self.target)
        self._move_from(self.target)
        reason = f"{trouble.reason}; reset when that is mended"
        self._enter(Mode.SAFE, reason, trouble.kind)

    def _move_from(self, start: Array) -> None:
        self._move, self._moved_s = SmoothMove(start, self._stand), 0.0

    # Joint targets.

    def _move_on(self, now_s: float) -> None:
        """RISING or SAFE: further on the way to the standing pose."""
        # Period by period: a pause on the way must not be caught up with.
        self._moved_s += self._period_s
        self._aim(self._move.at(self._moved_s))
        if self.mode is Mode.RISING and self._move.done(self._moved_s - SETTLE_S):
            self._walker.reset(fell=self._rose)
            self._tell(Command())
            self.command = self._walker.commanded
            self._enter(Mode.STANDING, "")
            self._stood_s = now_s

    def _get_up(self) -> None:
        """Go on with the way up, and stand in its end."""
        try:
            state = self.up.step()
        except BackendError as error:
            self._torque_off(Trouble(TroubleKind.LINK, str(error)))
            return
        self.reason, self.target = self.up.note, self.up.of_legs
        if state is Rising.GIVEN_UP:
            self._torque_off(Trouble(TroubleKind.FALL, self.up.note))
        elif state is Rising.UP:
            self.up.end()
            self.times_connected += 1  # the guard begins anew
            self._move_from(self.target)
            self._rose = True
            self._enter(Mode.RISING, "up again")

    def _walk(self, sensors: Sensors, now_s: float) -> None:
        """Let the walker choose the targets."""
        learns = now_s - self._stood_s < SETTLE_S  # the vertical, standing still
        wanted = Command() if learns else self.lease.errand or self.lease.asked
        try:
            if wanted != self._wanted:
                self._tell(wanted)
            self._pass_places()
            targets = self._walker.step(sensors)
            self.command = self._walker.commanded
        except Exception as error:  # a robot must not be left alone with its momentum
            _log.exception("the walker failed")
            reason = f"the walker failed: {error}"
            self._hold_still(Trouble(TroubleKind.WALKER, reason), sensors)
            return
        self.status = targets.status
        self._aim(targets.position)
        if targets.motors is not None:
            kept = targets.motors.position + (self.target - targets.position)
            self.motors = replace(targets.motors, position=kept)
        mode = Mode.STANDING if self._stands else Mode.WALKING
        if mode is not self.mode:
            self._enter(mode, "")

    @property
    def _stands(self) -> bool:
        """Whether it stands; to rock on both feet is not yet to walk."""
        walker = self._walker
        rocks = self.mode is Mode.STANDING and walker.gait.settling
        return walker.standing or rocks

    def _tell(self, wanted: Command | ask.Errand) -> None:
        """Give the walker another command, or send it on another way."""
        self._wanted = wanted
        if isinstance(wanted, Command):
            self.trip.end()
            self._walker.command(wanted)
            return
        try:
            self.trip.begin(wanted)
        except CommandError as error:
            self._refuse(wanted, str(error))
            self.lease.drop()

    def _pass_places(self) -> None:
        """Go on to the next place; where no way leads there any more, stop walking."""
        try:
            self.trip.pass_places()
        except CommandError as error:
            if (errand := self.lease.errand) is not None:
                self._refuse(errand, str(error))
            self.lease.drop()

    def _aim(self, target: Array) -> None:
        self.target, kept_from = self._limiter.limit(target, self.target)
        self.status = kept_from or self.status
