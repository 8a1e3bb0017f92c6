"""The control loop: requests and sensors in, joint targets and telemetry out.

One tick per control period. Nothing here waits for anything but the robot.
"""

import logging
import threading
from typing import Protocol

import numpy as np

from gaitchain.backends.base import TORQUE_UNIT
from gaitchain.errors import BackendError
from gaitchain.live.clock import Clock, Pacer
from gaitchain.live.event_log import EventLog
from gaitchain.live.guard import Bounds, Guard, Trouble
from gaitchain.live.messages import Mode, Request, Shutdown, Telemetry, TroubleKind
from gaitchain.live.modes import LIMP, ModeMachine
from gaitchain.live.safe_backend import SafeBackend
from gaitchain.live.telemetry_builder import TelemetryBuilder
from gaitchain.messages import Sensors
from gaitchain.walker.walker import Walker

_LATE_S = 0.1  # a tick that begins so late is an event; no period counts as longer
_AGAIN_S = 0.5  # a limp robot's torque is turned off again so often
_PARTING_S = 5.0  # a walk may take so long to end before the robot is let go
_NO_IMU = "no IMU is heard: a fall is not detected"
_log = logging.getLogger(__name__)


class LoopPort(Protocol):
    """Where requests come from and telemetry goes; neither call may wait."""

    def publish(self, telemetry: Telemetry) -> None:
        """Send telemetry to whoever listens."""

    def requests(self) -> list[Request]:
        """Return the requests that have come."""


