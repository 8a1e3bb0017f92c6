"""A robot behind ROS: both links, a controller of ros2_control at the other end."""

import queue
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from patience import PATIENCE_S
from ros_peers import RosbridgeServer, free_port, until, zenoh_router

from gaitchain.backends.base import Backend
from gaitchain.backends.ros import RobotTopics, RosBackend, RosEffortBackend
from gaitchain.backends.ros.messages import (
    Header,
    Imu,
    JointState,
    JointTrajectory,
    Time,
    Vector3,
)
from gaitchain.backends.ros.rosbridge_json import message, read
from gaitchain.backends.ros.rosbridge_link import RosbridgeLink
from gaitchain.backends.ros.zenoh_link import ZenohLink
from gaitchain.errors import BackendError
from gaitchain.messages import MotorTargets

NAMES = ("left_knee", "right_knee", "left_hip")
TRAJECTORY = "/joint_trajectory_controller/joint_trajectory"
MINUS_ONE = np.array([-1.0] + 8 * [0.0])


@pytest.fixture(scope="module")
def zenoh_endpoint():
    port = free_port()
    with zenoh_router(port):
        yield f"tcp/127.0.0.1:{port}"


@pytest.fixture(scope="module")
def rosbridge():
    server = RosbridgeServer()
    yield server.url
    server.close()


_domains = count(1)


@pytest.fixture
def links(request):
    """Ours and the robot's; through the rosbridge unless a test asks for both."""
    if getattr(request, "param", "rosbridge") == "zenoh":
        endpoint, domain = request.getfixturevalue("zenoh_endpoint"), next(_domains)
        pair = [ZenohLink(endpoint, domain=domain) for _ in range(2)]
    else:
        url = request.getfixturevalue("rosbridge")
        pair = [RosbridgeLink(url) for _ in range(2)]
    yield pair
    for link in pair:
        link.close()


over_both = pytest.mark.parametrize("links", ["zenoh", "rosbridge"], indirect=True)


class Robot:
    """Joints that are where the last trajectory ends, in another order, and a neck."""

    def __init__(self, link, joints):
        self.link, self.joints = link, dict(joints)
        self.heard = queue.Queue()
        link.subscribe(TRAJECTORY, JointTrajectory, self._move)

    def _move(self, message):
        for name, angle in zip(
            message.joint_names, message.points[0].positions, strict=True
        ):
            self.joints[name] = float(angle)
        self.heard.put(message)

    def tell(self, stamp_ns=0):
        names = tuple(reversed(self.joints))
        self.link.publish(
            "/joint_states",
            JointState(
                Header(Time.at(stamp_ns)),
                (*names, "neck"),
                np.array([*(self.joints[n] for n in names), 9.0]),
                np.array([*(0.5 * self.joints[n] for n in names), 9.0]),
                np.array([*(10.0 * self.joints[n] for n in names), 9.0]),
            ),
        )

    def turn(self, **fields):
        imu = Imu(
            angular_velocity=Vector3(0.1, 0.2, 0.3),
            linear_acceleration=Vector3(0.0, 0.5, 9.8),
            **fields,
        )
        self.link.publish("/imu/data", imu)


@pytest.fixture
def robot(links):
    return Robot(links[1], {"left_knee": 0.1, "right_knee": 0.2, "left_hip": 0.3})


@pytest.fixture
def backend(links, robot):
    """One that hears the robot's joints and IMU."""
    one: Backend = RosBackend(links[0], NAMES, 0.01, clock=lambda: one.now)
    one.now = 5.0

    def heard():
        robot.tell()
        robot.turn()
        return one.has_imu and not one.health().note.startswith("nothing came")

    until(heard)
    one.connect(np.zeros(3))
    yield one
    one.close()


def test_it_may_be_a_real_robot(backend):
    assert backend.physical
    assert backend.has_imu


@over_both
def test_joints_are_read_by_name(backend):
    sensors = backend.read()
    assert sensors.time == 5.0
    assert sensors.joint_position.tolist() == [0.1, 0.2, 0.3]
    assert sensors.joint_velocity.tolist() == [0.05, 0.1, 0.15]
    assert backend.loads().tolist() == [1.0, 2.0, 3.0]
    assert sensors.angular_velocity.tolist() == [0.1, 0.2, 0.3]
    assert sensors.acceleration.tolist() == [0.0, 0.5, 9.8]


