"""A port that is taken is nobody else's, on Windows too."""

import socket

import pytest

from gaitchain.errors import ServiceError
from gaitchain.service.api_transport import listen
from gaitchain.service.own_port import own_port
from gaitchain.service.supervisor import free_port


def test_a_port_that_is_listened_on_is_refused():
    with listen("127.0.0.1", 0) as first:
        port = first.getsockname()[1]
        with pytest.raises(ServiceError, match=f"port {port}"):
            listen("127.0.0.1", port)
        with pytest.raises(ServiceError, match=f"port {port}"):
            free_port("127.0.0.1", port)


def test_where_reuse_would_share_a_port_it_is_not_asked_for(monkeypatch):
    """Windows alone has the option; another one is asked for in its place here."""
    stand_in = socket.SO_KEEPALIVE
    monkeypatch.setattr(socket, "SO_EXCLUSIVEADDRUSE", stand_in, raising=False)
    with socket.socket() as listening:
        own_port(listening)
        assert listening.getsockopt(socket.SOL_SOCKET, stand_in)
        assert not listening.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR)
