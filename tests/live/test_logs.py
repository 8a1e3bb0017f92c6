"""Logs as others read them: names, units and numbers by readers that are not ours."""

import json
import math
from importlib.resources import files
from xml.etree import ElementTree

import msgspec
import mujoco
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from msgspec.structs import replace
from planned_library import planned_res
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from telemetry_factory import BEGAN_NS, event, told, walked

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import LogError
from gaitchain.gait.library_file import library_bytes, load_library
from gaitchain.live.logs.packing import pack, rounded, unpack
from gaitchain.live.logs.reader import read_log
from gaitchain.live.logs.ros_messages import TOPICS
from gaitchain.live.logs.writer import LogFile
from gaitchain.live.messages import Choice, Telemetry
from gaitchain.live.scene import Stage
from gaitchain.messages import Command
from gaitchain.walker.walker import Walker

LIBRARY = planned_res()
RES = LIBRARY.robot
SPEEDS = (0.3, 0.01, -0.2)
EVENTS = (
    event(0.5, "command", "rest asks for 0.3 m/s"),
    event(0.5, "link", "left_knee does not answer"),
)


def matrix(quaternion):
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.array(quaternion, dtype=float))
    return turn.reshape(3, 3)


class Tree:
    """What a listener of TF makes of transforms: a tree with one root."""

    def __init__(self, transforms):
        self.up = {t.child_frame_id: t for t in transforms}
        assert len(self.up) == len(transforms)
        (self.root,) = {t.header.frame_id for t in transforms} - set(self.up)

    def pose(self, frame, seen_from="world"):
        at, turn = np.zeros(3), np.eye(3)
        while frame != seen_from:
            step = self.up[frame].transform
            q, d = step.rotation, step.translation
            own = matrix((q.w, q.x, q.y, q.z))
            at, turn = np.array((d.x, d.y, d.z)) + own @ at, own @ turn
            frame = self.up[frame].header.frame_id
        return at, turn


@pytest.fixture(scope="module")
def rows():
    """Two seconds of walking at 250 Hz, the truth in every second row."""
    walker, backend = Walker(LIBRARY, period_s=0.004), MujocoBackend(RES, None, 0.004)
    walker.keep_odometry()
    backend.connect(walker.stand)
    for _ in range(250):
        backend.write(walker.step(backend.read()).position)
    walker.command(Command(0.3))
    found = list(walked(walker, backend, 500, period_s=0.004, each=2))
    found[125] = replace(found[125], events=EVENTS)
    return [
        replace(row, command=SPEEDS if i > 10 else (0.0,) * 3)
        for i, row in enumerate(found)
    ]


@pytest.fixture(scope="module")
def path(rows, tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "new" / "walk.mcap"
    file = LogFile(path, LIBRARY)
    for i, row in enumerate(rows):
        file.write(row)
        if i % 125 == 124:
            file.sync()
    file.close()
    return path


@pytest.fixture(scope="module")
def read(path):
    """Every decoded message of each topic, by the reader of mcap."""
    found = {topic: [] for topic in TOPICS}
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for decoded in reader.iter_decoded_messages(topics=list(TOPICS)):
            assert decoded.schema.name == TOPICS[decoded.channel.topic].type_name
            found[decoded.channel.topic].append(
                (decoded.message, decoded.decoded_message)
            )
    return found


def close(one, other):
    np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9)


def test_joints_have_their_names_angles_speeds_and_torques(rows, read):
    for row, (message, state) in zip(rows, read["/joint_states"], strict=True):
        assert message.log_time == message.publish_time == row.stamp_ns
        stamp = state.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == row.stamp_ns
        assert state.name[0] == "left_hip_yaw" and len(state.name) == 12
        close(state.position, row.joint_position)
        close(state.velocity, row.joint_velocity)
        close(state.effort, row.joint_load)
    for row, (_, state) in zip(rows, read["/joint_targets"], strict=True):
        close(state.position, row.joint_target)
        assert len(state.velocity) == len(state.effort) == 0


def test_the_imu_is_in_the_trunk(rows, read):
    for row, (_, imu) in zip(rows, read["/imu/data"], strict=True):
        gyro, felt = imu.angular_velocity, imu.linear_acceleration
        close((gyro.x, gyro.y, gyro.z), row.angular_velocity)
        close((felt.x, felt.y, felt.z), row.acceleration)
        assert imu.header.frame_id == "base_link"
        # Whatever the yaw, the third row of the rotation is what the angles say.
        q = imu.orientation
        roll, pitch = row.estimated_tilt
        assert 2.0 * (q.x * q.z - q.w * q.y) == pytest.approx(
            -math.sin(pitch), abs=1e-9
        )
        tipped = 2.0 * (q.y * q.z + q.w * q.x)
        assert tipped == pytest.approx(math.cos(pitch) * math.sin(roll), abs=1e-9)
        assert imu.orientation_covariance[0] == 0.0


