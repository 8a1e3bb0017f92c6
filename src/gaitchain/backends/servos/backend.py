"""A robot of servos of one make on one bus as a backend."""

import contextlib
import logging
import time
from collections.abc import Mapping, Sequence

import numpy as np

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.servos.angles import ServoAngles
from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.bus_load import SHARE, BusLoad
from gaitchain.backends.servos.calibration import MOST_PWM, Calibration, check_joints
from gaitchain.backends.servos.imu import BusImu
from gaitchain.backends.servos.make import OFF, make_named
from gaitchain.backends.servos.setup import ServoSetup, bus_load, label
from gaitchain.backends.servos.torque import goal_bytes, hold_here, let_go, make_limp
from gaitchain.backends.servos.watch import ServoWatch
from gaitchain.backends.servos.wire import Answer
from gaitchain.errors import BackendError, ServosStoppedError
from gaitchain.messages import GRAVITY, Array, Sensors

_log = logging.getLogger(__name__)
_IDLE_PATIENCE_S = 0.03  # longest silence before a packet while the robot does not walk
# Total wait for servos that do not answer, and again for an IMU.
_MISSING_WAIT_S, _RELEASE_WAIT_S = 0.4, 0.1
_PATIENCE = 0.4  # of a control period: longest silence before a packet while walking
_READING = 1.0  # of a control period: longest read of all servos
_SILENCE_S, _SILENT_READS = 0.1, 2  # if the whole bus is silent for longer, it is lost
_MARGIN = 0.9  # of the watchdog time, from which a stop of the servos is assumed
_UPRIGHT = np.array([0.0, 0.0, GRAVITY])


