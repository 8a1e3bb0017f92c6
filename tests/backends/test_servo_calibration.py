"""The calibration file: round trip, and a line for every bad value."""

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from servo_bench import PATIENT_S, RES, few, mounted_oddly, patient_bus

from gaitchain.backends.makes import MAKES
from gaitchain.backends.servos import (
    ServoBackend,
    ServoBusEmulator,
    load_calibration,
    save_calibration,
)
from gaitchain.backends.servos.calibration import (
    Calibration,
    ImuCalibration,
    JointCalibration,
    check_calibration,
    check_joints,
    check_robot,
    plain_calibration,
)
from gaitchain.backends.servos.calibration_file import (
    calibration_text,
    parse_calibration,
)
from gaitchain.errors import CalibrationError

IMU = ImuCalibration(200, 38, 44, 0.001065, 0.000598, axes=("-y", "x", "z"))
TEXT = calibration_text(plain_calibration(RES))
IMU_TEXT = """
[imu]
id = 200
gyro = 38
accelerometer = 44
gyro_scale = 0.001
accelerometer_scale = 0.0006
"""


@st.composite
def calibrations(draw):
    """Calibrations that can be, with any names."""
    names = draw(st.lists(st.text(min_size=1), min_size=1, max_size=4, unique=True))
    joints = {}
    for number, name in enumerate(names):
        offset = draw(st.floats(0.0, 360.0))
        low, high = sorted(draw(st.tuples(*[st.floats(0.0, 360.0)] * 2)))
        sign = draw(st.sampled_from([1, -1]))
        ends = sorted(sign * (end - offset) for end in (low, high))
        if not ends[0] < ends[1]:
            ends = [-1e-3, 0.0] if sign * 1e-3 <= offset else [0.0, 1e-3]
            offset = 180.0
        pwm = draw(st.floats(1.0, 100.0))
        joints[name] = JointCalibration(number, sign, offset, *ends, "", pwm)
    robot = draw(st.text())
    imu = draw(st.sampled_from([None, IMU]))
    baud, make = draw(st.integers(9600, 4_500_000)), draw(st.sampled_from(MAKES))
    return Calibration(robot, "f00d", baud, joints, imu, make)


@given(calibrations())
def test_what_is_written_is_read_again(calibration):
    assert parse_calibration(calibration_text(calibration)) == calibration


def test_a_file_comes_and_goes(tmp_path):
    path = tmp_path / "robot.toml"
    calibration = msgspec.structs.replace(mounted_oddly(), imu=IMU)
    save_calibration(calibration, path)
    assert load_calibration(path, RES) == calibration
    assert [p.name for p in tmp_path.iterdir()] == ["robot.toml"]


@pytest.mark.parametrize(
    ("line", "instead", "said"),
    [
        ("id = 1\n", "id = 300\n", "left_hip_yaw.id = 300: .*allowed .*: 0 to 252"),
        ("id = 1\n", "id = -1\n", "left_hip_yaw.id = -1: .*allowed .*: 0 to 252"),
        ("id = 1\n", "id = true\n", "left_hip_yaw.id = True: expected int"),
        ("id = 1\n", "id = 2\n", "id = 2 is that of left_hip_yaw, left_hip_roll"),
        ("id = 1\n", "", "left_hip_yaw: missing: id"),
        ("sign = 1\n", "sign = 0\n", "left_hip_yaw.sign = 0: .*allowed: 1, -1"),
        ("offset = 180.0", "offset = nan", "left_hip_yaw.offset = nan: .*to 720"),
        ("offset = 180.0", "ofset = 180.0", "unknown key ofset; did you mean offset"),
        ("lower = -80", "lower = 90", "lower = 90.* deg must be below upper = 80 deg"),
        (
            "lower = -80",
            "lower = -200",
            "servo angle -20 to 260 deg; allowed: 0 to 360",
        ),
        ("xm430-w350", "xm430-w3500", "model = 'xm430-w3500': unknown; near: xm430"),
        ("pwm_limit = 100", "pwm_limit = 0", "pwm_limit = 0.0: .*allowed: 1.0 to 100"),
        ("baud = 1000000", "baud = 5", "baud = 5: .*allowed: 9600 to 4500000"),
        ("baud = 1000000", "", "missing: baud"),
        ("robot = ", "robt = ", "unknown key robt; did you mean robot"),
        ("[joints.left_hip_yaw]", "joints = 3\n[x]", "not a TOML file"),
        ("[joints.left_hip_yaw]", "joints.a = 3\n[joints.b]", "joints.a = 3: expected"),
        ("robot = ", "robot = [[[", "not a TOML file"),
    ],
)
def test_a_bad_value_is_named(line, instead, said):
    assert line in TEXT
    with pytest.raises(CalibrationError, match=said) as error:
        parse_calibration(TEXT.replace(line, instead, 1), "robot.toml")
    assert str(error.value).startswith("robot.toml: ")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("line", "instead", "said"),
    [
        ("id = 200", "id = 1", "id = 1 is that of left_hip_yaw, imu"),
        ("id = 200", "id = 253", "imu.id = 253: .*allowed .*: 0 to 252"),
        ("gyro_scale = 0.001", "gyro_scale = 0", "gyro_scale = 0: .*0.0 to 1000"),
        ("gyro = 38", "gyro = 42", "imu.accelerometer = 44: overlaps gyro = 42"),
        ("gyro = 38", 'axes = ["x", "y", "-z"]\ngyro = 38', "no right-handed set"),
        ("gyro = 38", 'axes = ["x", "y", "w"]\ngyro = 38', "allowed: 'x', '-x'"),
        ("gyro = 38", 'format = "int8"\ngyro = 38', "allowed: 'int16', 'float32'"),
        ("[imu]", "imu = 3\n[more]", "imu"),
    ],
)
def test_a_bad_imu_is_named(line, instead, said):
    with pytest.raises(CalibrationError, match=said):
        parse_calibration((TEXT + IMU_TEXT).replace(line, instead, 1), "robot.toml")


