"""How many new connections the server's loop takes in one of its turns."""

import asyncio
import socket
from contextlib import ExitStack

from api_server import nothing_asked
from patience import Deadline

from gaitchain.service.api_limits import ApiLimits
from gaitchain.service.api_transport import listen, server_of

CLIENTS = 200
MOST = 32  # a turn of a few ms


def new_client(port):
    """Begin to connect, and do not wait for it."""
    client = socket.socket()
    client.setblocking(False)
    client.connect_ex(("127.0.0.1", port))
    return client


async def most_in_a_turn(server, stack):
    """Connect clients while the loop is held up; return the most taken at once."""
    listening = stack.enter_context(listen("127.0.0.1", 0))
    serving = asyncio.create_task(server.serve(sockets=[listening]))
    deadline = Deadline()
    while not server.started:
        await asyncio.sleep(0)
        assert not deadline.passed()
    for _ in range(CLIENTS):
        stack.enter_context(new_client(listening.getsockname()[1]))
    known, most = server.server_state.connections, 0
    while len(known) < MOST // 4:
        before = len(known)
        await asyncio.sleep(0)
        most = max(most, len(known) - before)
        assert not deadline.passed()
    server.should_exit = True
    await serving
    return most


def test_a_burst_of_connections_leaves_the_loop_time_for_a_stop_between_them():
    server = server_of(nothing_asked, ApiLimits())
    with ExitStack() as stack:
        assert 0 < asyncio.run(most_in_a_turn(server, stack)) <= MOST