def test_zmp_and_trunk_are_where_the_simulator_has_them(rows, read):
    whole = {row.stamp_ns: row for row in rows if row.truth}
    stage = Stage(RES)
    assert len(read["/tf"]) == pytest.approx(2.0 / 0.02, abs=2)
    for topic in ("/zmp", "/zmp_planned"):
        assert len(read[topic]) == len(read["/tf"])
    for i, (message, moved) in enumerate(read["/tf"]):
        row = whole[message.log_time]
        scene, tree = stage.scene(row), Tree(moved.transforms)
        at, turn = tree.pose("base_link")
        np.testing.assert_allclose(at, row.truth.qpos[:3], atol=1e-6)
        np.testing.assert_allclose(turn, matrix(row.truth.qpos[3:7]), atol=1e-6)
        for foot, sole in enumerate(("l_sole", "r_sole")):
            at, turn = tree.pose(sole)
            real = np.reshape(row.truth.turn, (2, 3, 3))[foot]
            ankle = np.reshape(row.truth.place, (2, 3))[foot]
            # Joints are read up to a step of the physics apart.
            np.testing.assert_allclose(turn, real, atol=5e-3)
            below = ankle - RES.reduced.ankle_height * real[:, 2]
            np.testing.assert_allclose(at, below, atol=5e-3)
        for topic, expected in (
            ("/zmp", scene.zmp),
            ("/zmp_planned", scene.planned_zmp),
        ):
            _, shown = read[topic][i]
            assert shown.header.frame_id == "world"
            np.testing.assert_allclose(
                (shown.point.x, shown.point.y), expected, atol=1e-5
            )
            assert shown.point.z == 0.0


def test_odometry_is_the_same_in_both_messages_and_near_the_truth(rows, read):
    whole = {row.stamp_ns: row for row in rows if row.truth}
    moved = {m.log_time: tree for m, tree in read["/tf"]}
    start = rows[0].truth.qpos[:2]
    assert len(read["/odom"]) == len(read["/tf"])
    for message, odom in read["/odom"]:
        assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_link")
        at = odom.pose.pose.position
        told = Tree(moved[message.log_time].transforms).pose("base_link", "odom")[0]
        close((at.x, at.y, at.z), told)
        real = np.array(whole[message.log_time].truth.qpos[:3])
        assert at.z == pytest.approx(real[2], abs=0.01)
        np.testing.assert_allclose((at.x, at.y), real[:2] - start, atol=0.03)
        covariance = np.reshape(odom.pose.covariance, (6, 6))
        assert (np.linalg.eigvalsh(covariance) > 0.0).all()
    assert at.x > 0.2


def test_the_description_has_the_frames_of_tf(read):
    ((_, text),) = read["/robot_description"]
    robot = ElementTree.fromstring(text.data)
    links = {link.get("name") for link in robot.iter("link")}
    _, moved = read["/tf"][0]
    frames = {t.child_frame_id for t in moved.transforms}
    assert frames == links | {"odom", "base_footprint"}
    parents = {t.child_frame_id: t.header.frame_id for t in moved.transforms}
    for joint in robot.iter("joint"):
        child = joint.find("child").get("link")
        assert parents[child] == joint.find("parent").get("link")
    joints = {j.get("name") for j in robot.iter("joint") if j.get("type") != "fixed"}
    assert joints == set(RES.legs.joint_names)
    mass = sum(float(m.get("value")) for m in robot.iter("mass"))
    assert mass == pytest.approx(RES.legs.mass)


def test_the_footprint_is_level_and_on_the_floor(read):
    for _, moved in read["/tf"]:
        at, turn = Tree(moved.transforms).pose("base_footprint", "odom")
        assert at[2] == pytest.approx(0.0, abs=0.01)
        np.testing.assert_allclose(turn[:, 2], (0.0, 0.0, 1.0), atol=1e-6)


def test_the_layout_shows_topics_that_are_in_the_log(read):
    page = files("gaitchain") / "data" / "foxglove_layout.json"
    layout = json.loads(page.read_text("utf-8"))
    panels = layout["configById"]
    shown = set(panels["3D!gaitchain"]["topics"])
    for panel in panels.values():
        shown |= {panel["topicToRender"]} if "topicToRender" in panel else set()
        shown |= {
            "/" + line["value"].split("/")[1].split(".")[0]
            for line in panel.get("paths", ())
        }
    assert "/robot_description" in shown
    assert shown <= {topic for topic, messages in read.items() if messages}


