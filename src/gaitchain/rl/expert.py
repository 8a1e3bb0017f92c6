"""The walk as an expert to imitate: observations in, actions out; NumPy, no torch."""

from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import LibraryError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.rl.actions import TargetScale
from gaitchain.rl.observation import Layout, Observation
from gaitchain.walker.walker import Walker


def open_library(library: GaitLibrary | str | Path | None) -> GaitLibrary:
    """Return a library, given as such or as its file; None is RES's of the package.

    Raises:
        LibraryError: it is none of these, or the file cannot be read.
    """
    if isinstance(library, GaitLibrary):
        return library
    if not isinstance(library, str | Path | None):
        raise LibraryError(
            f"library {library!r}: give a GaitLibrary, the path of one, or None for RES"
        )
    shipped = Path(str(files("gaitchain"))) / "data" / "res.gait"
    return load_library(shipped if library is None else Path(library))


class Expert:
    """A policy for the environment with `action="targets"`, from a library.

    It sees what any agent sees, a robot's sensors and the command, and needs neither
    torch nor the simulator. Like a recurrent policy it has a state: call `reset` at the
    start of each episode. It stands for its first second, to find the vertical.
    """

    def __init__(self, library: GaitLibrary | str | Path | None = None) -> None:
        """Prepare the walk.

        Args:
            library: the gaits, or their file; RES's library of the package by default.

        Raises:
            LibraryError: the library cannot be read, or physics has not passed it.
        """
        self._walker = Walker(open_library(library))
        stand = self._walker.stand
        self._scale = TargetScale(self._walker.library, stand)
        self._layout = Layout.of(len(stand), len(stand))
        self._rest_ticks = round(self._walker.gait.rest_s / CONTROL_PERIOD_S)
        self.reset()

    def reset(self) -> None:
        """Begin an episode: the robot stands."""
        self._walker.reset()
        self._walker.command(Command())
        self._ticks = 0

    def act(self, observation: Observation) -> NDArray[np.float32]:
        """Return the action for an observation; call once per step.

        Args:
            observation: (size,) of the environment with `action="targets"`.

        Returns:
            (n,) joint targets in [-1, 1].

        Raises:
            CommandError: the observation has another size.
        """
        self._layout.check(observation)
        parts = np.asarray(observation, np.float64)[self._layout.command]
        if self._ticks >= self._rest_ticks:
            self._walker.command(self._walker.command_range.steer(parts.tolist()))
        time_s = self._ticks * CONTROL_PERIOD_S
        seen = self._layout.sensors(observation, self._scale.stand, time_s)
        self._ticks += 1
        targets = self._walker.step(seen).position
        return self._scale.action(targets).astype(np.float32)
