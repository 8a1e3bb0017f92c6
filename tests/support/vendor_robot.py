"""A robot in its vendor's own MJCF: all its joints, actuators and shapes."""

import mujoco
import numpy as np

from gaitchain.messages import Sensors

PERIOD_S = 0.01
HINGE = mujoco.mjtJoint.mjJNT_HINGE


class VendorRobot:
    """The robot's file with a floor and an IMU added, and nothing else changed.

    Only where its actuators are no servos, or placeholders, do they get the gains that
    were derived, as one sets them in a robot's motor drivers.
    """

    def __init__(self, path, body):
        biped = body.biped
        spec = mujoco.MjSpec.from_file(str(path))
        spec.worldbody.add_geom(
            name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1]
        )
        # As a robot's driver does: gyro and accelerometer, ahead, left and up.
        base = spec.worldbody.first_body()
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, biped.anatomy.base_turn.ravel())
        imu = base.add_site(
            name="vendor_test_imu", pos=biped.anatomy.base_at, quat=quaternion
        )
        for kind in ("gyro", "accelerometer"):
            spec.add_sensor(
                name=f"vendor_test_{kind}",
                type=getattr(mujoco.mjtSensor, f"mjSENS_{kind.upper()}"),
                objtype=mujoco.mjtObj.mjOBJ_SITE,
                objname=imu.name,
            )
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        model = self.model
        hinges = [j for j in range(model.njnt) if model.jnt_type[j] == HINGE]
        self.joint_names = tuple(model.joint(j).name for j in hinges)
        self._qpos, self._qvel = model.jnt_qposadr[hinges], model.jnt_dofadr[hinges]
        # Targets by joint, controls by actuator: the orders need not be the same.
        driven = [model.joint(j).name for j in model.actuator_trnid[:, 0]]
        self._control = [self.joint_names.index(name) for name in driven]
        for actuator, name in enumerate(driven):
            servo = body.findings.servos[name]
            if servo.source.startswith("derived"):
                self._set_servo(actuator, servo)
        self._steps = round(PERIOD_S / model.opt.timestep)
        self._soles = [
            g
            for g in range(model.ngeom)
            if model.geom_bodyid[g]
            and (model.geom_contype[g] | model.geom_conaffinity[g])
        ]

    def _set_servo(self, actuator, servo):
        model = self.model
        own = model.dof_damping[model.joint(servo.joint).dofadr[0]]
        gains = servo.stiffness, 0.0, 0.0
        bias = 0.0, -servo.stiffness, -(servo.damping - own)
        model.actuator_biastype[actuator] = mujoco.mjtBias.mjBIAS_AFFINE
        model.actuator_gainprm[actuator, :3] = gains
        model.actuator_biasprm[actuator, :3] = bias
        model.actuator_ctrllimited[actuator] = False
        model.actuator_forcelimited[actuator] = True
        limit = servo.torque_limit
        model.actuator_forcerange[actuator] = -limit, limit

    def connect(self, targets):
        """Stand at the targets, the lowest shape just on the floor."""
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[self._qpos] = targets.position
        data.ctrl[:] = targets.position[self._control]
        mujoco.mj_forward(model, data)
        lowest = min(
            mujoco.mj_geomDistance(model, data, geom, model.geom("floor").id, 2.0, None)
            for geom in self._soles
        )
        data.qpos[2] -= lowest
        mujoco.mj_forward(model, data)
        self._height = float(data.qpos[2])

    def read(self):
        data = self.data
        return Sensors(
            time=float(data.time),
            joint_position=data.qpos[self._qpos],
            joint_velocity=data.qvel[self._qvel],
            angular_velocity=data.sensor("vendor_test_gyro").data.copy(),
            acceleration=data.sensor("vendor_test_accelerometer").data.copy(),
        )

    def write(self, position):
        self.data.ctrl[:] = position[self._control]
        mujoco.mj_step(self.model, self.data, nstep=self._steps)

    @property
    def fallen(self):
        return bool(self.data.qpos[2] < 0.65 * self._height)
