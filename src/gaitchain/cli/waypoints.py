"""Way points on the command line: read them, show how the robot came to them."""

import math
from itertools import zip_longest
from typing import Any

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.simulated_walk import Visit
from gaitchain.cli.console import print_table
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Schedule, Segment
from gaitchain.walker.place import Place

_LEAST_S = 0.01  # of a segment that was walked
_FURTHEST = 1000.0  # m, deg


def parse_waypoints(text: str) -> tuple[Place, ...]:
    """Parse way points such as "1,0,0;1,1,90": m, m, deg to the left.

    Raises:
        CommandError: they cannot be parsed, or are further than 1 km away.
    """
    places = []
    for part in text.split(";"):
        try:
            x, y, yaw = map(float, part.split(","))
        except ValueError:
            x = y = yaw = math.nan
        if not all(abs(number) <= _FURTHEST for number in (x, y, yaw)):  # nan is not
            raise CommandError(
                f"--waypoints {part.strip()!r}: expected x,y,yaw in m, m and deg, "
                f'within +-{_FURTHEST:g}, with semicolons between, as in "1,0,0;1,1,90"'
            )
        places.append(Place(x, y, math.radians(yaw)))
    return tuple(places)


def given_commands(record: WalkRecord) -> Schedule:
    """Return the commands that were given on the way as a schedule."""
    times = [time_s for time_s, _ in record.commands]
    lasted = np.diff([*times, max(float(record.time_s[-1]), times[-1] + _LEAST_S)])
    return tuple(
        Segment(command, max(float(s), _LEAST_S))
        for (_, command), s in zip(record.commands, lasted, strict=True)
    )


def visit_json(visit: Visit) -> dict[str, Any]:
    """Convert a visit for JSON."""
    off = visit.off
    return {
        "goal": [visit.goal.x, visit.goal.y, math.degrees(visit.goal.yaw)],
        "by_own_steps": [visit.place.x, visit.place.y, math.degrees(visit.place.yaw)],
        "missed_m": math.hypot(off.x, off.y),
        "missed_deg": abs(math.degrees(off.yaw)),
        "time_s": visit.time_s,
        "arrived": visit.arrived,
        "given_up_s": visit.given_up_s,
    }


def show_visits(
    library: GaitLibrary, goals: tuple[Place, ...], visits: list[Visit]
) -> None:
    """Print a table of all way points, also of those that were not reached."""
    rows = []
    for goal, visit in zip_longest(goals, visits):
        cells = ("-", "-", "not reached")
        if visit is not None:
            found = visit_json(visit)
            missed = (
                f"{100.0 * found['missed_m']:.1f} cm, {found['missed_deg']:.1f} deg"
            )
            cells = (f"{visit.time_s:.1f}", missed, _arrived(visit))
        place = f"{goal.x:g}, {goal.y:g} m, {math.degrees(goal.yaw):.0f} deg"
        rows.append((place, *cells))
    heads = ("way point", "time [s]", "really missed by", "arrived")
    print_table(f"{library.robot.name} walks to {len(goals)} way points", heads, rows)


def _arrived(visit: Visit) -> str:
    """Say whether the robot arrived, and if it walked on, after how long it did not."""
    if visit.given_up_s is not None:
        return f"no, given up after {visit.given_up_s:.0f} s"
    return "yes" if visit.arrived else "no"
