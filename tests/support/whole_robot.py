"""A robot as its file has it, and its skeleton, in the same pose."""

import mujoco
import numpy as np

from gaitchain.sim.model import build_model


class Whole:
    """A whole robot and its skeleton in one pose; all but the legs held."""

    def __init__(self, model, found, robot, seed, ours=None):
        self.model, self.found, self.robot = model, found, robot
        self.full = full = robot.legs
        self.rng = rng = np.random.default_rng(seed)
        self.data = mujoco.MjData(model)
        for name, angle in found.stand.items():
            self.data.joint(name).qpos = angle
        self.ours = ours or build_model(robot)
        self.skeleton = mujoco.MjData(self.ours)
        angles = rng.uniform(full.lower, full.upper)
        for name, angle in zip(full.joint_names, angles, strict=True):
            self.data.joint(name).qpos = self.skeleton.joint(name).qpos = angle
        self.angles = angles
        self.dofs = [int(model.joint(n).dofadr[0]) for n in full.joint_names]
        self._set_bases()
        self.forward()

    def _set_bases(self):
        """Put the pelvis frame anywhere, and the file's base where it belongs."""
        quaternion = self.rng.normal(size=4)
        mujoco.mju_normalize4(quaternion)
        self.turn, at = np.empty((3, 3)), self.rng.uniform(-1.0, 1.0, 3)
        mujoco.mju_quat2Mat(self.turn.ravel(), quaternion)
        self.skeleton.qpos[:3], self.skeleton.qpos[3:7] = at, quaternion
        base_turn = self.turn @ self.full.base_turn.T
        free = self.model.body(self.found.base).jntadr[0]
        to = self.model.jnt_qposadr[free]
        self.base_dof = int(self.model.jnt_dofadr[free])
        self.data.qpos[to : to + 3] = at - base_turn @ self.full.base_at
        mujoco.mju_mat2Quat(self.data.qpos[to + 3 : to + 7], base_turn.ravel())

    def forward(self):
        """Without contacts: only what hangs on the joints."""
        for model, data in ((self.model, self.data), (self.ours, self.skeleton)):
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
            mujoco.mj_forward(model, data)

    @property
    def motion(self):
        """(nv, 6 + 2 n) whole robot's velocities from those of pelvis and legs."""
        result = np.zeros((self.model.nv, 6 + len(self.dofs)))
        b, at = self.base_dof, -self.turn @ self.full.base_turn.T @ self.full.base_at
        result[b : b + 3, :3] = np.eye(3)
        arm = np.array([[0, at[2], -at[1]], [-at[2], 0, at[0]], [at[1], -at[0], 0]])
        result[b : b + 3, 3:6] = arm @ self.turn
        result[b + 3 : b + 6, 3:6] = self.full.base_turn
        result[self.dofs, range(6, 6 + len(self.dofs))] = 1.0
        return result

    def masses(self):
        """Mass matrices over pelvis and legs: the whole robot's, and ours.

        Rotors that the file leaves out are derived, so they are set aside.
        """
        found = []
        for model, data in ((self.model, self.data), (self.ours, self.skeleton)):
            matrix = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, matrix)
            found.append(matrix)
        derived = np.zeros(6 + len(self.dofs))
        derived[6:] = self.full.armature - self.model.dof_armature[self.dofs]
        theirs = self.motion.T @ found[0] @ self.motion
        return theirs, found[1] - np.diag(derived)

    def soles(self):
        """(2, 4, 3) corners of both soles: as found in the file, and ours."""
        rear, front = self.robot.reduced.sole_x
        half = 0.5 * self.robot.reduced.sole_width
        flat = np.array([(x, y, 0.0) for x in (rear, front) for y in (-half, half)])
        theirs, ours = [], []
        for side, leg in zip(("left", "right"), self.found.legs, strict=True):
            foot, sole = self.data.body(leg.sole.body), leg.sole
            points = sole.origin + flat @ sole.rotation.T
            theirs.append(foot.xpos + points @ foot.xmat.reshape(3, 3).T)
            box = self.skeleton.geom(f"{side}_foot_box")
            size = self.ours.geom(f"{side}_foot_box").size
            low = np.array([(x, y, -1) for x in (-1, 1) for y in (-1, 1)]) * size
            ours.append(box.xpos + low @ box.xmat.reshape(3, 3).T)
        return np.array(theirs), np.array(ours)
