"""First motions under the walker, driven as `serve` drives: hung, standing, walking."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from gaitchain.backends.servos.calibration import LOW_PWM, MOST_PWM
from gaitchain.commission.bench import Bench, Verdict
from gaitchain.commission.screen import Screen
from gaitchain.errors import BackendError
from gaitchain.live import messages as ask
from gaitchain.live.exercise import sway
from gaitchain.live.joint_mover import JointMover
from gaitchain.live.loop import ControlLoop
from gaitchain.live.messages import Mode, Request, Telemetry
from gaitchain.live.modes import BALANCED
from gaitchain.live.safe_backend import SafeBackend
from gaitchain.messages import Array, Command
from gaitchain.walker.walker import Walker

_DRIVER = "doctor"
_SLOW = 0.3  # part of the library's fastest walk ahead
_RISE_S, _STAND_S, _WALK_S, _STOP_S = 30.0, 5.0, 8.0, 15.0
_REPEAT_S = 0.1  # a command has to be repeated
_MOST_OFF_DEG = 12.0  # between a joint and its target, on average over a second
_SETTLED_S = 1.0  # over which a joint's distance from its target is averaged
_SWAY = 0.5  # of the exercise's size
_IDLE_TICKS = 10  # while a person is asked, who is heard in between
_PARTING = "Hold the robot: the torque goes off"


class MeanTrackingError:
    """How far joints are from their targets, on average over a second or so."""

    def __init__(self, period_s: float) -> None:
        """Begin at zero: what has just begun to move has not stayed behind.

        Args:
            period_s: between two errors [s].
        """
        self._part = min(period_s / _SETTLED_S, 1.0)  # a new value's
        self._mean: Array = np.zeros(1)

    def add(self, error: Array) -> None:
        """Take the next errors of all joints, NaN where not measured [rad]."""
        self._mean = self._mean + self._part * (np.nan_to_num(error) - self._mean)

    @property
    def worst_deg(self) -> float:
        """That of the joint which is farthest from its target now [deg]."""
        return float(np.degrees(np.abs(self._mean).max()))

    @property
    def worst_joint(self) -> int:
        """Index of that joint."""
        return int(np.abs(self._mean).argmax())


@dataclass
class _Watch:
    """The loop's port: asks, and remembers what was told."""

    screen: Screen
    error: MeanTrackingError
    pending: list[Request] = field(default_factory=list)
    latest: Telemetry | None = None
    off_deg: float = 0.0
    """Largest mean distance of a joint from its target so far [deg]."""

    def publish(self, telemetry: Telemetry) -> None:
        """Remember how far the joints are from their targets."""
        self.latest = telemetry
        self.screen.show(np.asarray(telemetry.joint_target))
        if telemetry.mode not in BALANCED:
            return
        self.error.add(np.subtract(telemetry.joint_position, telemetry.joint_target))
        self.off_deg = max(self.off_deg, self.error.worst_deg)

    def requests(self) -> list[Request]:
        """Return what is asked now."""
        asked, self.pending = self.pending, []
        return asked


class _Drive:
    """One robot under the control loop."""

    def __init__(self, bench: Bench, backend: SafeBackend, *, feedback: bool) -> None:
        error = MeanTrackingError(bench.period_s)
        self._bench, self.watch = bench, _Watch(bench.screen, error)
        library = bench.library
        walker = Walker(library, feedback=feedback, period_s=bench.period_s)
        self._loop = ControlLoop(
            walker,
            backend,
            self.watch,
            bench.clock,
            bench.period_s,
            connected=True,
        )
        self._asked_s = -1.0

    def rise(self) -> None:
        """Start, and wait until the robot stands.

        Raises:
            BackendError: it does not.
        """
        self._loop.tick()
        self.watch.pending.append(ask.Start(_DRIVER))
        self._until(lambda: self.mode is Mode.STANDING, _RISE_S, "stand")

    def stay(self, seconds: float, stage: str) -> None:
        """Stand for a time."""
        self._for(seconds, stage, Command())

    def idle(self) -> None:
        """Stand for a moment."""
        for _ in range(_IDLE_TICKS):
            self._tick(Command())

    def walk(self, command: Command, seconds: float, stage: str) -> int:
        """Walk for a time, and stop; return the number of steps."""
        self._for(seconds, stage, command)
        self.watch.pending.append(ask.Stop(_DRIVER))
        self._until(lambda: self.mode is Mode.STANDING, _STOP_S, "stop")
        return 0 if self.watch.latest is None else self.watch.latest.steps

    @property
    def mode(self) -> Mode:
        """Mode of the loop."""
        return self._loop.modes.mode

    def _for(self, seconds: float, stage: str, command: Command) -> None:
        count = round(seconds / self._bench.period_s)
        for i in range(count):
            self._bench.progress(stage, i + 1, count)
            self._tick(command)

    def _until(self, there: Callable[[], bool], most_s: float, what: str) -> None:
        for _ in range(round(most_s / self._bench.period_s)):
            self._tick(Command())
            if there():
                return
        raise BackendError(f"the robot did not {what} within {most_s:g} s")

    def _tick(self, command: Command) -> None:
        """Tick once, with the command repeated.

        Raises:
            BackendError: the loop found something wrong.
        """
        now_s, started = self._bench.clock.now(), self.mode is not Mode.OFF
        if not command.stops and now_s - self._asked_s > _REPEAT_S:
            self._asked_s = now_s
            self.watch.pending.append(ask.Drive(_DRIVER, *command.motion))
        self._loop.tick()
        modes = self._loop.modes
        bad = modes.mode in (Mode.SAFE, Mode.STOPPED)
        if bad or (started and modes.mode is Mode.OFF):
            raise BackendError(f"{modes.mode.value}: {modes.reason}")


