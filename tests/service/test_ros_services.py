"""Services and topics of the state for ROS, over real links."""

import threading
from collections import Counter
from xml.etree import ElementTree

import numpy as np
import pytest
import zenoh
from patience import PATIENCE_S
from ros_peers import (
    RosbridgeServer,
    free_port,
    say,
    until,
    zenoh_router,
    zenoh_session,
)
from telemetry_factory import told
from zenoh.ext import Int64, z_deserialize, z_serialize

from gaitchain.backends.base import LinkHealth
from gaitchain.backends.ros import cdr
from gaitchain.backends.ros import messages as ros
from gaitchain.backends.ros.rosbridge_link import RosbridgeLink
from gaitchain.backends.ros.zenoh_link import ZenohLink
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.live.messages import EmergencyStop, GetUp, Mode, Reset, Rest, Start, Stop
from gaitchain.service import ros_services
from gaitchain.service.ros_services import RosServices
from gaitchain.service.ros_state_topics import StateTopics
from gaitchain.walker.leg_odometry import LegOdometry

LIBRARY = load_library(shipped_library())
RES = LIBRARY.robot
HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"


class Kept:
    """A link to the own process."""

    mixes_types = True

    def __init__(self):
        self.latched, self.published, self.services = set(), [], {}

    def advertise(self, topic, kind, *, latched=False):
        if latched:
            self.latched.add(topic)

    def publish(self, topic, message):
        self.published.append((topic, message))

    def serve(self, service, answer):
        self.services[service] = answer

    def health(self):
        return LinkHealth()


class Loop:
    """A loop that does at once what is asked, or nothing."""

    def __init__(self, link, after):
        self.asked, self.after = [], after
        self.services = RosServices(link, self.ask, "ros")

    def ask(self, request):
        self.asked.append(request)
        for _ in range(5):
            self.services.take(told(RES, mode=self.after, reason="why"))
        return True


@pytest.mark.parametrize(
    ("name", "kind", "after"),
    [
        ("start", Start, Mode.RISING),
        ("stop", Stop, Mode.STANDING),
        ("stop", Stop, Mode.STOPPED),
        ("get_up", GetUp, Mode.GETTING_UP),
        ("rest", Rest, Mode.OFF),
        ("reset", Reset, Mode.OFF),
        ("emergency_stop", EmergencyStop, Mode.STOPPED),
    ],
)
def test_a_service_asks_and_says_what_became_of_it(name, kind, after):
    link = Kept()
    loop = Loop(link, after)
    answer = threaded(link.services[f"/gaitchain/{name}"], loop, after)
    assert loop.asked == [kind("ros")]
    assert answer == (True, f"{after}: why")


def threaded(call, loop, after):
    """Call as a link does, while telemetry goes on."""
    found = []
    thread = threading.Thread(target=lambda: found.append(call()))
    thread.start()
    while thread.is_alive():
        loop.services.take(told(RES, mode=after, reason="why"))
        thread.join(0.001)
    return found[0].success, found[0].message


def test_a_request_that_is_not_carried_out_is_no_success(monkeypatch):
    monkeypatch.setattr(ros_services, "WAIT_S", 0.05)
    link = Kept()
    loop = Loop(link, Mode.OFF)
    success, message = threaded(link.services["/gaitchain/start"], loop, Mode.OFF)
    assert not success
    assert "not carried out within 0.05 s; the robot is off: why" in message


class Deaf(Loop):
    """A loop that refuses, though the robot is in the mode that is asked for."""

    def ask(self, request):
        self.asked.append(request)
        self.say(f"push by ros refused: {WHY}")
        self.say(f"{ros_services.refusal(request)}{WHY}")
        return True

    def say(self, *refused):
        self.services.take(told(RES, mode=self.after, reason="", refused=refused))


WHY = "bob drives"


def test_who_is_refused_hears_why():
    link = Kept()
    loop = Deaf(link, Mode.WALKING)
    for _ in range(2):
        answer = threaded(link.services["/gaitchain/start"], loop, Mode.WALKING)
        assert answer == (False, "refused: bob drives")


class Slow(Deaf):
    """A loop that refuses once some rows of before have come."""

    def ask(self, request):
        for _ in range(20):
            self.say()
        return super().ask(request)


