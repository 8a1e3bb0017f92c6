"""What ends a verb that walks ends the processes that walk for it, too."""

import contextlib
import os
import re
import signal
import subprocess
import sys

import pytest
from patience import PATIENCE_S

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name == "nt", reason="no process groups"),
]
WALKS = ["trial", "res", "--runs", "200", "--seconds", "3", "--workers", "2"]
PROGRAM = """
import signal
import sys
from gaitchain.cli import main

for end in signal.SIGHUP, signal.SIGTERM:  # the tests may run under nohup
    signal.signal(end, signal.SIG_DFL)
main(sys.argv[1:])
"""


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGHUP])
def test_no_worker_is_left_by_a_plain_kill(end):
    """Each has a copy of standard error, which ends when the last of them does."""
    command = [sys.executable, "-c", PROGRAM, *WALKS]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            lines = iter(process.stderr.readline, "")
            assert any(re.search(": [1-9][0-9]* of 200", line) for line in lines)
            process.send_signal(end)
            _, said = process.communicate(timeout=PATIENCE_S)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert "gaitchain: interrupted" in said
    assert "Traceback" not in said
