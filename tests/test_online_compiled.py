"""The online path as machine code and as plain Python: the same numbers."""

import os
import subprocess
import sys

import numpy as np
import pytest

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.library_file import save_library
from gaitchain.messages import Command
from gaitchain.robot.world import Push, World
from gaitchain.walker import Walker

TICKS, START = 260, 40
FIELDS = ("joint_position", "joint_velocity", "angular_velocity", "acceleration")
REPLAY = f"""
import sys
import numpy as np
from gaitchain.messages import Command, Sensors
from gaitchain.online.compiled import COMPILED
from gaitchain.walker import Walker

library, recorded, result = sys.argv[1:]
data = np.load(recorded)
walker = Walker.load(library)
targets = []
for tick in range({TICKS}):
    if tick == {START}:
        walker.command(Command(0.2, 0.02, 0.05))
    row = [data[name][tick] for name in {FIELDS!r}]
    targets.append(walker.step(Sensors(0.01 * tick, *row)).position)
np.savez(result, compiled=COMPILED, targets=np.array(targets), steps=walker.steps)
"""


@pytest.fixture(scope="module")
def recorded(brisk, tmp_path_factory):
    """A noisy walk with a push, which no plan foresaw: sensors and targets."""
    folder = tmp_path_factory.mktemp("recorded")
    save_library(brisk, folder / "brisk.gait")
    push = Push(impulse_ns=6.0, direction_deg=60.0, at_s=1.8)
    backend = MujocoBackend(brisk.biped, World(noise=0.5, seed=2, push=(push,)))
    walker = Walker(brisk)
    backend.connect(walker.stand)
    rows, targets = {name: [] for name in FIELDS}, []
    for tick in range(TICKS):
        if tick == START:
            walker.command(Command(0.2, 0.02, 0.05))
        sensors = backend.read()
        for name, values in rows.items():
            values.append(getattr(sensors, name))
        targets.append(walker.step(sensors).position)
        backend.write(targets[-1])
    np.savez(folder / "sensors.npz", **rows)
    return folder, np.array(targets)


def replayed(folder, name, **environment):
    env = {k: v for k, v in os.environ.items() if k != "GAITCHAIN_PLAIN"}
    files = [str(folder / file) for file in ("brisk.gait", "sensors.npz", name)]
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", REPLAY, *files],
        env={**env, **environment},
    )


def test_machine_code_and_python_give_the_same_targets(recorded):
    """In two fresh interpreters, one of them without Numba."""
    folder, here = recorded
    plain = replayed(folder, "plain.npz", GAITCHAIN_PLAIN="1")
    usual = replayed(folder, "usual.npz")
    assert (plain.wait(), usual.wait()) == (0, 0)
    one, two = np.load(folder / "plain.npz"), np.load(folder / "usual.npz")
    assert not one["compiled"]
    assert one["steps"] == two["steps"] >= 2
    np.testing.assert_allclose(one["targets"], two["targets"], atol=1e-9)
    np.testing.assert_allclose(one["targets"], here, atol=1e-9)
    assert np.ptp(here, axis=0).max() > 0.2  # it walked
