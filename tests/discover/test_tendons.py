"""Servos on tendons: moved to the one joint that they turn, and the physics stays."""

import re
from dataclasses import asdict

import mujoco
import numpy as np
import pytest
from toy_file import JOINTS, SIDES, toy

from gaitchain.discover.load import load_model
from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.discover.tendons import fold_tendons, pulled_over_tendons, pulling_at
from gaitchain.errors import RobotFileError

HUNG = """
<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
  <body name="thigh"><joint name="hip" axis="0 1 0" damping="0.1"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>
    <site name="in_thigh" pos="0.05 0 -0.1"/><site name="also" pos="0.05 0 -0.2"/>
    <body name="shank" pos="0 0 -0.3"><joint name="knee" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>
      <site name="in_shank" pos="0.05 0 -0.1"/></body></body>
  </worldbody><tendon>{tendons}</tendon><actuator>{actuators}</actuator></mujoco>"""
OVER_KNEE = '<fixed name="cord" {}><joint joint="knee" coef="{}"/></fixed>'
OVER_BOTH = (
    '<fixed name="cord"><joint joint="hip" coef="1"/><joint joint="knee" coef="1"/>'
    "</fixed>"
)
SPATIAL = '<spatial name="cord"><site site="{}"/><site site="in_shank"/></spatial>'
SERVO = '<position tendon="cord" kp="20" kv="0.2" {}/>'


def hung(tendons, actuators):
    text = HUNG.format(tendons=tendons, actuators=actuators)
    return mujoco.MjSpec.from_string(text)


def moved(spec, control):
    """Angles of both joints over a second."""
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = control
    angles = []
    for _ in range(500):
        mujoco.mj_step(model, data)
        angles.append(np.array(data.qpos))
    return np.array(angles)


@pytest.mark.parametrize("coef", [1.0, -2.0, 0.5])
@pytest.mark.parametrize(
    ("tendon", "servo"),
    [
        ("", 'forcerange="-3 3" ctrlrange="-1 0.2"'),
        ('actuatorfrcrange="-1 2"', 'forcerange="-3 1.5" gear="2"'),
        ('range="-0.3 0.4"', 'inheritrange="0.9"'),
    ],
)
def test_an_actuator_moved_to_its_joint_does_the_same(coef, tendon, servo):
    parts = OVER_KNEE.format(tendon, coef), SERVO.format(servo)
    folded = hung(*parts)
    (note,) = fold_tendons(folded)
    assert note.startswith("1 actuator (cord) of tendons over one joint taken")
    model = folded.compile()
    assert model.actuator_trntype[0] == mujoco.mjtTrn.mjTRN_JOINT
    assert model.actuator_trnid[0, 0] == model.joint("knee").id
    before = moved(hung(*parts), 0.8)
    assert np.abs(before[:, 1]).max() > 0.05
    np.testing.assert_allclose(moved(folded, 0.8), before, atol=1e-9)


@pytest.mark.parametrize(
    ("tendon", "actuator"),
    [
        (OVER_BOTH, SERVO.format("")),
        (SPATIAL.format("in_thigh"), SERVO.format("")),
        (OVER_KNEE.format('range="0 1"', 1), '<muscle tendon="cord" force="9"/>'),
    ],
)
def test_what_turns_no_joint_alone_stays_and_is_named(tendon, actuator):
    spec = hung(tendon, actuator)
    (note,) = fold_tendons(spec)
    assert note.startswith("1 actuator (cord) of tendons, sites or bodies not used")
    assert spec.actuators[0].trntype == mujoco.mjtTrn.mjTRN_TENDON
    assert pulling_at(spec, ["knee"]) == spec.actuators
    assert pulling_at(spec, ["elbow"]) == []


