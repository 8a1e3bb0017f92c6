"""Small robots of every make, built part by part."""

from dataclasses import dataclass

import mujoco
import numpy as np

AXES = {"yaw": (0, 0, 1), "roll": (1, 0, 0), "pitch": (0, 1, 0)}


HIP = ("yaw", "roll", "pitch")


ANKLE = ("pitch", "roll")


GEOM = mujoco.mjtGeom


THIGH, SHANK, ANKLE_HEIGHT = 0.3, 0.28, 0.05

ROUND = {
    "spheres": (GEOM.mjGEOM_SPHERE, [0.01, 0.01, 0.01]),
    "ellipsoids": (GEOM.mjGEOM_ELLIPSOID, [0.02, 0.01, 0.01]),
    "wedge": (GEOM.mjGEOM_SPHERE, [0.01, 0.01, 0.01]),
}
"""Feet of round geoms at the corners of their soles."""


@dataclass
class Toy:
    """A robot of boxes; every field a way in which robots differ."""

    hip: tuple[str, ...] = HIP
    ankle: tuple[str, ...] = ANKLE
    foot: str = "box"
    knee_range: tuple[float, float] = (0.0, 2.3)
    forefoot: float = 0.13
    heel: float = 0.07
    turn: float = 0.0  # of the base's frame about z, against the way that it faces
    tilt: float = 0.0  # of the base's frame about y
    signs: int = 0  # bits: which joints turn the other way
    left_first: bool = True
    bent: float = 0.0  # the knee as drawn
    servo: str = "position"
    kp: float = 400.0
    arms: bool = True
    waist: bool = False
    toes: bool = False
    legs: int = 2


def quat(axis, angle):
    found = np.zeros(4)
    mujoco.mju_axisAngle2Quat(found, np.array(axis, float), angle)
    return found


