"""A walker of exported C, compiled and run in this process: to compare it with Python.

No robot needs this module: there `gait.c` is compiled into the robot's own program.
"""

import ctypes
from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from gaitchain.export.c_library import CODE, export_c
from gaitchain.export.compiler import STRICT, compile_c
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import (
    CONTROL_PERIOD_S,
    Array,
    Command,
    JointTargets,
    MotorTargets,
    Sensors,
)

_SIZE = '#include "gait.h"\nunsigned long size_of_walker(void);\n' + (
    "unsigned long size_of_walker(void) { return sizeof(gait_walker); }\n"
)
_STATUS = MappingProxyType(
    {1: "sensor replaced", 2: "target clamped", 4: "targets held"}
)


class CWalker:
    """Has `command`, `step` and `reset` of a `Walker`, in C."""

    def __init__(
        self,
        library: GaitLibrary,
        folder: Path,
        period_s: float = CONTROL_PERIOD_S,
        flags: Sequence[str] = ("-O2",),
    ) -> None:
        """Write, compile and load the code.

        Args:
            library: qualified strides.
            folder: where the files go.
            period_s: control period [s].
            flags: of the compiler, beside those that make it strict.

        Raises:
            ExportError: there is no compiler, or the library cannot be exported.
        """
        for name, text in export_c(library, period_s).items():
            (folder / name).write_text(text, "utf-8")
        (folder / "size.c").write_text(_SIZE, "utf-8")
        sources, made = [folder / CODE, folder / "size.c"], folder / "gait.so"
        compile_c(sources, made, *STRICT, *flags, "-shared", "-fPIC", libraries=["-lm"])
        self.joint_names = library.robot.legs.joint_names
        self.code = _declared(ctypes.CDLL(str(made.resolve())))
        joints = ctypes.c_double * len(self.joint_names)
        self._sensors, self._targets = _messages(joints)
        self.state_bytes: int = self.code.size_of_walker()
        """Memory of one robot."""
        self._state = ctypes.create_string_buffer(self.state_bytes)
        legs = library.robot.legs
        self._gains = legs.stiffness, legs.damping - legs.joint_damping
        self.code.gait_start(self._state)

    def reset(self) -> None:
        """See `Walker.reset`."""
        self.code.gait_reset(self._state)

    def command(self, command: Command) -> Command:
        """See `Walker.command`."""
        asked = _Command(*command.motion, command.crouch)
        done = self.code.gait_set_command(self._state, ctypes.byref(asked))
        return Command(done.vx, done.vy, done.yaw_rate, done.crouch)

    def step(self, sensors: Sensors) -> JointTargets:
        """See `Walker.step`."""
        self.measure(sensors)
        self.run()
        made = self._targets
        motors = MotorTargets(
            np.array(made.reference),
            np.array(made.velocity),
            np.array(made.torque),
            *self._gains,
        )
        told = ", ".join(text for bit, text in _STATUS.items() if made.status & bit)
        return JointTargets(self.joint_names, np.array(made.position), told, motors)

    def measure(self, sensors: Sensors) -> None:
        """Take the sensors for the next `run`."""
        to = self._sensors
        to.time = sensors.time
        to.joint_position[:] = sensors.joint_position.tolist()
        to.joint_velocity[:] = sensors.joint_velocity.tolist()
        to.angular_velocity[:] = sensors.angular_velocity.tolist()
        to.acceleration[:] = sensors.acceleration.tolist()
        to.has_foot_load = sensors.foot_load is not None
        if sensors.foot_load is not None:
            to.foot_load[:] = sensors.foot_load.tolist()

    def run(self) -> None:
        """Compute one control period: the code in C alone."""
        self.code.gait_step(
            self._state, ctypes.byref(self._sensors), ctypes.byref(self._targets)
        )

    @property
    def standing(self) -> bool:
        """See `Walker.standing`."""
        return bool(self.code.gait_standing(self._state))

    @property
    def carried_out(self) -> float:
        """Part of the command that the latest step carries out."""
        return float(self.code.gait_carried_out(self._state))

    @property
    def place(self) -> Array:
        """(3,) `Walker.place`."""
        at = self.code.gait_where(self._state)
        return np.array([at.x, at.y, at.yaw])


class _Command(ctypes.Structure):
    _fields_ = tuple(
        (name, ctypes.c_double) for name in ("vx", "vy", "yaw_rate", "crouch")
    )


class _Place(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_double) for name in ("x", "y", "yaw"))


def _declared(code: Any) -> Any:
    """Return the loaded code with the types of its results."""
    code.size_of_walker.restype = ctypes.c_ulong
    code.gait_set_command.restype = _Command
    code.gait_where.restype = _Place
    code.gait_standing.restype = ctypes.c_bool
    code.gait_carried_out.restype = ctypes.c_double
    return code


def _messages(joints: Any) -> tuple[Any, Any]:
    """Return sensors and targets for a robot with so many joints."""
    axes, real = ctypes.c_double * 3, ctypes.c_double
    sensors = [
        ("time", real),
        ("joint_position", joints),
        ("joint_velocity", joints),
        ("angular_velocity", axes),
        ("acceleration", axes),
        ("has_foot_load", ctypes.c_bool),
        ("foot_load", real * 2),
    ]
    names = ("position", "reference", "velocity", "torque")
    targets = [*((name, joints) for name in names), ("status", ctypes.c_uint)]
    made = (
        type(name, (ctypes.Structure,), {"_fields_": fields})
        for name, fields in (("_Sensors", sensors), ("_Targets", targets))
    )
    one, other = made
    return one(), other()
