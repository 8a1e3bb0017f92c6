"""The page that shows how a robot in commission should move, by viser itself."""

import os
import socket
import subprocess
import sys
from contextlib import closing
from urllib.error import URLError
from urllib.request import urlopen

import mujoco
import numpy as np
import pytest
from commission_bench import Somebody, library, robot
from patience import PATIENCE_S

from gaitchain.commission.servos import check_directions
from gaitchain.commission.view import RobotView, ViewProcess
from gaitchain.errors import CommandError
from gaitchain.sim.model import build_model
from gaitchain.sim.scene_meshes import local_server

pytest.importorskip("dynamixel_sdk")
KNEE = 3  # of the left leg


@pytest.fixture
def server():
    with local_server() as server:
        yield server


def bent():
    pose = np.array(library().robot.legs.stand)
    pose[KNEE] += 0.5
    return pose


def there(pose):
    """MuJoCo's own answer."""
    model = build_model(library().robot)
    data = mujoco.MjData(model)
    data.qpos[7:] = pose
    mujoco.mj_kinematics(model, data)
    return model, data


def test_links_are_where_the_targets_put_them(server):
    view = RobotView(server, library())
    view.show(bent())
    model, data = there(bent())
    foot = model.body("left_foot").id
    assert view._bodies[foot].position == pytest.approx(data.xpos[foot], abs=1e-6)
    assert view._bodies[foot].wxyz == pytest.approx(data.xquat[foot], abs=1e-6)


def test_a_ring_is_about_the_axis_of_the_joint_that_is_pointed_at(server):
    view = RobotView(server, library())
    view.point(KNEE, "left_knee")
    view.show(bent())
    model, data = there(bent())
    joint = model.joint(library().robot.legs.joint_names[KNEE]).id
    ring, label = view._marks
    assert ring.position == pytest.approx(data.xanchor[joint], abs=1e-6)
    normal = np.zeros(3)
    mujoco.mju_rotVecQuat(normal, np.array([0.0, 0.0, 1.0]), np.array(ring.wxyz))
    assert abs(normal @ data.xaxis[joint]) == pytest.approx(1.0)
    assert label.text == "left_knee"
    assert "left_knee" in view.text.content
    view.clear()
    assert "left_knee" not in view.text.content
    assert not view._marks


def test_a_motion_is_played_again_and_again_until_it_is_cleared(server):
    view = RobotView(server, library(), "Exercise")
    stand = np.array(library().robot.legs.stand)
    motion = np.linspace(stand, bent(), 7)
    view.play(motion, 0.01, "Preview")
    assert "Preview" in view.text.content
    knees = []
    for _ in range(6):
        view.advance()
        knees.append(view._data.qpos[7 + KNEE])
    # A picture for three control periods of 10 ms.
    assert knees == pytest.approx(2 * list(motion[::3, KNEE]))
    view.clear()
    view.show(stand)
    view.advance()
    assert view._data.qpos[7 + KNEE] == stand[KNEE]
    assert "Preview" not in view.text.content


def test_a_page_is_served_by_another_process_until_it_is_closed():
    with closing(ViewProcess(library(), 0)) as view:
        with urlopen(view.address, timeout=PATIENCE_S) as answer:
            assert b"<html" in answer.read()
        view.point(KNEE, "left_knee")
        view.show(bent())
        view.play(np.array([bent()]), 0.01, "Preview")
        process = view._process
        assert process.is_alive()
    assert not process.is_alive()
    assert process.exitcode == 0, "what was asked did not break it"
    with pytest.raises(URLError):
        urlopen(view.address, timeout=PATIENCE_S)


LOST_PAGE = """
import os, signal
import numpy as np
from commission_bench import library
from gaitchain.commission.view import ViewProcess

if __name__ == "__main__":
    view = ViewProcess(library(), 0)
    film = np.zeros((2000, 12))
    view.play(film, 0.01, "Preview")
    os.kill(view._process.pid, signal.SIGKILL)
    for _ in range(20):  # more than a pipe holds
        view.play(film, 0.01, "Preview")
    view.close()
    print("closed")
"""


def test_a_page_that_was_killed_keeps_nobody_from_the_end(tmp_path):
    script = tmp_path / "lost_page.py"
    script.write_text(LOST_PAGE, "utf-8")
    path = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run(
        [sys.executable, script],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    )
    assert done.stdout == "closed\n"


@pytest.mark.parametrize("port", [0, 65535])  # beyond the last one is none to try
def test_a_port_that_cannot_be_had_is_said(port):
    with socket.create_server(("127.0.0.1", port)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(CommandError, match=f"port {port} of the 3-D view: Addr"):
            ViewProcess(library(), port)


def test_each_joint_is_pointed_at_while_it_turns():
    seen, asked = {}, []

    class Screen:
        def show(self, target):
            if asked:
                seen.setdefault(asked[-1], []).append(target.copy())

        def point(self, joint, text):
            asked.append(joint)
            assert text == library().robot.legs.joint_names[joint]

        def clear(self):
            asked.append(None)

    with robot(Somebody()) as (bench, _):
        bench.screen = Screen()
        assert check_directions(bench).outcome == "go"
    assert asked == [*range(12), None]
    for joint in range(12):
        turned = np.ptp(np.degrees(seen[joint]), axis=0)
        assert int(np.argmax(turned)) == joint
        assert turned[joint] == pytest.approx(8.0, abs=0.1)
