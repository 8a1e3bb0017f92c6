"""Emulated servos on a pseudo-terminal, which any program can open as a port."""

import atexit
import contextlib
import os
import select
import shutil
import tempfile
import threading
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gaitchain.backends.servos.calibration import Calibration
from gaitchain.backends.servos.emulator.bus import EmulatedBus
from gaitchain.backends.servos.emulator.imu import EmulatedImu
from gaitchain.backends.servos.make import Make, make_named
from gaitchain.backends.servos.stall_free import StallFreeClock
from gaitchain.errors import BackendError, temporary_folder
from gaitchain.messages import Array
from gaitchain.robot.leg_model import LegModel

_CHUNK = 4096
_PAUSE_S = 0.02  # a packet with a longer pause inside is discarded
_COUNTED_S = 2.0 * _PAUSE_S  # longest time between two looks that servos live through


class Kinds(NamedTuple):
    """What a make's emulation is made of."""

    servo: Callable[[int, int, float], Any]
    """Makes a servo of its id, model number and initial angle [deg]."""
    bus: type[EmulatedBus]


def _kinds(make: Make) -> Kinds:
    """Return what emulates a make, imported when asked for."""
    found: Kinds = import_module(f"gaitchain.backends.{make.name}.emulator").KINDS
    return found


class ServoBusEmulator:
    """A bus that any program can open as a serial port, until it is closed.

    It needs pseudo-terminals, as on Linux and macOS. Electrical faults, supply, heat
    and load are not modelled; motion is a first-order lag with limited speed.
    """

    def __init__(self, bus: EmulatedBus) -> None:
        """Open the pseudo-terminal and start to answer.

        Args:
            bus: the emulated devices.

        Raises:
            BackendError: this system has no pseudo-terminals.
        """
        if not hasattr(os, "openpty"):
            raise BackendError("emulated servos need Linux or macOS: pseudo-terminals")
        self.bus = bus
        """The emulated devices; faults may be set at any time."""
        devices = bus.devices.items()
        self.servos = {n: d for n, d in devices if not isinstance(d, EmulatedImu)}
        """Emulated servos by id."""
        self.delay_s = 0.0
        """Time before each answer [s]."""
        self._folder = Path(
            tempfile.mkdtemp(
                prefix="gaitchain-servos-", dir=temporary_folder(BackendError)
            )
        )
        self.port = str(self._folder / "port")
        """Path of the port to open, the same after `replug`."""
        self._master, self._slave = -1, -1
        self._wake, self._woken = -1, -1
        self._thread: threading.Thread | None = None
        self._quit = threading.Event()
        atexit.register(self.close)
        self.replug()

    @classmethod
    def like(
        cls,
        calibration: Calibration,
        position: Array | None = None,
        seed: int = 0,
        clock: Callable[[], float] | None = None,
    ) -> "ServoBusEmulator":
        """Return a bus with the servos, and the IMU, of a calibration.

        Args:
            calibration: the calibration of the servos.
            position: initial joint angles, in the calibration's order, 0 by default
                [rad].
            seed: seed of the random faults.
            clock: clock of the servos' motion and watchdogs, by default the computer's
                without what it stood still [s].
        """
        clock = clock or StallFreeClock(_COUNTED_S)
        joints = list(calibration.joints.values())
        angles = np.degrees(np.zeros(len(joints)) if position is None else position)
        make = make_named(calibration.make)
        models = {model.name: number for number, model in make.models.items()}
        kinds = _kinds(make)
        devices: list[Any] = [
            kinds.servo(
                joint.id,
                models[joint.model or make.plain_model],
                joint.offset + joint.sign * float(angle),
            )
            for joint, angle in zip(joints, angles, strict=True)
        ]
        if calibration.imu is not None:
            devices.append(EmulatedImu(calibration.imu))
        return cls(kinds.bus(devices, seed, clock))

    @classmethod
    def standing(
        cls, calibration: Calibration, legs: LegModel, seed: int = 0
    ) -> "ServoBusEmulator":
        """Return the bus of a robot that stands, as `like` does.

        Args:
            calibration: the calibration of the servos.
            legs: of the robot; a joint that they do not have is at 0.
            seed: seed of the random faults.
        """
        stand = dict(zip(legs.joint_names, legs.stand, strict=True))
        angles = np.array([stand.get(name, 0.0) for name in calibration.joints])
        return cls.like(calibration, angles, seed)

    def angle_deg(self, number: int) -> float:
        """Return the present angle of a servo [deg]."""
        with self.bus.lock:
            servo = self.servos[number]
            servo.advance(self.bus.clock())
            return float(servo.angle_deg)

    def turn(self, number: int, angle_deg: float) -> None:
        """Turn a limp servo, as by hand, to an angle [deg]."""
        with self.bus.lock:
            self.servos[number].turn(angle_deg)

    def kill(self, number: int) -> None:
        """Disconnect one device from its supply and the bus."""
        self.bus.dead.add(number)

    def revive(self, number: int) -> None:
        """Connect one device again; it restarts with its torque off."""
        with self.bus.lock:
            self.bus.devices[number].reboot()
            self.bus.dead.discard(number)

    def cut(self) -> None:
        """Cut the data line; the servos keep their supply."""
        self.bus.cut = True

    def restore(self) -> None:
        """Repair the data line."""
        self.bus.cut = False

    def unplug(self) -> None:
        """Remove the adapter: programs with the port open lose it."""
        self._quit.set()
        if self._thread is not None:
            os.write(self._woken, b".")
            self._thread.join()
            self._thread = None
        for file in (self._master, self._slave, self._wake, self._woken):
            with contextlib.suppress(OSError):
                os.close(file)
        self._master = self._slave = self._wake = self._woken = -1
        Path(self.port).unlink(missing_ok=True)

    def replug(self) -> None:
        """Plug the adapter in again, with the same name."""
        self.unplug()
        self._master, self._slave = os.openpty()
        import_module("tty").setraw(self._slave)  # Windows has no such module
        os.set_blocking(self._master, False)
        self._wake, self._woken = os.pipe()
        Path(self.port).symlink_to(os.ttyname(self._slave))
        self._quit.clear()
        self._thread = threading.Thread(
            target=self._serve, args=(self._master, self._wake), daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Close the port and stop the thread; may be called repeatedly."""
        self.unplug()
        shutil.rmtree(self._folder, ignore_errors=True)
        atexit.unregister(self.close)

    def __enter__(self) -> "ServoBusEmulator":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the port and stop the thread."""
        self.close()

    def _serve(self, master: int, wake: int) -> None:
        """Answer requests until the adapter is removed."""
        while not self._quit.is_set():
            ready, _, _ = select.select([master, wake], [], [], _PAUSE_S)
            with self.bus.lock:
                self.bus.clock()
            if not ready:
                self.bus.pause()
            if master not in ready:
                continue
            try:
                answer = self.bus.answer(os.read(master, _CHUNK))
                if answer and self.delay_s > 0.0:
                    self._quit.wait(self.delay_s)
                # Bytes that no program reads are lost, as on a cable.
                if answer:
                    os.write(master, answer)
            except BlockingIOError:
                continue
            except OSError:
                return
