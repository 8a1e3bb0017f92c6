"""A user's own MuJoCo model: joints by name, servos, IMU and floor."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from planned_library import planned_library
from toy_file import toy

from gaitchain.backends.model import ModelBackend
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.errors import CommandError
from gaitchain.messages import Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.model import build_model
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

SECOND = 100
FLOOR = '<geom type="plane" size="0 0 0.1" pos="0 0 -0.3"/>'
ROOT = (
    '<body name="base_footprint"><freejoint/><inertial mass="0.01" pos="0 0 0" '
    'diaginertia="1e-5 1e-5 1e-5"/><body name="torso" pos="0 0 0.45">'
)
SERVO = '<position joint="left_tilt" kp="300.0" kv="6" forcerange="-60 60"/>'
SITE = '<site name="imu" pos="0.03 -0.02 0.1" euler="0.5 -0.4 1.2"/>'
SENSORS = '<sensor><gyro site="imu"/><accelerometer site="imu"/></sensor></mujoco>'


def model_of(text, floor=FLOOR):
    text = text.replace("<worldbody>", f"<worldbody>{floor}")
    return mujoco.MjModel.from_xml_string(text)


def walk(robot, library, command, seconds=4):
    """Stand a second, then walk; return the targets and where the robot got to."""
    walker = Walker(library, joint_names=getattr(robot, "joint_names", None))
    robot.connect(walker.stand)
    targets = []
    for tick in range((1 + seconds) * SECOND):
        if tick == SECOND:
            walker.command(command)
        targets.append(walker.step(robot.read()).position)
        robot.write(targets[-1])
        assert not robot.fallen, tick
    return np.array(targets), robot.data.qpos[:2].copy()


def test_our_own_model_walks_as_in_its_own_backend():
    res = load_box_robot("res")
    library = planned_library(res)
    robot = ModelBackend(build_model(res), library, imu="imu")
    targets, place = walk(robot, library, Command(0.2))
    expected, there = walk(MujocoBackend(res), library, Command(0.2))
    assert there[0] > 0.5
    np.testing.assert_allclose(targets, expected, atol=1e-6)
    np.testing.assert_allclose(place, there, atol=1e-6)


def test_joints_go_by_name_and_the_model_stays_as_it_was(toy_library):
    model = model_of(toy(kp=1.0))  # placeholders
    before = model.actuator_gainprm.copy(), model.actuator_biasprm.copy()
    robot = ModelBackend(model, toy_library)
    names = [model.joint(j).name for j in range(1, model.njnt)]
    assert robot.joint_names == tuple(names)  # the shoulders come first
    assert set(names) > set(toy_library.robot.legs.joint_names)
    _, place = walk(robot, toy_library, Command(0.1))
    assert place[0] > 0.1
    np.testing.assert_array_equal(model.actuator_gainprm, before[0])
    np.testing.assert_array_equal(model.actuator_biasprm, before[1])


def test_motors_with_gears_become_the_servos_that_the_library_knows(toy_library):
    """The arms keep theirs, of which the library knows nothing; they shake the legs."""
    geared = re.sub(
        r'<position (joint="\w+_(?!shoulder)\w+") kp="300.0" kv="6" forcerange="[^"]+"',
        r'<motor gear="-5" \1',
        toy(),
    )
    assert geared.count("<motor") == len(toy_library.robot.legs.joint_names)
    same = ModelBackend(model_of(toy()), toy_library)
    robot = ModelBackend(model_of(geared), toy_library)
    stand = Walker(toy_library, joint_names=robot.joint_names).stand
    for one in (same, robot):
        one.connect(stand)
    for tick in range(100):
        for one in (same, robot):
            one.write(stand + 0.02 * np.sin(0.2 * tick))
        # Contacts make more of the last digit, which gears change.
        exact = 1e-12 if tick < 8 else 1e-3
        expected = same.read().joint_position
        np.testing.assert_allclose(robot.read().joint_position, expected, atol=exact)
    legs = [n in toy_library.robot.legs.joint_names for n in robot.joint_names]
    limit = robot.model.actuator_forcerange[robot._rows.argsort()][legs, 1]
    np.testing.assert_allclose(limit, 60.0 / 5.0)


def test_it_stands_on_the_floor_wherever_that_is(toy_library):
    for height in (-0.3, 0.0, 0.4):
        floor = FLOOR.replace("-0.3", str(height))
        robot = ModelBackend(model_of(toy(), floor), toy_library)
        robot.connect(Walker(toy_library, joint_names=robot.joint_names).stand)
        soles = [
            mujoco.mj_geomDistance(robot.model, robot.data, g, 0, 1.0, None)
            for g in range(1, robot.model.ngeom)
            if robot.model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX
        ]
        assert min(soles) == pytest.approx(0.0, abs=1e-6)
        assert robot.data.qpos[2] - height == pytest.approx(0.45, abs=0.1)


@pytest.mark.parametrize("floor_z", [-0.3, 0.4])
def test_a_base_at_the_soles_has_not_fallen_where_it_stands(tmp_path, floor_z):
    """As ROS robots have it; with bent knees it is below the floor."""
    text = toy().replace('<body name="torso" pos="0 0 0.5"><freejoint/>', ROOT)
    text = text.replace("</worldbody>", "</body></worldbody>")
    file = tmp_path / "at_the_soles.xml"
    file.write_text(text, "utf-8")
    library = planned_library(load_with_findings(file).robot)
    robot = ModelBackend(model_of(text, FLOOR.replace("-0.3", str(floor_z))), library)
    _, place = walk(robot, library, Command(0.1))
    assert place[0] > 0.1
    assert robot.base_position[2] < floor_z
    robot.release()
    for _ in range(2 * SECOND):
        robot.write(np.zeros(len(robot.joint_names)))
    assert robot.fallen


def test_the_base_moves_as_an_imu_in_the_pelvis_frame_measures(toy_library):
    """Against MuJoCo's own sensors at a site there."""
    full = toy_library.robot.legs
    text = toy().replace("<worldbody>", f"<worldbody>{FLOOR}")
    spec = mujoco.MjSpec.from_string(text)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, full.base_turn.ravel())
    spec.body("torso").add_site(name="imu", pos=full.base_at, quat=quaternion)
    for kind in (mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER):
        spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu")
    model = spec.compile()
    exact, sensed = (ModelBackend(model, toy_library, imu=i) for i in (None, "imu"))
    rng = np.random.default_rng(0)
    stand = Walker(toy_library, joint_names=exact.joint_names).stand
    for robot in (exact, sensed):
        robot.connect(stand)
    for _ in range(20):
        target = stand + rng.uniform(-0.2, 0.2, len(stand))
        for robot in (exact, sensed):
            robot.write(target)
            mujoco.mj_forward(robot.model, robot.data)  # both of this very moment
        one, other = exact.read(), sensed.read()
        np.testing.assert_allclose(one.angular_velocity, other.angular_velocity)
        np.testing.assert_allclose(one.acceleration, other.acceleration, atol=1e-9)
    assert np.abs(one.acceleration - [0.0, 0.0, 9.81]).max() > 0.1


