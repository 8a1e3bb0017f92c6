"""Humanoids that nobody tuned, made at random, and what a build makes of them.

    python benchmarks/made_robots.py FOLDER [--robots 20] [--seed 1] [--only make]
        [--ankle-yaw]

Writes FOLDER/robot_N.xml: legs of 0.15 to 1 m with 5 to 7 joints each (5: no ankle
roll; 7: toes, which a build holds; with --ankle-yaw seven that walk), wide and narrow
soles and hips, heavy and light legs, soft and stiff servos; in some the hips turn
through a gear, or two cranks move the ankle. Each is then built without options; the
table says for each what was made of it, the speed or the reason. Libraries are kept, so
that an interrupted run goes on.
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.gait.library_file import load_library

_GRAVITY = 9.81
_DENSE = 110.0  # kg of a robot whose legs are 1 m long, before the draw
_TOE = 0.25  # of the sole
_GEAR = 3.0  # turns of a hip's motor for one of its yaw
# Of a linked ankle, parts of the leg: the cranks' arms, where the rods end behind the
# ankle and beside it, and the cranks above it.
_ARM, _BACK, _ASIDE, _ABOVE = 0.05, 0.07, 0.05, 0.2
_ROD = (0.004, 1.0)  # time constant and damping of its end


class Draw(NamedTuple):
    """The numbers of a robot; lengths are parts of the leg, if nothing else is said."""

    leg_m: float
    joints: int
    thigh: float
    hips: float
    """Distance of the hips."""
    sole: float
    sole_width: float
    heel: float
    """Part of the sole behind the ankle."""
    ankle: float
    """Height of the ankle."""
    mass: float
    """Over that of a usual robot of that size."""
    legs_mass: float
    """Both legs, part of the robot."""
    trunk: float
    stiffness: float
    """Of the servos, over m g leg."""
    torque: float
    """Limit of hip and knee, over m g leg; the other joints have half of it."""
    ankle_deg: float
    """Range of the ankle's pitch, either way."""
    drive: str
    """Where motors sit: "joints", "gear" for a hip yaw behind one, or "cranks"."""
    ankle_yaw: bool = False
    """Whether the ankle has a third axis; of those not drawn."""


def draw(seed: int, number: int) -> Draw:
    """Draw a robot."""
    rng = np.random.default_rng((seed, number))

    def between(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    return Draw(
        leg_m=float(np.exp(rng.uniform(np.log(0.15), 0.0))),
        joints=int(rng.choice([5, 6, 6, 6, 7])),
        thigh=between(0.42, 0.56),
        hips=between(0.22, 0.6),
        sole=between(0.28, 0.5),
        sole_width=between(0.1, 0.26),
        heel=between(0.25, 0.42),
        ankle=between(0.06, 0.14),
        mass=float(np.exp(rng.uniform(np.log(0.6), np.log(1.5)))),
        legs_mass=between(0.25, 0.6),
        trunk=between(0.4, 0.8),
        stiffness=float(np.exp(rng.uniform(np.log(1.0), np.log(15.0)))),
        torque=between(0.4, 1.2),
        ankle_deg=between(35.0, 75.0),
        drive=str(rng.choice(["joints", "joints", "joints", "gear", "cranks"])),
    )


def robot_spec(drawn: Draw, name: str) -> mujoco.MjSpec:
    """Make the robot's model."""
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    leg, mass = drawn.leg_m, drawn.mass * _DENSE * drawn.leg_m**2.5
    trunk_mass = 0.85 * (1.0 - drawn.legs_mass) * mass
    width = drawn.hips * leg
    trunk = spec.worldbody.add_body(name="trunk", pos=[0, 0, 1.2 * leg])
    trunk.add_freejoint()
    half = [0.12 * leg, 0.5 * width + 0.06 * leg, 0.5 * drawn.trunk * leg]
    trunk.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=[0, 0, half[2]], mass=trunk_mass
    )
    arms_mass = (1.0 - drawn.legs_mass) * mass - trunk_mass
    for side, sign in (("left", 1.0), ("right", -1.0)):
        _add_leg(spec, trunk, drawn, side, sign, mass)
        _add_arm(spec, trunk, side, sign * (half[1] + 0.06 * leg), drawn, arms_mass)
    return spec


