"""`gaitchain calibrate`: a scripted person moves emulated servos as they are told."""

import dataclasses
import json
import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import msgspec
import numpy as np
import planned_library
import pytest
from commands import call
from servo_bench import RES, STAND, TURN, Clock, mounted_oddly

from gaitchain.backends.dynamixel.control_table import (
    HIGHEST_POSITION,
    LOWEST_POSITION,
    MODELS,
    OPERATING_MODE,
)
from gaitchain.backends.servos import (
    ServoBusEmulator,
    load_calibration,
    save_calibration,
)
from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.calibration import ImuCalibration, JointCalibration
from gaitchain.backends.servos.emulator import EmulatedImu
from gaitchain.backends.servos.guide import (
    Mounted,
    angle_of,
    ends_at_zero,
    joint_at,
    joint_words,
    seen_limits,
    who_moved,
)
from gaitchain.backends.servos.setup import ServoSetup
from gaitchain.backends.servos.table import Block, Model
from gaitchain.cli.prompt import Answers
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import save_library

pytest.importorskip("dynamixel_sdk")
PROGRAM = "import sys; from gaitchain.cli import main; main(sys.argv[1:])"
IMU = ImuCalibration(200, 38, 44, 0.001, 0.002)
IDS = ",".join(str(joint.id) for joint in mounted_oddly().joints.values())


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """RES, and any steps at all: only the robot counts here."""
    path = tmp_path_factory.mktemp("library") / "res.gait"
    with pytest.MonkeyPatch.context() as patch:
        every = lambda poses, timing, limit: np.ones((6, 6), bool)  # noqa: E731
        patch.setattr(planned_library, "feasible_pairs", every)
        save_library(planned_library.planned_library(RES), path)
    return path


@pytest.fixture
def truth():
    """How the servos are really mounted."""
    return mounted_oddly()


@pytest.fixture
def bus(truth):
    with ServoBusEmulator.like(truth, STAND, clock=Clock()) as bus:
        yield bus


class Person:
    """Does what the program says, and reads what it answers."""

    def __init__(self, bus, truth, *words):
        self.bus, self.truth = bus, truth
        self.talk = []
        self.program = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, "calibrate", *map(str, words)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def answer(self, act):
        """Act on each line until the program ends; return its exit code."""
        with self.program as program:
            for line in program.stdout:
                self.talk.append(line.rstrip())
                typed = act(line)
                if typed is not None:
                    program.stdin.write(typed + "\n")
                    program.stdin.flush()
        return program.returncode

    def move(self, name, degrees):
        """Move a joint by hand."""
        joint = self.truth.joints[name]
        now = self.bus.angle_deg(joint.id)
        self.bus.turn(joint.id, now + joint.sign * degrees)

    def put(self, name, degrees):
        """Bring a joint to an angle."""
        joint = self.truth.joints[name]
        self.bus.turn(joint.id, joint.offset + joint.sign * degrees)


def as_mounted(found, truth):
    """Ids, signs and models are the same, offsets as well as anybody can see."""
    for name, joint in truth.joints.items():
        other = found.joints[name]
        assert (other.id, other.sign, other.model) == (
            joint.id,
            joint.sign,
            joint.model,
        )
        assert other.offset == pytest.approx(joint.offset, abs=0.1)


