"""`gaitchain qualify`: every step and command of a library on a grid of worlds."""

# ruff: noqa: PLC0415 - dask and Ray load only where they are asked for.

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from joblib import parallel_config

from gaitchain.build.grid import EVERY_STEP, Grid, GridRun, default_grid
from gaitchain.build.qualify import Crew, qualify_grid
from gaitchain.build.trial import available_cores
from gaitchain.cli.console import (
    check_writable,
    print_table,
    progress,
    say,
    write_json,
)
from gaitchain.cli.options import Qualify
from gaitchain.errors import CommandError, needed_by
from gaitchain.figures.passrate import plot_pass_rates
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes, load_library, save_library
from gaitchain.walker.walker import Walker

_MOST_SEEDS = 1000
_PATIENCE_S = 10
_NAMED = 12  # steps in a line


def run(options: Qualify) -> int:
    """Walk the grid; return 1 if the library does not pass."""
    _check(options)
    library, out = load_library(options.library), options.out or options.library
    for file in (out, options.json, options.map):
        if file is not None:
            check_writable(file)
    Walker(library.as_built())  # refuses what the build did not pass, before any work
    grid = default_grid(library, quick=options.quick, seeds=options.seeds)
    journal = Journal(out.with_name(f"{out.name}.qualify.jsonl"), library, grid)
    say(journal.greeting)
    workers = options.workers or available_cores()
    try:
        with journal, _backend(options, workers), progress() as tell:
            crew = Crew(workers, tell)
            found = qualify_grid(library, grid, crew, journal.runs, journal.add)
    except KeyboardInterrupt:
        say(f"{journal.path}: what is finished; the same command goes on from there")
        raise
    save_library(found, out)
    journal.path.unlink(missing_ok=True)
    _hand_out(options, found, out)
    return 0 if found.qualified else 1


class Journal:
    """Finished walks, line by line, so that an interrupted run goes on.

    The first line says what they belong to; a last line that was torn off is dropped.
    """

    def __init__(self, path: Path, library: GaitLibrary, grid: Grid) -> None:
        """Read what is there; what is of another library or grid is not used.

        Raises:
            CommandError: the file cannot be read.
        """
        digest = hashlib.sha256(library_bytes(library.as_built()))
        digest.update(f"{version('gaitchain')} {grid!r}".encode())
        self.path, self._header = path, {"qualify": digest.hexdigest()}
        self.runs: dict[tuple[int, int], GridRun] = {}
        self.greeting = f"{path}: finished walks are kept here until the end"
        self._good = 0
        if path.exists():
            self._read()

    def _read(self) -> None:
        try:
            lines = self.path.read_bytes().splitlines(keepends=True)
        except OSError as error:
            raise CommandError(
                f"{self.path}: cannot be read: {error.strerror}"
            ) from None
        if not lines or _parsed(lines[0]) != self._header:
            self.greeting = (
                f"{self.path}: of another library, grid or version; starting anew"
            )
            return
        self._good = len(lines[0])
        for line in lines[1:]:
            run = _read_run(_parsed(line))
            if run is None:
                break
            self.runs[run.key] = run
            self._good += len(line)
        self.greeting = f"{self.path}: going on after {len(self.runs)} finished walks"

    def __enter__(self) -> "Journal":
        """Drop what is torn or foreign, and stay open."""
        try:
            self._file = self.path.open("r+b" if self._good else "wb")
        except OSError as error:
            raise CommandError(
                f"{self.path}: cannot be written: {error.strerror}"
            ) from None
        self._file.truncate(self._good)
        self._file.seek(self._good)
        if not self._good:
            self._write(self._header)
        return self

    def __exit__(self, *unused: object) -> None:
        """Close; the file stays."""
        self._file.close()

    def add(self, run: GridRun) -> None:
        """Keep a walk, whatever happens next."""
        self._write(run)

    def _write(self, value: object) -> None:
        self._file.write(json.dumps(value).encode() + b"\n")
        self._file.flush()


def _parsed(line: bytes) -> Any:
    """Read a line; None if it is torn."""
    try:
        return json.loads(line) if line.endswith(b"\n") else None
    except ValueError:
        return None