@pytest.mark.parametrize(
    ("tendons", "actuator", "turned"),
    [
        (SPATIAL.format("in_thigh"), SERVO.format(""), {"knee"}),
        (OVER_BOTH, SERVO.format(""), {"hip", "knee"}),
        (
            "",
            '<position cranksite="in_shank" slidersite="also" cranklength="0.2"/>',
            {"knee"},
        ),
        ("", '<position site="in_shank" refsite="also" gear="1 0 0 0 0 0"/>', {"knee"}),
        ("", '<motor site="in_shank" gear="1 0 0 0 0 0"/>', set()),
        ("", '<motor joint="knee"/>', set()),
    ],
)
def test_actuators_pull_at_the_joints_between_their_ends(tendons, actuator, turned):
    spec = hung(tendons, actuator)
    found = {name for name in ("hip", "knee") if pulling_at(spec, [name])}
    assert found == turned


STRAY = '<fixed name="cord"><joint joint="stray" coef="2"/>{}</fixed>'
KEPT = '<equality><tendon tendon1="cord"/></equality>'
ALSO = '<joint joint="left_knee" coef="1"/>'


@pytest.mark.parametrize(
    ("more", "servo", "equality"),
    [("", SERVO.format(""), ""), (ALSO, "", KEPT), (ALSO, SERVO.format(""), "")],
)
def test_a_tendon_over_a_joint_that_is_none_is_told(tmp_path, more, servo, equality):
    end = f"</actuator><tendon>{STRAY.format(more)}</tendon>{equality}"
    file = tmp_path / "stray.xml"
    file.write_text(toy().replace("</actuator>", servo + end), "utf-8")
    with pytest.raises(RobotFileError, match=r"MuJoCo refuses it: .*joint 'stray'"):
        load_model(file)


def test_servos_on_tendons_are_those_of_the_legs(tmp_path):
    names = [f"{side}_{joint}" for side, _ in SIDES for joint in JOINTS]
    text, cords = toy(), ""
    for name in names:
        text = text.replace(f'<position joint="{name}"', f'<position tendon="t_{name}"')
        cords += f'<fixed name="t_{name}"><joint joint="{name}" coef="1"/></fixed>'
    corded, plain = tmp_path / "corded.xml", tmp_path / "plain.xml"
    corded.write_text(text.replace("<actuator>", f"<tendon>{cords}</tendon><actuator>"))
    plain.write_text(toy())
    assert "12 actuators (t_left_yaw, " in " ".join(load_model(corded).notes)
    found, expected = load_with_findings(corded), load_with_findings(plain)
    for name, servo in expected.findings.servos.items():
        assert asdict(found.findings.servos[name]) == asdict(servo)
    assert found.robot.fingerprint == expected.robot.fingerprint


def differential(text):
    """The toy with two motors at each ankle, over tendons of both of its joints."""
    cords, motors = "", ""
    for side, _ in SIDES:
        for joint in ("ankle", "tilt"):
            text = re.sub(f'<position joint="{side}_{joint}"[^>]*/>', "", text)
        for name, sign in (("inner", 1), ("outer", -1)):
            cords += (
                f'<fixed name="{side}_{name}"><joint joint="{side}_ankle" coef="0.5"/>'
                f'<joint joint="{side}_tilt" coef="{0.5 * sign}"/></fixed>'
            )
            motors += f'<motor name="{side}_{name}" tendon="{side}_{name}"/>'
    text = text.replace("<actuator>", f"<tendon>{cords}</tendon><actuator>{motors}")
    return text


def test_motors_of_a_differential_are_named_where_a_leg_lacks_joints(tmp_path):
    file = tmp_path / "differential.xml"
    file.write_text(differential(toy()), "utf-8")
    with pytest.raises(RobotFileError, match="a leg has 4 driven joints") as caught:
        load_with_findings(file)
    for joint in ("left_ankle", "left_tilt"):
        assert (
            f"; {joint} is pulled by 2 actuators (left_inner, left_outer) over a "
            "tendon, which is not read: give it a <position> at the joint"
        ) in str(caught.value)
    assert "has no actuator" not in str(caught.value)


def test_tendons_over_sites_pull_at_the_joints_between_them():
    model = hung(SPATIAL.format("in_thigh"), SERVO.format("")).compile()
    names = {n: pulled_over_tendons(model, model.joint(n).id) for n in ("hip", "knee")}
    assert names == {"hip": [], "knee": ["cord"]}