def check_hung(bench: Bench) -> Verdict:
    """Step slowly with the trunk held up and the feet in the air."""
    bench.person.ready(
        "Hold the trunk up in a gantry, upright, feet in the air, hands away: the "
        "robot goes to its standing pose, steps slowly for 8 s, stops and lets go"
    )
    # Hung, there is nothing to balance.
    return _walked(bench, "hung", LOW_PWM, feedback=False)


def check_stand(bench: Bench) -> Verdict:
    """Stand on the ground."""
    bench.person.ready(
        "Put the robot on level ground near its standing pose, rope slack, hands "
        "ready: it rises, stands for 5 s and lets go, so hold it then"
    )
    with bench.robot(MOST_PWM) as backend:
        drive = _Drive(
            bench, SafeBackend(backend, _joints(bench)), feedback=_balances(bench)
        )
        drive.rise()
        drive.stay(_STAND_S, "stands")
        bench.person.ready(_PARTING, drive.idle)
    return _judged(bench, drive, "stand", f"stood for {_STAND_S:g} s")


def check_shift(bench: Bench) -> Verdict:
    """Shift the weight from foot to foot and over the soles, slowly."""
    bench.person.ready(
        "The same place and rope: the robot stands up, sways for half a minute without "
        "lifting a foot, and lets go"
    )
    with bench.robot(MOST_PWM) as backend:
        whole = sway(bench.within(backend))
        motion = whole.smaller(_SWAY).every(bench.period_s)
        mover = bench.mover(backend, "the sway", upright=True)
        mover.begin()
        mover.go(motion.targets[0])
        _shift(bench, mover, motion.targets)
        bench.person.ready(_PARTING, mover.stay)
    steady = bench.person.confirms("Did both soles stay flat on the ground?")
    if not steady:
        todo = "correct the offsets of ankles and hips (--from offsets); check the CoM"
        return Verdict("no-go", "a sole lifted or slid", todo)
    return Verdict("go", f"swayed for {len(motion.targets) * bench.period_s:.0f} s")


def _shift(bench: Bench, mover: JointMover, targets: Array) -> None:
    """Send the targets of a motion, (T, 2 n) [rad], one each period.

    Raises:
        BackendError: a joint does not follow.
    """
    off = MeanTrackingError(bench.period_s)
    for i, wanted in enumerate(targets):
        bench.progress("shifts its weight", i + 1, len(targets))
        sent = mover.send(wanted)
        off.add(mover.seen[-1].joint_position - sent)
        if off.worst_deg > _MOST_OFF_DEG:
            name = bench.library.robot.legs.joint_names[off.worst_joint]
            raise BackendError(f"{name} stays {off.worst_deg:.0f} deg from its target")


def check_steps(bench: Bench) -> Verdict:
    """Walk the first slow steps on the ground."""
    balanced = bench.library.family.balanced
    if balanced and not _felt(bench):
        said = "this library balances by gyro and accelerometer, and there is no IMU"
        return Verdict("skipped", said, "add a table [imu] to the calibration")
    bench.person.ready(
        "Two metres of level ground ahead, rope slack, hands ready: it stands up, "
        "walks ahead slowly for 8 s, stops, and lets go"
    )
    verdict = _walked(bench, "steps", MOST_PWM, feedback=_balances(bench))
    if not bench.emulated:
        return verdict
    said = f"{verdict.said}; without balance, as emulated servos have no body"
    return replace(verdict, said=said)


def slow_command(bench: Bench) -> Command:
    """Return a command for a slow walk ahead."""
    low, high = bench.library.command_range.vx
    return Command(vx=max(_SLOW * high, min(low, high) if low > 0.0 else 0.0))


def _walked(bench: Bench, stage: str, most_pwm: float, *, feedback: bool) -> Verdict:
    """Rise, walk slowly, stop, and let go; judge it."""
    command = slow_command(bench)
    with bench.robot(most_pwm) as backend:
        drive = _Drive(bench, SafeBackend(backend, _joints(bench)), feedback=feedback)
        drive.rise()
        steps = drive.walk(command, _WALK_S, "steps slowly")
        bench.person.ready(_PARTING, drive.idle)
    if steps < 1:
        todo = "see the library with `gaitchain inspect`: does it walk this slowly?"
        return Verdict("no-go", f"no step at {command.vx:.2f} m/s", todo)
    return _judged(bench, drive, stage, f"{steps} steps at {command.vx:.2f} m/s")


def _judged(bench: Bench, drive: _Drive, stage: str, said: str) -> Verdict:
    """Judge how the joints followed, and ask the person how it looked."""
    off = drive.watch.off_deg
    figures = {"worst_follow_deg": off, "seen": bench.person.present}
    said = f"{said}, joints within {off:.1f} deg of their targets on average"
    if off > _MOST_OFF_DEG:
        todo = "raise pwm_limit step by step, or look for play, friction and low supply"
        return Verdict("no-go", said, todo, figures)
    if not bench.person.confirms("Was it calm: no shaking, no noise, nothing hot?"):
        todo = f"find what shakes, and mend it; then begin again with --from {stage}"
        return Verdict("no-go", f"{said}; but it was not calm", todo, figures)
    return Verdict("go", said, measured=figures)


def _felt(bench: Bench) -> bool:
    return bench.calibration.imu is not None


def _balances(bench: Bench) -> bool:
    """Whether to balance: of servos without a body that would answer to nothing."""
    return _felt(bench) and not bench.emulated


def _joints(bench: Bench) -> int:
    return len(bench.library.robot.legs.joint_names)
