"""Paths of ROS become places, over a link of the own process and a real rosbridge."""

import math

import pytest
from ros_peers import RosbridgeServer, until
from telemetry_factory import told

from gaitchain.backends.ros import cdr
from gaitchain.backends.ros import messages as ros
from gaitchain.backends.ros.rosbridge_link import RosbridgeLink
from gaitchain.live.messages import Drive, Going, GoTo, LetGo, Note
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.service.ros_path import TOPIC, RosPath
from gaitchain.walker.place import Place

RES = load_box_robot("res")
HERE = Place(1.0, 2.0, math.radians(90.0))
ALONG = ros.Header(frame_id="odom")
BESIDE = ros.Header(frame_id="base_link")
TOO_LARGE = ros.Quaternion(1e200, 1e200, -1e200, 1e200)


class Loopback:
    """A link to the own process."""

    def subscribe(self, topic, kind, callback):
        assert (topic, kind) == (TOPIC, ros.Path)
        self.say = callback


class Driven:
    """A path's end, and what it asks for."""

    def __init__(self, link=None):
        self.link, self.asked, self.time_s = link or Loopback(), [], 10.0
        self.path = RosPath(self.link, self.ask, "ros")

    def ask(self, request):
        self.asked.append(request)
        return True

    def tell(self, after_s=0.1, **changes):
        """Tell of the next moment; return what was asked for then."""
        self.time_s += after_s
        self.path.take(told(RES, self.time_s, **{"place": HERE, **changes}))
        asked, self.asked = self.asked, []
        return asked


@pytest.fixture
def driven():
    driven = Driven()
    driven.tell()
    return driven


def pose(x, y, yaw=0.0, frame=""):
    turned = ros.Quaternion(z=math.sin(0.5 * yaw), w=math.cos(0.5 * yaw))
    return ros.PoseStamped(
        ros.Header(frame_id=frame), ros.Pose(ros.Vector3(x, y), turned)
    )


def turned_by(**numbers):
    return ros.PoseStamped(pose=ros.Pose(orientation=ros.Quaternion(**numbers)))


def going(*, to=3.0, arrived=False):
    return Going(Place(to), 1, 0, 0.5, 0.0, arrived)


def test_poses_are_places_one_after_another(driven):
    driven.link.say(ros.Path(ALONG, (pose(1.0, 0.0), pose(2.0, 1.0, 1.5))))
    (asked,) = driven.tell()
    assert isinstance(asked, GoTo)
    assert asked.driver == "ros"
    assert asked.places == (Place(1.0), pytest.approx(Place(2.0, 1.0, 1.5)))


def test_the_robots_own_frame_is_where_it_stands_now(driven):
    path = ros.Path(BESIDE, (pose(0.5, 0.25, -0.5),))
    driven.link.say(path)
    (asked,) = driven.tell()
    assert asked.places[0] == pytest.approx((0.75, 2.5, HERE.yaw - 0.5))


def test_a_dense_path_is_thinned_and_keeps_its_end(driven):
    driven.link.say(ros.Path(ALONG, tuple(pose(0.01 * k, 0.0) for k in range(13))))
    (asked,) = driven.tell()
    assert [round(p.x, 2) for p in asked.places] == [0.0, 0.06, 0.12]
    driven.link.say(ros.Path(ALONG, (pose(0.0, 0.0), pose(0.0, 0.0, 1.0))))
    (asked,) = driven.tell()
    assert asked.places[-1].yaw == pytest.approx(1.0)


def test_it_keeps_the_wheel_until_it_has_arrived(driven):
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))
    (errand,) = driven.tell()
    assert driven.tell(going=going(), driver="ros") == []
    assert driven.tell(1.0, going=going(), driver="ros") == [errand]
    there = driven.tell(going=going(arrived=True), driver="ros")
    assert there == [LetGo("ros")]
    assert driven.tell(5.0) == []


def test_a_path_that_comes_as_the_one_before_arrives_is_walked(driven):
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))
    driven.tell()
    driven.tell(going=going(), driver="ros")
    driven.link.say(ros.Path(ALONG, (pose(5.0, 0.0),)))
    (errand,) = driven.tell(going=going(arrived=True), driver="ros")
    assert errand == GoTo("ros", (Place(5.0),))
    assert driven.tell(going=going(arrived=True), driver="ros") == []  # not heard yet
    assert driven.tell(1.0, going=going(to=5.0), driver="ros") == [errand]
    there = driven.tell(going=going(to=5.0, arrived=True), driver="ros")
    assert there == [LetGo("ros")]


def test_a_path_back_to_where_the_one_before_ended_is_walked(driven):
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))
    driven.tell()
    driven.tell(going=going(), driver="ros")
    driven.link.say(ros.Path(ALONG, (pose(4.0, 0.0), pose(3.0, 0.0))))
    (errand,) = driven.tell(going=going(arrived=True), driver="ros")
    assert driven.tell(going=going(arrived=True), driver="ros") == []
    assert driven.tell(1.0, going=going(), driver="ros") == [errand]
    there = driven.tell(going=going(arrived=True), driver="ros")
    assert there == [LetGo("ros")]


