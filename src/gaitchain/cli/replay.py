"""`gaitchain replay`: a log in the browser, as the robot's own page shows it."""

import tempfile
from pathlib import Path

from gaitchain.cli.console import say
from gaitchain.cli.serve_options import Replay
from gaitchain.errors import CommandError
from gaitchain.live.logs.reader import read_log
from gaitchain.service.settings import Settings
from gaitchain.service.supervisor import serve


def run(options: Replay) -> int:
    """Play until Ctrl-C."""
    if not 0 <= options.port < 2**16:
        raise CommandError(f"--port {options.port}: 0 to 65535, 0 finds a free one")
    log = read_log(options.log)
    # The parts of the service know a library by its path; this one is in the log.
    with tempfile.TemporaryDirectory(prefix="gaitchain-replay-") as folder:
        library = Path(folder) / "library.gait"
        library.write_bytes(log.library_bytes)
        settings = Settings(
            library=str(library), port=options.port, replay=str(options.log.resolve())
        )
        return serve(settings, open_browser=not options.no_browser, say=say)