@over_both
def test_it_holds_what_is_measured_then_sends_targets(backend, robot):
    backend.write(np.array([1.0, 1.0, 1.0]))  # not engaged: to nobody
    backend.engage()
    hold = robot.heard.get(timeout=PATIENCE_S)
    assert hold.joint_names == NAMES
    assert hold.points[0].positions.tolist() == [0.1, 0.2, 0.3]
    backend.write(np.array([0.4, 0.5, 0.6]))
    move = robot.heard.get(timeout=PATIENCE_S)
    (point,) = move.points
    assert point.positions.tolist() == [0.4, 0.5, 0.6]
    assert point.time_from_start.nanosec == 10_000_000
    assert len(point.velocities) == 0
    assert move.header.stamp.ns == 0

    def moved():
        robot.tell()
        return backend.read().joint_position[0] == 0.4

    until(moved)
    assert backend.read().joint_position.tolist() == [0.4, 0.5, 0.6]
    assert backend.health().note == ""


@over_both
def test_efforts_go_where_the_controller_takes_them(links, robot):
    """The law of a driver that damps towards rest: all of it in position and effort."""
    driven = RosEffortBackend(links[0], NAMES, 0.01, clock=lambda: 5.0)

    def heard():
        robot.tell()
        return not driven.health().note.startswith("nothing came")

    until(heard)
    driven.connect(np.zeros(3))
    driven.engage()
    assert robot.heard.get(timeout=PATIENCE_S).points[0].effort.tolist() == [0.0] * 3
    driven.write(np.array([0.4, 0.5, 0.6]))
    point = robot.heard.get(timeout=PATIENCE_S).points[0]
    assert point.positions.tolist() == [0.4, 0.5, 0.6]
    assert point.effort.tolist() == [0.0] * 3
    targets = MotorTargets(
        position=np.array([0.1, 0.2, 0.3]),
        velocity=np.array([2.0, -1.0, 0.0]),
        torque=np.array([5.0, 6.0, 0.0]),
        stiffness=np.array([80.0, 80.0, np.nan]),
        damping=np.array([1.5, 3.0, np.nan]),  # the last one is no joint of a leg
    )
    driven.drive(targets)
    point = robot.heard.get(timeout=PATIENCE_S).points[0]
    assert point.positions.tolist() == [0.1, 0.2, 0.3]
    assert point.effort.tolist() == [8.0, 3.0, 0.0]
    with pytest.raises(BackendError, match="target of right_knee is nan"):
        driven.drive(replace(targets, torque=np.array([0.0, np.nan, 0.0])))
    driven.release()  # as an emergency stop does: no torque of the last stride stays
    point = robot.heard.get(timeout=PATIENCE_S).points[0]
    assert point.positions.tolist() == [0.1, 0.2, 0.3]
    assert point.effort.tolist() == [0.0] * 3
    sent = driven.health().sent
    driven.release()
    driven.close()
    assert driven.health().sent == sent


def test_a_released_robot_is_sent_nothing(backend, robot):
    backend.engage()
    robot.heard.get(timeout=PATIENCE_S)
    assert not backend.health().holds
    backend.release()
    sent = backend.health().sent
    backend.write(np.ones(3))
    assert backend.health().sent == sent
    assert backend.health().note == (
        "nothing is published; the controller holds its last target"
    )
    assert backend.health().holds


def test_time_stands_still_when_the_robot_is_silent(backend):
    backend.engage()

    def silent():
        backend.now += 1.5
        return backend.health().note == "/joint_states silent for 1.5 s"

    until(silent)
    assert backend.read().time == backend.now - 1.5


@pytest.mark.parametrize("bad", ["null", "NaN", "Infinity"])
def test_a_sample_of_the_imu_with_a_gap_counts_as_lost(backend, bad):
    """The one before stands in, as where a message is lost, until it is too old."""
    known = backend.read()
    text = (
        '{"op": "publish", "topic": "/imu/data", "msg": {"angular_velocity": {"x": 5.0,'
        f' "y": {bad}, "z": 5.0}}, "linear_acceleration": {{"x": 1, "y": 2, "z": 3}}'
        "}}"
    )
    backend._on_imu(message(Imu, read(text)))
    np.testing.assert_array_equal(
        backend.read().angular_velocity, known.angular_velocity
    )
    np.testing.assert_array_equal(backend.read().acceleration, known.acceleration)


def test_an_imu_that_falls_silent_is_nan(backend, robot):
    def silent():
        backend.now += 0.2
        robot.tell()
        return np.isnan(backend.read().angular_velocity).all()

    until(silent)
    assert np.isnan(backend.read().acceleration).all()
    assert backend.has_imu