@pytest.mark.slow
def test_a_person_calibrates_a_robot(library, truth, bus, tmp_path):
    """Straight legs, one joint moved the other way, one mistake, one twice."""
    out = tmp_path / "robot.toml"
    person = Person(bus, truth, library, "--port", bus.port, "-o", out, "--baud", 57600)
    seen = {}

    def move(name):
        """Return what is typed after moving a joint; mistakes are made once."""
        seen[name] = seen.get(name, 0) + 1
        if name == "left_hip_roll":
            person.move(name, -20.0)
            return "-"
        if seen[name] == 1 and name == "left_knee":
            return ""  # forgot it
        if seen[name] == 1 and name == "left_ankle_roll":
            person.move("left_knee", 30.0)  # took the wrong one
            return ""
        if seen[name] == 1 and name == "right_knee":
            person.move("right_hip_pitch", 20.0)  # two at once
        person.move(name, 25.0)
        return ""

    def act(line):
        step = re.match(r"\[\d+ of 12\] (\w+): ", line)
        if step is not None:
            return move(step[1])
        if "Stretch both legs" in line:
            for name in truth.joints:
                person.put(name, 0.0)
        elif "Hang the robot up" not in line:
            return None
        return ""

    code = person.answer(act)
    talk = "\n".join(person.talk)
    assert code == 0, talk
    assert "no servo has turned by 8 deg" in talk
    assert "which moves left_knee: once more" in talk
    assert "move one joint alone: once more" in talk
    assert not any(servo.torque_seen for servo in bus.servos.values())
    found = load_calibration(out, RES)
    as_mounted(found, truth)
    assert found.baud == 57_600
    assert {joint.pwm_limit for joint in found.joints.values()} == {40.0}
    for joint in found.joints.values():
        assert (joint.lower, joint.upper) == pytest.approx((-80.0, 80.0), abs=0.1)


def sweep(bus, person, name, angles):
    """Move a joint on with the packets on the bus; return when it has been through.

    It stays for some packets, as a busy computer may lose the answer to one.
    """
    answer, done = bus.bus.answer, threading.Event()
    left = [angle for angle in angles for _ in range(4)]

    def answering(data):
        if left:
            person.put(name, left.pop(0))
        else:
            done.set()
        return answer(data)

    bus.bus.answer = answering
    assert done.wait(30.0)
    bus.bus.answer = answer


@pytest.mark.slow
def test_limits_found_by_hand_in_the_standing_pose(library, truth, bus, tmp_path):
    out = tmp_path / "robot.toml"
    save_calibration(msgspec.structs.replace(truth, imu=IMU), out)
    words = (library, "--port", bus.port, "-o", out, "--pose", "standing", "--limits")
    person = Person(bus, truth, *words, "--ids", IDS, "--baud", "1000000")
    bus.servos[2].put(HIGHEST_POSITION, 2400)  # the left hip yaw's builder was careful
    told = []

    def act(line):
        step = re.match(r"\[\d+ of 12\] (\w+): ", line)
        ends = re.match(r"(\w+): move it slowly to both ends", line)
        if step is not None:
            person.move(step[1], 20.0)
        elif "standing pose above" in line:
            for name, angle in zip(truth.joints, np.degrees(STAND), strict=True):
                person.put(name, angle)
        elif ends is not None:
            told.append(ends[1])
            often = told.count(ends[1])
            if (ends[1], often) == ("right_knee", 1):  # not as far as it stands
                sweep(bus, person, ends[1], [0.0, -45.0, 0.0, 40.0, 10.0])
            elif (ends[1], often) != ("left_knee", 1):
                sweep(bus, person, ends[1], [0.0, -45.0, 0.0, 70.0, 10.0])
        elif "Hang the robot up" not in line:
            return None
        return ""

    code = person.answer(act)
    talk = "\n".join(person.talk)
    assert code == 0, talk
    assert "its table [imu] is kept" in talk
    assert "its values of pwm_limit are kept" in talk
    assert re.search(r"it was moved from 63\.\d to 63\.\d deg only", talk)
    assert re.search(r"it stands at 63\.\d deg and was moved from .* past where", talk)
    assert told.count("right_knee") == 2
    assert "left_hip_yaw: limits -80.0 to 80.0 deg narrowed to -80.0 to 60.9" in talk
    found = load_calibration(out, RES)
    as_mounted(found, truth)
    assert found.imu == IMU
    assert {joint.pwm_limit for joint in found.joints.values()} == {100.0}
    for name, joint in found.joints.items():
        high = 60.9 if name == "left_hip_yaw" else 69.0
        assert (joint.lower, joint.upper) == pytest.approx((-44.0, high), abs=0.2)
    assert not any(servo.torque_seen for servo in bus.servos.values())


