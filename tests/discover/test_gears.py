"""Motors behind gears: the actuator moves to the joint, and the physics stays."""

import mujoco
import numpy as np
import pytest
from toy_robot import Builder, Toy

from gaitchain.discover.find import find
from gaitchain.discover.gears import fold_gears
from gaitchain.discover.load import load_model
from gaitchain.discover.notes import Doubt
from gaitchain.discover.ranges import joint_range

TIE = '<joint joint1="{0}" joint2="{1}" polycoef="{2} {3} {4} 0 0" solref="0.004 1"/>'
GEARED = """
<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
  <body name="pelvis"><freejoint/><geom size="0.1" mass="5"/>
    <body name="rotor" pos="0 0.1 0">
      <joint name="motor" axis="0 0 1" armature="0.002" damping="0.05"
        frictionloss="0.01"/>
      <geom size="0.01" mass="0.02"/>{child}</body>
    <body name="thigh" pos="0 0 -0.1"><joint name="yaw" axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 0.1 0 -0.2" size="0.02" mass="0.5"/></body>
  </body></worldbody>
  <tendon><fixed name="belt"><joint joint="yaw" coef="2"/><joint joint="motor"
    coef="1"/></fixed><fixed name="cord"><joint joint="yaw" coef="3"/></fixed>
    <fixed name="reel"><joint joint="motor" coef="2"/></fixed></tendon>
  <equality>{tie}</equality>
  <actuator><position joint="motor" kp="2" kv="0.1" forcerange="-1 1"/>{more}
  </actuator></mujoco>"""
BELT = '<tendon tendon1="belt" solref="0.004 1"/>'
TWO_CORDS = (
    '<tendon tendon1="cord" tendon2="reel" polycoef="0 -0.75" solref="0.004 1"/>'
)
PULLEY = '<body pos="0 0 0.02"><geom size="0.01" mass="0.01"/></body>'
CHILD = '<body><joint axis="0 1 0"/><geom size="0.01" pos="0.05 0 0"/></body>'


def geared(tie, child="", more=""):
    text = GEARED.format(tie=tie, child=child, more=more)
    return mujoco.MjSpec.from_string(text)


def turned(spec, wanted):
    """Angles of the joint over a second, the motor's set-point in its own angle."""
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[0] = wanted
    angles = []
    for _ in range(500):
        mujoco.mj_step(model, data)
        angles.append(float(data.joint("yaw").qpos[0]))
    return np.array(angles)


@pytest.mark.parametrize(
    ("tie", "ratio"),
    [
        (TIE.format("yaw", "motor", 0, -0.5, 0), -0.5),
        (TIE.format("yaw", "motor", 0, 2, 0), 2.0),
        (TIE.format("motor", "yaw", 0, 3, 0), 1.0 / 3.0),
        (BELT, -0.5),
        (TWO_CORDS, -0.5),
    ],
)
@pytest.mark.parametrize("child", ["", PULLEY], ids=["", "pulley"])
def test_a_folded_gear_moves_as_the_gear_does(tie, ratio, child):
    folded = geared(tie, child)
    (note,) = fold_gears(folded)
    assert note.startswith(f"yaw is turned by motor through a gear of {ratio:.4g}")
    before, after = turned(geared(tie, child), 0.6), turned(folded, 0.6)
    assert before[-1] == pytest.approx(0.6 * ratio, abs=0.02)
    assert after == pytest.approx(before, abs=5e-3)


def test_the_motors_limits_become_the_joints():
    spec = geared(TIE.format("yaw", "motor", 0.1, -0.5, 0))
    motor = spec.joint("motor")
    motor.range, motor.actfrcrange = [-1.0, 2.0], [-0.2, 0.3]
    spec.joint("yaw").range, spec.joint("yaw").actfrcrange = [-2.0, 0.5], [-0.5, 9.0]
    fold_gears(spec)
    model = spec.compile()
    yaw = model.joint("yaw")
    np.testing.assert_allclose(yaw.range, [-0.9, 0.5])
    np.testing.assert_allclose(model.jnt_actfrcrange[yaw.id], [-0.5, 0.4])
    assert model.jnt_limited[yaw.id]


def ends_of(spec):
    """Where MuJoCo lets the joint go, its motor told to go as far as it can."""
    model = spec.compile()
    model.jnt_solref[:] = 0.004, 1.0
    angles = []
    for control in (-99.0, 99.0):
        data = mujoco.MjData(model)
        data.ctrl[0] = control
        for _ in range(4000):
            mujoco.mj_step(model, data)
        angles.append(float(data.joint("yaw").qpos[0]))
    return sorted(angles)


def limit_the_yaw(spec):
    spec.joint("yaw").range = [-0.3, 0.2]


