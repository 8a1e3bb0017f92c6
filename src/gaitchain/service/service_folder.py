"""The folder of a service: its settings, with the token, and its channels.

It is locked as long as the service runs. So systemd's cleaning of temporary files
leaves it alone, and the next service can tell folders that killed ones left behind.
"""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gaitchain.errors import ServiceError, temporary_folder

try:
    import fcntl
except ImportError:  # Windows: nothing is locked or cleaned there
    fcntl = None  # type: ignore[assignment]

_PREFIX = "gaitchain-serve-"


@contextmanager
def service_folder() -> Iterator[Path]:
    """Make a folder of this user alone, and remove it at the end.

    Those of services that were killed are removed, too: they hold their tokens.

    Raises:
        ServiceError: no folder for temporary files can be written.
    """
    within = temporary_folder(ServiceError)
    _clean(Path(within))
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=within))
    locked = _locked(folder, exclusive=False)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if locked is not None:
            os.close(locked)


def _clean(within: Path) -> None:
    """Remove the folders of services that do not run any more."""
    for left in within.glob(f"{_PREFIX}*"):
        # One that was made just now may not be locked yet; it is empty still.
        with suppress(OSError):
            if left.is_symlink() or not any(left.iterdir()):
                continue
            if (locked := _locked(left, exclusive=True)) is not None:
                shutil.rmtree(left, ignore_errors=True)
                os.close(locked)


def _locked(folder: Path, *, exclusive: bool) -> int | None:
    """Lock a folder; return what holds the lock, None if that fails."""
    if fcntl is None:
        return None
    kind = fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH
    file = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except OSError:
        os.close(file)
        return None
    return file
