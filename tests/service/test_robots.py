"""Which robots the service takes hold of, and which it refuses."""

import threading
from contextlib import contextmanager
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from commission_bench import IMU
from live_robot import library
from other_robots import resized
from patience import PATIENCE_S, Deadline
from ros_peers import RosbridgeServer
from verdicts import FAILED

from gaitchain.backends.dynamixel.make import MAKE
from gaitchain.backends.servos import (
    ServoBackend,
    ServoBusEmulator,
    plain_calibration,
    save_calibration,
)
from gaitchain.backends.servos.search import opened
from gaitchain.cli.libraries import shipped_library
from gaitchain.errors import BackendError, CalibrationError, CommandError, LibraryError
from gaitchain.gait.library_file import save_library
from gaitchain.live.messages import Drive, Mode, Start
from gaitchain.live.modes import BALANCED
from gaitchain.service.channel import Asker, Listener
from gaitchain.service.loop_part import make_loop
from gaitchain.service.robots import check_backend, kind_of, open_robot
from gaitchain.service.settings import Settings, load_settings, save_settings

RES = Settings(library=str(shipped_library()), rate_hz=100.0)
CALIBRATION = plain_calibration(library().robot)


def asked(**changes):
    return msgspec.structs.replace(RES, **changes)


@contextmanager
def servos(folder, **changes):
    """RES's servos, emulated without an IMU, and the settings that reach them."""
    path = folder / "res.toml"
    save_calibration(CALIBRATION, path)
    with ServoBusEmulator.like(CALIBRATION) as bus:
        spec = f"dynamixel:{bus.port}"
        yield bus, asked(backend=spec, calibration=str(path), **changes)


def refusal(settings, folder):
    """Return why no loop can be made, of servos that may be late on a busy machine."""
    deadline = Deadline()
    while True:
        with pytest.raises((CommandError, BackendError)) as refused:
            make_loop(settings, folder)
        if refused.errisinstance(CommandError) or deadline.passed():
            assert refused.errisinstance(CommandError)
            return refused


@pytest.mark.parametrize("spec", ["", "mujoco:x", "dynamixel", "ros:", "usb:1"])
def test_a_backend_that_is_none_is_refused_with_those_that_are(spec):
    with pytest.raises(CommandError, match="mujoco, mock, dynamixel:PORT"):
        check_backend(spec)


@pytest.mark.parametrize(
    ("backend", "kind"),
    [
        ("mujoco", "simulation"),
        ("mock", "mock"),
        ("dynamixel:emulated", "emulated"),
        ("feetech:emulated", "emulated"),
        ("dynamixel:/dev/ttyUSB0", "real"),
        ("ros:ws://robot:9090", "real"),
    ],
)
def test_what_moves_is_told_by_the_backend(backend, kind):
    assert kind_of(asked(backend=backend)) == kind


def test_servos_without_a_calibration_are_refused(tmp_path):
    with pytest.raises(CommandError, match="gaitchain calibrate"):
        make_loop(asked(backend="dynamixel:/dev/null"), tmp_path)


def test_servos_of_another_robot_are_refused(tmp_path):
    other = resized(library().robot, name="another", trunk_mass=3.0)
    path = tmp_path / "other.toml"
    save_calibration(plain_calibration(other), path)
    with pytest.raises(CalibrationError, match="another"):
        make_loop(asked(backend="dynamixel:/dev/null", calibration=str(path)), tmp_path)


def test_a_library_that_is_not_qualified_moves_nothing(tmp_path):
    raw = replace(library(), qualification=FAILED)
    path = tmp_path / "raw.gait"
    save_library(raw, path)
    with pytest.raises(LibraryError, match="not qualified"):
        make_loop(asked(library=str(path)), tmp_path)


def test_servos_without_an_imu_need_open_loop_for_a_walk_that_balances(tmp_path):
    refused = pytest.raises(CommandError, match="--open-loop")
    with servos(tmp_path) as (_, settings), refused:
        make_loop(settings, tmp_path)


@pytest.mark.parametrize(("open_loop", "warned"), [(False, True), (True, False)])
def test_a_rehearsal_without_an_imu_says_that_real_servos_would_be_refused(
    tmp_path, capfd, open_loop, warned
):
    path = tmp_path / "robot.toml"
    save_calibration(CALIBRATION, path)
    changes = {"calibration": str(path), "open_loop": open_loop}
    loop, port = make_loop(asked(backend="dynamixel:emulated", **changes), tmp_path)
    loop.end()
    loop.run()
    port.close()
    told = capfd.readouterr().err
    assert ("servos that are real would be refused: this library" in told) is warned
    assert ("walk with --open-loop" in told) is warned