@pytest.mark.slow
def test_a_servo_that_does_not_reach_the_stand_is_told_before_limits(
    library, truth, bus, tmp_path
):
    """Before a person moves twelve joints to their ends in vain."""
    out = tmp_path / "robot.toml"
    words = (library, "--port", bus.port, "-o", out, "--ids", IDS, "--baud", "1000000")
    bus.servos[truth.joints["left_knee"].id].put(LOWEST_POSITION, 1500)
    person = Person(bus, truth, *words, "--limits")

    def act(line):
        if "move it slowly" in line:
            person.program.stdin.close()
            return None
        return stretched(person, line)

    code = person.answer(act)
    talk = "\n".join(person.talk)
    assert code == 2, talk
    assert re.search(r"left_knee stands at 63\.\d deg, outside -80\.0 to 33\.1", talk)
    assert "turn the horn of id 11" in talk
    assert "move it slowly" not in talk
    assert not out.exists()


def stretched(person, line):
    """Move each joint as asked, and stretch both legs; return what is typed."""
    step = re.match(r"\[\d+ of 12\] (\w+): ", line)
    if step is not None:
        person.move(step[1], 25.0)
    elif "Stretch both legs" in line:
        for name in person.truth.joints:
            person.put(name, 0.0)
    elif "Hang the robot up" not in line:
        return None
    return ""


def of_feetech(truth):
    """The same mounting, of STS servos."""
    joints = {n: TURN(j, model="sts3215") for n, j in truth.joints.items()}
    return TURN(truth, make="feetech", joints=joints)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({}, "they are of dynamixel servos"),
        ({"make": "feetech"}, None),
        ({"make": "feetech", "fingerprint": "0" * 16}, "they are of another robot"),
    ],
)
def test_what_was_set_for_others_is_not_kept(changed, why, library, truth, tmp_path):
    """The torque limit of another make is another register."""
    pytest.importorskip("scservo_sdk")
    out, sts = tmp_path / "robot.toml", of_feetech(truth)
    earlier = sts if changed else truth
    save_calibration(TURN(earlier, imu=IMU, **changed), out)
    words = (library, "--make", "feetech", "--ids", IDS, "--baud", "1000000", "-o", out)
    with ServoBusEmulator.like(sts, STAND, clock=Clock()) as bus:
        person = Person(bus, sts, *words, "--port", bus.port)
        code = person.answer(lambda line: stretched(person, line))
    talk = "\n".join(person.talk)
    assert code == 0, talk
    found = load_calibration(out, RES)
    as_mounted(found, sts)
    kept = {joint.pwm_limit for joint in found.joints.values()}, found.imu
    assert kept == (({40.0}, None) if why else ({100.0}, IMU))
    if why:
        told = re.findall(r".* not kept: .*", talk)
        assert len(told) == 1
        assert "pwm_limit and its table [imu]" in told[0]
        assert why in told[0]
        assert "pwm_limit is 40 %" in talk


def test_a_file_that_cannot_be_read_is_not_overwritten(
    library, truth, bus, tmp_path, capsys, monkeypatch
):
    """It may hold torque limits and an IMU that a new one would lose."""
    out = tmp_path / "robot.toml"
    save_calibration(truth, out)
    out.write_text(broken := out.read_text() + "\n[imu\n")
    ours, _ = os.openpty()
    with os.fdopen(ours) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        code, said, error = call(
            capsys, "calibrate", library, "--port", bus.port, "-o", out
        )
    assert code == 2
    assert "not a TOML file" in error
    assert "or write to another file" in error
    assert not said
    assert out.read_text() == broken


