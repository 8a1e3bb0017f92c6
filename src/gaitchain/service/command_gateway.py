"""Check the requests of drivers, from REST and stream, before they go to the loop."""

from gaitchain.errors import CommandError, ServiceError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.live.driver_lease import LEASE_S
from gaitchain.live.messages import (
    Disturb,
    Drive,
    EmergencyStop,
    Errand,
    FollowSteps,
    GetUp,
    GoTo,
    LetGo,
    Mode,
    Play,
    PushRobot,
    Request,
    Reset,
    Rest,
    Start,
    Stop,
    Telemetry,
)
from gaitchain.messages import Command
from gaitchain.service.api_feed import Feed
from gaitchain.service.api_limits import Allowance, ApiLimits
from gaitchain.service.channel import Asker
from gaitchain.service.disturbance_limits import PUSH_MOST
from gaitchain.service.schemas import (
    DisturbanceLimits,
    DisturbanceRequest,
    FootstepsRequest,
    GoalRequest,
    Motion,
    PushRequest,
    ReplayRequest,
    Steering,
)
from gaitchain.service.stale_errands import StaleErrands
from gaitchain.sim.bodies import ANY_BODY, check_body
from gaitchain.walker.footsteps import Footstep, check_footsteps
from gaitchain.walker.place import Place
from gaitchain.walker.stride_generator import StrideGenerator
from gaitchain.walker.waypoints import check_way, near_of

_Act = type[Start | Stop | Rest | Reset | GetUp | EmergencyStop | LetGo]
_ACTS: dict[str, _Act] = {
    "start": Start,
    "stop": Stop,
    "rest": Rest,
    "reset": Reset,
    "get_up": GetUp,
    "emergency_stop": EmergencyStop,
    "let_go": LetGo,
}
ANYBODY = ("stop", "emergency_stop", "let_go")
"""What leaves the wheel with whoever has it."""
_OF_ROBOTS = ("rest", "get_up")  # of which a log's player has nothing
ALWAYS_SENT = ("stop", "emergency_stop")
"""What is harmless however late it comes, so nothing may keep it back."""


class RefusedError(ServiceError):
    """A request of a client cannot be granted."""

    def __init__(self, status: int, detail: str) -> None:
        """Say why.

        Args:
            status: of the HTTP answer.
            detail: with the value, the limit and what would have worked.
        """
        super().__init__(detail)
        self.status = status