def _add_leg(spec, trunk, drawn: Draw, side: str, sign: float, mass: float) -> None:
    leg, own = drawn.leg_m, 0.5 * drawn.legs_mass * mass
    weight = mass * _GRAVITY * leg
    thigh_m, foot_up = drawn.thigh * leg, drawn.ankle * leg
    bend = np.radians(drawn.ankle_deg)
    chain = [
        ("yaw", (0, 0, 1), (-0.8, 0.8), 0.0, 0.06, 0.5),
        ("roll", (1, 0, 0), (-0.6, 0.6), 0.0, 0.06, 0.5),
        ("pitch", (0, 1, 0), (-2.0, 0.9), 0.0, 0.45, 1.0),
        ("knee", (0, 1, 0), (0.0, 2.3), thigh_m, 0.28, 1.0),
        ("ankle", (0, 1, 0), (-bend, bend), leg - thigh_m, 0.05, 0.5),
        ("tilt", (1, 0, 0), (-0.5, 0.5), 0.0, 0.1, 0.5),
    ]
    if drawn.joints == 5:
        *upper, ankle, tilt = chain
        chain = [*upper, (*ankle[:4], ankle[4] + tilt[4], ankle[5])]
    if drawn.ankle_yaw:
        *upper, tilt = chain
        light = 0.5 * tilt[4]
        twist = "twist", (0, 0, 1), (-0.8, 0.8), 0.0, light, 0.5
        chain = [*upper, (*tilt[:4], light, tilt[5]), twist]
    body = shank = trunk
    linked = drawn.drive == "cranks" and drawn.joints > 5
    for i, (joint, axis, span, below, part, strength) in enumerate(chain):
        at = [0.0, sign * 0.5 * drawn.hips * leg, 0.0] if i == 0 else [0, 0, -below]
        body = body.add_body(name=f"{side}_{joint}_link", pos=at)
        length = {"pitch": thigh_m, "knee": leg - thigh_m}.get(joint, 0.0)
        _give_mass(body, part * own, length, leg)
        torque = strength * drawn.torque * weight
        hinge = Hinge(f"{side}_{joint}", axis, span, weight, torque)
        if joint == "yaw" and drawn.drive == "gear":
            _add_geared(spec, trunk, body, hinge, drawn)
        elif linked and joint in ("ankle", "tilt"):
            _add_hinge(body, hinge, drawn)
        else:
            _add_joint(spec, body, hinge, drawn)
        shank = body if joint == "knee" else shank
    if linked:
        strength = Hinge(
            side, (0, 1, 0), (-1.2, 1.2), weight, 0.5 * drawn.torque * weight
        )
        _add_cranks(spec, shank, body, strength, drawn)
    _add_sole(spec, body, drawn, side, foot_up, weight)


def _give_mass(body, mass: float, length: float, leg: float) -> None:
    radius = 0.06 * leg
    body.explicitinertial = True
    body.mass, body.ipos = mass, [0, 0, -0.45 * length]
    across = mass * (0.5 * radius**2 + length**2 / 12.0)
    body.inertia = [across, across, mass * radius**2]


class Hinge(NamedTuple):
    """A joint and its servo."""

    name: str
    axis: tuple[int, int, int]
    span: tuple[float, float]
    weight: float
    """m g leg of what it moves [N m]."""
    torque: float
    """Limit [N m]."""


def _add_hinge(body, hinge: Hinge, drawn: Draw, ratio: float = 1.0) -> None:
    """Add a joint; a motor that turns `ratio` times as far has so much less inertia."""
    body.add_joint(
        name=hinge.name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=hinge.axis,
        range=hinge.span,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        armature=0.004 * hinge.weight * drawn.leg_m / _GRAVITY / ratio**2,
    )


def _add_joint(spec, body, hinge: Hinge, drawn: Draw, ratio: float = 1.0) -> None:
    """Add a joint and its servo, see `_add_hinge`."""
    _add_hinge(body, hinge, drawn, ratio)
    stiffness = drawn.stiffness * hinge.weight / ratio**2
    inertia = hinge.weight * drawn.leg_m / ratio**2
    torque = hinge.torque / ratio
    servo = spec.add_actuator(
        name=hinge.name,
        target=hinge.name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        forcerange=[-torque, torque],
        forcelimited=True,
    )
    # Critically damped for an eighth of the robot at half the leg's length.
    damping = 2.0 * np.sqrt(stiffness * inertia / _GRAVITY / 32.0)
    servo.set_to_position(kp=stiffness, kv=damping)


def _add_geared(spec, trunk, body, hinge: Hinge, drawn: Draw) -> None:
    """Add a joint without a motor, and a motor on the trunk that turns it."""
    _add_hinge(body, hinge, drawn)
    name = f"{hinge.name}_motor"
    motor = trunk.add_body(name=name, pos=[0.0, 0.0, 0.1 * drawn.leg_m])
    _give_mass(motor, 1e-3 * hinge.weight / _GRAVITY / drawn.leg_m, 0.0, drawn.leg_m)
    low, high = hinge.span
    shaft = hinge._replace(name=name, span=(_GEAR * low, _GEAR * high))
    _add_joint(spec, motor, shaft, drawn, _GEAR)
    tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT)
    tie.name1, tie.name2 = hinge.name, name
    tie.data[:2] = [0.0, 1.0 / _GEAR]


