"""Notes on a robot's file that may be why the robot is refused."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from gaitchain.errors import RobotFileError


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
