"""`gaitchain replay`: play a log in the browser, on the page of `serve`."""

import tempfile
from pathlib import Path

from gaitchain.cli.console import say
from gaitchain.cli.options import Replay
from gaitchain.discover.loaded_robot import robot_file
from gaitchain.errors import CommandError
from gaitchain.live.logs.reader import read_log
from gaitchain.service.settings import Settings
from gaitchain.service.supervisor import serve


def run(options: Replay) -> tuple[int, dict[str, str]]:
    """Play until Ctrl-C."""
    if options.robot is not None:
        robot_file(options.robot)  # tells a missing file before anything is started
    elif options.profile is not None:
        raise CommandError("--profile: of which robot? Give --robot as well")
    log = read_log(options.log)
    # The parts of the service load a library by its path, but this one is in the log.
    with tempfile.TemporaryDirectory(prefix="gaitchain-replay-") as folder:
        library = Path(folder) / "library.gait"
        library.write_bytes(log.library_bytes)
        settings = Settings(
            library=str(library),
            port=options.port,
            replay=str(options.log.resolve()),
            drawn=options.robot,
            profile=None if options.profile is None else str(options.profile),
        )
        code = serve(settings, open_browser=not options.no_browser, say=say)
    return code, {"log": str(options.log)}
