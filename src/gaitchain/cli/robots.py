"""`gaitchain robots`: the robots that are known by name, and how to get them."""

from dataclasses import asdict

from gaitchain.cli.console import check_writable, print_table, say, write_json
from gaitchain.cli.options import Robots
from gaitchain.discover.catalogue import HOW_TO_GET, list_robots


def run(options: Robots) -> int:
    """List them."""
    if options.json is not None:
        check_writable(options.json)
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
    if options.json is not None:
        write_json(options.json, [asdict(robot) for robot in robots])
    return 0