def test_who_is_in_that_mode_already_waits_for_a_refusal():
    link = Kept()
    loop = Slow(link, Mode.STANDING)
    loop.say()
    answer = threaded(link.services["/gaitchain/start"], loop, Mode.STANDING)
    assert answer == (False, "refused: bob drives")


def test_a_refusal_of_before_is_no_answer():
    link = Kept()
    loop = Loop(link, Mode.RISING)
    refused = (f"start by ros refused: {WHY}",)
    loop.services.take(told(RES, mode=Mode.OFF, reason="", refused=refused))
    answer = threaded(link.services["/gaitchain/start"], loop, Mode.RISING)
    assert answer == (True, "rising: why")


@pytest.mark.parametrize(
    ("name", "after"),
    [
        ("stop", Mode.GETTING_UP),
        ("get_up", Mode.STANDING),
        ("get_up", Mode.WALKING),
        ("get_up", Mode.RISING),  # as after a start
    ],
)
def test_what_goes_on_as_before_is_no_success(name, after, monkeypatch):
    monkeypatch.setattr(ros_services, "WAIT_S", 0.05)
    link = Kept()
    loop = Loop(link, after)
    success, message = threaded(link.services[f"/gaitchain/{name}"], loop, after)
    assert not success
    assert f"not carried out within 0.05 s; the robot is {after}" in message


def test_a_rosbridge_gets_the_answer():
    server = RosbridgeServer()
    link = RosbridgeLink(server.url)
    link.serve("/gaitchain/start", lambda: ros.TriggerResponse(True, "standing"))
    told_of = heard(server, "advertise_service")
    assert told_of["type"] == "std_srvs/srv/Trigger"
    say(
        server.connections[0],
        op="call_service",
        service="/gaitchain/start",
        id="7",
        args={},
    )
    answer = heard(server, "service_response")
    link.close()
    server.close()
    assert (answer["id"], answer["result"]) == ("7", True)
    assert answer["values"] == {"success": True, "message": "standing"}


def test_a_stop_waits_for_no_other_call():
    """Nor is it dropped for calls that come after it; who is dropped is told."""
    go_on, stopped = threading.Event(), threading.Event()

    def start():
        go_on.wait(PATIENCE_S)
        return ros.TriggerResponse(True, "standing")

    def stop():
        stopped.set()
        return ros.TriggerResponse(True, "stopped")

    server = RosbridgeServer()
    link = RosbridgeLink(server.url)
    link.serve("/gaitchain/start", start)
    link.serve("/gaitchain/emergency_stop", stop)
    for _ in range(2):
        heard(server, "advertise_service")
    for name in (*["start"] * 2, "emergency_stop", *["start"] * 9):
        service = f"/gaitchain/{name}"
        say(server.connections[0], op="call_service", service=service, id=name, args={})
    assert stopped.wait(PATIENCE_S), "behind a start that takes its time"
    by_id = {}
    while len(by_id) < 2:
        answer = heard(server, "service_response")
        by_id[answer["id"]] = answer["values"]
    go_on.set()
    link.close()
    server.close()
    assert by_id["emergency_stop"]["success"]
    assert by_id["start"] == {
        "success": False,
        "message": "too many calls at once; call again",
    }


def heard(server, op):
    while True:
        said = server.heard.get(timeout=PATIENCE_S)
        if said["op"] == op:
            return said


