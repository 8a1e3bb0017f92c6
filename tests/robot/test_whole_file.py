"""Files that are read as a whole: regular ones, of a limited size."""

import os
from pathlib import Path

import pytest

from gaitchain.analysis.record_file import load_record
from gaitchain.backends.servos.calibration_file import load_calibration
from gaitchain.discover.profile import load_profile
from gaitchain.errors import GaitchainError
from gaitchain.gait.get_up import load_get_up
from gaitchain.gait.library_file import load_library
from gaitchain.identify.log import load_log
from gaitchain.live.logs.reader import read_log
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.whole_file import read_file, replace_file, resolved

READERS = [
    load_library,
    load_record,
    load_calibration,
    load_profile,
    load_log,
    read_log,
    load_box_robot,
    lambda path: load_get_up(path, load_box_robot("res")),
]


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "pipe"
    if not hasattr(os, "mkfifo"):
        pytest.skip("pipes of POSIX")
    os.mkfifo(path)
    return path


@pytest.fixture
def ring(tmp_path):
    path = tmp_path / "ring"
    try:
        path.symlink_to("ring")
    except OSError:
        pytest.skip("links of POSIX")
    return path


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("kind", ["a pipe", "a device"])
def test_what_may_have_no_end_is_not_read(read, kind, pipe):
    """A pipe waits for its writer, and /dev/null stands for devices without an end."""
    path = pipe if kind == "a pipe" else Path(os.devnull)
    with pytest.raises(GaitchainError) as told:
        read(path)
    assert str(told.value).startswith(f"{path}: ")
    assert "no regular file; give one, not a device or a pipe" in str(told.value)


@pytest.mark.parametrize("read", READERS)
def test_a_ring_of_links_is_not_read(read, ring):
    with pytest.raises(GaitchainError, match="Too many levels of symbolic links"):
        read(ring)


@pytest.mark.parametrize("read", [one for one in READERS if one is not read_log])
def test_a_file_that_is_much_too_large_is_not_read(read, tmp_path):
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(2_000_000_000)  # which takes no room on the disk
    with pytest.raises(GaitchainError, match=r"it has 2000\.0 MB, such a file at most"):
        read(path)


def test_a_file_of_just_the_size_is_read(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_file(path, 5) == b"12345"
    with pytest.raises(OSError, match="such a file at most"):
        read_file(path, 4)
    with pytest.raises(IsADirectoryError):
        read_file(tmp_path, 5)


def test_a_ring_of_links_is_an_error_of_the_operating_system(ring):
    for work in (lambda: resolved(ring), lambda: replace_file(ring, b"")):
        with pytest.raises(OSError, match="Too many levels of symbolic links"):
            work()
