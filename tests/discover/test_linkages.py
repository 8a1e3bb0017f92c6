"""Motors behind linkages: their gains are seen at the joints, and the physics stays."""

import mujoco
import numpy as np
import pytest
from toy_robot import SHANK, Builder, Toy

from gaitchain.discover.find import find
from gaitchain.discover.gears import driven_by
from gaitchain.discover.linkages import fold_linkages
from gaitchain.discover.load import load_model
from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.discover.servos import sum_actuators
from gaitchain.errors import RobotFileError

LIMITED = mujoco.mjtLimited
ARM, BACK, UP, ASIDE = 0.03, 0.05, 0.12, 0.03
KP, KV = 150.0, 4.0


class Linked(Builder):
    """Ankles turned by cranks on the shank: one for pitch, or two for both."""

    def __init__(self, toy, sites=False, slide=False):
        super().__init__(toy)
        self.sites, self.slide = sites, slide

    def leg(self, parent, number):
        super().leg(parent, number)
        both = len(self.toy.ankle) == 2
        names = [self.made[number, f"ankle_{kind}"][0] for kind in self.toy.ankle]
        foot = self.spec.joint(names[-1]).parent
        shank = self.spec.joint(self.made[number, "knee"][0]).parent
        for name in names:
            self.driven.remove(name)
        for side in (1.0, -1.0) if both else (0.0,):
            self.crank(number, shank, foot, side)

    def crank(self, number, shank, foot, side):
        top = [0.0 if not self.slide else -BACK, side * ASIDE, UP - SHANK]
        crank = self.body(shank, top, 0.02)
        key = (number, "crank", side)
        if self.slide:
            joint = crank.add_joint(
                name=self.names.pop(),
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=[0, 0, 1],
                range=[-0.05, 0.05],
            )
            self.made[key] = (joint.name, 1.0)
            self.driven.append(joint.name)
            arm = 0.0
        else:
            joint, arm = self.hinge(crank, "pitch", key), ARM
        joint.armature = 0.001 if not self.slide else 1.0
        rod = self.body(crank, [-arm, 0, 0], 0.01)
        rod.add_joint(name=self.names.pop(), type=mujoco.mjtJoint.mjJNT_BALL)
        down = np.array([-BACK, side * ASIDE, 0.0]) - top - [-arm, 0.0, SHANK]
        tie = self.spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT)
        tie.solref, tie.solimp[:2] = [0.004, 1.0], [0.9999, 0.9999]
        if self.sites:
            rod.add_site(name=f"rod{number}{side}", pos=down)
            at = [-BACK, side * ASIDE, 0.0]
            foot.add_site(name=f"foot{number}{side}", pos=at)
            tie.objtype = mujoco.mjtObj.mjOBJ_SITE
            tie.name1, tie.name2 = f"rod{number}{side}", f"foot{number}{side}"
        else:
            tie.objtype = mujoco.mjtObj.mjOBJ_BODY
            tie.name1, tie.name2 = rod.name, foot.name
            tie.data[:3] = down

    def servos(self):
        super().servos()
        for name in self.cranks(0) + self.cranks(1):
            (servo,) = (a for a in self.spec.actuators if a.target == name)
            scale = 1.0 / BACK**2 if self.slide else 1.0
            servo.gainprm[0], servo.biasprm[1:3] = KP * scale, [-KP * scale, -KV]
            servo.forcerange, servo.forcelimited = [-40.0 * scale, 40.0 * scale], True

    def cranks(self, number):
        found = [n for key, (n, _) in self.made.items() if key[:2] == (number, "crank")]
        return found

    def ankles(self, number):
        return [self.made[number, f"ankle_{kind}"][0] for kind in self.toy.ankle]


def linked(ankle=("pitch", "roll"), **more):
    builder = Linked(Toy(ankle=ankle, arms=False), **more)
    builder.model()
    return builder