def test_an_imu_that_is_turned_measures_in_the_pelvis_frame(toy_library):
    text = toy().replace("<freejoint/>", f"<freejoint/>{SITE}")
    model = model_of(text.replace("</mujoco>", SENSORS))
    robot = ModelBackend(model, toy_library, imu="imu")
    stand = Walker(toy_library, joint_names=robot.joint_names).stand
    robot.connect(stand)
    for _ in range(SECOND):
        robot.write(stand)
    sensors = robot.read()
    np.testing.assert_allclose(sensors.acceleration, [0.0, 0.0, 9.81], atol=0.4)
    robot.data.qvel[3:6] = 0.3, -0.2, 0.1  # of the base, in its own frame
    mujoco.mj_forward(robot.model, robot.data)
    turn = toy_library.robot.legs.base_turn
    expected = turn.T @ [0.3, -0.2, 0.1]
    np.testing.assert_allclose(robot.read().angular_velocity, expected, atol=1e-9)


def test_actuators_with_a_delay_hold_the_robot_from_the_first_period_on(toy_library):
    """MuJoCo's buffer began with set-points of 0, and the robot fell at once."""
    text = toy().replace("<worldbody>", f"<worldbody>{FLOOR}")
    spec = mujoco.MjSpec.from_string(text)
    for actuator in spec.actuators:
        actuator.delay, actuator.nsample = 0.03, 20
    robot = ModelBackend(spec.compile(), toy_library)
    stand = np.array(robot.read().joint_position)
    robot.connect(stand)
    off = []
    for _ in range(100):
        robot.write(stand)
        off.append(np.abs(robot.read().joint_position - stand).max())
    assert not robot.fallen
    assert np.degrees(max(off)) < 2.0
    robot.release()
    robot.write(stand)
    assert not robot.loads().any()
    held = np.array(robot.read().joint_position)
    robot.engage()
    robot.write(stand)
    assert np.degrees(np.abs(robot.read().joint_position - held).max()) < 2.0