def free_the_motor(spec):
    spec.joint("motor").limited = False


def free_the_yaw(spec):
    spec.joint("yaw").range, spec.joint("yaw").limited = [-0.1, 0.1], False


def tell_less(spec):
    spec.actuators[0].ctrlrange = [-0.4, 0.3]


def inherit(spec):
    spec.actuators[0].inheritrange = 0.8


def gear_up(spec):
    spec.actuators[0].gear, spec.actuators[0].ctrlrange = [2, *[0] * 5], [-0.4, 0.9]


def turn_shares(spec):
    servo = spec.actuators[0]
    servo.gainprm[0], servo.biasprm[0], servo.ctrlrange = 4.0, 0.2, [-0.2, 0.3]


@pytest.mark.parametrize("ratio", [-0.5, 2.0])
@pytest.mark.parametrize("offset", [0.0, 0.2])
@pytest.mark.parametrize(
    "change",
    [
        None,
        limit_the_yaw,
        free_the_motor,
        free_the_yaw,
        tell_less,
        inherit,
        gear_up,
        turn_shares,
    ],
)
def test_a_folded_joint_goes_as_far_as_its_motor_turns_it(ratio, offset, change):
    """Against MuJoCo, which moves the gear as the file has it."""
    specs = [geared(TIE.format("yaw", "motor", offset, ratio, 0)) for _ in range(2)]
    for spec in specs:
        motor, yaw = spec.joint("motor"), spec.joint("yaw")
        motor.range, motor.ref, yaw.ref = [-0.9, 0.6], -0.3 * offset, 0.5 * offset
        spec.actuators[0].ctrlrange = [0, 0] if change is inherit else [-1.3, 1.3]
        if change:
            change(spec)
    fold_gears(specs[1])
    model = specs[1].compile()
    found, ends = joint_range(model, model.joint("yaw").id), ends_of(specs[0])
    np.testing.assert_allclose(found, ends, atol=0.02)


@pytest.mark.parametrize("change", [None, gear_up, turn_shares, inherit])
def test_a_control_means_the_same_where_joints_have_offsets(change):
    specs = [geared(TIE.format("yaw", "motor", 0.2, -0.5, 0)) for _ in range(2)]
    for spec in specs:
        motor, yaw = spec.joint("motor"), spec.joint("yaw")
        motor.ref, yaw.ref, motor.range = 0.4, 0.3, [-1.5, 1.5]
        if change:
            change(spec)
    fold_gears(specs[1])
    ends = [turned(spec, control)[-1] for spec in specs for control in (0.25, -0.2)]
    assert abs(ends[0] - ends[1]) > 0.05
    assert ends[2:] == pytest.approx(ends[:2], abs=5e-3)


def test_angles_count_from_where_the_joints_are_drawn():
    """An equality ties what joints moved from their `ref`, limits are absolute."""
    spec = geared(TIE.format("yaw", "motor", 0.1, -0.5, 0))
    motor, yaw = spec.joint("motor"), spec.joint("yaw")
    motor.ref, yaw.ref, motor.range = 0.4, 0.3, [-1.0, 2.0]
    (note,) = fold_gears(spec)
    assert "(target - 0.6) / -0.5" in note
    model = spec.compile()
    np.testing.assert_allclose(model.joint("yaw").range, [-0.4, 1.1])
    data = mujoco.MjData(model)
    data.joint("yaw").qpos[0], data.joint("motor").qpos[0] = 0.6 - 0.5 * 1.2, 1.2
    mujoco.mj_forward(model, data)
    assert data.efc_pos[0] == pytest.approx(0.0, abs=1e-9)


def test_one_motor_drives_one_joint():
    """A second joint that is tied to the same motor follows the first."""
    spec = geared(TIE.format("yaw", "motor", 0, -0.5, 0))
    other = spec.body("pelvis").add_body(name="other")
    other.add_geom(size=[0.02, 0, 0], mass=0.1)
    other.add_joint(name="second", axis=[0, 0, 1])
    tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT)
    tie.name1, tie.name2, tie.data[:5] = "second", "motor", [0, 2, 0, 0, 0]
    assert len(fold_gears(spec)) == 1
    model = spec.compile()
    assert [a.target for a in spec.actuators] == ["yaw"]
    assert model.joint("second").damping[0] == 0.0


def test_an_offset_is_said():
    tied = geared(TIE.format("yaw", "motor", 0.1, -0.5, 0))
    (note,) = fold_gears(tied)
    assert "the motor's are (target - 0.1) / -0.5" in note
    model = tied.compile()
    data = mujoco.MjData(model)
    data.joint("yaw").qpos[0] = 0.3
    mujoco.mj_forward(model, data)
    data.joint("motor").qpos[0] = (0.3 - 0.1) / -0.5
    mujoco.mj_forward(model, data)
    assert data.efc_pos[0] == pytest.approx(0.0, abs=1e-9), "the tie is kept"