def pushed(spec, ankles, torques, others=()):
    """Angles of joints after seconds without gravity, torques at the ankles."""
    spec.option.gravity = [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    data = mujoco.MjData(model)
    for name, torque in zip(ankles, torques, strict=True):
        data.qfrc_applied[model.joint(name).dofadr[0]] = torque
    for _ in range(2000):
        mujoco.mj_step(model, data)
    return np.array([data.joint(n).qpos[0] for n in (*ankles, *others)])


@pytest.mark.parametrize("torques", [(5.0, 0.0), (0.0, 5.0), (-3.0, 4.0)])
@pytest.mark.parametrize("sites", [False, True])
def test_two_cranks_hold_an_ankle_as_its_folded_servos_do(torques, sites):
    whole, folded = linked(sites=sites), linked(sites=sites)
    notes = fold_linkages(folded.spec)
    assert len(notes) == 2
    ankles = whole.ankles(0)
    before = pushed(whole.spec, ankles, torques)
    after = pushed(folded.spec, ankles, torques)
    assert np.abs(before).max() > 0.005
    assert after == pytest.approx(before, rel=0.05, abs=2e-4)
    assert not folded.spec.equalities


def test_one_crank_turns_its_ankle_by_the_ratio_of_the_arms():
    builder = linked(("pitch",))
    crank = builder.cranks(0)[0]
    motor = pushed(builder.spec, builder.ankles(0), [5.0], [crank])
    other = linked(("pitch",))
    note, _ = fold_linkages(other.spec)
    ratio = BACK / ARM
    assert motor[1] / motor[0] == pytest.approx(ratio, rel=0.03)
    assert f"{other.ankles(0)[0]} is turned by {crank} through a linkage" in note
    assert f"by {ratio:.3g} of" in note
    model = other.spec.compile()
    joint = model.joint(other.ankles(0)[0])
    servo = np.flatnonzero(model.actuator_trnid[:, 0] == joint.id)
    assert model.actuator_gainprm[servo, 0] == pytest.approx(KP * ratio**2, rel=1e-6)
    assert model.actuator_forcerange[servo, 1] == pytest.approx(40.0 * ratio, rel=1e-6)
    assert joint.armature[0] == pytest.approx(0.001 * ratio**2, rel=1e-6)


@pytest.mark.parametrize(
    ("own", "limited", "low"),
    [
        ((0, 0), LIMITED.mjLIMITED_AUTO, -0.3),
        ((-0.2, 1.2), LIMITED.mjLIMITED_AUTO, -0.2),
        ((-0.2, 1.2), LIMITED.mjLIMITED_FALSE, -0.3),
    ],
)
def test_an_ankle_ends_where_its_range_or_its_motors_does(own, limited, low):
    builder = linked(("pitch",))
    ankle, crank = (
        builder.spec.joint(n[0]) for n in (builder.ankles(0), builder.cranks(0))
    )
    ankle.range, ankle.limited = own, limited
    crank.range = [-0.5, 1.0]
    fold_linkages(builder.spec)
    model = builder.spec.compile()
    ends = [low, 1.0 * ARM / BACK]
    assert model.joint(ankle.name).range == pytest.approx(ends, rel=1e-6)
    assert model.joint(ankle.name).limited


def test_a_torque_motor_stays_one_with_the_torque_of_its_arm():
    builder = linked(("pitch",))
    for number in (0, 1):
        (servo,) = driven_by(
            builder.spec, builder.spec.joint(builder.cranks(number)[0])
        )
        servo.set_to_motor()
        servo.gear, servo.ctrllimited = [20.0, 0, 0, 0, 0, 0], True
        servo.ctrlrange, servo.forcelimited = [-2.0, 2.0], False
    fold_linkages(builder.spec)
    model = builder.spec.compile()
    found = sum_actuators(model, model.joint(builder.ankles(0)[0]).id)
    assert found.kind == "motor"
    assert found.force == pytest.approx(20.0 * 2.0 * BACK / ARM, rel=1e-6)


def test_a_screw_pushes_an_ankle():
    builder = linked(("pitch",), slide=True)
    note, _ = fold_linkages(builder.spec)
    assert f"by {BACK:.3g} of" in note
    model = builder.spec.compile()
    joint = model.joint(builder.ankles(0)[0])
    servo = np.flatnonzero(model.actuator_trnid[:, 0] == joint.id)
    assert model.actuator_gainprm[servo, 0] == pytest.approx(KP, rel=1e-6)


def test_the_legs_are_found_without_their_linkages(tmp_path):
    builder = linked()
    home = builder.spec.add_key(name="home")
    model = builder.spec.compile()
    home.qpos = model.qpos0
    knee = builder.made[0, "knee"][0]
    home.qpos[model.joint(knee).qposadr[0]] = 0.3
    path = tmp_path / "linked.xml"
    path.write_text(builder.spec.to_xml(), "utf-8")
    loaded = load_model(path)
    assert sum("through a linkage" in note for note in loaded.notes) == 2
    folded = loaded.spec.compile()
    assert folded.key("home").qpos[folded.joint(knee).qposadr[0]] == 0.3
    found = find(folded, "linked")
    plain = find(Builder(Toy(arms=False)).model(), "plain")
    for number, leg in enumerate((found.left, found.right)):
        assert set(builder.ankles(number)) <= set(leg.joints)
        assert not set(builder.cranks(number)) & set(leg.joints)
        assert not leg.passive
    assert len(found.left.joints) == len(plain.left.joints)
    assert found.servos[builder.ankles(0)[0]].source == "actuator"


def test_what_measures_a_crank_goes_with_it(tmp_path):
    builder = linked(("pitch",))
    joint, sensor = mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtSensor.mjSENS_JOINTPOS
    for name in (builder.cranks(0)[0], builder.made[0, "knee"][0]):
        builder.spec.add_sensor(name=name, type=sensor, objtype=joint, objname=name)
    builder.spec.compile()  # what is written is what was compiled last
    path = tmp_path / "measured.xml"
    path.write_text(builder.spec.to_xml(), "utf-8")
    loaded = load_with_findings(path)
    assert any(note.startswith("1 pairs, sensors") for note in loaded.notes)
    sensors = [loaded.model.sensor(n).name for n in range(loaded.model.nsensor)]
    assert sensors == [builder.made[0, "knee"][0]]
    assert len(loaded.findings.left.joints) == 5


def without_a_motor(builder):
    crank = builder.cranks(0)[0]
    for servo in list(builder.spec.actuators):
        if servo.target == crank:
            builder.spec.delete(servo)


def driven_at_both_ends(builder):
    builder.spec.add_actuator(
        target=builder.ankles(0)[0], trntype=mujoco.mjtTrn.mjTRN_JOINT
    )


def at_a_dead_point(builder):
    rod = builder.spec.joint(builder.cranks(0)[0]).parent.bodies[0]
    (tie,) = (t for t in builder.spec.equalities if t.name1 == rod.name)
    down = np.array(tie.data[:3])
    rod.pos = ARM * down / np.linalg.norm(down)  # rod and crank in one line


@pytest.mark.parametrize(
    "spoil", [without_a_motor, driven_at_both_ends, at_a_dead_point]
)
def test_a_loop_that_is_none_is_refused_as_before(tmp_path, spoil):
    builder = linked(("pitch",))
    spoil(builder)
    builder.spec.compile()  # what is written is what was compiled last
    path = tmp_path / "looped.xml"
    path.write_text(builder.spec.to_xml(), "utf-8")
    loaded = load_model(path)
    with pytest.raises(RobotFileError, match="closed loop"):
        find(loaded.spec.compile(), "looped")


def test_a_robot_without_loops_stays():
    builder = Builder(Toy())
    builder.model()
    before = builder.spec.to_xml()
    assert fold_linkages(builder.spec) == []
    assert builder.spec.to_xml() == before