def test_an_imu_is_within_the_addresses_of_its_protocol():
    feetech = calibration_text(plain_calibration(RES, make="feetech"))
    last = IMU_TEXT.replace("= 44", "= 250")  # 6 bytes, the last at 255
    assert parse_calibration(feetech + last).imu.accelerometer == 250
    beyond = IMU_TEXT.replace("= 44", "= 251")
    said = r"imu\.accelerometer = 251: 6 bytes from there .* feetech .* 0 to 250"
    with pytest.raises(CalibrationError, match=said):
        parse_calibration(feetech + beyond, "robot.toml")
    assert parse_calibration(TEXT + beyond).imu.accelerometer == 251
    far = IMU_TEXT.replace("gyro = 38", "gyro = 254").replace("= 44", "= 38")
    with pytest.raises(CalibrationError, match=r"imu\.gyro = 254: 6 bytes"):
        parse_calibration(feetech + far)


@pytest.mark.parametrize(("format_", "size"), [("int16", 6), ("float32", 12)])
def test_what_may_be_asked_of_an_imu_comes_in_one_answer(format_, size):
    """The farthest that is allowed is heard; one further is refused."""
    calibration = msgspec.structs.replace(few(1), make="feetech")
    imu = msgspec.structs.replace(IMU, format=format_, gyro=1, accelerometer=249 - size)
    calibration = msgspec.structs.replace(calibration, imu=imu)
    check_calibration(calibration, "robot.toml")
    with patient_bus(), ServoBusEmulator.like(calibration) as bus:
        bus.bus.devices[imu.id].noise_factor = 0.0
        robot = ServoBackend(bus.port, calibration, ["a"], PATIENT_S)
        robot.connect(np.zeros(1))
        try:
            assert robot.read().acceleration == pytest.approx(
                [0.0, 0.0, 9.81], abs=0.01
            )
        finally:
            robot.close()
    further = msgspec.structs.replace(imu, gyro=0)
    said = f"{249 - size} after gyro = 0, .* allowed: {248 - size}$"
    with pytest.raises(CalibrationError, match=said):
        check_calibration(msgspec.structs.replace(calibration, imu=further), "x")


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"a = " + b"9" * 6000])
def test_what_is_no_calibration_is_refused(tmp_path, content):
    path = tmp_path / "robot.toml"
    path.write_bytes(content)
    with pytest.raises(CalibrationError, match=r"robot\.toml"):
        load_calibration(path)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(CalibrationError, match=r"none\.toml: No such file.*calibrate"):
        load_calibration(tmp_path / "none.toml")
    with pytest.raises(CalibrationError, match="cannot be written"):
        save_calibration(plain_calibration(RES), tmp_path / "no" / "robot.toml")


def test_another_robots_calibration_is_refused():
    other = msgspec.structs.replace(plain_calibration(RES), fingerprint="feed")
    with pytest.raises(CalibrationError, match=f"'feed'.*{RES.fingerprint}"):
        check_robot(other, RES, "robot.toml")


def test_missing_and_unknown_joints_are_named():
    plain = plain_calibration(RES)
    joints = dict(plain.joints)
    knee = joints.pop("left_knee")
    less = msgspec.structs.replace(plain, joints=joints)
    with pytest.raises(CalibrationError, match="left_knee missing; all 12 are needed"):
        check_robot(less, RES, "robot.toml")
    more = msgspec.structs.replace(plain, joints={**plain.joints, "left_kne": knee})
    with pytest.raises(CalibrationError, match=r"left_kne: no joint.*near: left_knee"):
        check_robot(more, RES, "robot.toml")
    check_joints(more, plain.joints, ["left_kne"])  # a joint that is held still


def test_a_plain_calibration_has_the_robots_limits():
    calibration = plain_calibration(RES)
    assert calibration.joint_names == RES.legs.joint_names
    upper = [joint.upper for joint in calibration.joints.values()]
    assert np.allclose(np.radians(upper), RES.legs.upper)
    assert parse_calibration(calibration_text(calibration)) == calibration
