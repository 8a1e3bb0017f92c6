"""What a service was started with, kept for parts that are started again. Ours.

Parts read their files at each start. A file that was moved or replaced meanwhile would
keep a loop from starting, and motors stiff, or let it walk by another library than the
one that page and log show. So each service has copies in its own folder.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import msgspec

from gaitchain.errors import ServiceError, file_errors
from gaitchain.service.settings import Settings

_KEPT = "library", "calibration", "get_up"
"""Settings that name files; a model of the robot's own has more files than its own."""


class KeptFiles(NamedTuple):
    """The files of a service, and the settings that name its copies of them."""

    settings: Settings
    content: Mapping[Path, bytes]
    """By the path of the copy."""

    def put_back(self) -> None:
        """Write the copies that are missing.

        Raises:
            ServiceError: they cannot be written.
        """
        for path, content in self.content.items():
            if not path.exists():
                with file_errors(path, "written", ServiceError):
                    path.write_bytes(content)


def keep_files(settings: Settings, folder: Path) -> KeptFiles:
    """Copy the files that settings name into the folder of the service.

    Args:
        settings: of the service.
        folder: of the service.

    Raises:
        ServiceError: one cannot be read, or the copy not written.
    """
    copies, content = {}, {}
    for name in _KEPT:
        given = getattr(settings, name)
        if given:
            path = folder / f"{name}{Path(given).suffix}"
            with file_errors(given, "read", ServiceError):
                content[path] = Path(given).read_bytes()
            copies[name] = str(path)
    kept = KeptFiles(msgspec.structs.replace(settings, **copies), content)
    kept.put_back()
    return kept
