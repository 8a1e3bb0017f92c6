"""`gaitchain robots`: list the robots with a name, and how to install them."""

from dataclasses import asdict
from typing import Any

from gaitchain.cli.console import print_table, say
from gaitchain.cli.options import Robots
from gaitchain.discover.catalogue import HOW_TO_GET, list_robots


def run(options: Robots) -> tuple[int, list[dict[str, Any]]]:
    """Print the list of robots."""
    robots = list_robots()
    rows = [
        (robot.name, robot.source, robot.licence, robot.note or "-") for robot in robots
    ]
    print_table(
        "Robots known by name", ("name", "source", "licence", "where"), rows, range(4)
    )
    if not all(robot.available for robot in robots):
        say(f"To get one that is not here: {HOW_TO_GET}.")
    say("Any other humanoid: give the path of its MJCF (.xml) or URDF (.urdf) file.")
    return 0, [asdict(robot) for robot in robots]
