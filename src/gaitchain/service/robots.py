"""Open the robot that `--backend` names."""

# ruff: noqa: PLC0415 - each backend brings its own libraries.

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from gaitchain.backends.base import Backend
from gaitchain.backends.makes import MAKES, MakeName
from gaitchain.backends.mock import MockBackend
from gaitchain.errors import CommandError
from gaitchain.gait.get_up import load_get_up
from gaitchain.gait.library import GaitLibrary
from gaitchain.service.settings import RobotKind, Settings
from gaitchain.sim.world import World
from gaitchain.walker.riser import Riser

if TYPE_CHECKING:
    from gaitchain.backends.servos import Calibration

_EMULATED = "emulated"
_ROS = ("ros", "ros-effort")
_LINK = "zenoh"  # where `ros` names none
KINDS = (
    f"mujoco, mock, {', '.join(f'{make}:PORT, {make}:emulated' for make in MAKES)}, "
    "ros, ros:ws://HOST:9090, and "
    "ros-effort for ros where the controller takes efforts, too"
)


class OpenedRobot(NamedTuple):
    """What the settings name."""

    backend: Backend
    emulated: bool = False
    """Whether nothing real moves, though the backend goes about it as with motors."""


def check_backend(spec: str, calibration: str | Path | None = None) -> None:
    """Refuse a backend that cannot be opened, before anything is started.

    Args:
        spec: what `--backend` says.
        calibration: path of the servos' calibration.

    Raises:
        CommandError: there is no such backend or link to ROS, servos have no
            calibration, or there is one without servos.
        MissingExtraError: a package for the link is not installed.
    """
    kind, _, rest = spec.partition(":")
    alone, linked = ("mujoco", "mock", *_ROS), (*MAKES, *_ROS)
    whole = spec in alone or (kind in linked and rest)
    if not whole:
        raise CommandError(f"--backend {spec}: no such backend; known are {KINDS}")
    if kind in _ROS:
        from gaitchain.backends.ros import check_link

        check_link(rest or _LINK)
    if kind in MAKES and rest != _EMULATED and calibration is None:
        raise uncalibrated(f"--backend {spec}", rest, kind)
    if kind not in MAKES and calibration is not None:
        raise CommandError(
            f"--calibration applies to servo backends only; --backend {spec} has none; "
            "give --backend dynamixel:PORT or feetech:PORT, or leave it out"
        )


def uncalibrated(what: str, port: str, make: str = "") -> CommandError:
    """Return the error of servos without a calibration, which says how to make one.

    Args:
        what: needs it.
        port: of the servos.
        make: of the servos, where it is known.
    """
    words = f"LIBRARY --make {make}" if make else "LIBRARY"
    return CommandError(
        f"{what}: servos need a calibration: `gaitchain calibrate {words} --port "
        f"{port} -o robot.toml`, then --calibration robot.toml"
    )


def kind_of(settings: Settings) -> RobotKind:
    """Return what moves with these settings, as frames tell it."""
    kind, _, rest = settings.backend.partition(":")
    if settings.replay is not None:
        return "unknown"
    if kind in MAKES and rest == _EMULATED:
        return "emulated"
    kinds: dict[str, RobotKind] = {"mujoco": "simulation", "mock": "mock"}
    return kinds.get(kind, "real")


def open_robot(settings: Settings, library: GaitLibrary) -> OpenedRobot:
    """Make the backend that the settings name; nothing is connected yet.

    Raises:
        CommandError: see `check_backend`, or the servos are of another make.
        MissingExtraError: a package for it is not installed.
        CalibrationError: the calibration is not for this robot.
    """
    check_backend(settings.backend, settings.calibration)
    kind, _, rest = settings.backend.partition(":")
    period_s = 1.0 / settings.rate_hz
    if kind == "mock":
        return OpenedRobot(MockBackend(period_s))
    if kind == "mujoco":
        return _simulated(settings, library, period_s)
    joints = library.robot.legs.joint_names
    if kind in _ROS:
        from gaitchain.backends.ros import RosBackend, RosEffortBackend, open_link

        driven = RosBackend if kind == "ros" else RosEffortBackend
        return OpenedRobot(driven(open_link(rest or _LINK), joints, period_s))
    return _servos(rest, settings, library, period_s)


def open_riser(settings: Settings, library: GaitLibrary) -> Riser | None:
    """Return how the robot gets up, as the settings name it; None if they do not.

    Raises:
        LibraryError: the file is none, or of another robot.
    """
    if settings.get_up is None:
        return None
    found = load_get_up(settings.get_up, library.robot)
    return Riser(found, 1.0 / settings.rate_hz)


def _simulated(
    settings: Settings, library: GaitLibrary, period_s: float
) -> OpenedRobot:
    from gaitchain.backends.mujoco import MujocoBackend

    world = World(seed=settings.seed)
    if settings.own_model is not None:
        return OpenedRobot(_in_own_model(settings.own_model, library, world, period_s))
    return OpenedRobot(MujocoBackend(library.robot, world, period_s))


def _in_own_model(
    file: str, library: GaitLibrary, world: World, period_s: float
) -> Backend:
    from gaitchain.backends.whole_body import WholeBodyBackend
    from gaitchain.build.own_model import (
        of_its_file,
        own_model,
        use_implicit_integrator,
    )

    with of_its_file(file, library):
        model = own_model(file, library.robot, world)
        use_implicit_integrator(model)
        return WholeBodyBackend(model, library, period_s)


def servo_calibration(settings: Settings, library: GaitLibrary) -> "Calibration":
    """Return the calibration that servos have; a plain one of emulated ones.

    Args:
        settings: with servos as their backend.
        library: of the robot that it must be for.

    Raises:
        CommandError: it is of another make.
        MissingExtraError: no package for servos is installed.
        CalibrationError: it cannot be read, or is not for this robot.
    """
    from msgspec import convert

    from gaitchain.backends.servos import load_calibration, plain_calibration

    make, _, port = settings.backend.partition(":")
    if settings.calibration is None:
        return plain_calibration(library.robot, make=convert(make, MakeName))
    found = load_calibration(Path(settings.calibration), library.robot.nominal)
    if found.make != make:
        raise CommandError(
            f"--backend {make}: the calibration says make = {found.make!r}: give "
            f"--backend {found.make}:{port}"
        )
    return found


def _servos(
    port: str, settings: Settings, library: GaitLibrary, period_s: float
) -> OpenedRobot:
    from gaitchain.backends.servos import ServoBackend, ServoBusEmulator

    names, emulated = library.robot.legs.joint_names, port == _EMULATED
    calibration = servo_calibration(settings, library)
    if emulated:
        legs = library.robot.legs
        port = ServoBusEmulator.standing(calibration, legs, settings.seed).port
    backend = ServoBackend(port, calibration, names, period_s)
    return OpenedRobot(backend, emulated=emulated)
