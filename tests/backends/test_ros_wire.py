"""The bytes, names and words of ROS 2, against decoders and examples of others."""

import json
import struct
from contextlib import suppress

import numpy as np
import pytest
from mcap_ros2._dynamic import generate_dynamic

from gaitchain.backends.ros import cdr, rosbridge_json
from gaitchain.backends.ros.messages import (
    Duration,
    Header,
    Imu,
    JointState,
    JointTrajectory,
    Time,
    Twist,
    TwistStamped,
    Vector3,
)
from gaitchain.backends.ros.zenoh_names import (
    Node,
    Topic,
)
from gaitchain.errors import BackendError

VECTOR = """
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
TWIST = f"""
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
{VECTOR}"""
STAMPED = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""
JOINT_STATE = f"""
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{STAMPED}"""
TRAJECTORY = f"""
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint[] points
================================================================================
MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
{STAMPED}"""
CHATTER = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def read_by_mcap(message, definition):
    """Decode by another implementation of CDR, from the definition as text."""
    decoders = generate_dynamic(message.type_name, definition)
    return decoders[message.type_name](cdr.encode(message))


def state(n=3):
    return JointState(
        Header(Time.at(1_700_000_000_123_456_789), "trunk"),
        tuple(f"joint_{i}" * (i + 1) for i in range(n)),
        np.arange(n) * 0.5,
        np.arange(n) - 7.0,
        np.zeros(0),
    )


def test_another_decoder_reads_our_twist():
    read = read_by_mcap(Twist(Vector3(0.3, -0.1, 0.0), Vector3(0.0, 0.0, 0.5)), TWIST)
    assert (read.linear.x, read.linear.y, read.angular.z) == (0.3, -0.1, 0.5)


def test_a_twist_has_52_bytes():
    payload = cdr.encode(Twist(Vector3(1.0, 2.0, 3.0), Vector3(4.0, 5.0, 6.0)))
    assert payload == b"\0\1\0\0" + struct.pack("<6d", 1, 2, 3, 4, 5, 6)


def test_another_decoder_reads_our_joint_state():
    ours = state()
    read = read_by_mcap(ours, JOINT_STATE)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (
        1_700_000_000,
        123_456_789,
    )
    assert read.header.frame_id == "trunk"
    assert tuple(read.name) == ours.name
    assert list(read.position) == ours.position.tolist()
    assert list(read.velocity) == ours.velocity.tolist()
    assert list(read.effort) == []


def test_another_decoder_reads_our_trajectory():
    ours = JointTrajectory.reaching(("knee", "hip"), np.array([0.25, -1.0]), 0.01)
    read = read_by_mcap(ours, TRAJECTORY)
    assert list(read.joint_names) == ["knee", "hip"]
    (point,) = read.points
    assert list(point.positions) == [0.25, -1.0]
    assert not point.velocities
    assert not point.accelerations
    assert point.time_from_start.nanosec == 10_000_000
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (0, 0)


@pytest.mark.parametrize(
    "message",
    [
        TwistStamped(Header(Time.at(5), "x"), Twist(Vector3(1.0), Vector3(z=2.0))),
        state(),
        JointTrajectory.reaching(("a", "b"), np.array([1.0, 2.0]), 1.5),
        Imu(angular_velocity=Vector3(1.0, 2.0, 3.0)),
    ],
    ids=lambda m: m.type_name,
)
def test_what_is_written_is_read(message):
    payload = cdr.encode(message)
    assert cdr.encode(cdr.decode(type(message), payload)) == payload
    said = rosbridge_json.read(rosbridge_json.publish("/topic", message))
    assert cdr.encode(rosbridge_json.message(type(message), said)) == payload


def test_bytes_of_another_kind_are_refused_with_its_name():
    payload = cdr.encode(state())
    random = np.random.default_rng(1)
    for cut in range(0, len(payload), 3):
        with pytest.raises(BackendError, match="no sensor_msgs/msg/JointState"):
            cdr.decode(JointState, payload[:cut])
    for _ in range(300):
        with suppress(BackendError):  # and nothing else
            cdr.decode(JointState, b"\0\1\0\0" + random.bytes(40))


def test_hashes_are_those_of_ros():
    assert cdr.type_hash("geometry_msgs/msg/Twist").startswith("RIHS01_9c45bf16fe0983")
    # The example of rmw_zenoh's design document.
    assert cdr.type_hash("std_msgs/msg/String") == CHATTER


def test_names_are_those_of_the_design_document():
    node = Node(2, "8b20917502ee955ac4476e0266340d5c", "talker")
    chatter = Topic("/chatter", "std_msgs/msg/String", CHATTER)
    session = "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c"
    kind = f"std_msgs::msg::dds_::String_/{CHATTER}"
    assert node.key(chatter) == f"2/chatter/{kind}"
    assert node.token == f"{session}/0/0/NN/%/%/talker"
    assert (
        node.end_token(10, "MP", chatter)
        == f"{session}/0/10/MP/%/%/talker/%chatter/{kind}/::,10:,:,:,,"
    )
    below = Topic("/robot1/chatter", "std_msgs/msg/String", CHATTER)
    assert node.key(below) == f"2/robot1/chatter/{kind}"
    assert "/talker/%robot1%chatter/" in node.end_token(11, "MS", below)


def test_a_rosbridge_gets_every_field_of_a_header():
    """It would put its own time into a header that has no stamp."""
    ours = JointTrajectory.reaching(("knee",), np.array([0.5]), 0.01)
    said = json.loads(rosbridge_json.publish("/t", ours))
    assert said["op"] == "publish"
    assert said["msg"]["header"]["stamp"] == {"sec": 0, "nanosec": 0}
    assert said["msg"]["points"][0]["positions"] == [0.5]


@pytest.mark.parametrize("nothing", ["null", "NaN"])
def test_null_and_nan_of_a_rosbridge_are_not_known(nothing):
    """ros2_control publishes NaN for what a joint does not measure."""
    text = (
        '{"op": "publish", "topic": "/joint_states", "msg": {"name": ["knee"], '
        f'"position": [1], "velocity": [0.5], "effort": [{nothing}]}}}}'
    )
    read = rosbridge_json.message(JointState, rosbridge_json.read(text))
    assert read.position.tolist() == [1.0]
    assert np.isnan(read.effort).all()


@pytest.mark.parametrize(
    "text", ["", "[1]", '{"topic": "/x"}', '{"op": 3}', b"\xff\xfe\x00"]
)
def test_words_that_are_none_are_refused(text):
    with pytest.raises(BackendError, match="no message"):
        rosbridge_json.read(text)


@pytest.mark.parametrize("msg", [None, 3, {"linear": 3}, {"linear": {"x": "fast"}}])
def test_a_message_of_another_shape_is_refused(msg):
    said = rosbridge_json.Said("publish", "/cmd_vel", msg)
    with pytest.raises(BackendError, match="/cmd_vel is no geometry_msgs/msg/Twist"):
        rosbridge_json.message(Twist, said)


def test_times_are_split_as_ros_has_them():
    assert (Time.at(1_999_999_999).sec, Time.at(1_999_999_999).nanosec) == (
        1,
        999_999_999,
    )
    assert Time.at(1_700_000_000_123_456_789).ns == 1_700_000_000_123_456_789
    assert (Duration.of(1.25).sec, Duration.of(1.25).nanosec) == (1, 250_000_000)
    assert Duration.of(0.01).nanosec == 10_000_000
