"""What is no measurement of a robot is refused, and does not become one of its own."""

from dataclasses import replace

import numpy as np
import pytest
from servo_bench import RES

from gaitchain.cli import run
from gaitchain.errors import LogError
from gaitchain.identify import fit, hung_fit
from gaitchain.identify.fit import fit_logs
from gaitchain.identify.gyro_check import turns
from gaitchain.identify.hung_fit import HungFit
from gaitchain.identify.log import ExerciseLog, MotionLog, save_log
from gaitchain.identify.parameters import OF_IMU, OF_STAND, Parameters
from gaitchain.identify.refusals import (
    check_content,
    check_explained,
    check_units,
    encoder_noise,
)
from gaitchain.identify.simulated import exercise_hidden, replay
from gaitchain.identify.stand_fit import StandFit
from gaitchain.live.exercise import Motion, exercise
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.identified import Identified
from gaitchain.sim.world import World

NAMES = RES.legs.joint_names
HELD = Motion("held", exercise(RES)[0].targets[:500])
PLAIN = Identified.of_file(12)


def swung(found=PLAIN):
    """Five seconds of legs that swing, with the noise of encoders."""
    robot = RES.as_identified(found)
    return MotionLog(HELD, replay(robot, HELD, np.zeros(2), World(noise=1.0)))


@pytest.fixture(scope="module")
def good():
    return swung()


def with_joints(part, joints, targets=HELD.targets):
    measured = replace(part.measured, joint_position=joints)
    return MotionLog(Motion("held", targets), measured)


def log_with(part):
    parts = (part,)
    return ExerciseLog(RES.name, RES.fingerprint, NAMES, CONTROL_PERIOD_S, parts)


def quiet(stage, done, total):
    pass


def gain_of(joint, gain):
    gains = np.ones(12)
    gains[joint] = gain
    return replace(PLAIN, gain=gains)


def test_a_log_of_soft_worn_servos_is_none_of_dead_ones():
    soft = replace(PLAIN, gain=np.full(12, 0.3), backlash_deg=np.full(12, 2.0))
    check_content(NAMES, [swung(soft)])


@pytest.mark.parametrize("joint", [1, 3])
def test_a_servo_without_power_is_named(joint):
    """It does not stay where it is: gravity and the other joints swing it."""
    dead = swung(gain_of(joint, 1e-3))
    assert np.ptp(dead.measured.joint_position[:, joint]) > np.radians(20.0)
    with pytest.raises(LogError, match="do not follow their targets") as refused:
        check_content(NAMES, [dead])
    assert [name for name in NAMES if name in str(refused.value)] == [NAMES[joint]]


def test_a_robot_without_power_is_refused_before_any_work(good, tmp_path, capsys):
    noise = np.random.default_rng(0).normal(0.0, 1e-3, HELD.targets.shape)
    path, out = tmp_path / "dead.log", tmp_path / "a.gait"
    save_log(log_with(with_joints(good, HELD.targets[0] + noise)), path)
    assert run(["identify", "res", str(path), "-o", str(out)]) == 2
    said = capsys.readouterr().err
    assert "encoders show 0% of 38.5 deg of left_hip_yaw" in said
    assert "and 6 more; a fit needs 25% at least" in said
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (NAMES[::-1], f"joint 1 of the log is '{NAMES[-1]}', of Robo-Erectus Senior"),
        ((NAMES[0], *NAMES[:-1]), f"joint 2 of the log is '{NAMES[0]}'"),
        (("shoulder", *NAMES[1:]), f"is 'shoulder', .* it is '{NAMES[0]}'; the order"),
        (NAMES[:-1], f"the log has 11 joints, .* 12 in its legs: {NAMES[0]}, "),
    ],
)
def test_a_log_of_other_joints_is_refused(names, said, good):
    log = replace(log_with(good), joint_names=names)
    with pytest.raises(LogError, match=said):
        fit_logs(RES, [log], 1, quiet)


def test_angles_in_degrees_are_refused(good, tmp_path, capsys):
    """Before any work; the replay of 45 rad took minutes."""
    joints, targets = good.measured.joint_position, HELD.targets
    path, out = tmp_path / "a.log", tmp_path / "a.gait"
    for part, what in (
        (with_joints(good, np.degrees(joints), np.degrees(targets)), "asked for"),
        (with_joints(good, np.degrees(joints)), "shown"),
    ):
        save_log(log_with(part), path)
        assert run(["identify", "res", str(path), "-o", str(out)]) == 2
        said = capsys.readouterr().err
        assert f"rad are {what} of " in said
        assert "in the motion 'held up', its range is" in said
        assert "not in degrees" in said
        assert list(tmp_path.iterdir()) == [path]


