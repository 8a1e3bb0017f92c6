"""Links through a rosbridge: a real WebSocket server on loopback."""

import json
import queue
import threading

import numpy as np
import pytest
from patience import PATIENCE_S
from ros_peers import RosbridgeServer, free_port, say, until
from websockets.sync.server import serve

from gaitchain.backends.ros import open_link
from gaitchain.backends.ros.messages import (
    JointState,
    JointTrajectory,
    Path,
    Twist,
    TwistStamped,
    Vector3,
)
from gaitchain.backends.ros.rosbridge_link import RosbridgeLink
from gaitchain.errors import CommandError


@pytest.fixture
def server():
    one = RosbridgeServer()
    yield one
    one.close()


@pytest.fixture
def link(server):
    one = open_link(server.url)
    until(lambda: not one.health().note)  # a loaded machine connects late
    yield one
    one.close()


def test_a_subscriber_gets_what_is_published(server, link):
    heard = queue.Queue()
    link.subscribe("/cmd_vel", Twist, heard.put)
    said = server.wait("subscribe", "/cmd_vel")
    assert said["type"] == "geometry_msgs/msg/Twist"
    other = RosbridgeLink(server.url)
    other.publish("/cmd_vel", Twist(Vector3(0.3), Vector3(z=-0.5)))
    read = heard.get(timeout=PATIENCE_S)
    other.close()
    assert isinstance(read, Twist)
    assert (read.linear.x, read.angular.z) == (0.3, -0.5)


def test_a_topic_is_advertised_once_before_it_is_published(server, link):
    trajectory = JointTrajectory.reaching(("knee",), np.array([0.5]), 0.01)
    for _ in range(3):
        link.publish("/t", trajectory)
    said = [server.heard.get(timeout=PATIENCE_S) for _ in range(4)]
    assert [one["op"] for one in said] == ["advertise", *["publish"] * 3]
    assert said[0]["type"] == "trajectory_msgs/msg/JointTrajectory"
    assert said[1]["msg"]["joint_names"] == ["knee"]
    assert said[1]["msg"]["points"][0]["time_from_start"]["nanosec"] == 10_000_000


def test_it_connects_again_and_says_everything_again():
    port, heard = free_port(), queue.Queue()
    link = RosbridgeLink(f"ws://127.0.0.1:{port}")
    link.subscribe("/cmd_vel", Twist, heard.put)
    link.advertise("/joint_states", JointState)
    until(lambda: f"no rosbridge at ws://127.0.0.1:{port}" in link.health().note)
    for speed in (1.0, 2.0):
        server = RosbridgeServer(port)
        server.wait("advertise", "/joint_states")
        assert link.health().note == ""
        server.tell("/cmd_vel", {"linear": {"x": speed}})
        assert heard.get(timeout=PATIENCE_S).linear.x == speed
        server.close()
        until(lambda: link.health().note)
    link.close()


def test_what_nobody_can_take_is_lost_and_counted():
    link = RosbridgeLink(f"ws://127.0.0.1:{free_port()}")
    for _ in range(1000):
        link.publish("/cmd_vel", Twist())
    until(lambda: link.health().lost == 1000)
    assert link.health().sent == 1000
    link.close()
    link.publish("/cmd_vel", Twist())
    assert link.health().lost == 1001
    assert link.health().note == "closed"


def test_a_server_that_takes_nothing_holds_nobody_up_and_is_given_up():
    """It answers the handshake and then reads no more, as a process that hangs."""
    go_on, connections = threading.Event(), queue.Queue()

    def hang(connection):
        connections.put(connection)
        go_on.wait(PATIENCE_S)

    with serve(hang, "127.0.0.1", 0, close_timeout=0.1, max_queue=1) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        port = server.socket.getsockname()[1]
        link = RosbridgeLink(f"ws://127.0.0.1:{port}", stall_s=0.2)
        connections.get(timeout=PATIENCE_S)
        large = JointState(position=np.full(50_000, 0.123456789))

        def stalls():
            link.publish("/joint_states", large)
            return link.health().lost > 8

        until(stalls)
        connections.get(timeout=PATIENCE_S)  # it hung up, and tries again
        link.close()
        go_on.set()
        server.shutdown()
        thread.join(PATIENCE_S)
    assert link.health().sent > link.health().lost > 0


