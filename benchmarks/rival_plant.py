"""Walk a library in the plants of reinforcement-learned rivals, by their harness.

Usage: python benchmarks/rival_plant.py EVALWALK NAME LIBRARY [--tests abcdgh]
[--out FILE] [--quick] [--makers-gains MS]. EVALWALK is the folder of that harness
(evalwalk.py, plants.py), NAME one of its plants, such as g1 or t1; LIBRARY was built
from the vendor's file of the same robot. Its leg servos get the library's gains, as one
sets them in motor drivers; torque limits, all other joints and the contacts are the
plant's. With --makers-gains the leg servos keep the plant's gains, too: what they miss
is sent as torque every 2 ms, of joints as they were measured MS before. What the tests
are, and how they are run, is in the head of evalwalk.py.
"""

import argparse
import sys
from collections import deque
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.messages import (
    CONTROL_PERIOD_S,
    Array,
    Command,
    JointTargets,
    MeasuredJoints,
    MotorGains,
    MotorTargets,
    Sensors,
)
from gaitchain.walker.walker import Walker

START_NOISE = {"q": 0.02, "v": 0.05, "tilt": 0.02}


class Plant:
    """Where the robot's joints, actuators and IMU are in a plant."""

    def __init__(self, robot: Any, imu: tuple[str, str, str], lib: GaitLibrary) -> None:
        """Find them.

        Args:
            robot: the harness's.
            imu: names of the IMU's site, gyro and accelerometer.
            lib: the library.
        """
        model, legs = robot.model, lib.robot.legs
        self.library = lib
        hinge = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        joints = np.flatnonzero(hinge)
        self.names = tuple(model.joint(j).name for j in joints)
        self.qpos, self.dofs = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        driven = model.actuator_trnid[:, 0]
        self.order = [self.names.index(model.joint(j).name) for j in driven]
        self.legs = [self.names.index(name) for name in legs.joint_names]
        self.servos = [self.order.index(joint) for joint in self.legs]
        model.actuator_ctrllimited[self.servos] = False
        site, *sensors = imu
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, model.site(site).quat)
        self.turn = np.array(legs.base_turn).T @ axes.reshape(3, 3)
        self.imu = [int(model.sensor(name).adr[0]) for name in sensors]

    def set_gains(self, model: Any) -> None:
        """Set the leg servos to the library's gains."""
        legs = self.library.robot.legs
        passive = model.dof_damping[self.dofs[self.legs]]
        rest = np.maximum(legs.damping - passive, 0.0)
        model.actuator_gainprm[self.servos, 0] = legs.stiffness
        model.actuator_biasprm[self.servos, 1] = -legs.stiffness
        model.actuator_biasprm[self.servos, 2] = -rest

    def stand(self, robot: Any) -> None:
        """Let the harness begin in the standing pose."""
        walker = self.walker()
        robot.home_qpos[self.qpos] = walker.stand
        data = mujoco.MjData(robot.model)
        data.qpos[:] = robot.home_qpos
        mujoco.mj_kinematics(robot.model, data)
        robot.home_qpos[2] -= robot.lowest_foot(data)
        robot.home_ctrl = np.asarray(walker.stand)[self.order]
        robot.__post_init__()
        robot.init_noise = START_NOISE

    def walker(self) -> Walker:
        """Return a walker of the plant's joints."""
        return Walker(self.library, joint_names=self.names)


class Controller:
    """The walker, by the harness's protocol."""

    ctrl_dt = CONTROL_PERIOD_S

    def __init__(self, plant: Plant) -> None:
        self._plant, self._walker, self._ticks = plant, plant.walker(), 0

    def reset(self, model: Any, data: Any, rng: Any) -> None:
        """Stand, without a command."""
        self._walker.reset()
        self._ticks = 0

    def command(self, vx: float, vy: float, wz: float) -> None:
        """Take a command; the library's range limits it."""
        self._walker.command(Command(float(vx), float(vy), float(wz)))

    def act(self, data: Any) -> Array:
        """Return the set-points of all actuators."""
        return np.asarray(self._step(data).position)[self._plant.order]

    def _step(self, data: Any) -> JointTargets:
        plant = self._plant
        gyro, acceleration = (
            plant.turn @ data.sensordata[adr : adr + 3] for adr in plant.imu
        )
        sensors = Sensors(
            time=self._ticks * CONTROL_PERIOD_S,
            joint_position=data.qpos[plant.qpos].copy(),
            joint_velocity=data.qvel[plant.dofs].copy(),
            angular_velocity=gyro,
            acceleration=acceleration,
        )
        self._ticks += 1
        return self._walker.step(sensors)


class FastController(Controller):
    """The walker, and every 2 ms torques for leg servos of other gains than its own.

    The plant has its makers' kd as the joints' own damping.
    """

    ctrl_dt = 0.002

    def __init__(self, plant: Plant, model: Any, late: int) -> None:
        """Take the servos' gains.

        Args:
            plant: what is walked.
            model: of it.
            late: how many periods before a torque its joints are measured.
        """
        super().__init__(plant)
        self._gains = MotorGains(
            model.actuator_gainprm[plant.servos, 0].copy(),
            model.dof_damping[plant.dofs[plant.legs]].copy(),
            plant.library.robot.legs.armature,
            self.ctrl_dt,
        )
        self._each = round(CONTROL_PERIOD_S / self.ctrl_dt)
        self._late = late

    def reset(self, model: Any, data: Any, rng: Any) -> None:
        """Stand, without a command."""
        super().reset(model, data, rng)
        self._period, self._seen = 0, deque[Any](maxlen=self._late + 1)

    def act(self, data: Any) -> Array:
        """Return the set-points of all actuators."""
        plant = self._plant
        age = self._period % self._each
        if not age:
            self._targets = self._step(data)
        self._period += 1
        legs = plant.legs
        self._seen.append(
            (data.qpos[plant.qpos[legs]].copy(), data.qvel[plant.dofs[legs]].copy())
        )
        control = np.array(self._targets.position)[plant.order]
        motors = self._targets.motors
        assert motors is not None  # a walk of strides has them
        own = MotorTargets(
            *(getattr(motors, field.name)[legs] for field in fields(MotorTargets))
        )
        measured = MeasuredJoints(*self._seen[0], age * self.ctrl_dt)
        sent = own.with_gains(self._gains, measured)
        push = sent.torque + sent.damping * sent.velocity
        control[plant.servos] = sent.position + push / sent.stiffness
        return control


def main() -> None:
    """Run the harness's tests."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("evalwalk", type=Path)
    parser.add_argument("name")
    parser.add_argument("library", type=Path)
    parser.add_argument("--tests", default="abcdgh")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--makers-gains", type=int, metavar="MS")
    asked = parser.parse_args()
    sys.path.insert(0, str(asked.evalwalk))
    evalwalk, plants = map(import_module, ("evalwalk", "plants"))
    robot = plants.load_robot(asked.name)
    plant = Plant(robot, plants.SPEC[asked.name]["imu"], load_library(asked.library))
    late_ms = asked.makers_gains
    if late_ms is None:
        plant.set_gains(robot.model)
    plant.stand(robot)

    def controller() -> Controller:
        if late_ms is None:
            return Controller(plant)
        late = round(1e-3 * late_ms / FastController.ctrl_dt)
        return FastController(plant, robot.model, late)

    evalwalk.run_all(
        robot,
        controller,
        quick=asked.quick,
        tests=asked.tests,
        out=None if asked.out is None else str(asked.out),
    )


if __name__ == "__main__":
    main()