def _add_cranks(spec, shank, foot, hinge: Hinge, drawn: Draw) -> None:
    """Add two cranks to the shank, with rods to the foot; both move the ankle."""
    leg = drawn.leg_m
    long = leg - drawn.thigh * leg
    small = 1e-3 * hinge.weight / _GRAVITY / leg
    for side in (1.0, -1.0):
        name = f"{hinge.name}_crank_{'left' if side > 0.0 else 'right'}"
        top = np.array([0.0, side * _ASIDE * leg, _ABOVE * leg - long])
        crank = shank.add_body(name=name, pos=top)
        _give_mass(crank, small, 0.0, leg)
        # Both together are as strong and as stiff as a servo at the ankle's pitch.
        half = hinge._replace(name=name, torque=0.5 * hinge.torque)
        _add_joint(spec, crank, half, drawn, _BACK / _ARM)
        servo = spec.actuator(name)
        servo.gainprm[0] *= 0.5
        servo.biasprm[1:3] = 0.5 * np.array(servo.biasprm[1:3])
        rod = crank.add_body(name=f"{name}_rod", pos=[-_ARM * leg, 0.0, 0.0])
        _give_mass(rod, small, 0.0, leg)
        rod.add_joint(name=f"{name}_ball", type=mujoco.mjtJoint.mjJNT_BALL)
        end = np.array([-_BACK * leg, side * _ASIDE * leg, -long])
        tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT)
        tie.objtype = mujoco.mjtObj.mjOBJ_BODY
        tie.name1, tie.name2 = rod.name, foot.name
        tie.data[:3] = end - top - [-_ARM * leg, 0.0, 0.0]
        tie.solref = _ROD


def _add_sole(spec, foot, drawn: Draw, side: str, up: float, weight: float) -> None:
    long, half_width = drawn.sole * drawn.leg_m, 0.5 * drawn.sole_width * drawn.leg_m
    toe = _TOE * long if drawn.joints == 7 else 0.0
    rear, front = -drawn.heel * long, (1.0 - drawn.heel) * long - toe
    thick = 0.15 * up

    def plate(body, start: float, end: float) -> None:
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.5 * (end - start), half_width, thick],
            pos=[0.5 * (start + end), 0.0, 0.0 if body is not foot else thick - up],
            mass=0.0,
        )

    plate(foot, rear, front)
    if toe:
        body = foot.add_body(name=f"{side}_toes", pos=[front, 0.0, thick - up])
        _give_mass(body, 1e-3 * weight / _GRAVITY / drawn.leg_m, 0.0, drawn.leg_m)
        plate(body, 0.0, toe)
        hinge = Hinge(f"{side}_toe", (0, 1, 0), (-0.8, 0.8), 0.1 * weight, weight)
        _add_joint(spec, body, hinge, drawn)


def _add_arm(spec, trunk, side: str, y: float, drawn: Draw, mass: float) -> None:
    leg = drawn.leg_m
    arm = trunk.add_body(name=f"{side}_arm", pos=[0, y, 0.85 * drawn.trunk * leg])
    arm.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0, 0, 0, 0, 0, -0.6 * leg],
        size=[0.04 * leg, 0, 0],
        mass=0.5 * mass,
    )
    weight = mass * _GRAVITY * leg
    hinge = Hinge(f"{side}_shoulder", (0, 1, 0), (-2.5, 2.5), weight, 2.0 * weight)
    _add_joint(spec, arm, hinge, drawn)


def build(path: Path) -> str:
    """Build a library, and return what came of it."""
    library = path.with_suffix(".gait")
    log = path.with_suffix(".log")
    if not library.exists():
        command = [sys.executable, "-m", "gaitchain", "build", str(path)]
        began = time.monotonic()
        with log.open("w") as file:
            subprocess.run(
                [*command, "-o", str(library)], stderr=file, stdout=file, check=False
            )
        took = f"{time.monotonic() - began:.0f} s"
    else:
        took = "kept"
    if not library.exists():
        said = [line for line in log.read_text().splitlines() if "gaitchain:" in line]
        return said[-1] if said else "no library, see its log"
    made = load_library(library)
    ends = made.command_range.ends
    verdict = "qualified" if made.qualified else "NOT QUALIFIED"
    part = ends[0][1] / np.sqrt(_GRAVITY * made.robot.reduced.leg_length)
    return (
        f"{verdict}, {ends[0][1]:.2f} m/s ({part:.2f} sqrt(g l)), aside "
        f"{ends[1][1]:.2f} m/s, around {ends[2][1]:.2f} rad/s, {took}"
    )


def main() -> None:
    """Make the robots, and build them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=["make"])
    parser.add_argument("--ankle-yaw", action="store_true")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    for number in range(asked.robots):
        drawn = draw(asked.seed, number)
        if asked.ankle_yaw:
            drawn = drawn._replace(joints=6, drive="joints", ankle_yaw=True)
        path = asked.folder / f"robot_{number}.xml"
        spec = robot_spec(drawn, f"made {asked.seed}.{number}")
        spec.compile()
        path.write_text(spec.to_xml(), "utf-8")
        numbers = ", ".join(
            f"{k} {v if isinstance(v, str) else f'{v:.3g}'}"
            for k, v in drawn._asdict().items()
        )
        print(f"{path.name}: {numbers}", flush=True)
        if asked.only is None:
            print(f"  {build(path)}", flush=True)


if __name__ == "__main__":
    main()
