"""Links over Zenoh: real peers and a real router on loopback, no multicast."""

import queue
import socket
import struct
import subprocess
import sys
import threading
import zlib

import pytest
from patience import PATIENCE_S
from ros_peers import free_port, until, zenoh_router, zenoh_session

from gaitchain.backends.ros import cdr, check_link, open_link
from gaitchain.backends.ros.messages import Header, Time, Twist, TwistStamped, Vector3
from gaitchain.backends.ros.zenoh_link import ZenohLink
from gaitchain.errors import BackendError, CommandError, MissingExtraError

TWIST = "geometry_msgs::msg::dds_::Twist_"


@pytest.fixture(scope="module")
def endpoint():
    """Of a router; tests are kept apart by their domains."""
    port = free_port()
    with zenoh_router(port):
        yield f"tcp/127.0.0.1:{port}"


@pytest.fixture
def domain(request, endpoint):
    return zlib.crc32(request.node.name.encode()) % 233


@pytest.fixture
def link(endpoint, domain):
    """Factory of links, all closed at the end."""
    made = []

    def make(**options):
        options = {"endpoint": endpoint, "domain": domain} | options
        made.append(ZenohLink(**options))
        return made[-1]

    yield make
    for one in made:
        one.close()


def received(subscriber, publisher, topic, *messages):
    """Publish until something comes, and return it; a route takes a moment to be."""
    heard = queue.Queue()
    subscriber.subscribe(topic, type(messages[0]), heard.put)

    def came():
        for message in messages:
            publisher.publish(topic, message)
        return not heard.empty()

    until(came)
    return heard.get(timeout=PATIENCE_S)


def test_a_twist_goes_from_peer_to_peer(link):
    read = received(link(), link(), "/cmd_vel", Twist(Vector3(0.3), Vector3(z=-0.5)))
    assert (read.linear.x, read.angular.z) == (0.3, -0.5)


def test_one_topic_carries_both_twists(link):
    ours, theirs = link(), link()
    stamped = TwistStamped(Header(Time.at(3)), Twist(Vector3(0.1)))
    assert received(ours, theirs, "/cmd_vel", Twist(Vector3(0.2))).linear.x == 0.2
    read = received(ours, theirs, "/cmd_vel", stamped)
    assert (read.header.stamp.ns, read.twist.linear.x) == (3, 0.1)


def test_domains_do_not_hear_each_other(domain, link):
    ours, theirs, other = link(), link(), link(domain=(domain + 1) % 233)
    wrong = queue.Queue()
    other.subscribe("/cmd_vel", Twist, wrong.put)
    received(ours, theirs, "/cmd_vel", Twist())
    assert wrong.empty()


def test_a_message_is_what_rmw_zenoh_expects(endpoint, domain, link):
    """Key, bytes and attachment, as a subscriber that is not ours gets them."""
    samples = queue.Queue()
    with zenoh_session("peer", connect=[endpoint]) as session:
        held = session.declare_subscriber(f"{domain}/cmd_vel/{TWIST}/*", samples.put)
        ours, twist = link(), Twist(Vector3(1.0))

        def came():
            ours.publish("/cmd_vel", twist)
            return samples.qsize() > 1

        until(came)
        first, second = samples.get(), samples.get()
        del held
    hash_ = cdr.type_hash("geometry_msgs/msg/Twist")
    assert str(first.key_expr) == f"{domain}/cmd_vel/{TWIST}/{hash_}"
    assert first.payload.to_bytes() == cdr.encode(twist)
    layout = struct.Struct("<qqB16s")  # sequence, time, and an array of 16 bytes
    sequence, stamp_ns, size, gid = layout.unpack(first.attachment.to_bytes())
    after = layout.unpack(second.attachment.to_bytes())
    assert size == 16
    assert (after[0], after[3]) == (sequence + 1, gid)
    assert after[1] >= stamp_ns > 1_600_000_000 * 10**9


