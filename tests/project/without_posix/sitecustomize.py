"""What Windows does not have is taken away from every process with this on its path."""

import os
import signal
import sys

for name in ("SIGHUP", "SIGQUIT", "SIGUSR1"):
    delattr(signal, name)
for name in ("nice", "sched_setscheduler", "posix_fallocate", "getuid", "fork"):
    delattr(os, name)
for module in ("resource", "termios", "tty", "pty", "pwd", "grp", "fcntl"):
    sys.modules[module] = None

import zmq  # noqa: E402

_has = zmq.has
zmq.has = lambda what: what != "ipc" and _has(what)
