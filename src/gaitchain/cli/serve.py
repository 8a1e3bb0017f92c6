"""`gaitchain serve`: the robot live, in simulation or on its servos."""

import ipaddress
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

from gaitchain.cli.console import check_writable, make_folder, say
from gaitchain.cli.serve_options import Serve
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import load_library
from gaitchain.service.robots import check_backend
from gaitchain.service.settings import Settings
from gaitchain.service.supervisor import serve

_LOGS = Path("runs/serve")
_SIMULATED_HZ, _MOTOR_HZ = 250.0, 100.0
_SLOWEST_HZ, _FASTEST_HZ = 20.0, 1000.0
_TOKEN = 8  # characters at least


def run(options: Serve) -> int:
    """Serve until Ctrl-C."""
    check_backend(options.backend)
    library = shipped_library() if options.library is None else options.library
    load_library(library)  # a bad file is told before anything starts
    settings = Settings(
        library=str(library.resolve()),
        backend=options.backend,
        calibration=_path(options.calibration),
        rate_hz=_rate(options),
        host=options.host,
        port=_port(options.port),
        token=_token(options),
        log=None if options.no_log else _log(options.log),
        ros=options.ros,
        open_loop=options.open_loop,
        seed=options.seed,
    )
    return serve(settings, open_browser=options.browser, say=say)


def shipped_library() -> Path:
    """Return the library of RES that comes with the package."""
    return Path(str(files("gaitchain") / "data" / "res.gait"))


def _path(path: Path | None) -> str | None:
    if path is None:
        return None
    if not path.exists():
        raise CommandError(f"{path}: no such file")
    return str(path.resolve())


def _rate(options: Serve) -> float:
    simulated = options.backend in ("mujoco", "mock")
    usual = _SIMULATED_HZ if simulated else _MOTOR_HZ
    rate = usual if options.rate is None else options.rate
    if not _SLOWEST_HZ <= rate <= _FASTEST_HZ:
        raise CommandError(
            f"--rate {rate:g} Hz: {_SLOWEST_HZ:g} to {_FASTEST_HZ:g} can be kept"
        )
    return rate


def _port(port: int) -> int:
    if not 0 <= port < 2**16:
        raise CommandError(f"--port {port}: 0 to 65535, 0 finds a free one")
    return port


def _token(options: Serve) -> str:
    token = options.token or ""
    if token and (len(token) < _TOKEN or not token.isascii() or " " in token):
        raise CommandError(f"--token: {_TOKEN} or more ASCII characters, no blanks")
    if not token and not _is_loopback(options.host):
        raise CommandError(
            f"--host {options.host}: others could drive the robot; give a --token "
            "that only you know, or stay on 127.0.0.1"
        )
    return token


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _log(path: Path | None) -> str:
    if path is None:
        now = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
        path = make_folder(_LOGS) / f"{now}.mcap"
    check_writable(path)
    return str(path.resolve())
