"""`gaitchain serve`: walk a robot live, in simulation or on its servos."""

import math
import os
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gaitchain.backends.ros import check_link
from gaitchain.cli.console import say
from gaitchain.cli.files import check_writable, file_of, make_folder
from gaitchain.cli.libraries import find_library
from gaitchain.cli.mixtures import refuse
from gaitchain.cli.options import Serve
from gaitchain.errors import CommandError, file_errors
from gaitchain.gait.get_up import load_get_up
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.gait.limits import Limits, declared
from gaitchain.live.logs.names import files_of, in_words, next_free
from gaitchain.live.logs.reader import SUFFIX
from gaitchain.service.robots import check_backend, kind_of, servo_calibration
from gaitchain.service.settings import TOKEN_LENGTHS, Settings, is_loopback
from gaitchain.service.supervisor import serve
from gaitchain.sim.world import SAME_PERIOD, World

_LOGS = Path("runs/serve")
_SIMULATED_HZ, _MOTOR_HZ = 250.0, 100.0
_LEAST, _MOST = TOKEN_LENGTHS
_VARIABLE = "GAITCHAIN_TOKEN"


def run(options: Serve) -> tuple[int, dict[str, Any]]:
    """Serve until Ctrl-C."""
    check_backend(options.backend, options.calibration)
    _check_ros(options)
    _check_unused(options)
    options = _with_exact_rate(options)
    token = _token(options)
    library = find_library(options.library)
    known = load_library(library)  # reports a bad file before any part starts
    _check_own(options, known)
    options = _with_rate_of_own(options, known)
    settings = _settings(options, library, token)
    if settings.calibration is not None:
        servo_calibration(settings, known)  # reports a bad file likewise
    log = None if settings.log is None else str(next_free(Path(settings.log))[0])
    code = serve(
        settings,
        open_browser=options.browser,
        shows_token=bool(options.token),
        say=say,
    )
    found = {"library": settings.library, "backend": settings.backend}
    return code, {**found, "rate_hz": settings.rate_hz, "log": log}


def _settings(options: Serve, library: Path, token: str) -> Settings:
    """Return what the parts of the service are started with."""
    simulated = options.backend in ("mujoco", "mock") and not options.own_model
    usual_hz = _SIMULATED_HZ if simulated else _MOTOR_HZ
    return Settings(
        library=str(file_of(library)),
        backend=options.backend,
        own_model=_path(options.own_model),
        get_up=_path(options.get_up),
        calibration=_path(options.calibration),
        rate_hz=options.rate or usual_hz,
        host=options.host,
        port=options.port,
        token=token,
        log=_log(options),
        log_mb=options.log_size,
        log_files=options.log_files,
        ros=options.ros,
        ros_stamped=options.ros_stamped,
        open_loop=options.open_loop,
        seed=options.seed,
    )


def _check_ros(options: Serve) -> None:
    """Refuse a link that is none, and a type of commands without a link."""
    if options.ros is not None:
        check_link(options.ros)
    elif options.ros_stamped:
        raise CommandError("--ros-stamped: of the link to ROS; give --ros as well")


def _check_unused(options: Serve) -> None:
    """Refuse options of a log that is not written, and of a world that is none."""
    if options.no_log:
        refuse(options, ("log_size", "log_files"), "of a log; leave out --no-log")
    if kind_of(Settings(library="", backend=options.backend)) == "real":
        refuse(
            options,
            ("seed",),
            f"of a simulated world, which --backend {options.backend} has not",
        )


def _path(path: Path | None) -> str | None:
    if path is None:
        return None
    if not path.exists():
        raise CommandError(f"{path}: no such file")
    return str(path.absolute())  # of a link, the folder counts


def _check_own(options: Serve, library: GaitLibrary) -> None:
    """Refuse a model and a way up that cannot be used, before any part starts.

    Raises:
        CommandError: they do not go with the other options.
        LibraryError: the way is none, or of another robot.
    """
    if options.own_model is not None and options.backend != "mujoco":
        raise CommandError("--own-model: simulates; leave out --backend")
    if options.get_up is None:
        return
    if options.own_model is None:
        raise CommandError(
            "--get-up: needs all joints, which only --own-model FILE has here"
        )
    load_get_up(options.get_up, library.robot)


def _own_step_s(file: str, library: GaitLibrary) -> float:
    """Return the time step in which a robot's own model is simulated [s].

    Raises:
        CommandError: it is that of another robot, or cannot be simulated.
    """
    from gaitchain.build.own_model import of_its_file, own_model  # noqa: PLC0415 - slow

    with of_its_file(file, library):
        return float(own_model(file, library.robot, World()).opt.timestep)


