"""ROS drives a walk: commands in, joint states and targets out."""

import contextlib
import json
import queue
import threading
import time

import msgspec
import numpy as np
import pytest
from patience import PATIENCE_S
from ros_peers import RosbridgeServer, free_port, until, zenoh_router

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros import PilotTopics, RosPilot
from gaitchain.backends.ros.messages import (
    Header,
    JointState,
    JointTrajectory,
    Time,
    Twist,
    TwistStamped,
    Vector3,
)
from gaitchain.backends.ros.rosbridge_link import RosbridgeLink
from gaitchain.backends.ros.zenoh_link import ZenohLink
from gaitchain.messages import Command

NOW_NS = 1_700_000_000_000_000_000
NAMES = ("hip", "knee")


class Loopback:
    """A link to the own process: what is published is kept, and can be said."""

    def __init__(self, mixes_types=True):
        self.mixes_types = mixes_types
        self.advertised, self.published, self.subscribed = {}, [], {}

    def advertise(self, topic, kind):
        self.advertised[topic] = kind

    def publish(self, topic, message):
        self.published.append((topic, message))

    def subscribe(self, topic, kind, callback):
        self.subscribed[topic, kind] = callback

    def health(self):
        return LinkHealth(len(self.published))


@pytest.fixture
def commands():
    return []


@pytest.fixture
def link():
    return Loopback()


@pytest.fixture
def pilot(link, commands):
    one = RosPilot(link, commands.append, clock=lambda: NOW_NS)
    one.say = lambda message: link.subscribed["/cmd_vel", type(message)](message)
    return one


def stamped(age_s, vx=0.2):
    stamp = Time.at(NOW_NS - round(age_s * 1e9))
    return TwistStamped(Header(stamp), Twist(Vector3(vx)))


def test_a_twist_is_a_command(pilot, commands):
    pilot.say(Twist(Vector3(0.3, -0.1, 7.0), Vector3(8.0, 9.0, 0.5)))
    assert commands == [Command(0.3, -0.1, 0.5)]
    assert pilot.ignored == 0


def test_down_is_a_crouch(pilot, commands):
    pilot.say(Twist(Vector3(0.3, 0.0, -0.05)))
    assert commands == [Command(0.3, crouch=0.05)]


def test_a_stamped_twist_is_a_command(pilot, commands):
    pilot.say(stamped(0.1))
    pilot.say(TwistStamped(twist=Twist(Vector3(0.4))))  # stamp 0: not said
    assert commands == [Command(0.2), Command(0.4)]