def test_it_lets_go_and_takes_hold_again(toy_library):
    robot = ModelBackend(model_of(toy()), toy_library)
    stand = Walker(toy_library, joint_names=robot.joint_names).stand
    robot.connect(stand)
    robot.write(stand)
    assert np.abs(robot.loads()).max() > 0.1
    robot.release()
    robot.write(stand)
    assert not robot.loads().any()
    robot.engage()
    robot.write(robot.read().joint_position)
    assert robot.loads().any()
    for _ in range(3 * SECOND):
        robot.release()
        robot.write(stand)
    assert robot.fallen


def without(part):
    return lambda text: text.replace(part, "")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without(FLOOR), "the model has no floor that the robot touches; add a geom"),
        (without("<freejoint/>"), "body 'torso' has no free joint"),
        (
            lambda t: t.replace("left_knee", "knee"),
            "lacks joints .*: left_knee; it has",
        ),
        (without(SERVO), "no actuator on left_tilt; give each a <position/> or"),
    ],
)
def test_what_the_model_lacks_is_named(toy_library, change, message):
    text = toy().replace("<worldbody>", f"<worldbody>{FLOOR}")
    with pytest.raises(CommandError, match=message):
        ModelBackend(mujoco.MjModel.from_xml_string(change(text)), toy_library)


def test_options_that_do_not_fit_are_refused(toy_library):
    model = model_of(toy())
    with pytest.raises(CommandError, match="no site 'head' with one gyro"):
        ModelBackend(model, toy_library, imu="head")
    with pytest.raises(CommandError, match="no site 5 with one gyro"):
        ModelBackend(model, toy_library, imu=5)
    with pytest.raises(CommandError, match=r"timestep is 0.002 s, must divide"):
        ModelBackend(model, toy_library, 0.0033)
    for period_s in (np.nan, np.inf, None, "a"):
        with pytest.raises(CommandError, match="need seconds above 0"):
            ModelBackend(model, toy_library, period_s)


def test_what_is_no_model_or_no_library_is_refused(toy_library):
    model = model_of(toy())
    for odd in ("scene.xml", mujoco.MjData(model), None):
        with pytest.raises(CommandError, match=r"give a mujoco\.MjModel, such as"):
            ModelBackend(odd, toy_library)
    for odd in (toy_library.robot, "res", None):
        with pytest.raises(CommandError, match="is no gait library; give one, as load"):
            ModelBackend(model, odd)