class ServoBackend:
    """Servos of a make, read by one sync read and driven by one sync write.

    Without an IMU on the same bus, named in the calibration, `has_imu` is False and
    the robot is reported as upright and still. Not thread-safe.
    """

    load_unit = "A"

    def __init__(
        self,
        port: str,
        calibration: Calibration,
        joint_names: Sequence[str],
        period_s: float,
        *,
        watchdog_s: float = 0.2,
        physical: bool = True,
    ) -> None:
        """Set up the backend; nothing is sent before `connect`.

        Args:
            port: serial port, such as "/dev/ttyUSB0".
            calibration: calibration of the servos.
            joint_names: joints in the walker's order.
            period_s: control period [s].
            watchdog_s: time without packets after which the servos stop by themselves
                [s].
            physical: whether real motors move; False for emulated servos.

        Raises:
            CalibrationError: a joint has no servo.
        """
        check_joints(calibration, joint_names, calibration.joints)
        self.physical = physical
        self.has_imu = calibration.imu is not None
        self._joints = {name: calibration.joints[name] for name in joint_names}
        self._labels = {j.id: label(name, j) for name, j in self._joints.items()}
        self._ids = list(self._labels)
        self._port, self._baud = port, calibration.baud
        self._make = make_named(calibration.make)
        self._period_s = period_s
        self._stops_s = self._make.watchdog_time_s(watchdog_s)
        self._angles = ServoAngles(list(self._joints.values()), self._make)
        self._imu = None if calibration.imu is None else BusImu(calibration.imu)
        self._bus = ServoBus(port, self._baud, _IDLE_PATIENCE_S, make=self._make)
        self._watch = ServoWatch({}, [], self._make)
        self._amperes: Array = np.full(len(self._ids), np.nan)
        self._loads: Array = self._amperes
        self.load = BusLoad(len(self._ids), calibration.baud, make=self._make)
        """How long the packets of a period keep the bus; exact once connected."""
        self._begin_s = self._look_until_s = 0.0
        self.engaged = False
        """Whether the torque was turned on since `connect`."""
        self._most_pwm = MOST_PWM
        self._pwm_limits: dict[int, float] = {}  # of calibration and servos, by id
        self._holding: list[int] = []  # ids that did not confirm torque off
        self._may_hold: list[int] = []
        self._in_use = False  # from the first `connect` to `close`
        self._silent_since: float | None = None
        self._silent_reads = self._late_bytes = 0

    def connect(self, position: Array) -> None:
        """Open the port, find every servo and turn its torque off.

        Args:
            position: not used: the robot is not moved.

        Raises:
            BackendError: the port cannot be opened; a servo is missing, of another
                model or in another mode; or the bus is too slow.
        """
        self._bus.close()
        bus = self._bus = ServoBus(
            self._port, self._baud, _IDLE_PATIENCE_S, make=self._make
        )
        self._watch.engaged = False
        self._holding, self._in_use = list(self._ids), True
        try:
            bus.open()
            with bus.hurried(_MISSING_WAIT_S):
                setups = self._find_devices(bus)
        except BackendError:
            bus.close()
            raise
        finally:
            bus.patience_s = _PATIENCE * self._period_s
        self._adopt(setups)
        bus.return_delay_s = max(s.return_delay_s for s in setups)
        bus.sent = bus.lost = 0
        self._begin_s, self._holding = time.monotonic(), []
        self.engaged = False
        self._silent_since, self._silent_reads = None, 0

    def _find_devices(self, bus: ServoBus) -> list[ServoSetup]:
        """Find servos and IMU, and turn the torque off; check that the bus is fast."""
        setups = make_limp(bus, self._joints)
        bus.try_fast(self._ids)
        imu_bytes = 0 if self._imu is None else self._imu.size
        self.load = bus_load(bus, setups, imu_bytes)
        self.load.check(self._period_s, bus.name)
        if self._imu is not None:
            # What servos made it wait does not count: the IMU was not asked yet.
            with bus.hurried(_MISSING_WAIT_S):
                self._imu.find(bus)
        return setups

    def _adopt(self, setups: list[ServoSetup]) -> None:
        """Take over the servos' settings: their ranges, currents and limits."""
        self._angles = ServoAngles(list(self._joints.values()), self._make)
        ranges = np.array([(setup.lowest, setup.highest) for setup in setups])
        self._angles.narrow(*ranges.T)
        pairs = zip(self._joints.values(), setups, strict=True)
        self._pwm_limits = {j.id: min(j.pwm_limit, s.pwm_limit) for j, s in pairs}
        self._amperes = np.array([setup.model.amperes_per_count for setup in setups])
        self._watch = ServoWatch(self._labels, setups, self._make)
        load = self.load
        self._look_until_s = SHARE * self._period_s - load.look_s - load.write_s

    def read(self) -> Sensors:
        """Return the servos' measurements; NaN for each that did not answer.

        Takes at most one control period, or two if a servo's status is read as well.

        Raises:
            BackendError: the port is lost, or no servo has answered for 0.1 s.
        """
        begin = time.monotonic()
        self._check_watchdog(begin - self._bus.spoke_s)
        heard = self._bus.read_all(
            self._watch.present, self._make.present, _READING * self._period_s
        )
        self._watch.hear(heard)
        answers = heard.answers
        self._check_silence(bool(answers))
        current, velocity, position = self._counts(answers)
        self._loads = self._angles.sign * current * self._amperes
        gyro, acceleration = np.zeros(3), _UPRIGHT.copy()
        if self._imu is not None:
            gyro, acceleration = self._imu.read(self._bus)
        if answers and time.monotonic() - begin < self._look_until_s:
            self._watch.look(self._bus)
        return Sensors(
            time=begin - self._begin_s,
            joint_position=self._angles.positions(position),
            joint_velocity=self._angles.velocities(velocity),
            angular_velocity=gyro,
            acceleration=acceleration,
        )

    def write(self, position: Array) -> None:
        """Send goals (2 n,) [rad], clipped to the limits of calibration and servos.

        Raises:
            BackendError: the port is lost, a target is not finite, or the servos were
                stopped by their watchdog and accept no goals.
        """
        if not np.isfinite(position).all():
            bad = list(self._joints)[int(np.argmin(np.isfinite(position)))]
            raise BackendError(f"{bad}: a target that is no number; none was sent")
        self._check_watchdog(time.monotonic() - self._bus.spoke_s)
        if self._watch.tripped:
            raise ServosStoppedError(f"{self._port}: {self._why_refused()}")
        self._bus.write_all(
            self._make.goal,
            goal_bytes(self._make, self._ids, self._angles.goals(position)),
        )

    def limit_torque(self, most_pwm: float) -> None:
        """Bound the torque from the next `engage` on, as calibration and servos do.

        Args:
            most_pwm: limit of each servo [% of the supply voltage].
        """
        self._most_pwm = most_pwm

    def engage(self) -> None:
        """Turn the torque on, with the present positions as goals.

        Raises:
            BackendError: a servo does not answer or confirm, or a joint is far outside
                its limits; then all torques are off.
        """
        self._bus.patience_s, self.engaged = _IDLE_PATIENCE_S, True
        try:
            with self._bus.hurried(_MISSING_WAIT_S):
                limits = {
                    n: min(p, self._most_pwm) for n, p in self._pwm_limits.items()
                }
                joints, angles = self._joints, self._angles
                hold_here(self._bus, joints, angles, self._stops_s, limits)
        except BackendError:
            self.release()
            raise
        finally:
            self._bus.patience_s = _PATIENCE * self._period_s
        self._watch.engage()

    def release(self) -> None:
        """Turn the torque off, repeatedly if servos do not confirm; never raises.

        A lost port is opened again if it is back. Servos that did not confirm are named
        in `health` and keep their watchdog on.
        """
        self._watch.engaged = False
        self._holding = list(self._ids) if self._in_use else []
        self._may_hold = self._holding if self.engaged else []
        vain_s = max(_RELEASE_WAIT_S, 4.0 * self._bus.patience_s)
        with contextlib.suppress(BackendError), self._bus.hurried(vain_s):
            if self._in_use and not self._bus.is_open:
                self._bus.open()
            self._holding = let_go(self._bus, self._ids)
            self._may_hold = self._holding  # until one is known to have no torque
            self._may_hold = self._of_those_that_may(self._holding)
            limp = set(self._ids) - set(self._holding)
            if self._make.watchdog is not None:
                self._bus.write_all(self._make.watchdog, dict.fromkeys(limp, OFF))

    def health(self) -> LinkHealth:
        """Return the numbers of requested and lost answers, and present problems."""
        notes = [self._watch.note(), "" if self._imu is None else self._imu.note]
        if not self._bus.is_open:
            notes = [f"{self._port} is not connected"]
        elif self._silent_reads > _SILENT_READS:
            notes = [f"nobody answers on {self._port}"]
        if self._holding:
            notes.append(
                f"{self.not_let_go} NOT known to have let go: switch the supply off"
            )
        note = "; ".join(filter(None, notes))
        sent, lost, fault = self._bus.sent, self._bus.lost, self._watch.fault()
        volts = self._watch.supply_v
        return LinkHealth(sent, lost, note, fault, bool(self._holding), volts)

    @property
    def not_let_go(self) -> str:
        """Servos that did not confirm their torque off at the latest `release`."""
        return ", ".join(self._labels[number] for number in self._holding)

    @property
    def may_hold(self) -> str:
        """Servos of these that may be stiff.

        Of a robot that was given no torque, only those that answer: the others may be
        without supply, or on another port.
        """
        return ", ".join(self._labels[number] for number in self._may_hold)

    @property
    def limits(self) -> tuple[Array, Array]:
        """Ends (2 n,) of what `write` sends, by the servos once connected [rad]."""
        return self._angles.limits

    def loads(self) -> Array:
        """Return motor currents (2 n,) [A] of the latest `read`, with joint signs.

        NaN where unknown: no answer, or a model that does not measure its current.
        """
        return self._loads.copy()

    def temperatures(self) -> Array:
        """Return the servos' temperatures (2 n,) [deg C]; NaN where not yet known."""
        return self._watch.temperatures

    def close(self) -> None:
        """Turn the torque off and close the port; never raises.

        A lost port is opened again for that if it is back. What did not let go is
        logged, as `health` is not asked for any more.
        """
        if self._in_use:
            self.release()
            if self._may_hold:
                said = "%s: %s NOT known to have let go: switch the supply off"
                _log.error(said, self._port, self.may_hold)
        self._bus.close()
        self._in_use = False

    def _of_those_that_may(self, holding: list[int]) -> list[int]:
        if self.engaged:
            return holding
        return [number for number in holding if self._bus.ping(number) is not None]

    def _why_silent(self) -> str:
        """Say what to look at when no servo answers, or none in time."""
        if self._bus.late_bytes > self._late_bytes:
            if not self.physical:
                return (
                    "answers come, but too late: this computer emulates the servos and "
                    "has too much else to do; end other programs"
                )
            return (
                "answers come, but too late: set the adapter's latency timer to 1 ms "
                f"and {self._make.delay_register} to 0 (`gaitchain doctor`)"
            )
        return "check the supply, the cable and the emergency stop"

    def _why_refused(self) -> str:
        """Say why no goals are sent after a silence."""
        silence = f"nothing for {self._stops_s:g} s"
        if self._make.watchdog is None:
            return f"the servos heard {silence}, too long to go on where it was"
        stopped = "the servos have stopped by themselves"
        return f"{stopped}, as they do when they hear {silence}"

    def _counts(self, answers: Mapping[int, Answer]) -> tuple[Array, Array, Array]:
        """Return currents, velocities and positions (n,) in the servos' counts."""
        counts = np.full((len(self._ids), 3), np.nan)
        for row, number in enumerate(self._ids):
            if number in answers:
                counts[row] = self._make.measured(answers[number].data)
        return counts[:, 0], counts[:, 1], counts[:, 2]

    def _check_silence(self, answered: bool) -> None:
        """Raise if the whole bus is silent for too long; then check the watchdogs."""
        now, since = time.monotonic(), self._silent_since
        quiet_s = 0.0 if since is None else now - since
        if answered:
            self._silent_since, self._silent_reads = None, 0
            self._check_watchdog(quiet_s)
            return
        if since is None:
            self._silent_since, self._late_bytes = now, self._bus.late_bytes
        self._silent_reads += 1
        if quiet_s > _SILENCE_S and self._silent_reads > _SILENT_READS:
            raise BackendError(
                f"{self._port}: no servo has answered for {quiet_s:.2f} s; "
                f"{self._why_silent()}"
            )

    def _check_watchdog(self, quiet_s: float) -> None:
        """Mark the watchdogs as tripped after too long without packets."""
        if self._watch.engaged and quiet_s > _MARGIN * self._stops_s:
            self._watch.lapsed = True
