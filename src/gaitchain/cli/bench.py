"""`gaitchain bench`: how fast the parts are, as ratios measured in one run."""

from gaitchain.bench import MEASUREMENTS
from gaitchain.cli.console import print_table, watched
from gaitchain.cli.options import Bench


def run(options: Bench) -> tuple[int, dict[str, float]]:
    """Run all measurements and print them."""
    figures: dict[str, float] = {}
    measures = (measure() for measure in MEASUREMENTS)
    for measured in watched(measures, "measuring", len(MEASUREMENTS)):
        figures.update(measured)
    rows = [(name, f"{value:.4g}") for name, value in figures.items()]
    print_table("gaitchain bench", ("figure", "value"), rows)
    return 0, figures