def test_of_several_logs_the_one_that_is_wrong_is_named(good, tmp_path, capsys):
    right, wrong = tmp_path / "right.log", tmp_path / "wrong.log"
    save_log(log_with(good), right)
    save_log(replace(log_with(good), joint_names=NAMES[::-1]), wrong)
    out = str(tmp_path / "a.gait")
    assert run(["identify", "res", str(right), str(wrong), "-o", out]) == 2
    assert f"gaitchain: {wrong}: joint 1 of the log is" in capsys.readouterr().err


def test_a_few_spoilt_rows_are_no_degrees(good):
    joints = good.measured.joint_position.copy()
    joints[::20] = 100.0
    check_units(RES.legs, [with_joints(good, joints)])


@pytest.mark.parametrize(
    ("scale", "said"), [(0.0, "shows 0 m/s.2"), (1.0 / 9.81, "shows 1 m/s.2")]
)
def test_an_imu_without_gravity_is_refused(scale, said, good):
    """One that was not read, and one whose values are parts of g."""
    felt = scale * good.measured.acceleration
    part = MotionLog(HELD, replace(good.measured, acceleration=felt))
    with pytest.raises(LogError, match=f"{said} .* 6.87 to 12.8 can be"):
        fit_logs(RES, [log_with(part)], 1, quiet)
    none = np.full_like(felt, np.nan)
    check_units(RES.legs, [MotionLog(HELD, replace(good.measured, acceleration=none))])


def mounted(part, axes):
    """The same motion, by an accelerometer whose axes are the trunk's in a matrix."""
    felt = part.measured.acceleration @ np.array(axes, dtype=float)
    return replace(part, measured=replace(part.measured, acceleration=felt))


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ([[1, 0, 0], [0, -1, 0], [0, 0, -1]], "-z, 1[78][0-9] deg from its z"),
        ([[0, 0, -1], [0, 1, 0], [1, 0, 0]], r"\+x, [89][0-9] deg from its z"),
    ],
)
def test_an_imu_that_is_mounted_otherwise_is_refused(axes, said, good):
    """Upside down, and turned by 90 deg; the length of gravity is the same."""
    check_units(RES.legs, [good])
    with pytest.raises(LogError, match=f"{said}.* 'held up', and at most 45 can be"):
        check_units(RES.legs, [mounted(good, axes)])


@pytest.fixture(scope="module", params=[1, 10])
def stood(request):
    """The motion on the ground of a hidden robot."""
    return exercise_hidden(RES, request.param).parts[1]


def turning(part, scale):
    """The same motion, by a gyro of another scale."""
    rate = part.measured.angular_velocity * scale
    return replace(part, measured=replace(part.measured, angular_velocity=rate))


def test_a_gyro_in_degrees_is_refused(stood):
    check_units(RES.legs, [stood])
    said = r"gyro turns by \d+ deg to and fro .*'standing'.*, gravity by \d\.\d deg"
    with pytest.raises(LogError, match=said + ".*rad/s, not in deg/s"):
        check_units(RES.legs, [turning(stood, 180.0 / np.pi)])


def test_a_fair_gyro_drifts_misses_rows_and_may_not_be_there(stood):
    rate = stood.measured.angular_velocity + np.radians(3.0)
    rate[::3] = np.nan
    rate[1000:1100] = np.nan
    drifts = replace(stood.measured, angular_velocity=rate)
    assert turns(drifts).possible
    assert turns(drifts).gyro_deg == pytest.approx(
        turns(stood.measured).gyro_deg, rel=0.2
    )
    assert turns(replace(drifts, angular_velocity=np.full_like(rate, np.nan))) is None


def test_a_log_in_which_nothing_moves_is_refused(good):
    still = np.tile(HELD.targets[0], (500, 1))
    said = r"left_hip_yaw by 0.0 deg.*below 2.0 deg play may"
    with pytest.raises(LogError, match=said):
        fit_logs(RES, [log_with(with_joints(good, still, still))], 1, quiet)