POSITION = r'<position joint="(\w+)" kp="300.0" kv="6" forcerange="-60 60"/>'
LIMIT = 'forcerange="-60 60"'


def with_actuators(*kinds):
    """The toy with other actuators on each joint, whose name is "{}" in them."""
    return re.sub(POSITION, "".join(kinds).replace("{}", r"\1"), toy())


def standing(text, library):
    robot = ModelBackend(model_of(text), library)
    stand = Walker(library, joint_names=robot.joint_names).stand
    robot.connect(stand)
    return robot, stand


def knee(model):
    """The first actuator of the left knee."""
    joint = model.joint("left_knee").id
    return next(a for a in range(model.nu) if model.actuator_trnid[a, 0] == joint)


SERVO_ALONE = f'<position joint="{{}}" kp="300" {LIMIT}/>'
DAMPER = '<velocity joint="{}" kv="6"/>'
IN_DEGREES = (
    '<general joint="{}" gear="2" gainprm="2.6179938779914944" biastype="affine" '
    'biasprm="0 -75 -1.5" forcerange="-30 30"/>'
)


@pytest.mark.parametrize(
    "kinds",
    [(SERVO_ALONE, DAMPER), (DAMPER, SERVO_ALONE), (IN_DEGREES,)],
    ids=["damper last", "damper first", "set-points in degrees"],
)
def test_set_points_are_what_each_actuator_takes(toy_library, kinds):
    """Against the same servo as one <position/>; all gains are the library's."""
    same, stand = standing(toy(), toy_library)
    robot, _ = standing(with_actuators(*kinds), toy_library)
    np.testing.assert_allclose(robot.loads(), 0.0, atol=1e-9)
    for tick in range(8):
        for one in (same, robot):
            one.write(stand + 0.02 * np.sin(0.2 * tick))
        expected = same.read().joint_position
        np.testing.assert_allclose(robot.read().joint_position, expected, atol=1e-9)


OF_A_RANGE = (  # of 1.6 rad about 0.4 rad: set-points of -1 to 1
    '<general joint="{}" gear="-2" gainprm="120" biastype="affine" '
    'biasprm="-60 -75 -1.5" forcerange="-30 30"/>'
)
OFFSET = (  # by 0.3 rad
    '<general joint="{}" gainprm="300" biastype="affine" biasprm="90 -300 -6" '
    'forcerange="-60 60"/>'
)


@pytest.mark.parametrize("kind", [OF_A_RANGE, OFFSET], ids=["of a range", "offset"])
def test_servos_whose_set_points_have_another_zero_hold_the_same_angles(
    toy_library, kind
):
    """A constant in their bias moves them; contacts make more of the last digit."""
    same, stand = standing(toy(), toy_library)
    robot, _ = standing(with_actuators(kind), toy_library)
    np.testing.assert_allclose(robot.loads(), 0.0, atol=1e-9)
    for tick in range(SECOND):
        for one in (same, robot):
            one.write(stand + 0.02 * np.sin(0.2 * tick))
        expected = same.read().joint_position
        np.testing.assert_allclose(robot.read().joint_position, expected, atol=2e-3)


def test_actuators_with_other_gains_become_one_servo(toy_library):
    placeholders = with_actuators(
        DAMPER.replace("6", "0.1"), SERVO_ALONE.replace("300", "1")
    )
    robot, stand = standing(placeholders, toy_library)
    model, damper = robot.model, knee(robot.model)
    servo = damper + 1
    assert model.actuator_gainprm[servo, 0] == pytest.approx(300.0)
    np.testing.assert_allclose(model.actuator_biasprm[servo, 1:3], [-300.0, -6.0])
    assert not model.actuator_gainprm[damper].any()
    assert not model.actuator_biasprm[damper].any()
    for _ in range(SECOND):
        robot.write(stand)
    assert not robot.fallen