def test_the_graph_shows_node_publishers_and_subscribers(endpoint, domain, link):
    """What `ros2 node list` and `ros2 topic list` are made of."""
    ours = link(node="walker")
    ours.advertise("/joint_states", Twist)
    ours.subscribe("/cmd_vel", Twist, print)
    ours.subscribe("/cmd_vel", TwistStamped, print)
    with zenoh_session("peer", connect=[endpoint]) as session:
        tokens = set()

        def came():
            for reply in session.liveliness().get(f"@ros2_lv/{domain}/**"):
                tokens.add(str(reply.ok.key_expr))
            return len(tokens) == 4

        until(came)
    split = sorted(token.split("/") for token in tokens)
    assert len({parts[2] for parts in split}) == 1  # one session
    assert all(parts[6:9] == ["%", "%", "walker"] for parts in split)
    assert len({parts[4] for parts in split}) == 4  # each end has its own number
    ends = {(parts[5], *parts[9:11]) for parts in split}
    assert ends == {
        ("NN",),
        ("MP", "%joint_states", TWIST),
        ("MS", "%cmd_vel", TWIST),
        ("MS", "%cmd_vel", "geometry_msgs::msg::dds_::TwistStamped_"),
    }


def test_a_closed_link_leaves_the_graph(endpoint, domain, link):
    gone = queue.Queue()
    with zenoh_session("peer", connect=[endpoint]) as session:
        held = session.liveliness().declare_subscriber(
            f"@ros2_lv/{domain}/**",
            lambda sample: gone.put(str(sample.kind)),
            history=True,
        )
        ours = link()
        assert gone.get(timeout=PATIENCE_S).endswith("PUT")
        ours.close()
        assert gone.get(timeout=PATIENCE_S).endswith("DELETE")
        del held


def test_the_router_may_come_later_and_come_back(link):
    port = free_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    ours, theirs = link(endpoint=endpoint), link(endpoint=endpoint)
    assert f"no Zenoh router at {endpoint}" in ours.health().note
    for _ in range(2):
        with zenoh_router(port):
            until(lambda: ours.health().note == "" == theirs.health().note)
            assert received(ours, theirs, "/cmd_vel", Twist(Vector3(0.1)))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="has only one loopback address")
def test_nodes_of_another_computer_are_met_through_its_router(domain, link):
    """As far as one computer can tell: by an address that is none of its usual ones."""
    port = free_port()
    here, there = (f"tcp/127.0.0.{i}:{port}" for i in (1, 2))
    with pytest.raises(BackendError, match=f"no Zenoh router at {there}.*Timeout!\\)$"):
        link(endpoint=there)
    with zenoh_session("router", listen=[here, there]):
        node, ours = link(endpoint=here), link(endpoint=there)
        assert received(ours, node, "/joint_states", Twist(Vector3(0.4)))
        assert received(node, ours, "/cmd_vel", Twist(Vector3(0.4)))


def test_bytes_that_are_no_message_are_said_and_survived(endpoint, domain, link):
    ours, heard = link(), queue.Queue()
    ours.subscribe("/cmd_vel", Twist, heard.put)
    key = f"{domain}/cmd_vel/{TWIST}/{cdr.type_hash('geometry_msgs/msg/Twist')}"
    with zenoh_session("peer", connect=[endpoint]) as session:

        def told(payload, true):
            session.put(key, payload)
            return true()

        until(lambda: told(b"nonsense", lambda: ours.health().note))
        assert "8 bytes are no geometry_msgs/msg/Twist" in ours.health().note
        until(lambda: told(cdr.encode(Twist()), lambda: not heard.empty()))
    assert ours.health().note == ""


def test_a_subscriber_that_fails_is_logged_and_called_again(link, caplog):
    ours, theirs, calls = link(), link(), []

    def fail(message):
        calls.append(message)
        raise ZeroDivisionError

    ours.subscribe("/cmd_vel", Twist, fail)

    def came():
        theirs.publish("/cmd_vel", Twist())
        return len(calls) > 1

    until(came)
    assert "the subscriber of /cmd_vel failed" in caplog.text


def test_a_subscriber_that_hangs_holds_nobody_up(link):
    ours, theirs, go_on = link(), link(), threading.Event()
    hangs = queue.Queue()

    def hang(message):
        hangs.put(message)
        go_on.wait(PATIENCE_S)

    ours.subscribe("/cmd_vel", Twist, hang)

    def came():
        theirs.publish("/cmd_vel", Twist())
        return not hangs.empty()

    until(came)
    for _ in range(5000):
        theirs.publish("/cmd_vel", Twist())
    assert not go_on.is_set()
    health = theirs.health()
    assert health.sent > 5000
    go_on.set()


