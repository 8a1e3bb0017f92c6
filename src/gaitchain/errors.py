"""The errors that gaitchain raises: one root, each message a complete answer.

What runs a library on a robot comes with every install; all else is an extra, and an
import that misses one is an error as well.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec

EXTRAS = {
    "sim": ("mujoco", "joblib", "scipy", "cmaes", "filelock", "trimesh", "collada"),
    "view": ("matplotlib", "viser", "trimesh", "fast_simplification"),
    "serve": (
        *("fastapi", "starlette", "uvicorn", "websockets", "httpx"),
        *("zmq", "mcap", "rosbags"),
    ),
    "servos": ("dynamixel_sdk", "scservo_sdk", "serial"),
    "ros": ("rosbags", "zenoh", "websockets"),
    "dask": ("dask", "distributed"),
    "ray": ("ray",),
    "robots": ("mujoco_menagerie",),
    "rl": ("gymnasium",),
}
"""Each extra of the package, and the modules that it brings."""

MOST_SAID = 500
"""Characters of why a foreign file is refused, which may quote what is in it."""


class GaitchainError(Exception):
    """Root of every error that gaitchain raises on purpose."""


class RobotFileError(GaitchainError):
    """A robot file is missing, unreadable, or holds a value that cannot be."""


class UnreachableError(GaitchainError):
    """A primitive was asked for a target outside the reach of the leg."""


class ChainError(GaitchainError):
    """A Markov chain or its training data is not consistent."""


class NotFittedError(ChainError, AttributeError):
    """An estimator was asked for what it learns in `fit`, before that."""


class LibraryError(GaitchainError):
    """A gait library is damaged, foreign, or not qualified for the task."""


class RenderError(GaitchainError):
    """This computer cannot render pictures."""


class CommandError(GaitchainError):
    """A command or an option cannot be carried out."""


class UnfinishedError(CommandError):
    """Work ends before it is done; the same command goes on from what was kept."""


class JournalError(UnfinishedError):
    """Finished work cannot be kept; what was kept before it is."""


class WorkerError(UnfinishedError):
    """The processes that work are killed again and again."""


class RecordError(GaitchainError):
    """A walk's record cannot be written, or its file cannot be read."""


class BackendError(GaitchainError):
    """A robot cannot be reached, or is not what it is said to be."""


class ServosStoppedError(BackendError):
    """Servos have stopped by themselves, and take no targets until engaged again."""

    def __init__(self, why: str) -> None:
        """Say why; who moves them knows how they are engaged again."""
        super().__init__(f"{why}; engage again")
        self.why = why
        """Without what to do."""


class CalibrationError(GaitchainError):
    """A calibration file is missing, unreadable, or holds a value that cannot be."""


class LogError(GaitchainError):
    """A log cannot be written or read."""


class ServiceError(GaitchainError):
    """The service cannot be started as asked."""


class ExportError(GaitchainError):
    """A library or its code cannot be written in the language asked for."""


class MissingExtraError(GaitchainError, ImportError):
    """What was asked for needs packages that are not installed."""


@contextmanager
def file_errors(path: object, what: str, kind: type[GaitchainError]) -> Iterator[None]:
    """Raise an error of gaitchain for one of the operating system.

    Args:
        path: the file, for the message.
        what: "read", "written", "removed" or "found".
        kind: the error to raise.

    Raises:
        GaitchainError: of that kind, where the context raises OSError.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or error
        raise kind(f"{path}: cannot be {what}: {reason}") from None


def temporary_folder(kind: type[GaitchainError]) -> str:
    """Return the folder for temporary files.

    Raises:
        GaitchainError: of that kind, where none can be written.
    """
    import tempfile  # noqa: PLC0415 - seldom needed

    try:
        return tempfile.gettempdir()
    except OSError:
        raise kind(
            "no folder for temporary files can be written; set TMPDIR to one that can"
        ) from None


def printable(text: str) -> str:
    """Return a text in one line, with spaces for what a terminal would obey."""
    return "".join(char if char.isprintable() else " " for char in text)


def short_name(name: str, most: int = 60) -> str:
    """Return a name from a foreign file so that messages and tables can hold it.

    Args:
        name: as it is in the file.
        most: characters; the rest of a longer name is left out.
    """
    line = printable(name[: most + 1])
    return line if len(line) <= most else f"{line[: most - 3]}..."


def names_apart(given: Iterable[str], wanted: Iterable[str]) -> str:
    """Return which names are missing and which are unknown, for a message.

    Args:
        given: names that there are.
        wanted: names that there have to be.
    """
    apart = {
        "missing": set(wanted) - set(given),
        "unknown": set(given) - set(wanted),
    }
    return "; ".join(f"{how}: {', '.join(sorted(n))}" for how, n in apart.items() if n)


def require(what: str, extras: Sequence[str]) -> None:
    """Make sure that extras are installed, before any work is done.

    Args:
        what: what needs them, for the message.
        extras: keys of `EXTRAS`.

    Raises:
        MissingExtraError: some are not; all of them are named.
    """
    missing = [e for e in extras if not all(map(find_spec, EXTRAS[e]))]
    if missing:
        raise _missing(what, missing)


@contextmanager
def needed_by(what: str) -> Iterator[None]:
    """Name the extra that brings a package which an import within does not find.

    Args:
        what: what needs it, for the message.

    Raises:
        MissingExtraError: a package of an extra is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        extras = [e for e, modules in EXTRAS.items() if package in modules]
        if not extras or find_spec(package) is not None:
            raise
        raise _missing(what, extras[:1]) from error


def _missing(what: str, extras: Sequence[str]) -> MissingExtraError:
    """Name what needs the extras, and the command that installs them."""
    names = ", ".join(f"'{extra}'" for extra in extras)
    return MissingExtraError(
        f"{what} needs the extra{'s' * (len(extras) > 1)} {names}: "
        f"pip install 'gaitchain[{','.join(extras)}]'"
    )
