"""The folder of a service, and those of services that were killed."""

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from gaitchain.service.service_folder import service_folder

SERVES = """
import sys
from gaitchain.service.service_folder import service_folder
with service_folder() as folder:
    (folder / "settings.json").touch()
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def another(tmp_path, monkeypatch):
    """The folder of a service in another process, and the process."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with subprocess.Popen(
        [sys.executable, "-c", SERVES],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield Path(process.stdout.readline().strip()), process
        finally:
            process.kill()


def test_a_service_leaves_the_folder_of_another_one_alone(another):
    folder, _ = another
    with service_folder() as own:
        assert own != folder
        assert (folder / "settings.json").exists()
    assert not own.exists()


def test_the_folder_of_a_service_that_was_killed_is_removed(another, tmp_path):
    folder, process = another
    (tmp_path / "gaitchain-serve-new").mkdir()  # it is not locked yet
    process.kill()
    process.wait()
    assert folder.exists()
    with service_folder() as own:
        assert not folder.exists()
        assert {file.name for file in tmp_path.iterdir()} == {
            own.name,
            "gaitchain-serve-new",
        }
