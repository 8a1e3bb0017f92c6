"""Where machine code is kept from one process to the next. Ours.

In the package's own folder where that can be written, else in the user's cache, else
with temporary files. In an image that was warmed up and is run read-only, or as another
user, that code is taken over; what cannot be written at all each process compiles.
"""

import hashlib
import os
import re
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

_IMPORTED = re.compile(r"^from gaitchain\.([\w.]+) import", re.MULTILINE)
_HERE = Path(__file__).parent


def source_files() -> list[Path]:
    """List the modules of this folder and those that they import names from.

    Machine code contains their constants and the layouts of their named tuples. Names
    are never passed on (mypy refuses it), so imports of imports do not matter.
    """
    files = set(_HERE.glob("*.py"))
    for file in sorted(files):
        for module in _IMPORTED.findall(file.read_text("utf-8")):
            path = _HERE.parent.joinpath(*module.split("."))
            files.add(path.with_suffix(".py"))
    return sorted(file for file in files if file.is_file())


def code_name() -> str:
    """Name a folder after the sources of all that is compiled.

    Numba checks the file of a function only, and would go on using an old copy of what
    it calls, or of the constants it reads, in other files.
    """
    digest = hashlib.sha256()
    for file in source_files():
        digest.update(file.read_bytes())
    return f"numba-{digest.hexdigest()[:12]}"


def find_folder(beside: Path = _HERE / "__pycache__") -> Path | None:
    """Return a folder for machine code; None where none can be written.

    Args:
        beside: the package's own.
    """
    name = code_name()
    warmed = beside / name
    for find in (lambda: beside, user_folder, _own_folder):
        kept = find()
        if kept is None:
            continue
        folder = kept / name
        with suppress(OSError):  # a folder above must not be looked into
            if warmed.is_dir() and not folder.exists():
                _take_over(warmed, folder)
        if _can_write(folder):
            if kept == beside:  # the user's is that of all installs
                _drop_others(kept, name)
            return folder
    return None


def user_folder() -> Path | None:
    """Return the user's cache folder for gaitchain; None of a user without a home."""
    given = os.environ.get("XDG_CACHE_HOME")
    if given:
        return Path(given) / "gaitchain"
    try:
        return Path.home() / ".cache" / "gaitchain"
    except RuntimeError:
        return None


def unkept() -> str:
    """Return the text that says why nothing is kept, and what to do."""
    where = [str(_HERE / "__pycache__"), *map(str, filter(None, [user_folder()]))]
    return (
        f"machine code is not kept, as neither {', '.join(where)} nor a folder for "
        "temporary files can be written: each process compiles for a minute or more; "
        "set XDG_CACHE_HOME to a folder that can"
    )


def _own_folder() -> Path | None:
    """Return a folder for temporary files that nobody else may write; None without.

    Machine code is run, so a folder that another user made does not do.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0  # Windows has one for each user
    try:
        folder = Path(tempfile.gettempdir()) / f"gaitchain-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    safe = os.name == "nt" or (found.st_uid == user and not found.st_mode & 0o077)
    return folder if safe and stat.S_ISDIR(found.st_mode) else None


def _can_write(folder: Path) -> bool:
    """Return whether there is such a folder now that takes files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _drop_others(kept: Path, name: str) -> None:
    """Remove machine code of sources that are no longer there."""
    for old in kept.glob("numba-*"):
        if old.name != name:
            shutil.rmtree(old, ignore_errors=True)


def _take_over(warmed: Path, folder: Path) -> None:
    """Copy machine code, unless another process was faster or there is no room."""
    with suppress(OSError):
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(dir=folder.parent, prefix=".part-"))
        try:
            shutil.copytree(warmed, part, dirs_exist_ok=True)
            part.rename(folder)
        except OSError:
            shutil.rmtree(part, ignore_errors=True)
