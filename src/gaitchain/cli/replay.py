"""`gaitchain replay`: play a log in the browser, on the page of `serve`."""

import tempfile
from pathlib import Path

from gaitchain.cli.console import say
from gaitchain.cli.files import file_of
from gaitchain.cli.libraries import given_robot
from gaitchain.cli.options import Replay
from gaitchain.errors import CommandError, temporary_folder
from gaitchain.live.logs.names import missing
from gaitchain.live.logs.reader import SUFFIX, Log, read_log
from gaitchain.robot.compare import differences
from gaitchain.robot.robot import Robot
from gaitchain.service.settings import Settings
from gaitchain.service.supervisor import serve


def run(options: Replay) -> tuple[int, dict[str, str]]:
    """Play until Ctrl-C."""
    given = given_robot(options.robot, options.profile)
    _check_there(options.log)
    log = read_log(options.log)
    if given is not None:
        _check(given, log)
    # The parts of the service load a library by its path, but this one is in the log.
    kept = temporary_folder(CommandError)
    with tempfile.TemporaryDirectory(prefix="gaitchain-replay-", dir=kept) as folder:
        library = Path(folder) / "library.gait"
        library.write_bytes(log.library_bytes)
        settings = Settings(
            library=str(library),
            port=options.port,
            replay=str(file_of(options.log)),
            drawn=options.robot,
            profile=None if options.profile is None else str(options.profile),
        )
        code = serve(settings, open_browser=not options.no_browser, say=say)
    return code, {"log": str(options.log)}


def _check_there(path: Path) -> None:
    if path.is_dir() or not path.exists():
        found = "a folder" if path.is_dir() else missing(path)
        raise CommandError(
            f"{path}: {found}; replay plays a log of `gaitchain serve` ({SUFFIX})"
        )


def _check(given: Robot, log: Log) -> None:
    """Refuse to draw another robot than that of the log.

    Raises:
        CommandError: it is another one.
    """
    own = log.library.robot
    found = differences(own.in_file, given)
    if found:
        raise CommandError(
            f"--robot: {given.name} is not {own.name} as in {log.path}; they differ in "
            f"{found[0]} (log / --robot); give the file and profile of that robot, or "
            "none for its skeleton"
        )
