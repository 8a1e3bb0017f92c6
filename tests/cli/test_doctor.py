"""`gaitchain doctor` from the command line; its stages are in tests/commission."""

import json
import subprocess
import sys

import pytest
from servo_bench import RES

import gaitchain.cli.doctor
from gaitchain.backends.servos import plain_calibration, save_calibration
from gaitchain.cli import run
from gaitchain.commission.stages import STAGES

pytest.importorskip("dynamixel_sdk")
PROGRAM = "import sys; from gaitchain.cli import main; main(sys.argv[1:])"


@pytest.fixture
def calibration(tmp_path):
    path = tmp_path / "robot.toml"
    save_calibration(plain_calibration(RES), path)
    return path


def doctor(*words, typed=""):
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, "doctor", "res", *map(str, words)],
        input=typed,
        capture_output=True,
        text=True,
        check=False,
    )


def test_servos_need_a_calibration(capsys):
    assert run(["doctor", "res", "--port", "/dev/none"]) == 2
    assert "gaitchain calibrate" in capsys.readouterr().err


def test_a_port_that_is_not_there_is_no_go(calibration, tmp_path):
    out = tmp_path / "found.json"
    words = ["--port", "/dev/none", "--calibration", str(calibration), "--yes"]
    assert run(["doctor", "res", *words, "--quiet", "--json", str(out)]) == 1
    found = json.loads(out.read_text())
    assert not found["go"]
    assert found["stages"]["bus"]["outcome"] == "no-go"
    assert "cannot be opened" in found["stages"]["bus"]["said"]
    assert list(found["stages"]) == [stage.name for stage in STAGES]
    unreached = {stage["said"] for stage in list(found["stages"].values())[1:]}
    assert unreached == {"not reached"}


def test_nobody_lets_a_real_robot_stand_alone(calibration, tmp_path):
    out = tmp_path / "found.json"
    words = ["--port", "/dev/none", "--calibration", str(calibration), "--yes"]
    words += ["--from", "stand", "--quiet", "--json", str(out)]
    assert run(["doctor", "res", *words]) == 1
    stand = json.loads(out.read_text())["stages"]["stand"]
    assert (stand["outcome"], stand["said"]) == (
        "skipped",
        "--yes: nobody is ready to catch it",
    )


@pytest.mark.parametrize(
    ("typed", "ends"), [("q\n", "not reached"), ("s\n" * len(STAGES), "by you")]
)
def test_who_ends_or_skips_everything_has_no_go(typed, ends, tmp_path):
    out = tmp_path / "found.json"
    assert doctor("--port", "emulated", "--json", out, typed=typed).returncode == 1
    found = json.loads(out.read_text())
    assert found["go"] is False
    last = found["stages"][STAGES[-1].name]
    assert (last["outcome"], last["said"]) == ("skipped", ends)


def test_a_last_stage_that_is_a_go_is_a_go(monkeypatch, tmp_path):
    """The bus alone, as the last stage: all of them take minutes."""
    monkeypatch.setattr(gaitchain.cli.doctor, "STAGES", STAGES[:1])
    out = tmp_path / "found.json"
    words = ["--port", "emulated", "--yes", "--quiet", "--json", str(out)]
    assert run(["doctor", "res", *words]) == 0
    found = json.loads(out.read_text())
    assert found["go"] is True
    assert found["stages"]["bus"]["outcome"] == "go"


def test_what_was_found_is_written_where_it_is_interrupted(monkeypatch, tmp_path):
    def interrupted(bench):
        raise KeyboardInterrupt

    stages = STAGES[0], STAGES[1]._replace(check=interrupted)
    monkeypatch.setattr(gaitchain.cli.doctor, "STAGES", stages)
    out = tmp_path / "found.json"
    words = ["--port", "emulated", "--yes", "--quiet", "--json", str(out)]
    assert run(["doctor", "res", *words]) == 130
    found = json.loads(out.read_text())
    assert found["go"] is False
    said = [stage["outcome"] for stage in found["stages"].values()]
    assert said == ["go", "skipped"]
    assert found["stages"][STAGES[1].name]["said"] == "interrupted"


@pytest.mark.parametrize("verb", ["doctor", "calibrate"])
def test_an_empty_port_is_refused(verb, capsys):
    """As of a variable that is not set."""
    assert run([verb, "res", "--port", ""]) == 2
    said = capsys.readouterr().err
    assert said == "gaitchain: --port '': give a serial port, as /dev/ttyUSB0\n"


def test_a_person_skips_and_ends():
    done = doctor("--port", "emulated", typed="s\ns\nq\n")
    assert done.returncode == 1, done.stderr
    assert "[3 of 9] offsets" in done.stdout
    assert "[4 of 9]" not in done.stdout
    assert "by you" in done.stdout
    assert "not reached" in done.stdout


@pytest.mark.parametrize("refusal", ["no", "stop", "\u2212"])
def test_who_types_anything_but_enter_begins_nothing(refusal):
    done = doctor("--port", "emulated", "--json", "-", typed=f"{refusal}\nquit\n")
    assert json.loads(done.stdout)["stages"]["bus"]["said"] == "ended here"
    assert "type nothing or s or skip or q or quit before Enter" in done.stderr


def test_json_alone_goes_to_standard_output_and_questions_beside_it():
    done = doctor("--port", "emulated", "--json", "-", typed="s\nq\n")
    assert json.loads(done.stdout)["stages"]["bus"]["said"] == "by you"
    assert "[2 of 9] directions" in done.stderr
    assert "q to end" in done.stderr
    assert "not reached" in done.stderr


def test_quiet_questions_are_asked_beside_the_json_too():
    words = ("--port", "emulated", "--quiet", "--json", "-")
    done = doctor(*words, typed="q\n")
    assert json.loads(done.stdout)["go"] is False
    assert done.stderr.strip() == "Enter to begin, s to skip it, q to end"


def test_nobody_who_answers_ends_it():
    done = doctor("--port", "emulated", "--from", "imu")
    assert done.returncode == 2
    assert "nobody answers" in done.stderr
    assert "begun with imu" in done.stdout
