"""Joblib on Ray with one pool of processes for a whole build."""

from typing import Any

from joblib.pool import PicklingPool
from ray.util.joblib.ray_backend import RayBackend


class LastingRayBackend(RayBackend):
    """Ray's own backend starts a pool for each of joblib's calls, and ends it after it.

    A build makes dozens of calls, and each new process loads the physics for seconds.
    """

    _processes: int = 0
    _pool_of_joblib: tuple[type, ...] = ()

    def configure(
        self, n_jobs: int = 1, parallel: Any = None, *args: Any, **kwargs: Any
    ) -> int:
        """Start the pool, or take the one that is there."""
        if self._pool is None:
            self._pool_of_joblib = PicklingPool.__bases__
            self._processes = super().configure(n_jobs, parallel, *args, **kwargs)
        self.parallel = parallel
        return self._processes

    def terminate(self) -> None:
        """Keep the pool: joblib says so at the end of each call."""

    def abort_everything(self, ensure_ready: bool = True) -> None:
        """End what runs; the next call starts anew."""
        self.end()
        super().abort_everything(ensure_ready)

    def end(self) -> None:
        """End the pool, and give joblib's own back, whose base Ray put its own for.

        Else joblib's "multiprocessing" would be Ray from then on.
        """
        super().terminate()
        if self._pool_of_joblib:
            PicklingPool.__bases__ = self._pool_of_joblib
