"""The part that ROS talks to: what it subscribes to, over a real rosbridge."""

import threading
from contextlib import contextmanager

import numpy as np
import pytest
from patience import PATIENCE_S
from ros_peers import RosbridgeServer, until
from telemetry_factory import told

from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.live.messages import Drive, GoTo
from gaitchain.service import ros_part
from gaitchain.service.channel import LoopEnd
from gaitchain.service.settings import Settings, save_settings
from gaitchain.walker.place import Place


@contextmanager
def running(folder, **settings):
    """The part, and the rosbridge that it talks to."""
    server, ended = RosbridgeServer(), threading.Event()
    library = str(shipped_library())
    save_settings(Settings(library=library, ros=server.url, **settings), folder)
    part = threading.Thread(target=ros_part.run, args=(folder, ended))
    part.start()
    try:
        yield server
    finally:
        ended.set()
        part.join(PATIENCE_S)
        server.close()


@pytest.mark.parametrize(
    ("stamped", "kind"), [(False, "Twist"), (True, "TwistStamped")]
)
def test_commands_are_of_the_type_that_was_asked_for(stamped, kind, tmp_path):
    with running(tmp_path, ros_stamped=stamped) as server:
        said = server.wait("subscribe", "/cmd_vel")
    assert said["type"] == f"geometry_msgs/msg/{kind}"


class Loop:
    """A loop whose robot stands; what it was asked."""

    def __init__(self, folder):
        self.end, self.asked, self.time_s = LoopEnd(folder), [], 0.0
        self.robot = load_library(shipped_library()).robot

    def was_asked(self, kind, **fields):
        """Go on a moment; return whether this was asked for by now."""
        self.time_s += 0.02
        self.end.publish(told(self.robot, self.time_s, place=Place()))
        self.asked += self.end.requests()
        found = (r for r in self.asked if isinstance(r, kind))
        return any(getattr(r, n) == v for r in found for n, v in fields.items())


def test_zeros_end_no_path(tmp_path):
    """Also the first zero since a motion that was not stopped by one."""
    loop = Loop(tmp_path)
    place = {"position": {"x": 1.5}, "orientation": {"w": 1.0}}
    with running(tmp_path) as server:
        for topic in ("/gaitchain/path", "/cmd_vel"):
            server.wait("subscribe", topic)
        until(
            lambda: server.tell("/cmd_vel", speed(0.1)) or loop.was_asked(Drive, vx=0.1)
        )
        server.tell("/cmd_vel", speed(0.15))  # comes after all the others
        until(lambda: loop.was_asked(Drive, vx=0.15))
        # Until the part knows where the robot is, a path is refused.
        until(lambda: loop.was_asked(GoTo) or was_published(server, "/joint_states"))
        server.tell("/gaitchain/path", {"poses": [{"pose": place}]})
        until(lambda: loop.was_asked(GoTo, driver="ros"))
        loop.asked.clear()
        server.tell("/cmd_vel", speed(0.0))
        server.tell("/cmd_vel", speed(0.2))  # comes after it
        until(lambda: loop.was_asked(Drive, vx=0.2))
    loop.end.close()
    assert not [
        r for r in loop.asked if not isinstance(r, GoTo) and r != Drive("ros", 0.2)
    ]


def test_every_row_of_a_loop_of_100_hz_is_published_though_some_are_late(tmp_path):
    loop, late_s = (
        Loop(tmp_path),
        np.random.default_rng(0).uniform(0.0, 1.5e-3, 50).tolist(),
    )
    with running(tmp_path) as server:
        until(lambda: loop.was_asked(GoTo) or was_published(server, "/joint_states"))
        began_s = loop.time_s + 1.0
        for i, late in enumerate(late_s):
            row = told(loop.robot, began_s + 0.01 * i + late)
            loop.end.publish(row)
            stamp = divmod(row.stamp_ns, 10**9)
            while stamp_of(server.wait("publish", "/joint_states")) != stamp:
                assert i == 0  # what was published before
    loop.end.close()


def stamp_of(said):
    stamp = said["msg"]["header"]["stamp"]
    return stamp["sec"], stamp["nanosec"]


def was_published(server, topic):
    said = [server.heard.get() for _ in range(server.heard.qsize())]
    return any(one["op"] == "publish" and one.get("topic") == topic for one in said)


def speed(ahead):
    return {"linear": {"x": ahead, "y": 0.0, "z": 0.0}}