@pytest.mark.slow
def test_an_imu_whose_id_a_servo_has_is_refused_before_the_work(
    library, truth, tmp_path
):
    out = tmp_path / "robot.toml"
    save_calibration(msgspec.structs.replace(truth, imu=IMU), out)
    before = out.read_text()
    knee = msgspec.structs.replace(truth.joints["left_knee"], id=IMU.id)
    joints = truth.joints | {"left_knee": knee}
    changed = msgspec.structs.replace(truth, joints=joints)
    with ServoBusEmulator.like(changed, STAND, clock=Clock()) as bus:
        words = ("--port", bus.port, "-o", out, "--ids", f"{IDS},{IMU.id}")
        person = Person(bus, changed, library, *words, "--baud", "1000000")
        code = person.answer(lambda line: stretched(person, line))
    talk = "\n".join(person.talk)
    assert code == 2, talk
    assert "imu.id = 200 is a servo on this bus" in talk
    assert "Hang the robot up" not in talk
    assert out.read_text() == before


@pytest.fixture
def piped(monkeypatch):
    """Answers that are there before the questions."""
    read, write = os.pipe()
    os.write(write, b"\n\n\n")
    os.close(write)
    with os.fdopen(read) as answers:
        monkeypatch.setattr(sys, "stdin", answers)
        yield
        monkeypatch.undo()


@pytest.mark.usefixtures("piped")
def test_when_the_answers_end_nothing_is_written(library, bus, tmp_path, capsys):
    out = tmp_path / "robot.toml"
    words = ("--port", bus.port, "-o", out, "--baud", "1000000", "--ids", IDS)
    code, said, error = call(capsys, "calibrate", library, *words)
    assert code == 2
    assert said.count("no servo has turned by 8 deg") == 2
    assert "nobody answers: run it in a terminal" in error
    assert not out.exists()


@pytest.mark.usefixtures("piped")
def test_what_a_person_is_told_is_not_among_the_results(library, bus, tmp_path, capsys):
    out = tmp_path / "robot.toml"
    words = ("--port", bus.port, "-o", out, "--baud", "1000000", "--ids", IDS)
    code, said, error = call(capsys, "calibrate", library, *words, "--json", "-")
    assert (code, said) == (2, "")
    assert "Servos on" in error
    assert "Hang the robot up" in error
    assert "no servo has turned by 8 deg" in error


def test_without_anybody_to_ask_nothing_is_touched(
    library, bus, tmp_path, capsys, monkeypatch
):
    with Path(os.devnull).open() as nobody:
        monkeypatch.setattr(sys, "stdin", nobody)
        words = ("--port", bus.port, "-o", tmp_path / "robot.toml")
        code, _, error = call(capsys, "calibrate", library, *words)
    assert code == 2
    assert "run it in a terminal, or pipe a line for each question" in error


def test_a_terminal_is_somebody(capsys):
    ours, theirs = os.openpty()
    with os.fdopen(theirs) as terminal, os.fdopen(ours, "wb", buffering=0) as person:
        answers = Answers(terminal)
        words = iter([b"- \n", b"yes\n"])

        def typing():
            if next_words := next(words, None):
                person.write(next_words)

        assert answers.ask("first?", typing) == "-"
        assert answers.ask("second?", typing) == "yes"
    assert capsys.readouterr().out == "first?\nsecond?\n"


def test_a_choice_is_asked_until_it_is_one(capsys):
    """A minus of another keyboard is no sign, and "no" is no Enter."""
    ours, theirs = os.openpty()
    with os.fdopen(theirs) as terminal, os.fdopen(ours, "wb", buffering=0) as person:
        answers = Answers(terminal)
        words = iter(["\u2212\n", "--\n", "no\n", "-\n", "stop\n", "\n", "Yes\n"])

        def typing():
            if "which?" in capsys.readouterr().out:
                person.write(next(words).encode())

        def choose(*known):
            return answers.choose("which?", *known, meanwhile=typing)

        assert choose("-") == "-"
        assert choose() == ""
        assert choose("-") == ""


def test_who_refuses_to_exercise_is_not_moved(library, tmp_path):
    log = tmp_path / "exercise.log"
    words = ("calibrate", library, "--exercise", log, "--port", "emulated")
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, words)],
        input="no\nstop\n",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout.count("type nothing before Enter") == 2
    assert "nobody answers" in done.stderr
    assert not log.exists()


