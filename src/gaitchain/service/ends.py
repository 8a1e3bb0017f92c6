"""The signals that end a program from outside. Ours."""

import signal

_NAMES = "SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"


def known_ends() -> list[int]:
    """Return those that this system has."""
    return [int(getattr(signal, n)) for n in _NAMES if hasattr(signal, n)]
