"""The exercise of a robot of servos: emulated ones, by the computer's own clock."""

import os
import sys
from dataclasses import replace

import numpy as np
import pytest
from patience import PATIENCE_S
from servo_bench import RES, patient_bus

from gaitchain.backends.dynamixel.make import MAKE
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.backends.servos import ServoBackend
from gaitchain.backends.servos.bus_load import BusLoad
from gaitchain.backends.servos.calibration import LOW_PWM, MOST_PWM, plain_calibration
from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.cli import run
from gaitchain.errors import BackendError, ServosStoppedError
from gaitchain.identify.log import load_log
from gaitchain.identify.on_servos import exercise_servos
from gaitchain.live import exercise as motions
from gaitchain.live import joint_mover
from gaitchain.live.clock import Clock
from gaitchain.live.joint_mover import JointMover
from gaitchain.messages import GRAVITY
from gaitchain.robot.turn import turn_matrix
from gaitchain.walker.upright import tilt_deg

_ATTEMPTS = 5
_LONGEST_WATCHDOG_S = 2.5


class Jumps(Clock):
    """A clock that is where one waits for it to be."""

    def __init__(self):
        self._now = 0.0

    def now(self):
        return self._now

    def sleep_until(self, time_s):
        self._now = max(self._now, time_s)


class Watched(MujocoBackend):
    """The simulator as a robot that can be let go of."""

    def __init__(self, spoilt=None):
        super().__init__(RES)
        self.on, self.times, self._spoilt = False, 0, spoilt

    def engage(self):
        self.on = True
        super().engage()

    def release(self):
        self.on = False
        super().release()

    def read(self):
        self.times += 1
        seen = super().read()
        return seen if self._spoilt is None else self._spoilt(self.times, seen)


def exercised(backend, clock=None, write_s=0.0):
    asked = []

    def ready(motion):
        assert not backend.on, "the torque is off while a person is at the robot"
        asked.append(motion.support)
        backend.connect(np.array(RES.legs.stand))

    told = lambda stage, done, total: None  # noqa: E731
    clock = clock or Jumps()
    return exercise_servos(RES, backend, ready, told, clock, write_s=write_s), asked


def test_it_is_held_up_and_then_stands():
    backend = Watched()
    log, asked = exercised(backend)
    assert asked == ["held", "standing"] == [p.motion.support for p in log.parts]
    assert not backend.on
    for part in log.parts:
        assert len(part.measured.joint_position) == len(part.motion.targets)
        off = part.measured.joint_position - part.motion.targets
        assert np.abs(off).max() < 0.2


@pytest.mark.parametrize("when", [0, 1])
def test_a_packet_that_was_lost_is_no_measurement(when):
    """Every other one, also in the first period: an old angle looks like delay."""

    def spoilt(times, seen):
        if times % 2 == when and times > 1:
            seen.joint_position[4] = np.nan
        return seen

    log, _ = exercised(Watched(spoilt))
    for part in log.parts:
        off = part.measured.joint_position - part.motion.targets
        lost = np.isnan(off)
        assert lost.sum() == lost[:, 4].sum() == len(off) // 2
        assert np.nanmax(np.abs(off)) < 0.2


def test_no_target_is_beyond_what_the_servos_do():
    """A knee whose servo ends early: what it was not sent is not in the log."""
    knee = RES.legs.knee
    low, high = np.full(12, -9.0), np.full(12, 9.0)
    high[knee] = most = RES.legs.stand[knee] + 0.1

    class Narrow(Watched):
        limits = low, high

    log, _ = exercised(Narrow())
    plain, _ = exercised(Watched())
    moved = [part.motion.targets[:, knee] for part in (*log.parts, *plain.parts)]
    assert max(moved[0].max(), moved[1].max()) <= most
    assert max(moved[2].max(), moved[3].max()) > most, "else nothing is shown"
    assert np.ptp(moved[0]) > 0.03, "it still swings"


def test_a_log_tells_where_the_computer_was_held_up(monkeypatch):
    """By the times of its rows: of ticks that were left out nothing else tells."""
    monkeypatch.setattr(motions, "_SECONDS", dict.fromkeys(motions._SECONDS, 4.0))
    clock, held_up = Jumps(), 500

    def timed(times, seen):
        if times == held_up:
            clock.sleep_until(clock.now() + 0.08)
        return replace(seen, time=clock.now())

    log, _ = exercised(Watched(timed), clock)
    assert log.late_s == pytest.approx(0.08)
    assert "up to 80 ms late, at most 30 ms can be fitted" in log.uneven


def test_a_log_tells_how_long_the_bus_takes_from_a_read_to_its_target(monkeypatch):
    """3 ms of reading, and 1 ms of targets on the line."""
    monkeypatch.setattr(motions, "_SECONDS", dict.fromkeys(motions._SECONDS, 4.0))
    clock = Jumps()

    def slow(times, seen):
        clock.sleep_until(clock.now() + 0.003)
        return seen

    log, _ = exercised(Watched(slow), clock, write_s=0.001)
    rows = sum(len(part.motion.targets) for part in log.parts)
    np.testing.assert_allclose(log.turnarounds_s, np.full(rows, 0.004))


def test_a_robot_that_cannot_stand_level_is_not_put_on_the_ground():
    """A knee that ends 15 deg before the standing pose: the other one would not."""
    knee = RES.legs.knee
    low, high = np.full(12, -9.0), np.full(12, 9.0)
    high[knee] = RES.legs.stand[knee] - np.radians(15.0)

    class Short(Watched):
        limits = low, high

    backend = Short()
    with pytest.raises(
        BackendError, match="left_knee ends 21 deg before what the least"
    ):
        exercised(backend)
    assert not backend.on