class CommandGateway:
    """Takes requests, refuses what cannot be, and passes the rest on."""

    def __init__(
        self,
        feed: Feed,
        asker: Asker,
        library: GaitLibrary,
        limits: DisturbanceLimits | None,
        allowed: ApiLimits,
        *,
        replays: bool = False,
    ) -> None:
        """Open.

        Args:
            feed: the loop's telemetry.
            asker: the way to the loop.
            library: that the loop walks.
            limits: of what disturbs the robot; None where it is not simulated.
            allowed: how much is taken from all clients.
            replays: whether a log is played in place of a loop.

        Raises:
            LibraryError: no walk of a library of strides passed physics.
        """
        self._feed, self._asker = feed, asker
        self._library, self._limits, self._replays = library, limits, replays
        self._span = library.command_range
        self._strides: StrideGenerator | None = None  # what the loop chooses strides by
        if isinstance(library.poses, StridePoses) and not replays:
            self._strides = StrideGenerator(library)  # now, as later a stop may wait
        self._looks = Allowance(allowed.footsteps_per_s, allowed.footsteps)
        self._most_looks = allowed.footsteps_per_s
        self._passed: FollowSteps | None = None  # that were found to be possible
        self._errands = StaleErrands()

    def drive(self, driver: str, motion: Motion) -> None:
        """Ask for a motion.

        Raises:
            RefusedError: the library does not walk so, another one drives, a log is
                played, or the loop is silent.
        """
        command = Command(motion.vx, motion.vy, motion.yaw_rate, motion.crouch)
        try:
            self._span.check_each(command)
        except CommandError as error:
            raise RefusedError(422, str(error)) from error
        self._ask(driver, command)

    def steer(self, driver: str, steering: Steering) -> None:
        """Ask for the motion that parts of the library's range make.

        Raises:
            RefusedError: another one drives, a log is played, or the loop is silent.
        """
        parts = steering.ahead, steering.left, steering.turn
        self._ask(driver, self._span.steer(parts, steering.most, steering.crouch))

    def go_to(self, driver: str, goal: GoalRequest) -> None:
        """Ask for the way to a place.

        Raises:
            RefusedError: the library does not measure where the robot is, or has no way
                there, another one drives, the loop is silent, or it began anew while
                this was asked for again and again.
        """
        place = Place(goal.x, goal.y, goal.yaw)
        errand = GoTo(driver, (place,), goal.crouch * self._span.crouch[0])
        telemetry = self._check_errand(errand)
        going = telemetry.going
        if going is None or going.goal != place:  # else it is repeated
            self._check_way(telemetry, place)
        self._send(errand)

    def _check_errand(self, errand: Errand) -> Telemetry:
        """Refuse what nobody measures, may ask for, or means as it is now."""
        stale = self._errands.asks(errand, self._feed.latest)
        telemetry = self._check_strides(self._check_wheel(errand.driver))
        if stale:
            raise RefusedError(
                409,
                "the loop began anew since this was asked for, and its places are "
                f"others now: send a zero command, or nothing for {LEASE_S:g} s, and "
                "then where it is to go",
            )
        return telemetry

    def _check_way(self, telemetry: Telemetry, goal: Place) -> None:
        """Refuse a place without a way; the loop looks again, but cannot answer."""
        assert telemetry.place is not None  # whoever calls has seen that
        near = near_of(self._library)
        try:
            check_way(telemetry.place, goal, self._span, near)
        except CommandError as error:
            raise RefusedError(409, str(error)) from error

    def follow_steps(self, driver: str, wanted: FootstepsRequest) -> None:
        """Ask for footsteps.

        Raises:
            RefusedError: the robot does not stand, the chain cannot make one of them,
                which the message has the number of, too many were asked for, another
                one drives, the loop is silent, or it began anew while these were asked
                for again and again.
        """
        steps = tuple(Footstep(s.left, s.x, s.y, s.yaw) for s in wanted.steps)
        asked = FollowSteps(driver, steps)
        telemetry = self._check_errand(asked)
        if asked != self._passed or telemetry.going is None:  # else it is repeated
            self._check_steps(telemetry, steps)
        self._passed = asked
        self._send(asked)

    def _check_steps(self, telemetry: Telemetry, steps: tuple[Footstep, ...]) -> None:
        """Refuse steps that cannot be made; the loop looks again, but cannot answer."""
        if telemetry.mode is not Mode.STANDING or telemetry.feet is None:
            raise RefusedError(
                409, f"footsteps begin from a stand; the robot is {telemetry.mode}"
            )
        feet = dict(zip((1.0, -1.0), telemetry.feet, strict=True))
        if not self._looks.take(len(steps)):
            raise RefusedError(
                429,
                f"more than {self._most_looks:g} new footsteps a second: ask again "
                "later; repeated ones do not count",
            )
        strides = self._strides
        assert strides is not None  # no other library knows a place
        try:
            check_footsteps(strides, feet, steps, strides.stance)
        except CommandError as error:
            raise RefusedError(409, str(error)) from error

    def _check_strides(self, telemetry: Telemetry) -> Telemetry:
        """Refuse places where nothing says where the robot is."""
        if telemetry.place is None or telemetry.replay is not None:
            raise RefusedError(
                409,
                "nothing measures where this robot is: that needs a library of "
                "strides, as preset 'brisk' builds, and no replay",
            )
        return telemetry

    def act(self, driver: str, what: str) -> None:
        """Ask for what needs no numbers.

        Args:
            driver: who asks.
            what: a key of the stream's messages, such as "emergency_stop".

        Raises:
            RefusedError: another one drives, or the loop is silent.
        """
        if what in _OF_ROBOTS:
            self._check_driven()
        if what not in ALWAYS_SENT:
            self._check_wheel(driver, anybody=what in ANYBODY)
        self._send(_ACTS[what](driver))

    def push(self, driver: str, push: PushRequest) -> None:
        """Push a simulated robot.

        Raises:
            RefusedError: it is too hard, or there is nothing or no such body to push,
                another one drives, or the loop is silent.
        """
        bodies = self._check_impulse("pushed", "impulse_ns", push.impulse_ns).bodies
        try:
            check_body(push.body, (*bodies, ANY_BODY))
        except CommandError as error:
            raise RefusedError(422, str(error)) from error
        self._check_wheel(driver)
        pushed = push.impulse_ns, push.direction_deg, push.elevation_deg, push.body
        self._send(PushRobot(driver, *pushed))

    def disturb(self, driver: str, wanted: DisturbanceRequest) -> None:
        """Change what disturbs a simulated robot.

        Raises:
            RefusedError: punches are too hard, or there is nothing to disturb, another
                one drives, or the loop is silent.
        """
        hardest = 0.0 if wanted.punches is None else wanted.punches.most_ns
        self._check_impulse("disturbed", "punches.most_ns", hardest)
        self._check_wheel(driver)
        self._send(Disturb(driver, **wanted.changes))

    def play(self, driver: str, wanted: ReplayRequest) -> None:
        """Play a log otherwise.

        Raises:
            RefusedError: no log is played, or the player is silent.
        """
        self._check_wheel(driver)
        telemetry = self._feed.latest
        if telemetry is None or telemetry.replay is None:
            raise RefusedError(409, "seeking needs a replay; this is a live run")
        given = wanted.model_dump(exclude_none=True, exclude={"type"})
        self._send(Play(driver, **given))

    def _check_impulse(
        self, what: str, name: str, impulse_ns: float
    ) -> DisturbanceLimits:
        """Refuse a robot that is not simulated, and an impulse that is too hard."""
        limits = self._limits
        if limits is None:
            why = "this is a replay of a log, " if self._replays else ""
            raise RefusedError(409, f"{why}only a simulated robot can be {what}")
        if impulse_ns > limits.impulse_ns:
            raise RefusedError(
                422,
                f"{name} {impulse_ns:g} N s: at most {limits.impulse_ns:.1f} N s, "
                f"which is {PUSH_MOST:g} m/s of this robot's mass",
            )
        return limits

    def _ask(self, driver: str, command: Command) -> None:
        self._check_driven()
        self._check_wheel(driver)
        self._errands.forget(driver)
        self._send(Drive(driver, *command.motion, command.crouch))

    def _check_driven(self) -> None:
        """Refuse to drive a log."""
        if self._replays:
            raise RefusedError(409, "this is a replay of a log: nobody drives it")

    def _check_wheel(self, driver: str, *, anybody: bool = False) -> Telemetry:
        telemetry = self._feed.latest
        if telemetry is None:
            raise RefusedError(503, self._feed.why_silent)
        if not anybody and telemetry.driver not in ("", driver):
            raise RefusedError(
                409,
                f"{telemetry.driver} drives, {driver} watches: wait until it lets go",
            )
        return telemetry

    def _send(self, request: Request) -> None:
        if not self._asker.ask(request):
            raise RefusedError(
                503,
                "the loop takes no requests: it has just begun, or too many wait",
            )
