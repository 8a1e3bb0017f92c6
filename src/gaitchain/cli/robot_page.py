"""The page that shows how a robot of servos should move, for a verb's time."""

from collections.abc import Iterator
from contextlib import closing, contextmanager

from gaitchain.cli.console import say
from gaitchain.commission.screen import NoScreen, Screen
from gaitchain.gait.library import GaitLibrary


@contextmanager
def robot_page(library: GaitLibrary, port: int | None, title: str) -> Iterator[Screen]:
    """Serve the page if it is asked for.

    Args:
        library: of the robot.
        port: to listen on; None for no page.
        title: of the page's panel.

    Raises:
        CommandError: the port cannot be had, or a package for the view is missing.
    """
    if port is None:
        yield NoScreen()
        return
    from gaitchain.commission.view import ViewProcess  # noqa: PLC0415 - heavy

    with closing(ViewProcess(library, port, title)) as view:
        say(f"{view.address} shows the robot as it should move: compare the real one")
        yield view
