"""The part that serves page, REST, telemetry stream and 3-D view on one port."""

import ipaddress
import threading
from pathlib import Path

from uvicorn import Server

from gaitchain.errors import ServiceError
from gaitchain.service.api import make_app
from gaitchain.service.api_limits import Limits
from gaitchain.service.api_transport import listen, server_of
from gaitchain.service.settings import Settings, load_settings


def run(folder: Path, ended: threading.Event) -> None:
    """Serve.

    Args:
        folder: of the service: its settings and channels.
        ended: ends it when it is set.

    Raises:
        GaitchainError: the address cannot be served on, or the library cannot be read.
    """
    settings, limits = load_settings(folder), Limits()
    check_guarded(settings)
    with listen(settings.host, settings.port) as listening:
        app = make_app(settings, folder, limits=limits)
        server = server_of(app, limits)
        threading.Thread(target=_end, args=[server, ended], daemon=True).start()
        server.run(sockets=[listening])


def _end(server: Server, ended: threading.Event) -> None:
    ended.wait()
    server.should_exit = True


def check_guarded(settings: Settings) -> None:
    """Refuse to let other machines in without a token.

    Raises:
        ServiceError: there is none.
    """
    if settings.token or _is_loopback(settings.host):
        return
    raise ServiceError(
        f"--host {settings.host} lets other machines in: give a --token, or serve on "
        "127.0.0.1"
    )


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
