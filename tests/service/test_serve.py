"""The whole service as processes: what happens when parts of it die, and at its end."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from commands import call
from running_service import Service, gone

from gaitchain.backends.servos import (
    ServoBusEmulator,
    plain_calibration,
    save_calibration,
)
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.gait.stride.family import STRIDES

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    service = Service("--rate", "100", folder=tmp_path_factory.mktemp("service"))
    yield service
    service.kill_all()


@pytest.fixture
def walking(service):
    service.until(lambda: service.mode("standing"))
    service.until(lambda: service.drives(vx=0.3))
    return service


def test_it_walks_when_driven_and_stands_when_not(walking):
    start = walking.state["scene"]["trunk"][0]

    def further():
        walking.put(vx=0.3)
        return walking.state["scene"]["trunk"][0] > start + 0.3

    walking.until(further)
    walking.until(lambda: walking.mode("standing"))
    assert any("no command" in text for text in walking.events("command"))


@pytest.fixture(scope="module")
def another(tmp_path_factory):
    """A service of its own: who is punched may end on the floor."""
    service = Service(folder=tmp_path_factory.mktemp("another"))
    yield service
    service.kill_all()


def test_disturbances_come_and_go_while_it_walks_and_outlast_a_reset(another):
    walking = another
    walking.until(lambda: walking.mode("standing"))
    walking.until(lambda: walking.drives(vx=0.3))

    def disturbed(**wanted):
        walking.put(vx=0.2)
        return wanted.items() <= walking.state["disturbances"].items()

    def change(**wanted):
        return walking.client.patch("api/v1/disturbances", json=wanted).status_code

    punches = {"most_ns": 1.0, "every_s": 0.2}
    assert change(punches=punches, payload=0.05) == 202
    walking.until(lambda: disturbed(punches=punches, payload=0.05, arms="still"))
    assert change(arms="random") == 202
    walking.until(lambda: disturbed(punches=punches, payload=0.05, arms="random"))
    assert change(payload=10.5) == 422
    walking.until(lambda: any(map(_is_punch, walking.events("push"))))
    assert walking.mode("walking")
    stop_and_reset(walking)
    assert disturbed(punches=punches, payload=0.05, arms="random")
    assert change(punches=None, payload=None, arms=None) == 202
    walking.until(lambda: disturbed(punches=None, payload=0.0, arms="still"))


def stop_and_reset(service):
    service.client.post("api/v1/emergency-stop")
    service.until(lambda: service.mode("stopped"))
    service.client.post("api/v1/reset")
    service.until(lambda: service.mode("standing"))


def test_sigterm_ends_everything_in_order(another):
    """Nothing asks that service any more."""
    parts = another.parts()
    assert {"loop", "api", "viewer", "log"} <= set(parts)
    assert another.end() == 0
    assert all(gone(number) for number in parts.values())
    assert another.log.stat().st_size > 0
    assert "Traceback" not in another.said


@pytest.mark.parametrize("name", ["api", "viewer", "log"])
def test_a_killed_part_is_started_again_and_the_robot_stands(walking, name):
    loop = walking.part("loop")
    killed = walking.kill(name)
    walking.until(lambda: walking.part(name) not in (None, killed))
    walking.until(walking.answers)
    walking.until(lambda: walking.mode("standing"))
    assert walking.part("loop") == loop
    said = f"the {name} part ended with signal 9 and was started again"
    walking.until(lambda: said in walking.events("part"))


def test_a_killed_loop_begins_again_standing(walking):
    killed = walking.kill("loop")
    walking.until(lambda: walking.part("loop") not in (None, killed))
    walking.until(lambda: walking.mode("standing"))
    assert walking.state["scene"]["trunk"][0] == pytest.approx(0.0, abs=0.05)


def test_a_stop_outlives_the_loop_that_was_told(walking):
    walking.client.post("api/v1/emergency-stop")
    walking.until(lambda: walking.mode("stopped"))
    killed = walking.kill("loop")
    walking.until(lambda: walking.part("loop") not in (None, killed))
    walking.until(walking.answers)
    walking.until(lambda: walking.reason("emergency stop by rest"))
    assert walking.mode("stopped")
    # Its requests may reconnect later than its telemetry.
    walking.until(lambda: walking.client.post("api/v1/reset").status_code == 202)
    walking.until(lambda: walking.mode("standing"))


def test_a_stop_outlives_its_loop_and_the_files_of_the_service(walking):
    """As a program that cleans the folder of temporary files takes them."""
    walking.client.post("api/v1/emergency-stop")
    walking.until(lambda: walking.mode("stopped"))
    words = Path(f"/proc/{walking.part('loop')}/cmdline").read_bytes().split(b"\0")
    for file in Path(os.fsdecode(words[4])).iterdir():
        if file.is_file():
            file.unlink()
    killed = walking.kill("loop")
    walking.until(lambda: walking.part("loop") not in (None, killed))
    walking.until(walking.answers)
    walking.until(lambda: walking.reason("emergency stop by rest"))
    walking.until(lambda: walking.client.post("api/v1/reset").status_code == 202)
    walking.until(lambda: walking.mode("standing"))


def test_a_stuck_loop_is_replaced(service):
    service.until(lambda: service.mode("standing"))
    stuck = service.part("loop")
    os.kill(stuck, signal.SIGSTOP)
    service.until(lambda: service.part("loop") not in (None, stuck))
    service.until(lambda: service.mode("standing"))


def test_a_supervisor_that_is_killed_leaves_nobody_behind(service):
    """The last that asks the service of this module."""
    parts = service.parts()
    assert {"loop", "api", "viewer", "log"} <= set(parts)
    os.kill(service.process.pid, signal.SIGKILL)
    service.process.wait()
    for number in parts.values():
        service.until(lambda number=number: gone(number))


def test_servos_that_lost_their_supply_are_waited_for(tmp_path):
    robot = load_library(shipped_library()).robot
    calibration, file = plain_calibration(robot), tmp_path / "res.toml"
    save_calibration(calibration, file)
    with ServoBusEmulator.like(calibration, robot.legs.stand) as bus:
        words = ["--backend", f"dynamixel:{bus.port}", "--calibration", str(file)]
        service = Service(*words, "--open-loop", folder=tmp_path)
        try:
            service.until(lambda: service.mode("off"))
            for number in bus.servos:
                bus.kill(number)
            service.kill("loop")
            service.until(lambda: service.reason("not connected: "))
            assert "none answers: supply" in service.state["reason"]
            loop = service.part("loop")
            service.client.post("api/v1/emergency-stop")
            service.until(lambda: service.reason("emergency stop by rest"))
            assert service.mode("stopped")
            service.client.post("api/v1/reset")
            service.until(lambda: service.reason("not connected: "))
            for number in bus.servos:
                bus.revive(number)
            service.until(lambda: service.mode("off"))
            assert service.part("loop") == loop  # all the while
        finally:
            service.kill_all()


def test_a_loop_lets_go_of_servos_though_its_files_are_gone(tmp_path):
    robot = load_library(shipped_library()).robot
    library, file = tmp_path / "own.gait", tmp_path / "res.toml"
    library.write_bytes(shipped_library().read_bytes())
    calibration = plain_calibration(robot)
    save_calibration(calibration, file)
    with ServoBusEmulator.like(calibration, robot.legs.stand) as bus:
        words = ["--backend", f"dynamixel:{bus.port}", "--calibration", str(file)]
        service = Service(str(library), *words, "--open-loop", folder=tmp_path)
        try:
            service.until(lambda: service.mode("off"))
            library.unlink()
            file.write_text("of nothing")
            killed = service.kill("loop")
            for servo in bus.servos.values():  # as of a loop that died while it stood
                servo.put(servo.torque_at, 1)
            service.until(lambda: not any(s.torque for s in bus.servos.values()))
            service.until(lambda: service.part("loop") not in (None, killed))
            service.until(lambda: service.mode("off"))
        finally:
            service.kill_all()


def test_a_damaged_library_is_refused_in_one_line(tmp_path):
    damaged = tmp_path / "damaged.gait"
    damaged.write_bytes(shipped_library().read_bytes()[:5000])
    done = subprocess.run(
        [sys.executable, "-m", "gaitchain", "serve", str(damaged), "--port", "0"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("gaitchain: ")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "options, told",
    [
        (["--host", "0.0.0.0"], "token"),
        (["--host", "example.org"], "token"),
        (["--token", "short"], "8 to 256"),
        (["--backend", "hydraulic"], "mujoco, mock, dynamixel:PORT"),
        (["--rate", "5000"], "20 to 1000"),
        (["--rate", "300"], "500 or 250 Hz would do"),
        (["--rate", "1000"], "500 Hz would do"),
        (["--token-file", "nowhere"], "No such file"),
        (["--token-file", "a", "--token", "b"], "give one of them"),
        (["--log-size", "0"], "1 to 100000"),
        (["--port", "123456"], "0 to 65535"),
        (["--calibration", "nowhere.toml"], "servo backends only; --backend mujoco"),
        (
            ["--backend", "dynamixel:emulated", "--calibration", "nowhere.toml"],
            "no such file",
        ),
    ],
)
def test_bad_options_are_refused_with_what_would_work(capsys, options, told):
    code, _, said = call(capsys, "serve", *options)
    assert code == 2
    assert told in said


def test_the_shipped_library_is_qualified_for_todays_robot():
    from gaitchain.discover.loaded_robot import load_robot

    library = load_library(shipped_library(), load_robot("res"))
    assert library.qualified
    assert library.family is STRIDES
    assert library.command_range.vx[1] > 0.5


def _is_punch(text):
    return text.startswith("punch: a push of ")
