"""A port that this program alone listens on."""

import socket


def own_port(listening: socket.socket) -> None:
    """Share a port with no other program, and take one that was left just before.

    On Windows SO_REUSEADDR would let two programs listen on one port.

    Args:
        listening: a socket that is not bound yet.
    """
    alone = getattr(socket, "SO_EXCLUSIVEADDRUSE", None)  # Windows has it
    option = socket.SO_REUSEADDR if alone is None else alone
    listening.setsockopt(socket.SOL_SOCKET, option, 1)