def test_a_path_to_where_the_robot_stands_ends(driven):
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))
    there = {"going": going(arrived=True), "driver": "ros"}
    asked = [request for _ in range(4) for request in driven.tell(1.0, **there)]
    assert asked[-1] == LetGo("ros")


def test_where_another_driver_went_says_nothing_of_a_path(driven):
    driven.link.say(ros.Path(ALONG, (pose(5.0, 0.0),)))
    (errand,) = driven.tell(going=going(arrived=True), driver="me")
    assert driven.tell(1.0, going=going(), driver="me") == [errand]
    assert driven.tell(0.5) == []  # who drove lets go
    assert driven.tell(0.5, going=going(to=5.0), driver="ros") == [errand]


def test_what_somebody_stopped_is_not_asked_for_again(driven):
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))
    driven.tell()
    driven.tell(going=going(), driver="ros")
    assert driven.tell(driver="ros") == [LetGo("ros")]
    assert driven.tell(5.0) == []


def test_what_the_loop_does_not_begin_is_given_up(driven):
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))
    asked = [driven.tell(0.5, driver="another") for _ in range(10)]
    assert [len(each) for each in asked[:3]] == [1, 0, 1]
    assert asked[5:] == [[]] * 5


def test_a_path_is_not_walked_by_the_loop_after_the_one_that_it_was_sent_to(driven):
    driven.time_s = 5000.0
    driven.tell()
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))  # the loop is silent by now
    (note,) = driven.tell(-5000.0)
    assert "the loop began anew" in note.text
    assert [driven.tell(1.0) for _ in range(4)] == [[]] * 4


def test_a_command_or_an_empty_path_ends_it(driven):
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))
    driven.path.forget()
    assert driven.tell() == []
    driven.link.say(ros.Path(ALONG, (pose(3.0, 0.0),)))
    driven.link.say(ros.Path(ALONG))  # the zero ends a stop that is in force
    assert driven.tell() == [Drive("ros"), LetGo("ros")]


@pytest.mark.parametrize(
    ("path", "says"),
    [
        (ros.Path(ros.Header(frame_id="map"), (pose(1.0, 0.0),)), "pose 1 is in map"),
        (ros.Path(ALONG, (pose(1.0, 0.0), pose(math.nan, 0.0))), "pose 2 (nan, "),
        (ros.Path(ALONG, (pose(0.0, 0.0), pose(0.0, 0.0), pose(2e3, 0.0))), "pose 3 ("),
        (
            ros.Path(ALONG, (ros.PoseStamped(pose=ros.Pose(orientation=TOO_LARGE)),)),
            "pose 1 has an orientation of length 2e+200, no rotation; its length is 1",
        ),
        (ros.Path(ALONG, (turned_by(z=1e200, w=1e200),)), "pose 1 has an orientation"),
        (
            ros.Path(ALONG, (turned_by(w=0.0),)),
            "pose 1 has an orientation of length 0, no",
        ),
        (
            ros.Path(ALONG, (turned_by(z=0.5, w=0.5),)),
            "pose 1 has an orientation of length 0.707107",
        ),
        (
            ros.Path(ALONG, (turned_by(w=math.nan),)),
            "pose 1 has an orientation of length nan",
        ),
        (ros.Path(BESIDE, (pose(999.5, 0.0),)), "pose 1 (1.0"),
        (
            ros.Path(ALONG, tuple(pose(0.06 * k, 0.0) for k in range(1001))),
            "1001 places: at most 1000 are walked one after another",
        ),
    ],
)
def test_a_path_that_cannot_be_is_refused_and_why(driven, path, says):
    driven.link.say(path)
    (note,) = driven.tell()
    assert isinstance(note, Note)
    assert f"path on {TOPIC} refused: {says}" in note.text


def test_a_robot_that_does_not_know_where_it_is_takes_no_path():
    driven = Driven()
    driven.tell(place=None)
    driven.link.say(ros.Path(ALONG, (pose(1.0, 0.0),)))
    (note,) = driven.tell(place=None)
    assert "nothing measures where" in note.text


def test_the_type_is_that_of_ros():
    path = ros.Path(ALONG, (pose(1.0, 2.0, 0.5, "odom"),))
    back = cdr.decode(ros.Path, cdr.encode(path))
    assert back.header.frame_id == "odom"
    at = back.poses[0].pose.position
    assert (at.x, at.y) == (1.0, 2.0)
    definition = cdr.definition(ros.Path.type_name)
    assert definition.startswith("std_msgs/Header header\ngeometry_msgs/PoseStamped[]")


def test_a_rosbridge_brings_it():
    server = RosbridgeServer()
    link = RosbridgeLink(server.url)
    driven = Driven(link)
    driven.tell()
    assert server.wait("subscribe", TOPIC)["type"] == "nav_msgs/msg/Path"
    stamp = {"sec": 0, "nanosec": 0}
    place = {"position": {"x": 1.5, "y": 0.5, "z": 0.0}}
    place["orientation"] = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    header = {"stamp": stamp, "frame_id": "odom"}
    path = {"header": header, "poses": [{"header": header, "pose": place}]}
    server.tell(TOPIC, path)
    found = []
    until(lambda: found.extend(driven.tell()) or found)
    link.close()
    server.close()
    assert found[0] == GoTo("ros", (Place(1.5, 0.5),))
