"""Where the walks of a build or a qualification run: here, on dask, or on Ray."""

# ruff: noqa: PLC0415 - dask and Ray load only where they are asked for.

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from joblib import parallel_config

from gaitchain.build.jobs import keeping
from gaitchain.build.journal import Journal
from gaitchain.build.workers import Crew, available_cores
from gaitchain.cli.console import progress, resumable
from gaitchain.cli.options import Build, Qualify
from gaitchain.errors import CommandError, needed_by

_PATIENCE_S = 10
# Of each connection dask keeps the latest messages, by default 1000, for its own
# developers: with a library in each, they are some 200 MB.
_MESSAGES_KEPT = {"distributed.admin.low-level-log-length": 16}


def check_address(options: Build | Qualify) -> None:
    """Refuse an address without a cluster.

    Raises:
        CommandError: there is one, and the backend is this machine.
    """
    if options.address is not None and options.backend == "loky":
        raise CommandError(
            f"--address {options.address}: loky is this machine; give --backend dask "
            "or --backend ray as well"
        )


@contextmanager
def on_backend(options: Build | Qualify, workers: int) -> Iterator[None]:
    """Run the walks on the chosen backend in a context."""
    if options.backend == "dask":
        client = dask_client(options.address, workers)
        with client, parallel_config(backend="dask", client=client):
            yield
    elif options.backend == "ray":
        with on_ray(options.address, workers):
            yield
    else:
        yield


@contextmanager
def journaled_crew(options: Qualify, journal: Journal) -> Iterator[Crew]:
    """Yield the processes of a test of falls; what they finish is kept in a journal."""
    workers = options.workers or available_cores()
    with (
        resumable(journal.path),
        on_backend(options, workers),
        keeping(journal),
        progress() as tell,
    ):
        yield Crew(workers, tell)


def dask_client(address: str | None, workers: int) -> Any:
    """Join the dask cluster at an address, or start one on this machine.

    Raises:
        MissingExtraError: dask is not installed.
        CommandError: no scheduler answers there.
    """
    with needed_by("--backend dask"):
        import dask
        import distributed
    dask.config.set(_MESSAGES_KEPT)  # for connections that come later, too
    make: Any = distributed.Client  # untyped
    if address is None:
        # Dask serves its measures in any case; on port 8787 but for one that is free.
        free = "127.0.0.1:0"
        return make(n_workers=workers, threads_per_worker=1, dashboard_address=free)
    try:
        return make(address, timeout=_PATIENCE_S)
    except (OSError, ValueError) as error:
        raise CommandError(
            f"--address {address}: no dask scheduler within {_PATIENCE_S} s: {error}; "
            "start one with `dask scheduler`, or leave --address out"
        ) from None


def _check_answers(address: str | None) -> None:
    """Check that somebody listens at HOST:PORT; Ray itself would try for minutes.

    Raises:
        OSError: nobody does.
    """
    host, _, port = (address or "").rpartition("://")[2].rpartition(":")
    if host and port.isdecimal():
        socket.create_connection((host.strip("[]"), int(port)), _PATIENCE_S).close()


@contextmanager
def on_ray(address: str | None, workers: int) -> Iterator[None]:
    """Run the walks on the Ray cluster at an address, or on one on this machine.

    Raises:
        MissingExtraError: Ray is not installed.
        CommandError: no cluster is there.
    """
    if address is None:
        # Else Ray starts each worker by `uv run` where gaitchain was, from a copy of
        # the working folder, though this very Python is at hand. It looks only once.
        os.environ.setdefault("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
        # Else its processes wait behind all else that runs here.
        os.environ.setdefault("RAY_worker_niceness", "0")
    with needed_by("--backend ray"):
        import ray

        from gaitchain.cli.ray_backend import LastingRayBackend
    try:
        _check_answers(address)
        ray.init(address=address, num_cpus=None if address else workers)
    except (OSError, ValueError) as error:
        raise CommandError(
            f"--address {address}: no Ray cluster: {error}; start one with `ray start "
            "--head`, or leave --address out"
        ) from None
    backend = LastingRayBackend()
    try:
        with parallel_config(backend=backend):
            yield
    finally:
        backend.end()
        ray.shutdown()
