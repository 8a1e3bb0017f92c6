"""Files of a service outlast what becomes of the user's own."""

import pytest

from gaitchain.errors import ServiceError
from gaitchain.service.kept_files import keep_files
from gaitchain.service.settings import Settings


def given(folder):
    """Return settings that name two files, and a folder for the service."""
    library, calibration = folder / "my.gait", folder / "my.toml"
    library.write_bytes(b"library")
    calibration.write_bytes(b"calibration")
    service = folder / "service"
    service.mkdir()
    return Settings(library=str(library), calibration=str(calibration)), service


def test_copies_are_put_back_as_they_were(tmp_path):
    settings, folder = given(tmp_path)
    kept = keep_files(settings, folder)
    assert (kept.settings.library, kept.settings.get_up) == (
        str(folder / "library.gait"),
        None,
    )
    (tmp_path / "my.gait").unlink()
    (tmp_path / "my.toml").write_bytes(b"of another robot")
    for copy in folder.iterdir():
        copy.unlink()
    kept.put_back()
    assert (folder / "library.gait").read_bytes() == b"library"
    assert (folder / "calibration.toml").read_bytes() == b"calibration"


def test_a_file_that_is_gone_is_named(tmp_path):
    settings, folder = given(tmp_path)
    (tmp_path / "my.toml").unlink()
    with pytest.raises(ServiceError, match=r"my\.toml: cannot be read"):
        keep_files(settings, folder)