class Builder:
    """Builds a toy; joint names are numbers in an order of their own."""

    def __init__(self, toy, seed=0):
        self.toy, self.rng = toy, np.random.default_rng(seed)
        self.spec = mujoco.MjSpec()
        self.spec.compiler.degree = False
        self.names = [f"n{i}" for i in self.rng.permutation(90)]
        self.driven, self.made = [], {}

    def body(self, parent, pos, mass=1.0, name=None):
        body = parent.add_body(name=name or self.names.pop(), pos=pos)
        body.mass, body.inertia = mass, np.full(3, 0.01 * mass)
        body.ipos, body.explicitinertial = [0.0, 0.0, 0.0], True
        return body

    def hinge(self, body, kind, key, limits=(-1.5, 1.5), driven=True):
        sign = -1.0 if self.toy.signs >> len(self.made) & 1 else 1.0
        low, high = sorted(sign * np.array(limits))
        joint = body.add_joint(
            name=self.names.pop(), axis=sign * np.array(AXES[kind]), range=[low, high]
        )
        joint.limited = True
        self.made[key] = (joint.name, sign)
        if driven:
            self.driven.append(joint.name)
        return joint

    def model(self):
        toy, world = self.toy, self.spec.worldbody
        world.add_geom(type=GEOM.mjGEOM_PLANE, size=[0, 0, 1], name="ground")
        turn = np.zeros(4)
        mujoco.mju_mulQuat(turn, quat((0, 0, 1), toy.turn), quat((0, 1, 0), toy.tilt))
        base = self.body(world, [0, 0, 1.0], 8.0, "base")
        base.quat = turn
        base.add_freejoint(name="free")
        back = turn * [1, -1, -1, -1]
        inner = base.add_body(name="inner", quat=back)  # welded: level as drawn
        self.box(inner, (0.08, 0.1, 0.1), (0, 0, 0.12))
        trunk = inner
        if toy.waist:
            trunk = self.body(inner, [0, 0, -0.02], 0.5)
            self.hinge(trunk, "yaw", "waist")
        order = range(toy.legs) if toy.left_first else reversed(range(toy.legs))
        for leg in order:
            self.leg(trunk, leg)
        if toy.arms:
            for side in (1.0, -1.0):
                self.arm(inner, side)
        self.servos()
        return self.spec.compile()

    def box(self, body, size, pos, **more):
        return body.add_geom(
            type=GEOM.mjGEOM_BOX, size=list(size), pos=list(pos), **more
        )

    def arm(self, parent, side):
        for i, kind in enumerate(("pitch", "roll", "pitch")):
            parent = self.body(
                parent, [0, side * 0.14, 0.2] if i == 0 else [0, 0, -0.1], 0.4
            )
            self.hinge(parent, kind, f"arm{side}{i}")
        self.box(parent, (0.02, 0.02, 0.1), (0, 0, -0.05))

    def leg(self, parent, number):
        toy, side = self.toy, 1.0 if number % 2 == 0 else -1.0
        at = [-0.4 * (number // 2), side * 0.1, 0.0]
        for i, kind in enumerate(toy.hip):
            parent = self.body(parent, at if i == 0 else [0, 0, 0], 0.6)
            self.hinge(parent, kind, (number, f"hip_{kind}"))
        parent.quat = quat((0, 1, 0), -0.5 * toy.bent)
        self.box(parent, (0.03, 0.03, 0.12), (0, 0, -0.15))
        shank = self.body(parent, [0, 0, -THIGH], 1.5)
        shank.quat = quat((0, 1, 0), toy.bent)
        low, high = np.array(toy.knee_range) - toy.bent
        self.hinge(shank, "pitch", (number, "knee"), (low, high))
        self.box(shank, (0.03, 0.03, 0.1), (0, 0, -0.14))
        foot = shank
        for i, kind in enumerate(toy.ankle):
            foot = self.body(foot, [0, 0, -SHANK] if i == 0 else [0, 0, 0], 0.4)
            self.hinge(foot, kind, (number, f"ankle_{kind}"), (-1.2, 1.2))
            if i == 0:
                foot.quat = quat((0, 1, 0), -0.5 * toy.bent)
        self.sole(foot, number)

    def sole(self, foot, number):
        toy, down = self.toy, -ANKLE_HEIGHT
        front, rear, half = toy.forefoot, -toy.heel, 0.04
        corners = [(x, y) for x in (rear, front) for y in (-half, half)]
        middle = [0.5 * (front + rear), 0.0]
        if toy.foot in ("box", "pair", "visual"):
            size, pos = (0.5 * (front - rear), half, 0.01), (*middle, down + 0.01)
            hidden = {} if toy.foot == "box" else {"contype": 0, "conaffinity": 0}
            geom = self.box(foot, size, pos, name=f"sole{number}", **hidden)
            if toy.foot == "pair":
                self.spec.add_pair(geomname1=geom.name, geomname2="ground")
        elif toy.foot in ROUND:
            kind, size = ROUND[toy.foot]
            wedge = [(rear, 0.0), *corners[2:]]  # a point behind and two ahead
            for x, y in wedge if toy.foot == "wedge" else corners:
                foot.add_geom(type=kind, size=size, pos=[x, y, down + 0.01])
        elif toy.foot == "capsules":
            for y in (-half, half):
                foot.add_geom(
                    type=GEOM.mjGEOM_CAPSULE,
                    size=[0.012, 0, 0],
                    fromto=[rear, y, down + 0.012, front, y, down + 0.012],
                )
        elif toy.foot == "cylinder":
            foot.add_geom(
                type=GEOM.mjGEOM_CYLINDER,
                size=[0.08, 0.01, 0],
                pos=[0.02, 0, down + 0.01],
            )
        elif toy.foot == "welded":
            child = foot.add_body(name=self.names.pop(), pos=[*middle, down])
            self.box(child, (0.5 * (front - rear), half, 0.01), (0, 0, 0.01))
        elif toy.foot in ("mesh", "rocker"):
            self.mesh(foot, corners, down)
        elif toy.foot == "point":
            foot.add_geom(type=GEOM.mjGEOM_SPHERE, size=[0.02, 0, 0], pos=[0, 0, down])
        elif toy.foot == "wheel":
            wheel = self.body(foot, [0, 0, down], 0.5)
            wheel.add_joint(name=self.names.pop(), axis=[0, 1, 0])
            wheel.add_geom(
                type=GEOM.mjGEOM_CYLINDER,
                size=[0.08, 0.02, 0],
                quat=quat((1, 0, 0), np.pi / 2),
            )
        if toy.toes:
            toe = self.body(foot, [front, 0, down + 0.01], 0.1)
            self.hinge(toe, "pitch", (number, "toe"), (-0.5, 0.5), driven=False)
            self.box(toe, (0.02, half, 0.01), (0.02, 0, 0))

    def mesh(self, foot, corners, down):
        low = [(x, y, down) for x, y in corners]
        if self.toy.foot == "rocker":  # a bottom that curves along the foot
            xs = np.linspace(-self.toy.heel, self.toy.forefoot, 15)
            low = [
                (x, y, down + 1.5 * (x - 0.01) ** 2) for x in xs for y in (-0.04, 0.04)
            ]
        top = [(x, 0.7 * y, down + 0.04) for x, y in corners]
        if "foot" not in [m.name for m in self.spec.meshes]:
            self.spec.add_mesh(name="foot", uservert=np.ravel(low + top))
        foot.add_geom(type=GEOM.mjGEOM_MESH, meshname="foot")

    def servos(self):
        for name in self.driven if self.toy.servo != "none" else ():
            servo = self.spec.add_actuator(name=f"a_{name}", target=name)
            servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
            if self.toy.servo == "position":
                servo.set_to_position(kp=self.toy.kp, kv=8.0)
                servo.forcelimited, servo.forcerange = True, [-90.0, 90.0]
            else:
                servo.set_to_motor()
                servo.ctrllimited, servo.ctrlrange = True, [-0.6, 0.6]
                servo.gear = [100.0, 0, 0, 0, 0, 0]


def built(toy, seed=0):
    builder = Builder(toy, seed)
    return builder.model(), builder


def tie_hip_pitches(builder, ratio):
    """Let the second of two hip pitches follow the first."""
    original = builder.servos

    def couple():
        joints = [
            j for j in builder.spec.joints if j.type == mujoco.mjtJoint.mjJNT_HINGE
        ]
        names = [j.name for j in joints]
        for number in range(2):
            second = names.index(builder.made[number, "hip_pitch"][0])
            tie = builder.spec.add_equality()
            tie.type = mujoco.mjtEq.mjEQ_JOINT
            tie.name1, tie.name2 = names[second], names[second - 1]
            tie.data[:5] = [0.0, ratio, 0.0, 0.0, 0.0]
        original()

    builder.servos = couple