def test_commands_events_and_decisions_are_told(rows, read):
    times = [message.log_time for message, _ in read["/cmd_vel"]]
    assert rows[11].stamp_ns in times  # at once, when it changes
    assert max(np.diff(times)) <= 0.11e9
    last = read["/cmd_vel"][-1][1].twist
    assert (last.linear.x, last.linear.y, last.angular.z) == SPEEDS
    assert [(log.name, log.msg, log.level) for _, log in read["/events"]] == [
        ("command", EVENTS[0].text, 20),
        ("link", EVENTS[1].text, 30),
    ]
    choices = [row.choice for row in rows if row.choice]
    distinct = [c for i, c in enumerate(choices) if not i or c != choices[i - 1]]
    assert len(distinct) == len(read["/decision"]) > 3
    for choice, (_, shown) in zip(distinct, read["/decision"], strict=True):
        assert (shown.key_moment, shown.layer, shown.pose, shown.target) == (
            choice.key_moment,
            choice.layer,
            choice.pose,
            choice.target,
        )
        assert (shown.cost, shown.left_support) == (choice.cost, choice.left_support)
        assert dict(zip(shown.primitive, shown.value, strict=True)) == choice.primitives
        sizes = tuple(zip(shown.size, shown.size_cost, strict=True))
        assert sizes == choice.sizes
        assert tuple(zip(shown.end, shown.end_cost, strict=True)) == choice.ends
        assert not choice.ends or choice.ends[0][0] == choice.target


def test_a_reader_of_ros_bags_reads_it_too(rows, path):
    store = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([path], default_typestore=store) as bag:
        counts = {c.topic: c.msgcount for c in bag.connections}
        assert counts["/joint_states"] == counts["/gaitchain/telemetry"] == len(rows)
        wanted = [c for c in bag.connections if c.topic in TOPICS]
        assert {c.topic: c.msgtype for c in wanted} == {
            topic: kind.type_name for topic, kind in TOPICS.items()
        }
        seen = set()
        for connection, _, data in bag.messages(connections=wanted):
            bag.deserialize(data, connection.msgtype)
            seen.add(connection.topic)
        assert seen == set(TOPICS)


def test_a_log_needs_no_other_file(path, tmp_path):
    log = read_log(path)
    assert log.library_bytes == library_bytes(LIBRARY)
    assert log.library.robot == RES
    assert log.library.timing == LIBRARY.timing
    (tmp_path / "again.gait").write_bytes(log.library_bytes)
    assert load_library(tmp_path / "again.gait").poses.counts == LIBRARY.poses.counts
    with path.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        (facts,) = reader.iter_metadata()
        (library,) = reader.iter_attachments()
    assert facts.metadata["robot"] == "Robo-Erectus Senior"
    assert facts.metadata["fingerprint"] == RES.fingerprint
    assert (library.name, library.data) == ("library.gait", log.library_bytes)


def plain(value):
    """Numbers in order, NaN as None, for comparing what NaN is unlike."""
    return msgspec.json.decode(msgspec.json.encode(value))


def assert_same(one: Telemetry, other: Telemetry):
    """All that is no measured number is the same, those are to seven digits."""
    for name in Telemetry.__struct_fields__:
        a, b = getattr(one, name), getattr(other, name)
        if name == "truth" and a is not None:
            for part in a.__struct_fields__:
                np.testing.assert_allclose(
                    getattr(a, part), getattr(b, part), rtol=1e-7
                )
        elif isinstance(a, tuple) and a and isinstance(a[0], float):
            np.testing.assert_allclose(a, b, rtol=1e-7, err_msg=name)
        else:
            assert plain(a) == plain(b), name


def test_all_telemetry_comes_back(rows, path):
    log = read_log(path)
    for one, other in zip(rows, log.telemetries(), strict=True):
        assert_same(one, other)
        assert (one.time_s, one.stamp_ns) == (other.time_s, other.stamp_ns)
    assert log.rows == len(rows)
    assert log.damage == ""