def test_a_robot_behind_ros_without_an_imu_is_told_the_topic(tmp_path):
    """It has no calibration that could name an IMU."""
    server = RosbridgeServer()
    joints = library().robot.legs.joint_names
    state = {"name": list(joints), "position": [0.0] * len(joints)}
    ended = threading.Event()

    def publish():
        while not ended.wait(0.05):
            server.tell("/joint_states", state)

    publishing = threading.Thread(target=publish)
    publishing.start()
    try:
        with pytest.raises(CommandError, match="nothing came on /imu/data; have a"):
            make_loop(asked(backend=f"ros:{server.url}"), tmp_path)
    finally:
        ended.set()
        publishing.join()
        server.close()


def test_a_robot_that_was_connected_is_let_go_of_when_no_loop_can_be_made(tmp_path):
    with servos(tmp_path) as (bus, settings):
        refused = refusal(settings, tmp_path)
        assert refused.traceback  # which would keep the robot alive, and its port
        with opened(bus.port, [CALIBRATION.baud], [1], MAKE) as (_, _, models):
            assert models


def test_a_loop_that_may_wait_is_made_for_servos_that_do_not_answer(tmp_path):
    with servos(tmp_path, open_loop=True) as (bus, settings):
        bus.cut()
        with pytest.raises(BackendError, match="none answers"):
            make_loop(settings, tmp_path)
        waits = msgspec.structs.replace(settings, waits=True)
        loop, wires = make_loop(waits, tmp_path)
        try:
            loop.tick()
            assert loop.modes.mode is Mode.STOPPED
            assert "none answers" in loop.modes.reason
        finally:
            loop.end()
            loop.run()
            wires.close()


def test_servos_are_connected_once(tmp_path, monkeypatch):
    connected, begun = [], []
    connect = ServoBackend.connect

    def count(backend, position):
        connected.append(backend)
        connect(backend, position)

    monkeypatch.setattr(ServoBackend, "connect", count)
    with servos(tmp_path, open_loop=True) as (_, settings):
        begin = lambda: begun.append(len(connected))  # noqa: E731
        loop, port = make_loop(settings, tmp_path, begin)
        try:
            loop.tick()
            assert loop.modes.mode is Mode.OFF
            assert len(connected) == 1
            assert begun == [1]
        finally:
            loop.end()
            loop.run()
            port.close()


def test_emulated_servos_rise_from_torque_off_to_a_stand(tmp_path):
    loop, wires = make_loop(asked(backend="dynamixel:emulated"), tmp_path)
    with walked(loop, wires, tmp_path) as (listener, asker):
        assert listener.next(PATIENCE_S).mode is Mode.OFF
        while not asker.ask(Start("me")):
            listener.next(1.0)
        modes = []
        while Mode.STANDING not in modes and len(modes) < 3000:
            told = listener.next(PATIENCE_S)
            modes.append(told.mode)
        assert Mode.RISING in modes
        assert told.load_unit == "A"
        off = np.array(told.joint_target) - np.array(told.joint_position)
        assert np.degrees(np.abs(off)).max() < 2.0


@pytest.mark.slow
def test_emulated_servos_with_an_imu_walk_the_plan(tmp_path):
    """Their IMU rustles as one that is not stuck, and there is no body to balance."""
    path = tmp_path / "robot.toml"
    save_calibration(msgspec.structs.replace(CALIBRATION, imu=IMU), path)
    changes = {"calibration": str(path), "rate_hz": 50.0}
    loop, wires = make_loop(asked(backend="dynamixel:emulated", **changes), tmp_path)
    assert not loop.modes._walker.gait._walk.feedback
    with walked(loop, wires, tmp_path) as (listener, asker):
        while not asker.ask(Start("me")):
            listener.next(1.0)
        modes, steps = set(), 0
        while steps < 2 and not modes & {Mode.SAFE, Mode.STOPPED}:
            told = listener.next(PATIENCE_S)
            modes.add(told.mode)
            steps = told.steps
            if told.mode in BALANCED and not told.number % 10:
                asker.ask(Drive("me", 0.1))
    assert steps == 2, told.reason


@contextmanager
def walked(loop, wires, folder):
    """Run a loop in a thread of its own; yield both ends of its wires."""
    listener, asker, ended = Listener(folder), Asker(folder), threading.Event()
    running = threading.Thread(target=loop.run, args=[ended])
    running.start()
    try:
        yield listener, asker
    finally:
        ended.set()
        running.join()
        for end in (listener, asker, wires):
            end.close()


def test_mock_and_simulator_are_not_physical():
    for spec in ("mock", "mujoco"):
        assert not open_robot(asked(backend=spec), library()).backend.physical


def test_settings_are_for_their_user_alone(tmp_path):
    save_settings(asked(token="secret-secret"), tmp_path)
    assert load_settings(tmp_path) == asked(token="secret-secret")
    (file,) = tmp_path.iterdir()
    assert file.stat().st_mode & 0o077 == 0
