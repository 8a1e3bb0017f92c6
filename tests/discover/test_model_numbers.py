"""Numbers that MuJoCo compiles and no robot has."""

import mujoco
import numpy as np
import pytest
from robot_text import write
from toy_file import toy

from gaitchain.discover.load import load_model
from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.discover.model_numbers import check_numbers
from gaitchain.errors import RobotFileError

KNEE = '<joint name="left_knee" axis="0 1 0" range="0 2.2"'
SERVO = '<position joint="left_knee" kp="300.0" kv="6" forcerange="-60 60"'
FOOT = '<geom type="box" size="0.09 0.05 0.01"'
LINK = '<inertial mass="0.1" pos="0 0 0"'
TIE = '</actuator><equality><joint joint1="left_knee" {}/></equality>'
END = "</actuator>"


def changed(old, new, option=""):
    text = toy()
    assert old in text
    top = f"<option {option}/><default>" if option else "<default>"
    return text.replace(old, new, 1).replace("<default>", top, 1)


def refusal(folder, text):
    path = write(folder, text)
    with pytest.raises(RobotFileError) as caught:
        load_model(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and "\n" not in message
    return message.removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (KNEE, f'{KNEE} damping="{{}}"', "joint 'left_knee': damping"),
        (KNEE, f'{KNEE} armature="{{}}"', "joint 'left_knee': armature"),
        (KNEE, f'{KNEE} frictionloss="{{}}"', "joint 'left_knee': frictionloss"),
        (KNEE, f'{KNEE} stiffness="{{}}"', "joint 'left_knee': stiffness"),
        (KNEE, f'{KNEE} ref="{{}}"', "joint 'left_knee': ref"),
        (KNEE, f'{KNEE} springref="{{}}"', "joint 'left_knee': springref"),
        (KNEE, f'{KNEE} margin="{{}}"', "joint 'left_knee': margin"),
        (KNEE, f'{KNEE} solreflimit="{{}} 1"', "joint 'left_knee': solreflimit"),
        (LINK, LINK.replace('"0 0 0"', '"0 0 {}"'), "body 'left5': inertial pos"),
        (FOOT, f'{FOOT} friction="{{}}"', "a geom of body 'left6': friction"),
        (FOOT, f'{FOOT} solref="{{}} 1"', "a geom of body 'left6': solref"),
        (SERVO, SERVO.replace("300.0", "{}"), "actuator of joint 'left_knee': kp"),
        (SERVO, SERVO.replace('"6"', '"{}"'), "actuator of joint 'left_knee': kp, kv"),
        (SERVO, f'{SERVO} gear="{{}}"', "actuator of joint 'left_knee': gear"),
        (END, TIE.format('polycoef="{}"'), "equality of 'left_knee': its numbers"),
        (END, TIE.format('solref="{} 1"'), "equality of 'left_knee': solref"),
    ],
)
@pytest.mark.parametrize("bad", ["nan", "inf"])
def test_what_is_not_finite_is_named_as_the_file_calls_it(
    tmp_path, old, new, said, bad
):
    message = refusal(tmp_path, changed(old, new.format(bad)))
    assert message.startswith(said)
    assert message.removesuffix("; give a finite number").endswith(bad)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (SERVO, SERVO.replace("-60 60", "-60 {}"), "joint 'left_knee': forcerange"),
        (SERVO, f'{SERVO} ctrlrange="-1 {{}}"', "joint 'left_knee': ctrlrange"),
        (KNEE, f'{KNEE} actuatorfrcrange="-1 {{}}"', "'left_knee': actuatorfrcrange"),
    ],
)
def test_what_bounds_nothing_may_be_infinite(tmp_path, old, new, said):
    assert said in refusal(tmp_path, changed(old, new.format("nan")))
    endless = changed(old, new.replace("-1 ", "-inf ").format("inf"))
    assert load_model(write(tmp_path, endless)).model.nu == 14


@pytest.mark.parametrize("step", ["0", "-0.01", "nan", "inf"])
def test_time_goes_forward(tmp_path, step):
    message = refusal(tmp_path, changed("", "", f'timestep="{step}"'))
    assert message.startswith(f"option timestep = {step}")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            SERVO,
            SERVO.replace("300.0", "-300"),
            "actuator of joint 'left_knee': kp = -",
        ),
        (
            SERVO,
            '<general joint="left_knee" biastype="affine" biasprm="0 -9 2"',
            "actuator of joint 'left_knee': kv = -2",
        ),
        (KNEE, f'{KNEE} damping="-5"', "joint 'left_knee': damping = -5"),
    ],
)
def test_what_pushes_away_is_refused(tmp_path, old, new, said):
    message = refusal(tmp_path, changed(old, new))
    assert message.startswith(said) and message.endswith("give 0 or more")


ALL_KINDS = """
<mujoco><compiler angle="radian"><lengthrange mode="none"/></compiler><worldbody>
  <body name="a"><freejoint/><geom size="0.1"/><site name="s"/>
    <body name="b"><joint name="j" axis="0 1 0"/><geom size="0.1" pos="0 0 0.2"/>
      <site name="t"/></body></body></worldbody>
  <tendon><fixed name="f"><joint joint="j" coef="1"/></fixed></tendon>
  <equality><weld body1="a" body2="b"/><weld site1="s" site2="t"/>
    <connect site1="s" site2="t"/><joint joint1="j"/><tendon tendon1="f"/></equality>
  <actuator><motor joint="j"/><position joint="j" kp="3" dampratio="1" gear="-2"/>
    <intvelocity joint="j" kp="3" actrange="-1 1"/><velocity joint="j" kv="3"/>
    <damper joint="j" kv="1" ctrlrange="0 1"/><muscle joint="j"/><cylinder joint="j"/>
    <adhesion body="b" ctrlrange="0 1"/><position tendon="f" kp="0"/>
    <general site="s" refsite="t" gear="0 0 1 0 0 0" forcerange="-inf inf"/>
  </actuator></mujoco>"""


def test_every_kind_of_mujocos_objects_has_numbers():
    model = mujoco.MjModel.from_xml_string(ALL_KINDS)
    assert np.isinf(model.actuator_forcerange).any()
    check_numbers(model)


def test_an_actuator_that_turns_nothing_is_left_out(tmp_path):
    text = toy()
    for side in ("left", "right"):
        servo = f'<position joint="{side}_tilt"'
        text = text.replace(servo, f'{servo} gear="0"')
    loaded = load_with_findings(write(tmp_path, text))
    note = "2 actuators (left_tilt, right_tilt) left out: gear 0 turns nothing."
    assert note in loaded.notes
    assert loaded.findings.left.passive == ("left_tilt",)
    assert loaded.model.nu == 12