def test_a_servo_that_turns_elsewhere_is_named():
    knee = RES.legs.knee
    low, high = np.full(12, -9.0), np.full(12, 9.0)
    low[knee] = np.radians(85.0)

    class Elsewhere(Watched):
        limits = low, high

    with pytest.raises(BackendError, match="left_knee: its servo may turn from 85 to"):
        exercised(Elsewhere())


def silent(times, seen):
    if times > 100:
        seen.joint_position[4] = np.nan
    return seen


def leaning(times, seen):
    if times > 4000:
        seen.acceleration[:] = 5.0, 0.0, 8.0
    return seen


def unfelt(times, seen):
    if times > 4000:
        seen.acceleration[:] = np.nan
    return seen


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        (silent, "left_ankle_pitch has not answered"),
        (unfelt, "the IMU has not answered for 0.25 s"),
        (leaning, "leans by 2. deg, at most 25"),
    ],
)
def test_what_fails_ends_it_with_the_torque_off(spoilt, words):
    backend = Watched(spoilt)
    with pytest.raises(BackendError, match=words):
        exercised(backend)
    assert not backend.on


@pytest.mark.parametrize("further_deg", [0.0, 35.0])
def test_a_trunk_leans_as_far_as_it_is_asked_to(further_deg):
    """By 32 deg, with level soles; what it leans further ends the motion."""
    legs, bow = legs_of(RES), np.zeros((40, 6))
    bow[:, 4] = np.linspace(0.0, np.radians(32.0), len(bow))
    targets = motions._swaying(RES, bow)
    further = turn_matrix(np.array([0.0, -np.radians(further_deg), 0.0]))

    def shown(times, seen):
        up = posture(legs, mover.target).feet[0, :, 2]
        seen.acceleration[:] = GRAVITY * (further @ up)
        return seen

    backend = Watched(shown)
    mover = JointMover(RES, backend, Jumps(), 0.01, what="a bow", upright=True)
    backend.connect(targets[0])
    mover.begin()
    for row in targets if not further_deg else targets[:1]:
        mover.go(row)
    if further_deg:
        with pytest.raises(BackendError, match=r"a bow ended: .* leans by 2\d deg"):
            mover.go(targets[-1])
    else:
        assert tilt_deg(mover.seen[-1].acceleration) > 30.0


def test_servos_that_stopped_by_themselves_are_exercised_by_the_same_command():
    """Nobody can engage them again within it."""

    class Stopped(Watched):
        def write(self, position):
            raise ServosStoppedError("/dev/bus: the servos have stopped")

    backend = Stopped()
    said = "the exercise ended: /dev/bus: the servos have stopped; begin again with the"
    with pytest.raises(BackendError, match=said + " same command$"):
        exercised(backend)
    assert not backend.on


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give either --port"),
        (["--port", "x", "--robot-hidden", "1"], "give either --port"),
        (["--port", "/dev/none"], "servos need a calibration"),
        (["--robot-hidden", "1", "-o", "a.toml"], "not with -o"),
        (["--robot-hidden", "1", "--view", "0"], "--view: shows what servos are"),
        (["--robot-hidden", "1", "--calibration", "a.toml"], "--calibration is of"),
        (["--port", "emulated", "--baud", "57600"], "--baud: has no effect"),
        (["--port", "emulated", "--make", "feetech"], "--make: has no effect"),
        (["--port", "emulated", "--limits"], "--limits: has no effect"),
    ],
)
def test_options_that_do_not_go_together(words, said, tmp_path, capsys):
    log = str(tmp_path / "a.log")
    assert run(["calibrate", "res", "--exercise", log, *words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")
def test_emulated_servos_exercise_in_real_time(tmp_path, monkeypatch):
    """A person answers both questions; servos on a pseudo-terminal move."""
    pytest.importorskip("dynamixel_sdk")
    seconds = dict.fromkeys(motions._SECONDS, 4.0)
    monkeypatch.setattr(motions, "_SECONDS", seconds)
    # A busy machine may keep the bus silent for longer than servos may be.
    monkeypatch.setattr(joint_mover, "_SILENT_S", PATIENCE_S)
    monkeypatch.setattr(f"{ServoBackend.__module__}._SILENCE_S", PATIENCE_S)
    defaults = ServoBackend.__init__.__kwdefaults__
    monkeypatch.setitem(defaults, "watchdog_s", _LONGEST_WATCHDOG_S)
    path = tmp_path / "a.log"
    words = ["calibrate", "res", "--exercise", str(path), "--port", "emulated"]
    words += ["--view", "0"]
    limits, limit = [], ServoBackend.limit_torque

    def noted(backend, most_pwm):
        limits.append(most_pwm)
        limit(backend, most_pwm)

    monkeypatch.setattr(ServoBackend, "limit_torque", noted)

    def exercises():
        reading, writing = os.pipe()
        os.write(writing, b"\n\n")
        with os.fdopen(reading) as answers, os.fdopen(writing, "w"):
            monkeypatch.setattr(sys, "stdin", answers)
            return run(words) == 0

    with patient_bus():
        assert any(exercises() for _ in range(_ATTEMPTS))
    assert limits[-2:] == [LOW_PWM, MOST_PWM], "hung legs are limited"
    log = load_log(path)
    line_s = BusLoad(12, plain_calibration(RES).baud, make=MAKE).write_s
    assert 0.0 < line_s < log.turnarounds_s.min()
    for part in log.parts:
        assert len(part.motion.targets) == 400
        assert np.isnan(part.measured.acceleration).all(), "it has no IMU"
        off = part.measured.joint_position - part.motion.targets
        assert np.isfinite(off).mean() > 0.5, "a busy machine loses some"
        assert np.sqrt(np.nanmean(off**2)) < 0.1