def test_a_joint_that_is_not_told_any_more_is_named(backend, robot):
    del robot.joints["right_knee"]

    def silent():
        backend.now += 0.2
        robot.tell()
        missing = np.isnan(backend.read().joint_position).tolist()
        return missing == [False, True, False]

    until(silent)
    until(lambda: not backend.health().note.startswith("/joint_states silent"))
    assert backend.health().note == "right_knee not in /joint_states"
    with pytest.raises(BackendError, match="no position of right_knee"):
        backend.engage()


def test_joints_that_fall_silent_while_it_is_engaged_are_no_targets(backend):
    """Another publisher says where one joint is, just as all of them were looked at."""
    sent, clock = backend.health().sent, backend._clock

    def later():
        backend._clock, backend.now = clock, backend.now + 0.3
        backend._on_state(JointState(name=NAMES[:1], position=np.zeros(1)))
        return backend.now

    backend._clock = later
    with pytest.raises(BackendError, match=r"0\.3 s old"):
        backend.engage()
    assert backend.health().sent == sent


def test_a_target_that_is_no_number_is_refused(backend):
    backend.engage()
    sent = backend.health().sent
    with pytest.raises(BackendError, match="target of left_hip is nan rad"):
        backend.write(np.array([0.0, 0.0, np.nan]))
    assert backend.health().sent == sent


def test_a_closed_backend_sends_nothing(backend):
    backend.engage()
    backend.close()
    backend.close()
    with pytest.raises(BackendError, match="closed"):
        backend.write(np.zeros(3))


def test_without_an_imu_the_robot_rests(links, robot):
    backend = RosBackend(links[0], NAMES, 0.01, timeout_s=0.01, clock=lambda: 5.0)

    def heard():
        robot.tell()
        robot.turn(angular_velocity_covariance=MINUS_ONE)
        robot.turn(linear_acceleration_covariance=MINUS_ONE)
        return not backend.health().note.startswith("nothing came")

    until(heard)
    backend.connect(np.zeros(3))
    assert not backend.has_imu
    assert backend.read().angular_velocity.tolist() == [0.0, 0.0, 0.0]
    assert backend.read().acceleration.tolist() == [0.0, 0.0, 9.81]
    waited = []
    backend._imu_came.wait = waited.append
    backend.connect(np.zeros(3))  # by a reset, in a control loop
    assert waited == [0.0]


def test_a_silent_robot_is_an_error_that_names_the_topic(links):
    backend = RosBackend(
        links[0],
        NAMES,
        0.01,
        topics=RobotTopics(state="/robot1/joint_states"),
        timeout_s=0.01,
    )
    words = "nothing came on /robot1/joint_states within 0.01 s"
    for act in (lambda: backend.connect(np.zeros(3)), backend.read):
        with pytest.raises(BackendError, match=words):
            act()
    with pytest.raises(BackendError, match="left_knee, right_knee, left_hip"):
        backend.engage()
    assert words in backend.health().note


def test_a_robot_that_fell_silent_is_not_connected_again(backend, robot):
    """By a reset, in a control loop, which must not stand still for long."""
    robot.joints["left_knee"] = 0.7
    robot.tell()
    until(lambda: backend.read().joint_position[0] == 0.7)  # nothing is on its way
    backend.now += 300.0
    waited, wait = [], backend._state_came.wait
    backend._state_came.wait = lambda s: waited.append(s) or wait(s)
    with pytest.raises(BackendError, match=r"nothing came on .* within 0\.4 s"):
        backend.connect(np.zeros(3))
    assert waited == [0.4]
    assert "nothing came" in backend.health().note

    def heard():
        robot.tell()
        return not backend.health().note.startswith("nothing came")

    until(heard)
    backend.connect(np.zeros(3))
    assert backend.read().time == backend.now


def test_another_robot_is_an_error_that_names_both(links, robot):
    backend = RosBackend(links[0], ["elbow"], 0.01, timeout_s=0.01)

    def heard():
        robot.tell()
        return "none of elbow" in backend.health().note

    until(heard)
    with pytest.raises(BackendError, match=r"left_hip.*neck, none of elbow"):
        backend.connect(np.zeros(3))


def test_an_unreachable_network_is_part_of_the_error():
    link = RosbridgeLink(f"ws://127.0.0.1:{free_port()}")
    backend = RosBackend(link, NAMES, 0.01, timeout_s=0.01)
    with pytest.raises(BackendError, match=r"/joint_states.*no rosbridge at"):
        backend.connect(np.zeros(3))
    backend.close()
