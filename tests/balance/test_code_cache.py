"""Machine code is kept where that can be, and taken over from where it was made."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gaitchain.balance import code_cache
from gaitchain.balance.code_cache import code_name, find_folder, source_files
from gaitchain.errors import ServiceError, temporary_folder

NOWHERE = Path(__file__) / "none"  # not even root can write there


@pytest.fixture
def warmed(tmp_path, monkeypatch):
    """A package's folder with machine code that cannot be written, nor the user's."""
    beside = tmp_path / "__pycache__"
    made = beside / code_name() / "balance_0123"
    made.mkdir(parents=True)
    (made / "sane.nbi").write_bytes(b"code")
    can_write = code_cache._can_write
    read_only = [beside]
    monkeypatch.setattr(
        code_cache, "_can_write", lambda f: f.parent not in read_only and can_write(f)
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(NOWHERE))
    return beside


def content(folder):
    return {f.name: f.read_bytes() for f in folder.rglob("*") if f.is_file()}


def test_code_beside_the_package_is_used_where_it_can_be_written(tmp_path):
    beside = tmp_path / "__pycache__"
    old = beside / "numba-0123456789ab"
    old.mkdir(parents=True)
    assert find_folder(beside) == beside / code_name()
    assert not old.exists()


def test_code_of_a_read_only_package_is_taken_over_by_the_user(
    warmed, tmp_path, monkeypatch
):
    home = tmp_path / "home"
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    found = find_folder(warmed)
    assert found == home / "gaitchain" / code_name()
    assert content(found) == {"sane.nbi": b"code"}
    (found / "more.nbi").write_bytes(b"new")
    assert find_folder(warmed) == found
    assert content(found) == {"sane.nbi": b"code", "more.nbi": b"new"}
    assert [f.name for f in found.parent.iterdir()] == [code_name()]


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """The user's own folder for temporary files."""
    if os.name == "nt":
        pytest.skip("Windows has one for each user")
    monkeypatch.setattr(code_cache.tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    return tmp_path / "tmp" / f"gaitchain-{os.getuid()}"


def test_without_a_home_it_is_kept_with_temporary_files(warmed, temporary):
    found = find_folder(warmed)
    assert found == temporary / code_name()
    assert content(found) == {"sane.nbi": b"code"}
    assert temporary.stat().st_mode & 0o777 == 0o700


def test_what_another_user_could_write_is_not_run(warmed, temporary):
    temporary.mkdir()
    temporary.chmod(0o777)
    assert find_folder(warmed) is None
    temporary.rmdir()
    temporary.symlink_to(warmed.parent)
    assert find_folder(warmed) is None


def test_no_folder_at_all_is_no_error(warmed, temporary):
    temporary.write_bytes(b"")
    assert find_folder(warmed) is None
    assert find_folder(NOWHERE / "__pycache__") is None
    assert "set XDG_CACHE_HOME to a folder that can" in code_cache.unkept()


def test_without_temporary_files_there_is_no_folder(warmed, monkeypatch):
    def nowhere():
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(code_cache.tempfile, "gettempdir", nowhere)
    assert find_folder(warmed) is None
    with pytest.raises(ServiceError, match="set TMPDIR to one that can"):
        temporary_folder(ServiceError)


def test_a_home_that_must_not_be_looked_into_is_passed_by(
    warmed, temporary, monkeypatch
):
    """As of root in a container of another user."""
    exists = Path.exists

    def refused(path, **how):
        if path.is_relative_to(NOWHERE):
            raise PermissionError(13, "Permission denied")
        return exists(path, **how)

    monkeypatch.setattr(Path, "exists", refused)
    assert find_folder(warmed) == temporary / code_name()


def test_a_folder_that_another_user_made_in_it_is_passed_by(
    warmed, tmp_path, temporary, monkeypatch
):
    """As after `sudo gaitchain warm-up`, which has the user's home."""
    home = tmp_path / "home"
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    (home / "gaitchain").mkdir(parents=True)
    (home / "gaitchain" / code_name()).write_bytes(b"")  # no folder for this one
    assert find_folder(warmed) == temporary / code_name()


def test_other_installs_keep_their_code_in_the_users_cache(
    warmed, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    other = tmp_path / "gaitchain" / "numba-0123456789ab"
    other.mkdir(parents=True)
    find_folder(warmed)
    assert other.is_dir()


def test_a_user_without_a_home_is_no_error(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(code_cache.Path, "home", homeless)
    assert code_cache.user_folder() is None
    assert "__pycache__ nor a folder" in code_cache.unkept()


DOUBLED = """
from gaitchain.balance.compiled import compiled

@compiled
def twice(x: float) -> float:
    return 2.0 * x
"""
CALLED = """
import sys
from gaitchain.balance import code_cache
if sys.argv[1] == "folder":
    code_cache.find_folder = lambda: None
from numba.core.caching import IndexDataCacheFile
def full(*_):
    raise OSError(28, "No space left on device")
IndexDataCacheFile.save = full
from doubled import twice
from gaitchain.balance.compiled import cache_trouble
print(twice(3.0), cache_trouble())
"""


@pytest.mark.slow
@pytest.mark.parametrize("lacks", ["folder", "room"])
def test_what_cannot_be_kept_is_compiled_all_the_same(lacks, tmp_path):
    """In a fresh interpreter."""
    (tmp_path / "doubled.py").write_text(DOUBLED, "utf-8")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-c", CALLED, lacks]
    environment = {**os.environ, "PYTHONPATH": path}
    said = subprocess.check_output(command, env=environment, text=True)
    assert said.startswith("6.0 ")
    assert "XDG_CACHE_HOME" in said
    assert ("No space left" in said) == (lacks == "room")


@pytest.fixture
def kept(tmp_path):
    """Run a small compiled function in fresh interpreters that keep its code."""
    (tmp_path / "doubled.py").write_text(DOUBLED, "utf-8")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    called = f"""
import os
from pathlib import Path
from gaitchain.balance import code_cache
code_cache.find_folder = lambda: Path({str(tmp_path / "kept")!r})
from doubled import twice
from gaitchain.balance.compiled import cache_trouble
print(twice(3.0), sum(twice.stats.cache_hits.values()), cache_trouble())"""

    def run():
        environment = {**os.environ, "PYTHONPATH": path}
        return subprocess.check_output(
            [sys.executable, "-c", called], env=environment, text=True
        ).strip()

    assert run() == "6.0 0"
    assert run() == "6.0 1"
    return tmp_path / "kept", run


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize("left", [0, 40])
def test_a_file_that_a_power_cut_damaged_is_compiled_anew(kept, kind, left):
    folder, run = kept
    (file,) = folder.rglob(f"*.{kind}")
    file.write_bytes(file.read_bytes()[:left])
    assert run() == "6.0 0"
    assert run() == "6.0 1"


@pytest.mark.slow
def test_a_damaged_file_in_a_folder_that_cannot_be_written_is_no_end(kept):
    folder, run = kept
    (file,) = folder.rglob("*.nbi")
    file.unlink()
    file.mkdir()  # not even root can write there
    assert run().startswith("6.0 0 ")
    assert "machine code cannot be kept" in run()


def test_the_name_is_that_of_all_that_machine_code_contains(monkeypatch, tmp_path):
    """Targets and constants lie in other folders; old machine code must not serve."""
    files = source_files()
    package = Path(code_cache.__file__).parents[1]
    for name in ("gait/step_target.py", "messages.py", "balance/curves.py"):
        assert package / name in files, name
    name = code_name()
    changed = tmp_path / "messages.py"
    changed.write_text((package / "messages.py").read_text("utf-8") + "# new", "utf-8")
    others = [file for file in files if file.name != changed.name]
    monkeypatch.setattr(code_cache, "source_files", lambda: [*others, changed])
    assert code_name() != name