def test_a_client_of_rmw_zenoh_gets_the_answer():
    port = free_port()
    with zenoh_router(port):
        link = ZenohLink(f"tcp/127.0.0.1:{port}")
        link.serve("/gaitchain/stop", lambda: ros.TriggerResponse(False, "no"))
        peer = zenoh_session("client", connect=[f"tcp/127.0.0.1:{port}"])
        key = f"0/gaitchain/stop/std_srvs::srv::dds_::Trigger_/{HASH}"
        sent = z_serialize((Int64(5), Int64(1), bytes(range(16))))
        found = []

        def answered():
            request = b"\0\1\0\0\0"
            for reply in peer.get(key, payload=request, attachment=sent):
                if reply.ok is not None:
                    found.append(reply.ok)
            return found

        until(answered)
        tokens = [
            str(reply.ok.key_expr)
            for reply in peer.liveliness().get("@ros2_lv/**")
            if reply.ok is not None
        ]
        peer.close()
        link.close()
    # CDR by hand: false, padding, length of "no" and its end, "no".
    expected = b"\0\1\0\0" + b"\0\0\0\0" + b"\3\0\0\0no\0"
    assert found[0].payload.to_bytes().rstrip(b"\0") == expected.rstrip(b"\0")
    attached = z_deserialize(tuple[Int64, Int64, bytes], found[0].attachment)
    assert (attached[0], attached[2]) == (5, bytes(range(16)))
    assert any("/SS/" in t and t.split("/")[-3].endswith("Trigger_") for t in tokens)


def test_who_comes_late_gets_the_description():
    port = free_port()
    with zenoh_router(port):
        link = ZenohLink(f"tcp/127.0.0.1:{port}")
        StateTopics(link, RES, behind=False)
        until(lambda: link.health().sent == 1)
        peer = zenoh_session("client", connect=[f"tcp/127.0.0.1:{port}"])
        found = []

        def came():
            history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
            reader = zenoh.ext.declare_advanced_subscriber(
                peer,
                "0/robot_description/**",
                lambda s: found.append(s.payload.to_bytes()),
                history=history,
            )
            threading.Event().wait(0.1)
            reader.undeclare()
            return found

        until(came)
        peer.close()
        link.close()
    text = cdr.decode(ros.String, found[0]).data
    assert ElementTree.fromstring(text).get("name") == RES.name


def test_the_state_is_published():
    link = Kept()
    topics = StateTopics(link, RES, behind=False)
    place = LegOdometry(LIBRARY, 0.01).latest
    for i in range(11):
        state = told(RES, 0.01 * i, odometry=place, status="no IMU")
        topics.publish(state, LinkHealth(7, 2, "commands are ignored: NaN"), 3)
    count = {
        t: sum(t == other for other, _ in link.published) for t, _ in link.published
    }
    assert count == {
        "/robot_description": 1,
        "/imu/data": 11,
        "/tf": 6,
        "/odom": 6,
        "/diagnostics": 1,
    }
    assert link.latched == {"/robot_description"}
    (states,) = [m for t, m in link.published if t == "/diagnostics"]
    assert [s.level for s in states.status] == [0, 1, 0, 0, 1]
    assert states.status[1].message == "no IMU"
    assert states.status[4].name == "gaitchain: link to ROS"
    assert states.status[4].message == "commands are ignored: NaN"
    said = {v.key: v.value for v in states.status[4].values}
    assert said == {"sent": "7", "lost": "2", "ignored commands": "3"}
    for _, message in link.published:
        assert cdr.decode(type(message), cdr.encode(message)).type_name


@pytest.mark.parametrize("hz", [100, 250])
def test_the_rates_are_those_of_the_documentation_though_rows_are_late(hz):
    """50 Hz, and of the IMU that of a loop of 10 ms."""
    link, late_s = Kept(), np.random.default_rng(0).uniform(0.0, 1.5e-3, 4 * hz)
    topics = StateTopics(link, RES, behind=False)
    place = LegOdometry(LIBRARY, 0.01).latest
    for i, late in enumerate(late_s):
        topics.publish(told(RES, i / hz + late, odometry=place), LinkHealth(), 0)
    count = Counter(topic for topic, _ in link.published)
    assert count["/tf"] == count["/odom"] == pytest.approx(200, abs=1)
    assert count["/imu/data"] == pytest.approx(400, abs=1)


def test_a_robot_behind_ros_keeps_its_own_links_and_imu():
    link = Kept()
    topics = StateTopics(link, RES, behind=True)
    state = told(RES, odometry=LegOdometry(LIBRARY, 0.01).latest)
    topics.publish(state, LinkHealth(), 0)
    assert {t for t, _ in link.published} == {"/tf", "/odom", "/diagnostics"}
    (tree,) = [m for t, m in link.published if t == "/tf"]
    frames = [t.child_frame_id for t in tree.transforms]
    assert frames == ["base_link", "base_footprint"]