def test_one_topic_carries_one_type(link):
    link.subscribe("/cmd_vel", Twist, print)
    with pytest.raises(CommandError, match="one type per topic, zenoh both"):
        link.subscribe("/cmd_vel", TwistStamped, print)
    link.publish("/out", Twist())
    with pytest.raises(CommandError, match="/out is geometry_msgs/msg/Twist"):
        link.publish("/out", TwistStamped())


def test_a_complaint_of_the_server_is_passed_on(server, link):
    server.types["/cmd_vel"] = "geometry_msgs/msg/TwistStamped"
    link.subscribe("/cmd_vel", Twist, print)
    until(lambda: link.health().note)
    assert link.health().note == (
        "rosbridge: /cmd_vel is geometry_msgs/msg/TwistStamped"
    )


def test_nonsense_is_said_and_survived(server, link):
    heard = queue.Queue()
    link.subscribe("/cmd_vel", Twist, heard.put)
    server.wait("subscribe", "/cmd_vel")
    server.connections[0].send("nonsense")
    server.connections[0].send(b"\xff\x00")
    say(server.connections[0], op="publish", topic="/cmd_vel", msg={"linear": 3})
    until(lambda: "/cmd_vel is no geometry_msgs/msg/Twist" in link.health().note)
    server.tell("/cmd_vel", {"linear": {"x": 0.5}})
    assert heard.get(timeout=PATIENCE_S).linear.x == 0.5
    assert link.health().note == ""


def said_on_s(message):
    return f'{{"op": "publish", "topic": "/s", "msg": {message}}}'


@pytest.mark.parametrize(
    "text",
    [
        said_on_s('{"position": [1' + "0" * 400 + "]}"),
        said_on_s("[" * 950 + "1" + "]" * 950),
        "[" * 100_000,
    ],
    ids=["beyond doubles", "nested", "nested deeply"],
)
def test_a_message_that_is_too_much_is_said_and_survived(server, link, text):
    heard = queue.Queue()
    link.subscribe("/s", JointState, heard.put)
    server.wait("subscribe", "/s")
    server.connections[0].send(text)
    until(lambda: link.health().note.startswith("rosbridge"))
    server.tell("/s", {"position": [0.5]})
    assert heard.get(timeout=PATIENCE_S).position.tolist() == [0.5]
    assert link.health().note == ""


def test_a_path_of_two_megabytes_is_heard_and_ends_no_connection(server, link):
    heard = queue.Queue()
    link.subscribe("/plan", Path, heard.put)
    server.wait("subscribe", "/plan")
    pose = {"position": {"x": 0.123456789012345, "y": 0.0, "z": 0.0}}
    server.tell("/plan", {"poses": 25_000 * [{"pose": pose}]})
    assert len(heard.get(timeout=PATIENCE_S).poses) == 25_000
    assert len(server.connections) == 1


def test_a_host_that_no_socket_takes_is_refused():
    with pytest.raises(CommandError, match="a URL such as ws://localhost:9090 works"):
        RosbridgeLink("ws://robot..local:9090")


def test_whatever_ends_a_connection_the_link_goes_on(server, link, monkeypatch, caplog):
    heard = queue.Queue()
    link.subscribe("/cmd_vel", Twist, heard.put)
    server.wait("subscribe", "/cmd_vel")
    with monkeypatch.context() as patch:
        patch.setattr(link, "_take", lambda text: 1 / 0)
        server.tell("/cmd_vel", {})
        until(lambda: "connecting anew" in caplog.text)
    server.wait("subscribe", "/cmd_vel")
    server.tell("/cmd_vel", {"linear": {"x": 0.5}})
    assert heard.get(timeout=PATIENCE_S).linear.x == 0.5


def test_words_of_no_interest_are_passed_over(server, link):
    heard = queue.Queue()
    link.subscribe("/cmd_vel", Twist, heard.put)
    server.wait("subscribe", "/cmd_vel")
    for said in ({"op": "service_response", "id": "x", "values": {}}, {"op": "png"}):
        server.connections[0].send(json.dumps(said))
    server.tell("/cmd_vel", {})
    assert heard.get(timeout=PATIENCE_S).linear.x == 0.0
    assert link.health().note == ""


def test_a_message_that_cannot_be_written_ends_nothing(server, link, caplog):
    def lost():
        link.publish("/cmd_vel", Twist(linear=object()))
        return "ros-rosbridge-send: lost" in caplog.text

    until(lost)  # what a loaded machine's connection drops is not logged
    link.publish("/cmd_vel", Twist(Vector3(0.5)))
    assert server.wait("publish", "/cmd_vel")["msg"]["linear"]["x"] == 0.5
    assert link.health().lost >= 1
