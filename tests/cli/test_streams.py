"""Commands whose standard output nobody reads any more, or has no room left."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

FULL = Path("/dev/full")
COMMAND = [sys.executable, "-m", "gaitchain"]
NO_ROOM = "gaitchain: standard output: cannot be written: No space left on device\n"
needs_full = pytest.mark.skipif(not FULL.exists(), reason="Linux has a full device")


def run_into(output, *words):
    """Run a command whose standard output is that one."""
    command = [*COMMAND, *map(str, words)]
    error = subprocess.PIPE
    return subprocess.run(command, stdout=output, stderr=error, text=True, check=False)


def unread(*words):
    """Run a command whose standard output was closed by its reader beforehand."""
    reader, writer = os.pipe()
    os.close(reader)
    try:
        return run_into(writer, *words)
    finally:
        os.close(writer)


def without_room(*words):
    """Run a command whose standard output is on a full disk."""
    with FULL.open("w") as full:
        return run_into(full, *words)


@pytest.mark.skipif(os.name == "nt", reason="a closed pipe has another error there")
@pytest.mark.parametrize(
    "words",
    [["inspect", "res"], ["inspect", "res", "--json", "-"], ["--help"], ["--version"]],
)
def test_a_reader_that_has_ended_is_no_failure(words):
    done = unread(*words)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a closed pipe has another error there")
def test_work_goes_on_without_a_reader_and_files_are_written(tmp_path):
    out = tmp_path / "trial.json"
    words = ("--runs", 1, "--seconds", 2, "--workers", 1, "--json", out)
    done = unread("trial", "res", *words)
    assert done.returncode == 0, done.stderr
    assert json.loads(out.read_text())["survived"] == 1


@needs_full
@pytest.mark.parametrize("words", [["robots"], ["--help"], ["--version"]])
def test_a_full_disk_ends_in_one_line(words):
    done = without_room(*words)
    assert (done.returncode, done.stderr) == (2, NO_ROOM)


@needs_full
def test_files_are_written_where_standard_output_has_no_room(tmp_path):
    out = tmp_path / "found.json"
    done = without_room("inspect", "res", "--json", out)
    assert (done.returncode, done.stderr) == (2, NO_ROOM)
    assert json.loads(out.read_text())["robot"] == "Robo-Erectus Senior"


@needs_full
def test_standard_error_without_room_changes_no_exit_code():
    with FULL.open("w") as full:
        done = subprocess.run([*COMMAND, "inspect", "x.gait"], stderr=full, check=False)
    assert done.returncode == 2


def started_without(streams, *words):
    """Run a command whose process has none of these standard streams."""
    closed = " ".join(f"{number}>&-" for number in streams)
    shell = ["sh", "-c", f'exec "$@" {closed}', "sh", *COMMAND, *map(str, words)]
    return subprocess.run(shell, capture_output=True, text=True, check=False)


@pytest.mark.skipif(os.name == "nt", reason="no shell closes streams there")
@pytest.mark.parametrize("streams", ["1", "2", "012"])
def test_a_stream_that_is_missing_leads_nowhere(streams, tmp_path):
    """Files do not get its number, and what is printed is in none of them."""
    out = tmp_path / "found.json"
    done = started_without(streams, "inspect", "res", "--json", out)
    assert (done.returncode, done.stderr) == (0, "")
    assert bool(done.stdout) == ("1" not in streams)
    assert json.loads(out.read_text())["robot"] == "Robo-Erectus Senior"
    done = started_without(streams, "inspect", "x.gait")
    assert (done.returncode, done.stdout) == (2, "")
    assert bool(done.stderr) == ("2" not in streams)


@pytest.mark.skipif(os.name == "nt", reason="no shell closes streams there")
@pytest.mark.slow
@pytest.mark.parametrize("streams", ["1", "2", "012"])
def test_workers_are_started_without_a_stream(streams, tmp_path):
    """It ended in a traceback of joblib, with the exit code of a fall."""
    out = tmp_path / "trial.json"
    words = ("--runs", 2, "--seconds", 2, "--workers", 2, "--json", out, "--quiet")
    done = started_without(streams, "trial", "res", *words)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert json.loads(out.read_text())["survived"] == 2
