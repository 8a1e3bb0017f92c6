"""Move the joints of a robot by a list of targets, and stop where anything is wrong."""

from collections.abc import Callable

import numpy as np

from gaitchain.backends.base import Backend
from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.errors import BackendError, ServosStoppedError
from gaitchain.live.clock import Clock, Pacer
from gaitchain.live.joint_motion import SLOW, JointLimiter, SmoothMove
from gaitchain.messages import GRAVITY, Array, JointTargets, Sensors
from gaitchain.robot.robot import Robot
from gaitchain.walker.mounting import Mounting
from gaitchain.walker.upright import angle_deg, tilt_deg

_MOST_LEAN_DEG = 25.0  # of a robot that stands, and from what targets ask of it
_LEAN_S = 0.2  # over which gravity is averaged, longer than a knock
_SILENT_S = 0.25  # without an answer of a joint or IMU, after which the motion ends,
_SILENT = 3.5  # or so many periods, if that is longer: one lost packet ends nothing


class JointMover:
    """Targets for a connected backend, one in each control period."""

    def __init__(
        self,
        robot: Robot,
        backend: Backend,
        clock: Clock,
        period_s: float,
        *,
        what: str,
        upright: bool = False,
        sent: Callable[[Array], None] | None = None,
    ) -> None:
        """Take a robot; nothing moves yet.

        Args:
            robot: with the limits of its joints.
            backend: the robot, connected.
            clock: clock of the control periods.
            period_s: control period [s].
            what: what is done, for messages.
            upright: whether to end where the IMU says that the robot leans too far.
            sent: called with each target (2 n,) [rad] after it was sent.
        """
        self.seen: list[Sensors] = []
        """Measurements of each control period since the last `begin`."""
        self.turnarounds_s: list[float] = []
        """From the begin of each of these reads to its target's write [s]."""
        legs = robot.legs
        self.target = np.zeros(len(legs.joint_names))
        """(2 n,) the latest target [rad]."""
        self.mounting: Mounting | None = None
        """How encoders and IMU are mounted; None for raw targets and measurements."""
        self._names, self._backend, self._clock = legs.joint_names, backend, clock
        self._sent = sent
        self._limiter = JointLimiter(legs, period_s)
        self._period_s, self._what, self._upright = period_s, what, upright
        self._silent_s = max(_SILENT_S, _SILENT * period_s)
        self._legs, self._up = legs_of(robot), np.array([0.0, 0.0, GRAVITY])
        self._asked_up = self._soles_up(robot.legs.stand)  # compiled before it moves
        self._heard_s, self._felt_s = np.zeros(len(self._names)), 0.0
        self._pacer = Pacer(clock, period_s)

    def begin(self) -> None:
        """Turn the torque on; each joint holds where it is.

        Raises:
            BackendError: a joint does not answer, or the torque cannot be turned on.
        """
        self.target = self._where()
        self._backend.engage()
        self._pacer = Pacer(self._clock, self._period_s)
        self._heard_s[:] = self._felt_s = self._clock.now()
        self.seen.clear()
        self.turnarounds_s.clear()

    def go(self, goal: Array, speed: float = SLOW) -> Array:
        """Move to a pose slowly.

        Args:
            goal: (2 n,) [rad].
            speed: of the joint that goes furthest, at most [rad/s].

        Returns:
            (2 n,) the latest measured angles; NaN where there was no answer [rad].

        Raises:
            BackendError: a joint failed, or the robot leans too far.
        """
        move, moved_s = SmoothMove(self.target, goal, speed), 0.0
        while not move.done(moved_s):
            moved_s += self._period_s
            self.send(move.at(moved_s))
        return self.seen[-1].joint_position

    def hold(self, seconds: float = 0.0) -> Array:
        """Stay at the latest target for a time, at least for three periods.

        Returns:
            (2 n,) mean of the angles in the second half [rad].

        Raises:
            BackendError: a joint failed, or the robot leans too far.
        """
        count = max(3, round(seconds / self._period_s))
        for _ in range(count):
            self.send(self.target)
        came = np.array([s.joint_position for s in self.seen[-(count // 2) :]])
        heard = np.isfinite(came)
        total = np.where(heard, came, 0.0).sum(axis=0)
        return np.asarray(
            total / np.where(heard.any(axis=0), heard.sum(axis=0), np.nan)
        )

    def stay(self) -> None:
        """Stay at the latest target for one period.

        Raises:
            BackendError: a joint failed, or the robot leans too far.
        """
        self.send(self.target)

    def send(self, wanted: Array) -> Array:
        """Wait for the next period, measure and send.

        Args:
            wanted: (2 n,) [rad].

        Returns:
            (2 n,) what was sent, inside limits of angle and speed [rad].

        Raises:
            BackendError: a joint failed, or the robot leans too far.
        """
        self._pacer.wait()
        begin_s = self._clock.now()
        seen = self._read()
        self._check(seen)
        self.seen.append(seen)
        self.target, _ = self._limiter.limit(wanted, self.target)
        self._write(self.target)
        self.turnarounds_s.append(self._clock.now() - begin_s)
        if self._sent is not None:
            self._sent(self.target)
        return self.target

    def _read(self) -> Sensors:
        seen = self._backend.read()
        return seen if self.mounting is None else self.mounting.sensed(seen)

    def _write(self, target: Array) -> None:
        if self.mounting is not None:
            target = self.mounting.asked(JointTargets(self._names, target)).position
        try:
            self._backend.write(target)
        except ServosStoppedError as error:  # nobody here can engage them again
            raise BackendError(
                f"{self._what} ended: {error.why}; begin again with the same command"
            ) from None

    def _where(self) -> Array:
        """Return where all joints are."""
        begin = self._clock.now()
        while True:
            seen = self._read().joint_position
            if np.isfinite(seen).all():
                return np.array(seen)
            if self._clock.now() >= begin + self._silent_s:
                break
        missing = [n for n, q in zip(self._names, seen, strict=True) if np.isnan(q)]
        raise BackendError(f"{', '.join(missing)}: no answer; check cables and power")

    def _check(self, seen: Sensors) -> None:
        fault = self._backend.health().fault
        if fault:
            raise BackendError(f"{self._what} ended: {fault}")
        now_s, heard = self._clock.now(), np.isfinite(seen.joint_position)
        self._heard_s[heard] = now_s
        silent = now_s - self._heard_s > self._silent_s
        if silent.any():
            name = self._names[int(np.argmax(silent))]
            raise BackendError(
                f"{self._what} ended: {name} has not answered for {self._silent_s:g} s"
            )
        if self._upright and self._backend.has_imu:
            self._check_imu(seen.acceleration, now_s)
            self._check_lean(seen.acceleration)

    def _check_imu(self, acceleration: Array, now_s: float) -> None:
        if np.isfinite(acceleration).all():
            self._felt_s = now_s
        elif now_s - self._felt_s > self._silent_s:
            raise BackendError(
                f"{self._what} ended: the IMU has not answered for {self._silent_s:g} "
                "s, so that nobody would see the robot lean; check its cable"
            )

    def _check_lean(self, acceleration: Array) -> None:
        felt = np.where(np.isfinite(acceleration), acceleration, self._up)
        part = min(self._period_s / _LEAN_S, 1.0)
        self._up += part * (felt - self._up)
        self._asked_up += part * (self._soles_up(self.target) - self._asked_up)
        lean_deg = min(tilt_deg(self._up), angle_deg(self._up, self._asked_up))
        if lean_deg > _MOST_LEAN_DEG:
            raise BackendError(
                f"{self._what} ended: the robot leans by {lean_deg:.0f} deg, at "
                f"most {_MOST_LEAN_DEG:.0f}; stand it up, or mend its zeros first"
            )

    def _soles_up(self, joints: Array) -> Array:
        """Return up in a trunk whose soles lie flat: how it is asked to lean, (3,)."""
        return np.asarray(posture(self._legs, joints).feet[..., 2].mean(axis=0))
