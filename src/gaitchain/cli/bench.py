"""`gaitchain bench`: how fast the parts are, as ratios measured in one run."""

from gaitchain.bench import MEASUREMENTS
from gaitchain.cli.console import check_writable, print_table, watched, write_json
from gaitchain.cli.options import Bench


def run(options: Bench) -> int:
    """Measure."""
    if options.json is not None:
        check_writable(options.json)
    figures: dict[str, float] = {}
    measures = (measure() for measure in MEASUREMENTS)
    for measured in watched(measures, "measuring", len(MEASUREMENTS)):
        figures.update(measured)
    if options.json is not None:
        write_json(options.json, figures)
    rows = [(name, f"{value:.4g}") for name, value in figures.items()]
    print_table("gaitchain bench", ("figure", "value"), rows)
    return 0
