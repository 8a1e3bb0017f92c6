"""The live 3-D view: real viser, real telemetry, and a browser that looks at it."""

import dataclasses
import select
import signal
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager
from http.client import HTTPConnection
from itertools import count

import imageio.v3 as imageio
import numpy as np
import pytest
from msgspec.structs import replace
from page_browser import Watched, chromium
from patience import PATIENCE_S, Deadline
from planned_library import planned_library
from telemetry_factory import told

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.discover.looks import read_looks
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import save_library
from gaitchain.messages import GRAVITY
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.service.channel import Listener, LoopEnd
from gaitchain.service.settings import Settings, save_settings
from gaitchain.service.viewer import LiveView
from gaitchain.service.viewer_part import looks_of, run, watch
from gaitchain.sim.scene_meshes import WORLD, local_server

RES = load_box_robot("res")
TRUNK = f"{WORLD}/1 trunk"
WAIT_S = 0.05  # between two looks
RUN = (
    "import signal, sys, threading; from pathlib import Path\n"
    "from gaitchain.service.viewer_part import run\n"
    "ended = threading.Event()\n"
    "signal.signal(signal.SIGTERM, lambda *_: ended.set())\n"
    "run(Path(sys.argv[1]), ended)\n"
)


@pytest.fixture(scope="module")
def truth():
    """The simulator's truth of a robot that stands, half its weight on each foot."""
    backend = MujocoBackend(RES)
    backend.connect(RES.legs.stand)
    half = 0.5 * GRAVITY * RES.legs.mass
    return replace(backend.truth(), wrench=(0.0, 0.0, 0.0, 0.0, 0.0, half) * 2)


@pytest.fixture
def at(truth):
    """Telemetry of a robot that stands a way ahead."""

    def place(ahead, **changes):
        shift = np.array([ahead, 0.0, 0.0])
        moved = replace(
            truth,
            qpos=(truth.qpos[0] + ahead, *truth.qpos[1:]),
            place=tuple((np.reshape(truth.place, (2, 3)) + shift).ravel().tolist()),
            com=tuple((np.array(truth.com) + shift).tolist()),
        )
        return told(RES, 1.0, truth=moved, **changes)

    return place


@pytest.fixture
def server():
    with local_server() as running:
        yield running


def node(server, name):
    return server.scene.get_handle_by_name(name)


def waited(ready):
    """Poll until something is there."""
    deadline = Deadline()
    while not ready():
        assert not deadline.passed(), "it never was there"
        select.select([], [], [], WAIT_S)


@contextmanager
def watched(folder, view):
    """Draw what a loop publishes; yield the loop's end."""
    loop, ended = LoopEnd(folder), threading.Event()
    listener = Listener(folder, latest=True)
    thread = threading.Thread(target=watch, args=(listener, view, ended))
    thread.start()
    try:
        yield loop
    finally:
        ended.set()
        thread.join()
        listener.close()
        loop.close()


@pytest.mark.slow
def test_the_robot_and_its_marks_move_with_the_telemetry(server, tmp_path, at):
    view = LiveView(server, RES)
    before = np.array(node(server, TRUNK).position)
    assert node(server, "/no telemetry").visible
    with watched(tmp_path, view) as loop:
        telemetry = at(2.0, planned_zmp=(0.03, 0.0), support="ls")

        def drawn():
            """All of it, and the view has not been silent since."""
            loop.publish(telemetry)
            support = np.array(node(server, f"{WORLD}/support").points)
            return (
                not node(server, "/no telemetry").visible
                and node(server, TRUNK).position[0] > 1.0
                and node(server, f"{WORLD}/ZMP").visible
                and node(server, f"{WORLD}/planned ZMP").visible
                and len(support) == 4
            )

        waited(drawn)
        np.testing.assert_allclose(
            node(server, TRUNK).position, telemetry.truth.qpos[:3], atol=1e-9
        )
        assert before[0] == pytest.approx(0.0)
        zmp, ring = node(server, f"{WORLD}/ZMP"), node(server, f"{WORLD}/planned ZMP")
        assert zmp.visible
        assert zmp.position[0] == pytest.approx(telemetry.truth.com[0], abs=1e-6)
        assert ring.position[0] == pytest.approx(telemetry.truth.place[0] + 0.03)
        edge = node(server, f"{WORLD}/support")
        assert len(edge.points) == 4  # the left sole
        assert (edge.points + edge.position)[..., 0].min() > 1.5
        waited(lambda: node(server, "/no telemetry").visible)  # the loop is silent now


def test_without_a_simulator_the_joints_place_the_robot(server, truth):
    view = LiveView(server, RES)
    view.show(told(RES, truth=truth), 0.1)
    known = {name: np.array(node(server, name).position) for name in names(server)}
    nan = (float("nan"),) * len(RES.legs.joint_names)
    view.show(told(RES, time_s=50.0, joint_position=nan), 0.1)  # the targets will do
    for name, place in known.items():
        np.testing.assert_allclose(node(server, name).position, place, atol=0.02)
    assert not node(server, f"{WORLD}/ZMP").visible  # nobody measured it