def _read_run(value: Any) -> GridRun | None:
    try:
        (number, job), steps, fell = value
        return GridRun((number, job), [(a, b) for a, b in steps], bool(fell))
    except (TypeError, ValueError):
        return None


@contextmanager
def _backend(options: Qualify, workers: int) -> Iterator[None]:
    """Send the walks where they were asked to go."""
    if options.backend == "dask":
        client = _dask_client(options.address, workers)
        with client, parallel_config(backend="dask", client=client):
            yield
    elif options.backend == "ray":
        _start_ray(options.address, workers)
        with parallel_config(backend="ray"):
            yield
    else:
        yield


def _dask_client(address: str | None, workers: int) -> Any:
    with needed_by("--backend dask"):
        import distributed
    make: Any = distributed.Client  # has no types
    if address is None:
        return make(n_workers=workers, threads_per_worker=1, dashboard_address=None)
    try:
        return make(address, timeout=_PATIENCE_S)
    except (OSError, ValueError) as error:
        raise CommandError(
            f"--address {address}: no dask scheduler within {_PATIENCE_S} s: {error}; "
            "start one with `dask scheduler`, or leave --address out"
        ) from None


def _start_ray(address: str | None, workers: int) -> None:
    with needed_by("--backend ray"):
        import ray
        from ray.util.joblib import register_ray
    try:
        ray.init(address=address, num_cpus=None if address else workers)
    except (ConnectionError, ValueError) as error:
        raise CommandError(f"--address {address}: no Ray cluster: {error}") from None
    register: Any = register_ray  # has no types
    register()


def _check(options: Qualify) -> None:
    if options.workers is not None and options.workers < 1:
        raise CommandError(f"--workers {options.workers}: give 1 or more")
    if not 1 <= options.seeds <= _MOST_SEEDS:
        raise CommandError(f"--seeds {options.seeds}: give 1 to {_MOST_SEEDS}")
    if options.address is not None and options.backend == "loky":
        raise CommandError(
            f"--address {options.address}: loky is this machine; give --backend dask "
            "or --backend ray as well"
        )


def _hand_out(options: Qualify, library: GaitLibrary, out: Path) -> None:
    """Print the table, write the files."""
    report = library.qualification["grid"]
    _show(library, report)
    if options.json is not None:
        walks = {name: library.qualification[name] for name in ("commands", "passed")}
        write_json(options.json, {"robot": library.biped.name, **walks, **report})
    if options.map is not None:
        plot_pass_rates(
            report["cells"], f"{library.biped.name}, {out.name}", options.map
        )
        say(f"{options.map}: the map")
    verdict = "passes" if library.qualified else "does not pass"
    say(f"{out}: {verdict}; what was found is in it")


def _show(library: GaitLibrary, report: Mapping[str, Any]) -> None:
    rows = []
    for cell in report["cells"]:
        every = cell["groups"].get(EVERY_STEP, [0, 0])
        rows.append(
            (
                cell["name"],
                "yes" if cell["required"] else "",
                f"{cell['passes']}/{cell['runs']}",
                f"{every[1]}/{every[0]}",
                f"{cell['steps'][0]}",
                f"{cell['steps'][1]}",
            )
        )
    walks = "commands\nheld", "every\nstep"
    heads = "world", "required", *walks, "steps\nwalked", "fallen\non"
    print_table(f"{library.biped.name} on a grid of worlds", heads, rows)
    out = report["taken_out"]
    named = ", ".join(f"{first} to {last}" for first, last in out[:_NAMED])
    more = " ..." if len(out) > _NAMED else ""
    before = int(library.as_built().allowed_pairs.sum())
    say(f"steps taken out: {len(out)} of {before}{': ' * bool(out)}{named}{more}")
    span = library.command_range
    say(
        f"left: {span.vx[0]:.3f} to {span.vx[1]:.3f} m/s ahead, {span.vy[0]:.3f} to "
        f"{span.vy[1]:.3f} m/s to the left, {span.yaw_rate[0]:.2f} to "
        f"{span.yaw_rate[1]:.2f} rad/s around"
    )
