"""Cost and memory of many short walks of a proof on one backend.

    python benchmarks/scale.py --backend dask --walks 1000 --json scale.json

Walks of 2 s of RES, as `qualify --bound` makes them, without an end. Prints for each
tenth the seconds and the processor's seconds per walk, the memory of this process and
of the largest worker, and a digest of all results so far, which has to be the same on
every backend.
"""

import argparse
import hashlib
import json
import os
import time
from itertools import islice
from pathlib import Path

from gaitchain.build.workers import available_cores
from gaitchain.cli.cluster import on_backend
from gaitchain.cli.libraries import shipped_library
from gaitchain.cli.options import Qualify
from gaitchain.gait.library_file import load_library
from gaitchain.proof.proof_walks import Criterion, ProofWalks, mild_cells

PARTS = 10


def resident_mib(pid="self"):
    """Return the resident memory of a process [MiB]; 0 once it has ended."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    found = [line for line in status.splitlines() if line.startswith("VmRSS")]
    return int(found[0].split()[1]) / 1024.0 if found else 0.0


def cpu_s(pid="self"):
    """Return the processor time of a process and of its ended children [s]."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def all_cpu_s():
    """Return that of this process and all that it started [s]."""
    return cpu_s() + sum(map(cpu_s, descendants("self")))


def descendants(pid):
    """Return the processes that a process started, and theirs."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in task.read_text().split():
            found += [child, *descendants(child)]
    return found


def measure(options):
    library = load_library(shipped_library())
    criterion, cells = Criterion(1e-4, seconds=options.seconds), mild_cells(library)
    walks = ProofWalks(library, criterion, cells, options.workers).drawn()
    digest, rows, part = hashlib.sha256(), [], max(options.walks // PARTS, 1)
    for done in range(0, options.walks, part):
        began, used_s, spent = time.monotonic(), all_cpu_s(), 0
        for walk in islice(walks, min(part, options.walks - done)):
            digest.update(repr(walk).encode())
            spent += 1
        row = {
            "walks": done + spent,
            "s_per_walk": (time.monotonic() - began) / spent,
            "cpu_s_per_walk": (all_cpu_s() - used_s) / spent,
            "here_mib": resident_mib(),
            "workers_mib": max([0.0, *map(resident_mib, descendants("self"))]),
            "sha256": digest.hexdigest(),
        }
        rows.append(row)
        print(json.dumps(row), flush=True)
    return {"rows": rows}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--backend", choices=("loky", "dask", "ray"), default="loky")
    parser.add_argument("--walks", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=2.0, help="of each walk")
    parser.add_argument("--workers", type=int, default=available_cores())
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with on_backend(Qualify("res", backend=options.backend), options.workers):
        began = time.monotonic()
        found = measure(options)
        found |= {"backend": options.backend, "seconds": time.monotonic() - began}
    print(f"{options.backend}: {found['seconds']:.1f} s")
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