def test_a_router_that_says_nothing_holds_nobody_up():
    """A socket that accepts and is silent, as of a computer that hangs."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        link = ZenohLink(f"tcp/127.0.0.1:{silent.getsockname()[1]}")
        for _ in range(1000):
            link.publish("/cmd_vel", Twist())
        health = link.health()
        link.close()
    assert health.sent == 1000
    assert "no Zenoh router" in health.note
    assert link.health().note == "closed"
    link.publish("/cmd_vel", Twist())
    assert link.health().lost >= 1


def test_a_process_that_forgets_to_close_ends(endpoint, domain, link):
    code = (
        "from gaitchain.backends.ros.messages import Twist\n"
        "from gaitchain.backends.ros.zenoh_link import ZenohLink\n"
        "import threading\n"
        f"link, came = ZenohLink({endpoint!r}, domain={domain}), threading.Event()\n"
        "link.subscribe('/cmd_vel', Twist, lambda _: came.set())\n"
        f"raise SystemExit(0 if came.wait({PATIENCE_S}) else 'nothing came')\n"
    )
    ours = link()
    with subprocess.Popen(
        [sys.executable, "-c", code], stderr=subprocess.PIPE
    ) as other:

        def ended():
            ours.publish("/cmd_vel", Twist())
            return other.poll() is not None

        try:
            until(ended)
        finally:
            other.kill()
        assert (other.returncode, other.stderr.read()) == (0, b"")


def test_spec_zenoh_takes_domain_and_endpoint(monkeypatch, endpoint, domain):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    with zenoh_session("peer", connect=[endpoint]) as session:
        link = open_link(f"zenoh:{endpoint}", node="pilot")
        try:
            until(lambda: list(session.liveliness().get(f"@ros2_lv/{domain}/**")))
        finally:
            link.close()


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("", "zenoh:tcp/HOST:7447 and ws://HOST:9090"),
        ("zenoh:", "zenoh:tcp/HOST:7447 and ws://HOST:9090"),
        ("dds", "zenoh:tcp/HOST:7447 and ws://HOST:9090"),
        (None, "no link to ROS is None; zenoh, zenoh:tcp/HOST:7447 and"),
        (5, "no link to ROS is 5; zenoh"),
        ("http://host:9090", "ws://HOST:9090"),
        ("zenoh:host", "tcp/localhost:7447 works"),
        ("zenoh:tcp/host", "tcp/localhost:7447 works"),
        ("zenoh:tcp/host:99999", "tcp/localhost:7447 works"),
        ("ws:host", "ws://localhost:9090 works"),
        ("ws://", "ws://localhost:9090 works"),
    ],
)
def test_a_spec_that_is_none_names_what_works(spec, words):
    for take in (check_link, open_link):
        with pytest.raises(CommandError, match=words):
            take(spec)


@pytest.mark.parametrize("domain", ["lots", "-1", "233"])
def test_a_domain_that_is_none_is_refused(monkeypatch, domain):
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    with pytest.raises(CommandError, match=r"ROS_DOMAIN_ID is .*0 to 232"):
        open_link("zenoh")


@pytest.mark.parametrize("topic", ["cmd_vel", "/", "/a/**", "/a b", "/3d", ""])
def test_a_topic_that_cannot_be_is_refused(link, topic):
    ours = link()
    for act in (
        lambda: ours.publish(topic, Twist()),
        lambda: ours.advertise(topic, Twist),
        lambda: ours.subscribe(topic, Twist, print),
    ):
        with pytest.raises(CommandError, match="/cmd_vel or /robot1/joint_states"):
            act()


def test_without_the_packages_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "zenoh", None)
    monkeypatch.delitem(
        __import__("sys").modules, "gaitchain.backends.ros.zenoh_link", raising=False
    )
    with pytest.raises(MissingExtraError, match=r"Zenoh needs.*'gaitchain\[ros\]'"):
        open_link("zenoh")
