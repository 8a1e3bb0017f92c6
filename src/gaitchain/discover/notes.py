"""Notes on a robot's file, some of which may be why the robot is refused."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from gaitchain.errors import RobotFileError

_SHOWN = 3


class Doubt(str):
    """A note that a refusal repeats, as what it says may be the cause."""

    __slots__ = ()


@contextmanager
def doubts_told(notes: Sequence[str]) -> Iterator[None]:
    """Add what is doubtful in a file to the refusal of its robot.

    Args:
        notes: all that is said of the file.

    Raises:
        RobotFileError: the context raises it.
    """
    try:
        yield
    except RobotFileError as error:
        doubts = " ".join(note for note in notes if isinstance(note, Doubt))
        if not doubts:
            raise
        raise RobotFileError(f"{error}; the file: {doubts}") from None


def listed(kind: str, names: list[str]) -> str:
    """Return how many things of a kind there are, and the first names."""
    first = ", ".join(f"{name}"[:60] or "(unnamed)" for name in names[:_SHOWN])
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    plural = f"{kind[:-1]}ies" if kind.endswith("y") else f"{kind}s"
    many = kind if len(names) == 1 else plural
    return f"{len(names)} {many} ({first}{more})"