class ControlLoop:
    """Drive one robot, and keep it safe."""

    def __init__(
        self,
        walker: Walker,
        backend: SafeBackend,
        port: LoopPort,
        clock: Clock,
        period_s: float,
        *,
        bounds: Bounds | None = None,
        connected: bool = False,
    ) -> None:
        """Make ready; the first `tick` takes hold of the robot.

        A simulated robot is put on its feet then, a real one stays limp. One that
        cannot be reached is tried again from time to time.

        Args:
            walker: in its library's order of joints; made for the same control period.
            backend: the robot.
            port: requests and telemetry.
            clock: the loop's.
            period_s: control period [s].
            bounds: limits of the guard.
            connected: whether the backend is connected already.
        """
        legs = walker.library.robot.legs
        self._backend, self._port = backend, port
        self._events = EventLog(clock)
        self.modes = ModeMachine(
            walker, backend, self._events, period_s, connected=connected
        )
        """The mode of the robot, and why it is in it."""
        self._builder = TelemetryBuilder(
            walker, backend, self.modes, self._events, period_s
        )
        self._has_imu = backend.has_imu  # as the guard knows it
        self._guard = Guard(legs, has_imu=self._has_imu, bounds=bounds)
        self._times_connected = self.modes.times_connected
        self._blank = _nothing(len(legs.joint_names))
        self._read = self._blank
        self._sensors: Sensors | None = None
        self._lost = self._unsent = self._muted = ""
        self._unsent_s = self._limp_s = 0.0
        self._parting_s: float | None = None  # since when
        self._last_s = self._events.time_s()
        self._pacer = Pacer(clock, period_s)

    def end(self) -> None:
        """Let `run` return as soon as the robot stands, at most 5 s from now."""
        if self._parting_s is None:
            self._parting_s = self._events.time_s()

    @property
    def ended(self) -> bool:
        """Whether nothing is left to do but to let go of the robot."""
        if self._parting_s is None:
            return False
        waited_s = self._events.time_s() - self._parting_s
        return self.modes.mode is not Mode.WALKING or waited_s > _PARTING_S

    def run(self, asked_to_end: threading.Event | None = None) -> None:
        """Tick until an end is asked for; then let the robot go, torque off.

        Args:
            asked_to_end: set by whoever wants that; `Shutdown` does as well.
        """
        try:
            while not self.ended:
                self.tick()
                if asked_to_end is not None and asked_to_end.is_set():
                    self.end()
        finally:
            self._backend.close()

    def tick(self) -> None:
        """Do one control period, when it is due."""
        late_s = self._pacer.wait()
        now_s = self._events.time_s()
        elapsed_s = min(max(now_s - self._last_s, 0.0), _LATE_S)
        self._last_s = now_s
        self.modes.reconnect(now_s)
        # Reaching a limp robot takes its time.
        if late_s > _LATE_S and self.modes.mode not in LIMP:
            self._events.add_spell("overrun", f"the loop was late by {late_s:.2f} s")
        for request in self._port.requests():
            if isinstance(request, Shutdown):
                self.end()
            self.modes.handle(request, now_s)
        if self._parting_s is not None:
            self.modes.lease.stop()
        self.modes.expire(now_s)
        trouble = self._sense(elapsed_s)
        self.modes.act(self._sensors, trouble, now_s)
        self.modes.lie(self._read)
        self._write(elapsed_s)
        self.modes.note_punches()
        self._publish()

    def _sense(self, elapsed_s: float) -> Trouble | None:
        """Read, mend what is missing, and let the guard judge it."""
        self._begin_anew()
        self._read = self._blank
        try:
            self._read = self._backend.read()
        except BackendError as error:
            self._events.add_spell("link", str(error))
            self._lost = str(error)
        else:
            self._lost = ""
        self._sensors = self._guard.mend(self._read, elapsed_s)
        limp = self.modes.mode in LIMP
        self.modes.lying = self._guard.lying(self._sensors, elapsed_s) if limp else None
        if limp:
            return None
        found = self._judge(self._sensors, elapsed_s)
        if found is not None and found.kind is TroubleKind.FALL:
            return found
        fault = self._backend.health().fault
        if fault:
            return Trouble(TroubleKind.JOINTS, fault)
        if self._unsent_s > self._guard.bounds.silent_s:
            unsent = f"targets do not reach the robot: {self._unsent}"
            return Trouble(TroubleKind.LINK, unsent)
        return found

    def _begin_anew(self) -> None:
        """Forget what was when the robot is connected, or its IMU is heard at last."""
        has_imu = self._backend.has_imu
        if self._times_connected != self.modes.times_connected:
            self._times_connected = self.modes.times_connected
            self._unsent, self._unsent_s = "", 0.0
        elif self._has_imu == has_imu:
            return
        else:
            heard = "an IMU is heard: a fall is detected from now on"
            self._events.add("sensor", heard if has_imu else _NO_IMU)
        self._has_imu = has_imu
        self._guard.reset(has_imu=has_imu)

    def _judge(self, sensors: Sensors | None, elapsed_s: float) -> Trouble | None:
        """Let the guard judge what was measured, or that nothing was."""
        if sensors is None or self.modes.mode is Mode.GETTING_UP:
            return self._guard.silence()  # a robot that lies leans, and strains
        torques = self._backend.loads()
        if self._backend.load_unit != TORQUE_UNIT:
            torques = self._blank.joint_position
        return self._guard.judge(
            sensors,
            torques,
            self.modes.target,
            elapsed_s,
            moving=self.modes.mode is Mode.WALKING,
        )

    def _write(self, elapsed_s: float) -> None:
        """Send the targets; a simulated robot's time goes on in any mode."""
        if self.modes.mode in LIMP and self._backend.physical:
            self._let_go_again(elapsed_s)
            return
        try:
            if self.modes.up.target is not None:
                self._backend.write_whole(self.modes.up.target)
            else:
                self._backend.write(self.modes.target, self.modes.motors)
        except BackendError as error:
            if str(error) != self._lost:
                self._events.add_spell("link", str(error))
            self._unsent, self._unsent_s = str(error), self._unsent_s + elapsed_s
        else:
            self._unsent, self._unsent_s = "", 0.0

    def _let_go_again(self, elapsed_s: float) -> None:
        """Turn the torque of a limp robot off again, in case it did not hear."""
        self._unsent, self._unsent_s = "", 0.0
        self._limp_s += elapsed_s
        if self._limp_s > _AGAIN_S:
            self._limp_s = 0.0
            self._backend.release()

    def _publish(self) -> None:
        sensors = self._blank if self._sensors is None else self._sensors
        unfelt = _NO_IMU if self._backend.physical and not self._has_imu else ""
        status = self.modes.status or self._lost or self._unsent or unfelt
        try:
            built = self._builder.build(sensors, status, self._pacer.pace)
            self._port.publish(built)
        except Exception as error:  # a walk does not end for want of a reader
            if str(error) != self._muted:
                _log.exception("telemetry")
            self._muted = str(error)


def _nothing(count: int) -> Sensors:
    """Return sensors that measured nothing."""
    nan = np.full(count, np.nan)
    return Sensors(np.nan, nan, nan, np.full(3, np.nan), np.full(3, np.nan))