def _with_exact_rate(options: Serve) -> Serve:
    """Refuse a rate that the simulator cannot keep, before anything is loaded."""
    if options.rate is None or options.backend != "mujoco" or options.own_model:
        return options
    return replace(options, rate=_exact_rate(options.rate, World.timestep))


def _with_rate_of_own(options: Serve, library: GaitLibrary) -> Serve:
    """Refuse a rate that the simulation of the own model cannot keep."""
    if options.rate is None or options.own_model is None:
        return options
    step_s = _own_step_s(_path(options.own_model) or "", library)
    return replace(options, rate=_exact_rate(options.rate, step_s))


def _exact_rate(rate_hz: float, step_s: float) -> float:
    """Return the rate whose period is a whole number of time steps [s].

    Raises:
        CommandError: it is another one than was asked for.
    """
    steps = 1.0 / (rate_hz * step_s)
    whole = max(1, round(steps))
    if math.isclose(steps, whole, rel_tol=SAME_PERIOD):
        return 1.0 / (whole * step_s)
    near = max(1, math.floor(steps)), max(1, math.ceil(steps))
    limits = declared(Serve, Limits)["rate"]
    rates = [rate for n in dict.fromkeys(near) if limits.hold(rate := 1 / (n * step_s))]
    would = " or ".join(f"{rate:.7g}" for rate in rates)
    raise CommandError(
        f"--rate {rate_hz:.7g}: a control period in simulation is a whole number of "
        f"time steps of {1e3 * step_s:g} ms; {would} Hz would do"
    )


def _secret(options: Serve) -> tuple[str, str]:
    """Return the token, and where it was given; nowhere where none was asked for."""
    file = options.token_file
    if options.token is not None and file is not None:
        raise CommandError("--token and --token-file: give one of them")
    if options.token is not None:
        return options.token, "--token"
    if file is None:
        known = os.environ.get(_VARIABLE)
        return known or "", "" if known is None else f"the variable {_VARIABLE}"
    if str(file) == "-":
        text = sys.stdin.readline(_MOST + 1)
        return text.strip(), "the first line of standard input"
    # Also a pipe, as of `<(pass show robot)`.
    with file_errors(file, "read", CommandError), file.open("rb") as opened:
        text = opened.readline(_MOST + 1).decode("utf-8", "replace")
    return text.strip(), f"the first line of {file}"


def _token(options: Serve) -> str:
    """Return the token, empty where nobody asked for one.

    Raises:
        CommandError: it would keep nobody out, or others can connect without one.
    """
    token, where = _secret(options)
    if where and not token.strip():  # who asked for a token must not serve without
        raise CommandError(
            f"the token: {where} is empty; give {_LEAST} or more ASCII characters, "
            "or ask for no token"
        )
    sound = token.isascii() and token.isprintable() and " " not in token
    if token and not (sound and _LEAST <= len(token) <= _MOST):
        raise CommandError(
            f"the token: {_LEAST} to {_MOST} printable ASCII characters, no blanks"
        )
    if not token and not is_loopback(options.host):
        raise CommandError(
            f"--host {options.host}: others could drive the robot; give --token-file "
            f"FILE, or {_VARIABLE}, with a token that only you know, or stay on "
            "127.0.0.1"
        )
    return token


def _log(options: Serve) -> str | None:
    """Return the log to write; say where it begins if there is a file already.

    Raises:
        CommandError: it cannot be written, or nothing would read it.
    """
    path = options.log
    if options.no_log:
        if path is not None:
            raise CommandError("--log and --no-log: give one of them")
        return None
    if path is None:
        now = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
        path = make_folder(_LOGS) / f"{now}{SUFFIX}"
    if path.suffix != SUFFIX:
        raise CommandError(f"{path}: logs are MCAP; name it {path.stem}{SUFFIX}")
    check_writable(path)
    free, _ = next_free(path)
    _check_begun(free)
    if there := files_of(path):
        stay = "stays as it is" if len(there) == 1 else "stay as they are"
        say(f"{in_words(there)}: {stay}; this log is {free}")
    return str(file_of(path))


def _check_begun(log: Path) -> None:
    """Check that a log can be begun, as permissions do not tell: in /proc, or for root.

    Raises:
        CommandError: it cannot.
    """
    try:
        log.open("xb").close()
        log.unlink()
    except OSError as error:
        raise CommandError(
            f"--log {log}: cannot be written: {error.strerror}; name a file in your "
            "own folder, or give --no-log"
        ) from None