def test_one_motion_that_moves_a_joint_is_enough(good):
    still = np.tile(HELD.targets[0], (500, 1))
    check_content(NAMES, [with_joints(good, still, still), good])


def test_rows_without_encoders_are_refused_where_they_are_most(good):
    joints = good.measured.joint_position.copy()
    joints[::3] = np.nan
    check_content(NAMES, [with_joints(good, joints)])
    joints[100:, 3] = np.nan
    with pytest.raises(LogError, match=r"left_knee in 13%; a fit needs 50%"):
        fit_logs(RES, [log_with(with_joints(good, joints))], 1, quiet)


def test_noise_is_that_of_the_encoders(good):
    exact = replay(RES.as_identified(PLAIN), HELD, np.zeros(2))
    true = np.std(good.measured.joint_position - exact.joint_position)
    assert encoder_noise([good]) == pytest.approx(true, rel=0.1)


def test_gaps_in_each_second_row_switch_no_refusal_off(good):
    """No second difference is left; the noise is unknown, and not no number."""
    gaps = good.measured.joint_position.copy()
    gaps[::2] = np.nan
    noise = encoder_noise([with_joints(good, gaps)])
    assert noise == 0.0
    with pytest.raises(LogError, match="no robot makes this log"):
        check_explained(0.1, 0.0999, noise, told=True)


def test_a_fit_that_explains_nothing_is_refused(good, monkeypatch):
    """Of a log that no robot makes, or where nothing is fitted: no numbers are told."""
    for rounds in "SEARCHES", "CLIMBS":
        monkeypatch.setattr(hung_fit, rounds, 0)
    monkeypatch.setattr(HungFit, "certainty", lambda own, found, b, rng: b.covariance)
    with pytest.raises(LogError, match="the log tells no number of any joint"):
        fit_logs(RES, [log_with(good)], 1, quiet)
    bent = good.measured.joint_position + np.radians(20.0) * (np.arange(12) == 3)
    with pytest.raises(
        LogError, match=r"miss the joints by 5.84 deg after the fit, 5.77 before"
    ):
        fit_logs(RES, [log_with(with_joints(good, bent))], 1, quiet)


def test_a_fit_is_good_that_leaves_noise_or_much_less_than_before():
    noise = np.radians(0.1)
    check_explained(4.0 * noise, 4.0 * noise, noise, told=True)
    check_explained(40.0 * noise, 30.0 * noise, noise, told=True)
    with pytest.raises(
        LogError, match=r"by 3.80 deg after .* 4.00 before .* above 0.5"
    ):
        check_explained(40.0 * noise, 38.0 * noise, noise, told=True)


def standing():
    motion = Motion("standing", exercise(RES)[1].targets[:500])
    return MotionLog(motion, replay(RES.as_identified(PLAIN), motion, np.zeros(2)))


@pytest.mark.parametrize("imu", [True, False])
@pytest.mark.parametrize("stands", [True, False])
def test_what_nothing_shows_stays_as_in_the_file(imu, stands, good, monkeypatch):
    """It was what happened to be drawn: without an IMU a tilt of 0.9 deg."""
    parameters = Parameters(NAMES)
    drawn, known = np.zeros(len(parameters.all)), 1e-4 * np.eye(len(parameters.all))
    for name in (*OF_IMU, *OF_STAND):
        drawn[parameters.places(name)] = 0.5
    for kind in HungFit, StandFit:
        monkeypatch.setattr(kind, "fit", lambda *given: (drawn, known))
    monkeypatch.setattr(fit, "check_explained", lambda *given, told: None)
    part = standing() if stands else good
    none = np.full((500, 3), np.nan)
    blind = replace(part.measured, angular_velocity=none, acceleration=none)
    part = part if imu else replace(part, measured=blind)
    found = fit_logs(RES, [log_with(part)], 1, quiet)
    one = found.identified
    told = {n.parameter.name: n.told for n in found.numbers}
    np.testing.assert_allclose(one.tilt, 0.013 * (imu and stands))
    assert told["tilt"] == (imu and stands), "hung legs tell no zeros"
    assert one.imu_delay_s == pytest.approx(0.005 * imu)
    assert told["imu_delay_s"] == imu
    np.testing.assert_allclose(one.com, 0.0075 * stands)
    assert one.trunk_mass == pytest.approx(1.0 + 0.05 * stands)
    assert [told[name] for name in OF_STAND] == [stands, stands]
    assert told["delay_s"]