def test_what_was_not_measured_stays_unknown(tmp_path):
    """A robot with joints alone, a dead servo, and costs that nobody knows."""
    nan, inf = math.nan, math.inf
    load = (nan, 1.0, inf, -inf, 1e300, *[nan] * 7)
    choice = Choice("kp_2", 1, 2, 3, nan, ((4, nan), (5, inf)), True, {"sway": nan})
    row = told(
        RES,
        joint_load=load,
        joint_velocity=(),
        angular_velocity=(nan,) * 3,
        acceleration=(nan,) * 3,
        estimated_tilt=(nan, 0.1),
        choice=choice,
    )
    again = Choice("kp_2", 1, 2, 3, nan, ((4, nan), (5, inf)), True, {"sway": nan})
    with_load = replace(row, time_s=0.01, joint_load=(nan,) * 12, choice=again)
    path = tmp_path / "nan.mcap"
    file = LogFile(path, LIBRARY)
    file.write(row)
    file.write(with_load)
    file.close()
    again, _ = read_log(path).telemetries()
    np.testing.assert_array_equal(again.joint_load, (*load[:4], inf, *load[5:]))
    assert again.joint_velocity == ()
    assert plain(again.choice) == plain(choice)
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        seen = [
            (d.channel.topic, d.decoded_message)
            for d in reader.iter_decoded_messages(topics=list(TOPICS))
        ]
    topics = {topic for topic, _ in seen}
    assert topics.isdisjoint({"/imu/data", "/zmp", "/zmp_planned"})
    states = [m for topic, m in seen if topic == "/joint_states"]
    np.testing.assert_array_equal(states[0].effort, again.joint_load)
    assert len(states[1].effort) == 0  # none measured at all
    (decision,) = [m for topic, m in seen if topic == "/decision"]
    assert math.isnan(decision.cost)
    np.testing.assert_array_equal(decision.runner_up, [4, 5])
    np.testing.assert_array_equal(decision.runner_up_cost, [nan, inf])
    (moved, *_) = [m for topic, m in seen if topic == "/tf"]  # by the joints
    assert moved.transforms[0].transform.translation.z > 0.4


def test_a_tilt_that_is_unknown_is_said_as_ros_says_it(tmp_path):
    file = LogFile(tmp_path / "a.mcap", LIBRARY)
    file.write(told(RES, estimated_tilt=(math.nan, math.nan)))
    file.close()
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        (imu,) = [d.decoded_message for d in reader.iter_decoded_messages("/imu/data")]
    assert imu.orientation_covariance[0] == -1.0
    assert imu.orientation.w == 1.0


def test_a_fast_loop_tells_joints_no_more_than_250_times_a_second(tmp_path):
    file = LogFile(tmp_path / "fast.mcap", LIBRARY)
    rng = np.random.default_rng(0)
    for i in range(1000):  # 1 kHz for a second, and its rows not quite on time
        file.write(told(RES, 0.001 * i + rng.uniform(0.0, 2e-4)))
    file.close()
    with (tmp_path / "fast.mcap").open("rb") as stream:
        counts = make_reader(stream).get_summary().statistics.channel_message_counts
    assert counts[1] == 1000
    assert 245 <= counts[2] <= 250


def test_a_clock_that_jumps_breaks_nothing(tmp_path):
    """The computer's clock is set back by an hour, before 1970, and past 2038."""
    stamps = [BEGAN_NS, BEGAN_NS - 3600 * 10**9, -5, 2**62, BEGAN_NS + 10**9]
    path = tmp_path / "jump.mcap"
    file = LogFile(path, LIBRARY)
    for i, stamp in enumerate(stamps):
        file.write(replace(told(RES, 0.1 * i), stamp_ns=stamp, steps=i))
        file.sync()
    for i, stamp in enumerate(stamps):  # and the loop begins again
        file.write(replace(told(RES, 0.1 * i), stamp_ns=stamp, steps=10 + i))
    file.close()
    log = read_log(path)
    found = list(log.telemetries())
    assert [row.steps for row in found] == [0, 1, 2, 3, 4, 10, 11, 12, 13, 14]
    assert [row.stamp_ns for row in found] == 2 * stamps
    assert log.damage == ""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        times = [
            d.message.log_time for d in reader.iter_decoded_messages("/joint_states")
        ]
    assert times == sorted(2 * [BEGAN_NS, stamps[1], 0, 2**62, stamps[4]])


def test_a_file_that_is_there_is_left_alone(path, tmp_path):
    before = path.read_bytes()
    with pytest.raises(LogError, match="File exists"):
        LogFile(path, LIBRARY)
    assert path.read_bytes() == before
    (tmp_path / "file").touch()
    with pytest.raises(LogError, match="cannot be written") as caught:
        LogFile(tmp_path / "file" / "a.mcap", LIBRARY)
    assert "\n" not in str(caught.value)


def test_packing_is_exact_once_the_numbers_are_rounded(rows):
    for row in rows[:20]:
        few = rounded(row)
        assert unpack(pack(few)) == few
        assert rounded(few) == few


@pytest.mark.parametrize("cut", [b"", b"\xc0", b"\x93\xc0\x90\xc4\x00", None])
def test_bytes_that_are_no_telemetry_are_refused(cut, rows):
    data = pack(rows[0])[:-1] if cut is None else cut
    with pytest.raises(ValueError, match="no telemetry"):
        unpack(data)
    with pytest.raises(ValueError, match="no telemetry: 0 arrays"):
        unpack(msgspec.msgpack.encode((rows[0], (), b"")))
