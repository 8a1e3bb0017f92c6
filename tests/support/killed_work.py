"""Work whose process is killed; without imports that take worker processes long."""

import os
import signal


def killed_work(enough, number, folder):
    """Be killed in job 2 until that was so often; else return a third."""
    kills = len(list(folder.iterdir()))
    if number == 2 and kills < enough:
        (folder / f"{kills}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number / 3
