"""Whatever ends a verb that moves servos, their torque is off afterwards."""

import os
import signal
import subprocess
import sys
from itertools import cycle
from pathlib import Path

import pytest
from patience import Deadline
from servo_bench import RES

from gaitchain.backends.servos import (
    ServoBusEmulator,
    plain_calibration,
    save_calibration,
)
from gaitchain.cli import doctor, run

pytest.importorskip("dynamixel_sdk")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals"),
]
SUPPORT = Path(__file__).parents[1] / "support"
# On a busy machine the bus is silent for longer than it may be where a robot moves.
PROGRAM = """
import os
import signal
import sys
from functools import partial
from patience import PATIENCE_S
from servo_bench import patient_bus
from gaitchain.backends.servos import backend
from gaitchain.cli import doctor, main
from gaitchain.live import joint_mover

signal.signal(signal.SIGINT, signal.default_int_handler)
for end in signal.SIGHUP, signal.SIGTERM:  # the tests may run under nohup
    signal.signal(end, signal.SIG_DFL)
joint_mover._SILENT_S = backend._SILENCE_S = PATIENCE_S
backend.ServoBackend.__init__.__kwdefaults__["watchdog_s"] = 2.5
doctor.Bench = partial(doctor.Bench, watchdog_s=2.5)
if sys.argv.pop(1) == "twice":
    let_go = backend.let_go

    def ended_again(bus, ids):
        for end in signal.SIGHUP, signal.SIGTERM, signal.SIGINT:
            os.kill(os.getpid(), end)
        return let_go(bus, ids)

    backend.let_go = ended_again
with patient_bus():
    main(sys.argv[1:])
"""
EXERCISE = ["calibrate", "res", "--exercise", "a.log"]
DOCTOR = ["doctor", "res", "--yes", "--from", "directions"]
MOVES = b"swinging hung legs", b"joints wiggle"
ATTEMPTS = 5  # servos stop by themselves where a machine holds still for 2.5 s


def moves(process):
    """Whether it comes to move the servos; otherwise it has ended."""
    process.stdin.write(b"\n")
    process.stdin.flush()
    lines = iter(process.stderr.readline, b"")
    return any(word in line for line in lines for word in MOVES)


def let_go_at(end, words, folder, times="once"):
    """End a verb that moves servos; return whether it came so far."""
    calibration = plain_calibration(RES)
    save_calibration(calibration, folder / "robot.toml")
    with ServoBusEmulator.like(calibration, RES.legs.stand) as bus:
        paths = [str(SUPPORT), *filter(None, [os.environ.get("PYTHONPATH")])]
        command = [sys.executable, "-c", PROGRAM, times, *words, "--port", bus.port]
        with subprocess.Popen(
            [*command, "--calibration", "robot.toml"],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        ) as moving:
            held = moves(moving) and all(s.torque for s in bus.servos.values())
            moving.send_signal(end)
            if times == "on and on":
                keep_ending(moving)
            said = moving.stderr.read()
        assert not any(servo.torque for servo in bus.servos.values())
    assert not held or moving.returncode == 130
    assert b"Traceback" not in said
    assert b"Exception ignored" not in said
    return held


def keep_ending(process):
    """Press Ctrl-C and close the terminal, again and again, until it is gone."""
    deadline = Deadline()
    for end in cycle((signal.SIGINT, signal.SIGHUP, signal.SIGINT, signal.SIGTERM)):
        try:
            process.wait(0.002)
        except subprocess.TimeoutExpired:
            assert not deadline.passed()
            process.send_signal(end)
        else:
            return


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
    assert any(let_go_at(end, words, tmp_path) for _ in range(ATTEMPTS))


def test_who_ends_it_again_while_it_lets_go_does_not_stop_that(tmp_path):
    """A closed terminal is a hangup and a kill; who panics presses Ctrl-C twice."""
    ends = (
        let_go_at(signal.SIGHUP, DOCTOR, tmp_path, "twice") for _ in range(ATTEMPTS)
    )
    assert any(ends)


@pytest.mark.parametrize("words", [EXERCISE, DOCTOR])
def test_who_goes_on_pressing_ctrl_c_changes_nothing(words, tmp_path):
    """Until the process is gone, and not only while it lets go."""
    ends = (
        let_go_at(signal.SIGINT, words, tmp_path, "on and on") for _ in range(ATTEMPTS)
    )
    assert any(ends)


def test_a_process_that_goes_on_hears_ctrl_c_again(monkeypatch):
    """After a verb that was ended, as in a notebook."""

    def ended(options):
        for _ in range(3):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(doctor, "run", ended)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert run(["doctor", "res", "--port", "none"]) == 130
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