def test_commands_of_both_types_come_one_at_a_time(link):
    """Each type may have a thread of its own."""
    both, met = threading.Barrier(2), []

    def drive(command):
        with contextlib.suppress(threading.BrokenBarrierError):
            both.wait(0.2)  # the other one does not come
            met.append(command)

    RosPilot(link, drive, clock=lambda: NOW_NS)
    threads = [
        threading.Thread(target=link.subscribed["/cmd_vel", type(said)], args=[said])
        for said in (Twist(Vector3(0.3)), stamped(0.1))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert met == []


@pytest.mark.parametrize("age_s", [0.6, -0.6, NOW_NS * 1e-9 - 12.0])
def test_a_stale_command_is_ignored_and_said(pilot, commands, age_s):
    pilot.say(stamped(age_s))
    assert not commands
    assert pilot.ignored == 1
    pilot.say(stamped(age_s))
    assert pilot.ignored == 2
    assert pilot.health().note == (
        "commands on /cmd_vel are ignored: its stamp is "
        f"{age_s:.1f} s old, more than 0.5 s from this computer's clock"
    )
    pilot.say(stamped(0.0))
    assert commands == [Command(0.2)]
    assert pilot.ignored == 2
    assert pilot.health().note == ""


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", range(6))
def test_a_command_that_is_no_number_is_ignored_and_said(pilot, commands, bad, place):
    numbers = [0.1] * 6
    numbers[place] = bad
    twist = Twist(Vector3(*numbers[:3]), Vector3(*numbers[3:]))
    pilot.say(twist)
    pilot.say(TwistStamped(twist=twist))
    assert not commands
    assert pilot.ignored == 2
    assert "commands on /cmd_vel are ignored" in pilot.health().note
    assert "must be finite" in pilot.health().note


def test_a_link_with_one_type_per_topic_listens_as_told(commands):
    for is_stamped, kind in ((False, Twist), (True, TwistStamped)):
        link = Loopback(mixes_types=False)
        RosPilot(link, commands.append, stamped=is_stamped)
        assert list(link.subscribed) == [("/cmd_vel", kind)]


def test_a_robot_behind_ros_is_not_echoed(commands):
    link = Loopback()
    pilot = RosPilot(link, commands.append, topics=PilotTopics(state=None, target=None))
    zeros = np.zeros(2)
    pilot.publish(1, NAMES, position=zeros, velocity=zeros, effort=zeros, target=zeros)
    assert not link.advertised
    assert not link.published


def test_joints_and_targets_are_told(pilot, link):
    assert link.advertised == {
        "/joint_states": JointState,
        "/gaitchain/joint_trajectory": JointTrajectory,
    }
    values = [np.array([i + 0.1, i + 0.2]) for i in range(4)]
    names = ("position", "velocity", "effort", "target")
    pilot.publish(NOW_NS, NAMES, **dict(zip(names, values, strict=True)))
    (state_topic, state), (target_topic, target) = link.published
    assert state_topic == "/joint_states"
    assert target_topic == "/gaitchain/joint_trajectory"
    assert state.header.stamp.ns == NOW_NS
    assert state.name == target.joint_names == NAMES
    for ours, theirs in zip(
        values, (state.position, state.velocity, state.effort), strict=False
    ):
        assert theirs.tolist() == ours.tolist()
    assert target.points[0].positions.tolist() == values[3].tolist()


def test_targets_that_are_none_are_not_told(pilot, link):
    nan, zeros = np.full(2, np.nan), np.zeros(2)
    pilot.publish(NOW_NS, NAMES, position=zeros, velocity=zeros, effort=nan, target=nan)
    ((topic, state),) = link.published
    assert topic == "/joint_states"
    assert state.effort.tolist() == []


def drive(ours, theirs, message, stamped=False):
    """Publish what `message` returns until the pilot passes it on; return the pilot."""
    commands, twist = queue.Queue(), Twist(Vector3(0.3), Vector3(z=-0.5))
    pilot = RosPilot(ours, commands.put, stamped=stamped)

    def came():
        theirs.publish("/cmd_vel", message(twist))
        return not commands.empty()

    until(came)
    assert commands.get(timeout=PATIENCE_S) == Command(0.3, 0.0, -0.5)
    return pilot


def just_now(twist):
    return TwistStamped(Header(Time.at(time.time_ns())), twist)


def unchanged(twist):
    return twist


@pytest.mark.parametrize("message", [unchanged, just_now])
def test_both_twists_drive_over_zenoh(message):
    port = free_port()
    with zenoh_router(port):
        ours, theirs = (ZenohLink(f"tcp/127.0.0.1:{port}") for _ in range(2))
        states = queue.Queue()
        theirs.subscribe("/joint_states", JointState, states.put)
        pilot = drive(ours, theirs, message)
        angles = np.array([0.25, -0.5])
        told = dict.fromkeys(("position", "velocity", "effort", "target"), angles)

        def heard():
            pilot.publish(NOW_NS, NAMES, **told)
            return not states.empty()

        until(heard)
        read = states.get(timeout=PATIENCE_S)
        assert (read.name, read.position.tolist()) == (NAMES, [0.25, -0.5])
        assert pilot.health().note == ""
        pilot.close()
        theirs.close()
        assert pilot.health().note == "closed"


@pytest.mark.parametrize("message", [unchanged, just_now])
def test_a_rosbridge_drives(message):
    server = RosbridgeServer()
    ours, theirs = RosbridgeLink(server.url), RosbridgeLink(server.url)
    pilot = drive(ours, theirs, message, stamped=message is just_now)
    whole = json.dumps(msgspec.to_builtins(message(Twist())))
    # A rosbridge says null for NaN.
    server.tell("/cmd_vel", json.loads(whole, parse_float=lambda _: None))
    until(lambda: pilot.ignored)
    theirs.close()
    pilot.close()
    server.close()