@pytest.mark.parametrize(
    "spec",
    [
        geared(TIE.format("yaw", "motor", 0, 1, 0), child=CHILD),
        geared(
            TIE.format("yaw", "motor", 0, 1, 0), more='<motor joint="yaw" gear="1"/>'
        ),
        geared('<joint joint1="motor" polycoef="0 1 0 0 0"/>'),
        geared(TIE.format("yaw", "motor", 0, "inf", 0)),
    ],
    ids=["the motor carries more", "driven at both ends", "held", "infinite"],
)
def test_what_is_no_gear_stays(spec):
    before = spec.to_xml()
    assert fold_gears(spec) == []
    assert spec.to_xml() == before


def test_a_cam_stays_and_is_doubted():
    cam = geared(TIE.format("yaw", "motor", 0, -0.5, 0.2))
    before = cam.to_xml()
    (doubt,) = fold_gears(cam)
    assert isinstance(doubt, Doubt)
    assert doubt.startswith("yaw is coupled to motor by a curve, which is no gear, and")
    assert cam.to_xml() == before


def test_the_offset_of_a_belt_is_in_the_joints_own_angle():
    """Against MuJoCo, which has both joints count from where they are drawn."""
    tied = geared(BELT.replace("/>", ' polycoef="0.2"/>'))
    tied.joint("motor").ref, tied.joint("yaw").ref = 0.4, 0.3
    data = mujoco.MjData(tied.compile())
    data.joint("yaw").qpos[0] = 0.3 + 0.1 - 0.5 * 0.7
    data.joint("motor").qpos[0] = 0.4 + 0.7
    mujoco.mj_forward(data.model, data)
    assert data.efc_pos[0] == pytest.approx(0.0, abs=1e-9)
    fold_gears(tied)
    again = mujoco.MjData(tied.compile())
    again.qpos[:] = data.qpos
    mujoco.mj_forward(again.model, again)
    assert again.model.eq_type.tolist() == [int(mujoco.mjtEq.mjEQ_JOINT)]
    assert again.efc_pos[0] == pytest.approx(0.0, abs=1e-9)


def gear_the_yaws(builder, ratio, curve=0.0):
    """Turn a toy's hips by motors beside them."""
    spec, servos = builder.spec, builder.servos

    def gear():
        for side in (0, 1):
            name, _ = builder.made[side, "hip_yaw"]
            builder.driven.remove(name)
            hip = spec.joint(name).parent.parent
            rotor = builder.body(hip, [0, 0, 0.1], mass=0.02)
            motor = builder.hinge(rotor, "yaw", ("motor", side), (-3.0, 3.0))
            tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT)
            tie.name1, tie.name2 = name, motor.name
            tie.data[:5] = [0.0, ratio, curve, 0.0, 0.0]
        servos()

    builder.servos = gear


def test_a_leg_turns_by_its_geared_hip(tmp_path):
    builder = Builder(Toy())
    gear_the_yaws(builder, -0.5)
    builder.model()
    path = tmp_path / "geared.xml"
    path.write_text(builder.spec.to_xml(), "utf-8")
    loaded = load_model(path)
    assert sum(note.count("through a gear of -0.5") for note in loaded.notes) == 2
    found = find(loaded.spec.compile(), "geared")
    plain = find(Builder(Toy()).model(), "plain")
    for side, leg in enumerate((found.left, found.right)):
        yaw = builder.made[side, "hip_yaw"][0]
        assert yaw in leg.joints
        assert builder.made["motor", side][0] not in leg.joints
        assert not leg.passive
    yaw = builder.made[0, "hip_yaw"][0]
    assert found.servos[yaw].source == "actuator"
    other = plain.servos[yaw]
    assert found.servos[yaw].stiffness == pytest.approx(other.stiffness / 0.25)


def test_a_hip_that_a_cam_turns_is_held_and_said():
    builder = Builder(Toy())
    gear_the_yaws(builder, -0.5, curve=0.02)
    found = find(builder.model(), "toy")
    yaws = [builder.made[side, "hip_yaw"][0] for side in (0, 1)]
    motors = [builder.made["motor", side][0] for side in (0, 1)]
    assert [leg.passive for leg in found.legs] == [(yaw,) for yaw in yaws]
    (row,) = (row for row in found.evidence if row[0] == "turning")
    assert row[1] == "it will not turn"
    for yaw, motor in zip(yaws, motors, strict=True):
        assert f"{yaw} follows {motor} by an equality" in row[2]
    whole = find(Builder(Toy()).model(), "toy")
    assert "turning" not in [row[0] for row in whole.evidence]