def test_a_robot_of_a_file_gets_its_own_shapes_when_they_are_read(server, toy_path):
    loaded = load_with_findings(toy_path)
    view = LiveView(server, loaded.robot)
    bare = set(names(server))
    thigh = f"{WORLD}/4 left_link_3"
    placed = np.array(node(server, thigh).position)
    view.wear(())
    assert set(names(server)) == bare
    looks = read_looks(loaded.model, loaded.findings, loaded.robot)
    view.wear(looks)
    nodes = server.scene._handle_from_node_name
    assert sum(name.count("/") == 3 for name in nodes) == len(looks)
    np.testing.assert_allclose(node(server, thigh).position, placed, atol=1e-9)


def names(server):
    return [name for name in server.scene._handle_from_node_name if "_" in name]


def test_no_file_that_a_log_names_is_read(toy_path, toy_library, tmp_path, caplog):
    """Whoever wrote the log named it; the one that is given is drawn."""
    config = toy_library.config
    secret = tmp_path / "secret.xml"
    secret.write_bytes(toy_path.read_bytes())
    named = dataclasses.replace(
        toy_library, config=dataclasses.replace(config, robot=str(secret))
    )
    live, replay = Settings(library=""), Settings(library="", replay="a.mcap")
    assert len(looks_of(live, named)) == 9
    assert looks_of(replay, named) == ()
    assert "drawn as its skeleton: the log names" in caplog.text
    assert len(looks_of(replace(replay, drawn=str(toy_path)), named)) == 9
    profiled = dataclasses.replace(config, robot="robotis_op3", profile=str(secret))
    of_name = dataclasses.replace(toy_library, config=profiled)
    caplog.clear()
    assert looks_of(replay, of_name) == ()
    assert "drawn as its skeleton: the log names" in caplog.text


def test_no_client_can_make_it_share_a_link(server):
    assert server.request_share_url() is None
    assert server.get_host() == "127.0.0.1"


def test_a_taken_port_is_told(tmp_path):
    save_library(planned_library(RES), tmp_path / "res.gait")
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        settings = Settings(library=str(tmp_path / "res.gait"), viewer_port=port)
        save_settings(settings, tmp_path)
        with pytest.raises(CommandError, match=f"port {port} of the 3-D view: Addr"):
            run(tmp_path, threading.Event())


@pytest.mark.slow
def test_the_part_serves_until_it_is_told_to_end(tmp_path):
    save_library(planned_library(RES), tmp_path / "res.gait")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    settings = Settings(library=str(tmp_path / "res.gait"), viewer_port=port)
    save_settings(settings, tmp_path)
    part = subprocess.Popen(
        [sys.executable, "-c", RUN, str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )

    def answers():
        assert part.poll() is None
        visit = HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
        try:
            visit.request("GET", "/")
            return visit.getresponse().status == 200
        except ConnectionRefusedError:
            return False
        finally:
            visit.close()

    try:
        waited(answers)
        part.send_signal(signal.SIGTERM)
        assert part.wait(60.0) == 0
        assert part.stdout.read().decode() == ""
    finally:
        part.kill()
        part.stdout.close()


@pytest.mark.slow
@pytest.mark.browser
def test_a_visitor_sees_the_robot_and_may_stay_behind(server, at):
    view = LiveView(server, RES)
    view.show(at(0.0), 1.0)
    with chromium() as browser:
        address = f"http://127.0.0.1:{server.get_port()}"
        visitor = Watched(browser, address, viewport={"width": 640, "height": 480})
        page = visitor.open()
        page.locator("canvas").first.wait_for()
        until(page, lambda: blue(page) > 300)
        assert page.evaluate(
            "[...document.querySelectorAll('canvas')]"
            ".some(c => c.getContext('webgl2') !== null)"
        )
        (client,) = server.get_clients().values()
        world = client.scene.get_handle_by_name(WORLD)
        view.show(at(50.0), 100.0)
        np.testing.assert_allclose(world.position, (-50.0, 0.0, 0.0), atol=0.2)
        until(page, lambda: blue(page) > 300)  # still in view
        page.get_by_text("View", exact=True).click()
        page.get_by_label("Follow the robot").uncheck()  # tries until it is

        places = count(100.0, 50.0)

        def left():
            # Further each time: the view may know of the box only after the first.
            view.show(at(next(places)), 100.0)
            return blue(page) < 30

        until(page, left)
        stays = world.position.copy()
        view.show(at(next(places)), 100.0)
        np.testing.assert_array_equal(world.position, stays)
        visitor.context.close()
    waited(lambda: not server.get_clients())


def until(page, ready):
    """Poll, and let the browser work meanwhile."""
    deadline = Deadline()
    while not ready():
        assert not deadline.passed(), "the picture did not change"
        page.wait_for_timeout(1000.0 * WAIT_S)


def blue(page):
    """Count the pixels of the robot's blue trunk."""
    shot = page.locator("canvas").first.screenshot()
    red, green, blue = np.moveaxis(np.asarray(imageio.imread(shot))[..., :3], 2, 0)
    return int(((blue > 120) & (red < 80) & (green < 130)).sum())