@pytest.mark.parametrize(
    ("actuator", "message"),
    [
        (
            '<intvelocity joint="{}" kp="300" kv="6" actrange="-3 3" ' + LIMIT + "/>",
            "takes a speed, not an angle; make it a <position/>",
        ),
        (
            '<general joint="{}" dyntype="filter" dynprm="0.01"/>',
            "dynamics of its own and not the library's gains; give it .* N m/rad",
        ),
        ('<position joint="{}" kp="300" gear="0"/>', "turns nothing with gear 0"),
    ],
)
def test_actuators_that_cannot_be_aimed_are_refused(toy_library, actuator, message):
    with pytest.raises(CommandError, match=message):
        ModelBackend(model_of(with_actuators(actuator)), toy_library)


@pytest.mark.parametrize("changed", ["damping", "torque_limit"])
def test_all_numbers_of_the_librarys_servos_are_set(toy_library, changed):
    """The stiffness is that of the file; a profile, say, gave the others."""
    legs = toy_library.robot.legs
    legs = replace(legs, **{changed: 1.5 * getattr(legs, changed)})
    robot = replace(toy_library.robot, legs=legs)
    library = replace(toy_library, poses=replace(toy_library.poses, robot=robot))
    text = toy().replace("<joint name=", '<joint actuatorfrcrange="-60 60" name=')
    model = ModelBackend(model_of(text), library).model
    damping, limit = (9.0, 60.0) if changed == "damping" else (6.0, 90.0)
    assert model.actuator_biasprm[knee(model), 2] == pytest.approx(-damping)
    np.testing.assert_allclose(model.actuator_forcerange[knee(model)], [-limit, limit])
    joint = model.joint("left_knee").id
    if model.jnt_actfrclimited[joint]:
        assert model.jnt_actfrcrange[joint, 1] >= limit


def test_a_servo_that_limits_its_rate_keeps_that():
    """As those of our own models; here half as strong as the library's."""
    res = load_box_robot("res")
    library = planned_library(res)
    same = ModelBackend(build_model(res), library)
    robot = ModelBackend(build_model(res, World(torque_limit=0.5)), library)
    for name in ("gainprm", "biasprm", "gaintype", "dyntype", "forcerange"):
        found, wanted = (
            getattr(one.model, f"actuator_{name}") for one in (robot, same)
        )
        np.testing.assert_allclose(found, wanted)
    stand = Walker(library, joint_names=robot.joint_names).stand
    for one in (same, robot):
        one.connect(stand)
        for _ in range(5):
            one.write(stand + 0.01)
    expected = same.read().joint_position
    np.testing.assert_allclose(robot.read().joint_position, expected, atol=1e-9)


def test_joints_outside_the_legs_are_held_by_what_the_robot_weighs(tmp_path):
    """Wherever the file draws it: as in the robot that was found there."""
    finger = (
        '<body name="finger" pos="0 0 0.3"><joint name="finger" axis="0 0 1" '
        'range="-1 1" armature="1e-5"/><geom type="sphere" size="0.01" mass="0.02"/>'
        "</body>"
    )
    text = toy().replace("<freejoint/>", f"<freejoint/>{finger}")
    text = re.sub("<position ", "<motor ", re.sub(' k[pv]="[^"]*"', "", text))
    text = text.replace("</actuator>", '<motor joint="finger"/></actuator>')
    for height in (0.5, 0.0, -1.0):
        file = tmp_path / f"at_{height}.xml"
        drawn = text.replace('pos="0 0 0.5"', f'pos="0 0 {height}"')
        file.write_text(drawn, "utf-8")
        loaded = load_with_findings(file)
        library = planned_library(loaded.robot)
        model = ModelBackend(model_of(drawn), library).model
        names = [model.joint(j).name for j in model.actuator_trnid[:, 0]]
        stiffness = model.actuator_gainprm[names.index("finger"), 0]
        found = loaded.findings.servos["finger"].stiffness
        assert stiffness == pytest.approx(found, rel=1e-3)
