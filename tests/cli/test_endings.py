"""Whatever ends a verb that moves servos, their torque is off afterwards."""

import os
import signal
import subprocess
import sys

import pytest
from servo_bench import RES

from gaitchain.backends.dynamixel import (
    ServoBusEmulator,
    plain_calibration,
    save_calibration,
)

pytest.importorskip("dynamixel_sdk")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals"),
]
PROGRAM = "import sys; from gaitchain.cli import main; main(sys.argv[1:])"
EXERCISE = ["calibrate", "res", "--exercise"]
DOCTOR = ["doctor", "res", "--yes", "--from", "directions"]
MOVES = b"swinging hung legs", b"joints wiggle"


@pytest.mark.parametrize(
    ("words", "end"),
    [
        (EXERCISE, signal.SIGHUP),
        (EXERCISE, signal.SIGTERM),
        (EXERCISE, signal.SIGINT),
        (DOCTOR, signal.SIGHUP),
    ],
)
def test_a_closed_terminal_turns_the_torque_off(words, end, tmp_path):
    calibration = plain_calibration(RES)
    save_calibration(calibration, tmp_path / "robot.toml")
    log = [str(tmp_path / "a.log")] if words is EXERCISE else []
    with ServoBusEmulator.like(calibration, RES.legs.stand) as bus:
        files = ["--port", bus.port, "--calibration", str(tmp_path / "robot.toml")]
        with subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *words, *log, *files],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        ) as moving:
            moving.stdin.write(b"\n")
            moving.stdin.flush()
            said = b""
            while not any(word in said for word in MOVES):
                said = moving.stderr.readline()
                assert said, "it ended before it moved"
            assert all(servo.torque for servo in bus.servos.values())
            moving.send_signal(end)
            moving.stderr.read()
        assert moving.returncode == 130
        assert not any(servo.torque for servo in bus.servos.values())
