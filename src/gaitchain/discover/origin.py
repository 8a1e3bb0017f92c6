"""Where the file is from which a library's robot came. Ours.

A library keeps the file as it was typed, since the same build gives the same bytes in
any folder.
"""

from pathlib import Path

from gaitchain.errors import RobotFileError


def check_origin(typed: str) -> None:
    """Check that a robot's file can be read from this folder.

    Args:
        typed: path or name, as it was given to a build.

    Raises:
        RobotFileError: there is no such file; the message says how to give it.
    """
    path = Path(typed)
    is_name = not path.suffix and len(path.parts) == 1
    if not is_name and not path.is_file():
        raise RobotFileError(
            f"{typed}: no such file to draw the robot from; work in the folder in "
            f"which the library was built, not {Path.cwd()}"
        )