@pytest.mark.parametrize("early", [b"\n", b"\n\ny\n", b"half a line"])
def test_what_is_typed_before_a_question_does_not_answer_it(early):
    """Enter, pressed while the legs swing, must not let the robot stand up."""
    ours, theirs = os.openpty()
    with os.fdopen(theirs) as terminal, os.fdopen(ours, "wb", buffering=0) as person:
        answers = Answers(terminal)
        periods = []

        def moving():
            """Type during the first motion, and the answer in the fifth period."""
            periods.append(1)
            if len(periods) == 1:
                person.write(b"first\n" + early)
            if len(periods) == 5:
                person.write(b"second\n")

        assert answers.ask("first?", moving) == "first"
        person.write(early)
        assert answers.ask("second?", moving) == "second"
        assert len(periods) >= 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda bus: bus.kill(5), "11 servos found, the robot has 12 leg joints"),
        (lambda bus: bus.cut(), "nobody answers at 1000000 bit/s"),
        (
            lambda bus: bus.servos[5].put(OPERATING_MODE, 1),
            "id 5 is in operating mode 1 (velocity)",
        ),
    ],
)
@pytest.mark.usefixtures("piped")
def test_a_bus_that_cannot_be_calibrated_is_refused(
    change, said, library, bus, tmp_path, capsys
):
    change(bus)
    words = ("--port", bus.port, "-o", tmp_path / "a.toml", "--baud", "1000000")
    code, _, error = call(capsys, "calibrate", library, *words, "--ids", IDS)
    assert code == 2
    assert said in error


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "one of -o FILE, to write a calibration, --check FILE, --exercise FILE"),
        (("-o", "a.toml", "--check", "b.toml"), "give one of"),
        (("-o", "a.toml", "--view", "0"), "--view: shows an exercise; give --exercise"),
        (("-o", "a.toml", "--ids", "300"), "--ids '300': give ids from 0 to 252"),
        (("--check", "none.toml"), "none.toml: No such file"),
        (("-o", "a.toml", "--calibration", "b.toml"), "of servos that exercise; -o"),
        (("--check", "b.toml", "--calibration", "c.toml"), "which names the one"),
        (("--check", "b.toml", "--ids", "1-12"), "--ids: has no effect with --check"),
        (("--check", "b.toml", "--make", "feetech"), "--make: has no effect with"),
        (("--check", "b.toml", "--pose", "standing"), "--pose: has no effect with"),
        (("--check", "b.toml", "--limits"), "--limits: has no effect with --check"),
        (("-o", "a.toml", "--baud", "0"), "9600 to 4500000"),
        (("--check", "b.toml", "--baud", "0"), "9600 to 4500000"),
        (("-o", "a.toml", "--baud", "10000000000"), "9600 to 4500000"),
    ],
)
@pytest.mark.usefixtures("piped")
def test_odd_options_are_refused(words, said, library, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, _, error = call(capsys, "calibrate", library, "--port", "none", *words)
    assert code == 2
    assert said in error


@pytest.mark.parametrize("option", ["-o", "--check"])
def test_emulated_servos_only_exercise(option, library, capsys, tmp_path):
    words = ("--port", "emulated", option, tmp_path / "robot.toml")
    code, _, error = call(capsys, "calibrate", library, *words)
    assert code == 2
    assert "emulated servos can only exercise, with --exercise FILE" in error
    assert len(error.splitlines()) == 1
    code, out, _ = call(capsys, "calibrate", "--help")
    assert code == 0
    assert "with `--exercise` also emulated" in " ".join(re.findall(r"[^\s│]+", out))


def check(capsys, library, bus, file):
    words = ("--port", bus.port, "--check", file)
    return call(capsys, "calibrate", library, *words)


def test_a_calibration_is_compared_with_the_bus(
    library, truth, bus, tmp_path, capsys, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "160")
    file = tmp_path / "robot.toml"
    save_calibration(truth, file)
    before = [servo.read(Block(0, 120))[1] for servo in bus.servos.values()]
    code, said, _ = check(capsys, library, bus, file)
    assert code == 0, said
    assert "all as calibrated" in said
    assert re.search(r"left_knee +. +11 +. +xm430-w350 +. +63\.\d +. +-80.0", said)
    assert re.search(r"35 +. +12\.0", said)
    assert [s.read(Block(0, 120))[1] for s in bus.servos.values()] == before


def test_a_comparison_as_json_is_json_alone(library, truth, bus, tmp_path, capsys):
    file = tmp_path / "robot.toml"
    save_calibration(truth, file)
    words = ("--port", bus.port, "--check", file, "--json", "-")
    code, said, error = call(capsys, "calibrate", library, *words)
    found = json.loads(said)
    assert (code, found["wrong"]) == (0, [])
    assert "all as calibrated" in error
    knee = next(joint for joint in found["joints"] if joint["joint"] == "left_knee")
    assert knee == {
        "joint": "left_knee",
        "id": 11,
        "model": "xm430-w350",
        "at_deg": pytest.approx(np.degrees(RES.legs.stand[3]), abs=0.1),
        "from_deg": -80.0,
        "to_deg": 80.0,
        "temperature_c": 35.0,
        "supply_v": 12.0,
        "wrong": [],
    }


def test_what_a_servo_does_not_say_is_null_in_json(
    library, truth, bus, tmp_path, capsys
):
    file = tmp_path / "robot.toml"
    save_calibration(truth, file)
    bus.kill(11)
    words = ("--port", bus.port, "--check", file, "--json", "-")
    _, said, _ = call(capsys, "calibrate", library, *words)
    knee = next(j for j in json.loads(said)["joints"] if j["joint"] == "left_knee")
    assert knee["wrong"] == ["does not answer"]
    unknown = {name for name, value in knee.items() if value is None}
    assert unknown == {"model", "at_deg", "temperature_c", "supply_v"}


def test_what_differs_is_listed(library, truth, bus, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    file = tmp_path / "robot.toml"
    joints = dict(truth.joints)
    joints["right_knee"] = TURN(joints["right_knee"], model="xm540-w270")
    save_calibration(msgspec.structs.replace(truth, joints=joints, imu=IMU), file)
    ids = {name: joint.id for name, joint in joints.items()}
    bus.kill(ids["left_hip_yaw"])
    bus.servos[ids["left_knee"]].fail(0x20)
    bus.servos[ids["left_hip_roll"]].put(OPERATING_MODE, 4)
    bus.turn(ids["right_hip_yaw"], 20.0)
    code, said, _ = check(capsys, library, bus, file)
    assert code == 1
    for name, wrong in {
        "left_hip_yaw": "does not answer",
        "left_hip_roll": "operating mode 4, not 3",
        "left_knee": "overload",
        "right_hip_yaw": "outside its limits",
        "right_knee": "not a xm540-w270",
    }.items():
        assert re.search(rf"{name} .*{wrong}", said), name
    assert "imu (id 200): the IMU does not answer" in said
    assert "6 things are wrong" in said


@pytest.mark.parametrize("block", ["present", "state", "setup", "supply"])
def test_a_servo_that_stops_answering_midway_is_a_row_of_its_own(
    block, library, truth, bus, tmp_path, capsys, monkeypatch
):
    """Whatever it was asked last: what it did not say is not told as zero."""
    monkeypatch.setenv("COLUMNS", "160")
    file, ended = tmp_path / "robot.toml", truth.joints["left_knee"].id
    save_calibration(truth, file)
    asked = ServoBus.read_surely

    def read_surely(own, ids, of):
        if of is getattr(own.make, block) and ended in ids:
            bus.kill(ended)
        return asked(own, ids, of)

    monkeypatch.setattr(ServoBus, "read_surely", read_surely)
    code, said, _ = check(capsys, library, bus, file)
    assert code == 1
    (row,) = (line for line in said.splitlines() if "left_knee" in line)
    words = f"left_knee {ended} - - -80.0 80.0 - - does not answer"
    assert re.findall(r"[\w.-]+", row) == words.split()
    assert said.count("does not answer") == 1
    assert "1 thing is wrong" in said


def imu_on(bus, truth, tmp_path, mounted=IMU, **told):
    """Put an IMU on the bus, and a calibration that tells how it is mounted."""
    device = bus.bus.devices[IMU.id] = EmulatedImu(mounted)
    device.noise_factor = 0.1  # of a usual one's, so that digits are told
    file = tmp_path / "robot.toml"
    imu = msgspec.structs.replace(IMU, **told)
    save_calibration(msgspec.structs.replace(truth, imu=imu), file)
    return device, file


def test_what_the_imu_says_is_shown(library, truth, bus, tmp_path, capsys):
    device, file = imu_on(bus, truth, tmp_path)
    device.acceleration = np.array([0.0, 1.7, 9.66])
    device.angular_velocity = np.radians([0.5, -1.0, 0.0])
    code, said, _ = check(capsys, library, bus, file)
    assert code == 0, said
    words = re.search(r"imu \(id 200\): accel.* deg/s", " ".join(said.split()))
    assert words is not None
    assert "up is 10 deg from the trunk's z" in words[0]
    shown = [float(number) for number in re.findall(r"-?\d+\.\d\d", words[0])]
    expected = [0.0, 1.7, 9.66, 9.81, 0.5, -1.0, 0.0]
    assert shown == pytest.approx(expected, abs=0.04)


@pytest.mark.parametrize(
    ("told", "turning", "wrong"),
    [
        (
            {"accelerometer_scale": 0.02},
            0.0,
            r"98\.\d+ m/s.*accelerometer_scale",
        ),
        ({"accelerometer": 60}, 0.0, r"0\.00 m/s.2 long.*its address"),
        ({"axes": ("z", "y", "-x")}, 0.0, r"up is near the trunk's \+x, 90 deg.*axes"),
        ({"axes": ("x", "-y", "-z")}, 0.0, "the trunk's -z, 180 deg from its z.*axes"),
        ({}, 0.2, "turns by 11.5 deg/s, at rest 5 at most: check gyro_scale"),
        ({"accelerometer": 60, "format": "float32"}, 0.1, "check"),
    ],
)
def test_an_imu_that_says_nonsense_is_refused(
    told, turning, wrong, library, truth, bus, tmp_path, capsys
):
    device, file = imu_on(bus, truth, tmp_path, **told)
    device.angular_velocity = np.array([0.0, turning, 0.0])
    code, said, _ = check(capsys, library, bus, file)
    assert code == 1
    assert re.search(wrong, " ".join(said.split())), said


@pytest.mark.parametrize("length", [9.81, 0.0])
def test_an_imu_that_never_changes_is_named(
    length, library, truth, bus, tmp_path, capsys
):
    """As `doctor` does: at rest, too, the last bits of a sound one change."""
    device, file = imu_on(bus, truth, tmp_path)
    device.noise_factor, device.acceleration = 0.0, np.array([0.0, 0.0, length])
    code, said, _ = check(capsys, library, bus, file)
    assert code == 1
    assert "imu (id 200): the IMU is stuck" in " ".join(said.split())


def test_how_to_move_each_joint_is_told_in_words():
    words = joint_words(RES.legs)
    assert words["left_hip_yaw"] == "turn the toes of the left foot to the left"
    assert words["right_hip_roll"] == "swing the whole right leg to the left"
    assert words["left_hip_pitch"] == "swing the whole left leg back"
    assert words["right_knee"] == "bend the right knee: its foot goes back"
    assert words["left_ankle_pitch"] == "tip the toes of the left foot down"
    assert words["right_ankle_roll"] == "lift the left edge of the right foot"


def test_the_words_follow_the_axes_of_the_robot():
    """A robot whose joints all count the other way is told the other way."""
    legs = RES.legs
    words = joint_words(dataclasses.replace(legs, axis=-legs.axis))
    assert words["left_hip_yaw"] == "turn the toes of the left foot to the right"
    assert words["left_hip_roll"] == "swing the whole left leg to the right"
    assert words["left_hip_pitch"] == "swing the whole left leg forward"
    assert words["left_knee"] == "stretch the left knee: its foot goes forward"
    assert words["left_ankle_pitch"] == "tip the toes of the left foot up"
    assert words["left_ankle_roll"] == "lift the right edge of the left foot"


def test_who_moved_is_seen_past_the_servos_zero():
    assert who_moved({1: 4090, 2: 100}, {1: 300, 2: 120}, {}) == (1, 1)
    assert who_moved({1: 10, 2: 100}, {1: 3800, 2: 100}, {}) == (1, -1)
    with pytest.raises(CommandError, match="which moves left_knee"):
        who_moved({1: 10, 2: 100}, {1: 510, 2: 100}, {1: "left_knee"})


@pytest.mark.parametrize("sign", [1, -1])
def test_a_joint_from_one_pose_is_where_it_is(sign):
    setup = ServoSetup(MODELS[1020], 0.0, 80, 0, 4095)
    joint = joint_at(Mounted(7, sign, setup), 1000, 20.0, (-60.0, 70.0))
    assert angle_of(joint, 1000) == pytest.approx(20.0, abs=1e-3)
    assert angle_of(joint, 1000 + sign * 100) == pytest.approx(20.0 + 8.79, abs=0.01)
    assert joint.model == "xm430-w350"
    assert (joint.lower, joint.upper) == (-60.0, 70.0)


def test_limits_are_narrowed_to_what_the_servo_can_do():
    setup = ServoSetup(Model("xl330-m288", 0.001), 0.0, 70, 0, 4095)
    joint = joint_at(Mounted(7, -1, setup), 100, 0.0, (-60.0, 70.0))
    assert (joint.lower, joint.upper) == pytest.approx((-60.0, 8.79), abs=0.01)
    assert joint.servo_range[0] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("counts", "ends"), [(100, True), (2048, False), (3900, True)])
def test_a_joint_whose_servo_ends_inside_its_limits_is_known(counts, ends):
    setup = ServoSetup(MODELS[1020], 0.0, 80, 0, 4095)
    for sign in (1, -1):
        joint = joint_at(Mounted(7, sign, setup), counts, 0.0, (-60.0, 70.0))
        assert ends_at_zero(joint) == ends


def test_limits_seen_keep_off_the_stops():
    assert seen_limits([0.0, -50.0, 30.0], (-80.0, 25.0), 20.0) == (-49.0, 25.0)
    with pytest.raises(CommandError, match="to both of its ends"):
        seen_limits([1.0, 2.0], (-80.0, 80.0), 1.5)


@pytest.mark.parametrize("stand", [-50.5, 30.5])
def test_limits_seen_include_the_stand(stand):
    with pytest.raises(CommandError, match="move it past where it stands"):
        seen_limits([0.0, -50.0, 30.0], (-80.0, 80.0), stand)
    assert seen_limits([-52.0, 32.0], (-80.0, 80.0), stand) == (-51.0, 31.0)


def test_a_joint_may_stand_near_its_stop():
    """It cannot be moved further, and would be asked for again without an end."""
    angles = [0.0, -50.0, 30.0]
    assert seen_limits(angles, (-80.0, 80.0), -49.7) == (-49.7, 29.0)
    assert seen_limits(angles, (-80.0, 80.0), 29.6) == (-49.0, 29.6)


def test_an_angle_is_given_within_a_turn_of_the_limits():
    joint = JointCalibration(1, 1, 10.0, -5.0, 80.0)
    assert angle_of(joint, 4096) == pytest.approx(-10.0)
