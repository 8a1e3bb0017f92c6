"""The online path as machine code and as plain Python: the same numbers."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.library_file import save_library
from gaitchain.messages import Command
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

TICKS, START = 260, 40
OWN_PATH = os.environ.get("PYTHONPATH", "").split(os.pathsep)
FIELDS = ("joint_position", "joint_velocity", "angular_velocity", "acceleration")
REPLAY = f"""
import sys
import numpy as np
from gaitchain.messages import Command, Sensors
from gaitchain.balance.compiled import COMPILED
from gaitchain.walker.walker import Walker

library, recorded, result = sys.argv[1:]
data = np.load(recorded)
walker = Walker.load(library)
targets = []
for tick in range({TICKS}):
    if tick == {START}:
        walker.command(Command(0.2, 0.02, 0.05))
    row = [data[name][tick] for name in {FIELDS!r}]
    targets.append(walker.step(Sensors(0.01 * tick, *row)).position)
np.savez(result, compiled=COMPILED, targets=np.array(targets), steps=walker.gait.steps)
"""

ANY_LEG = """
import sys
import numpy as np
from leg_makes import MAKES, NO_ANKLE_ROLL, NO_YAW, SEVEN, make_legs
from gaitchain.balance.compiled import COMPILED
from gaitchain.balance.support_foot import see_support
from gaitchain.balance.leg_kinematics import (
    angular_momentum,
    com_from_pelvis,
    com_velocity,
    link_speeds,
    posture,
)
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.feedforward import LegLoad, holding_torques
from gaitchain.balance.state import Attitude

found = []
rng = np.random.default_rng(5)
for make in (*MAKES, NO_YAW, NO_ANKLE_ROLL, SEVEN):
    legs = make_legs(make, rng)
    count = len(make.split())
    joints = legs.start + rng.uniform(-0.3, 0.3, 2 * count)
    rates, spin = rng.normal(size=2 * count), rng.normal(size=3)
    pose = posture(legs, joints)
    view = see_support(legs, Attitude(*rng.normal(0.0, 0.2, 6)), 1.0, joints, rates)
    found += [*pose, com_from_pelvis(legs, pose), *view.com, *view.swing]
    links, ankles = link_speeds(legs, pose, rates, spin)
    found += [links, ankles, com_velocity(legs, links, spin)]
    found += [angular_momentum(legs, pose.coms, links, spin), *view.turning]
    for leg in range(2):
        start = joints[leg * count : (leg + 1) * count] + rng.uniform(-0.1, 0.1, count)
        here = pose.ankles[leg], pose.feet[leg]
        force, pull = rng.normal(0.0, 99.0, 3), rng.normal(size=(count, 3))
        found.append(leg_joints(legs, leg, *here, start))
        load = LegLoad(force, 0.03, 0.01, 0.8)
        found.append(holding_torques(legs, pose, leg, load, pull))
numbers = np.concatenate([np.ravel(x) for x in found])
np.savez(sys.argv[1], compiled=COMPILED, numbers=numbers)
"""


@pytest.fixture(scope="module")
def recorded(brisk, tmp_path_factory):
    """A noisy walk with a push, which no plan foresaw: sensors and targets."""
    folder = tmp_path_factory.mktemp("recorded")
    save_library(brisk, folder / "brisk.gait")
    push = Push(impulse_ns=6.0, direction_deg=60.0, at_s=1.8)
    backend = MujocoBackend(brisk.robot, World(noise=0.5, seed=2, push=(push,)))
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


def interpreter(code, *files, **environment):
    env = {k: v for k, v in os.environ.items() if k != "GAITCHAIN_PLAIN"}
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", code, *map(str, files)],
        env={**env, **environment},
    )


def replayed(folder, name, **environment):
    files = [folder / file for file in ("brisk.gait", "sensors.npz", name)]
    return interpreter(REPLAY, *files, **environment)


@pytest.mark.slow
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


@pytest.mark.slow
def test_legs_of_any_make_give_the_same_numbers(tmp_path):
    """5, 6 and 7 joints: posture, velocities, inverse kinematics, torques."""
    here = {
        "PYTHONPATH": os.pathsep.join(
            [str(Path(__file__).parents[1] / "support"), *OWN_PATH]
        )
    }
    plain = interpreter(ANY_LEG, tmp_path / "plain.npz", GAITCHAIN_PLAIN="1", **here)
    usual = interpreter(ANY_LEG, tmp_path / "usual.npz", **here)
    assert (plain.wait(), usual.wait()) == (0, 0)
    one, two = np.load(tmp_path / "plain.npz"), np.load(tmp_path / "usual.npz")
    assert not one["compiled"]
    assert two["compiled"]
    assert one["numbers"].size > 800
    np.testing.assert_allclose(one["numbers"], two["numbers"], atol=1e-9)


def test_without_numba_it_says_what_to_install():
    code = (
        "import sys\n"
        "sys.modules['numba'] = None\n"
        "from gaitchain.errors import GaitchainError\n"
        "try:\n    import gaitchain.balance.compiled\n"
        "except GaitchainError as error:\n    print(error)\n"
        "else:\n    print('plain', gaitchain.balance.compiled.COMPILED)\n"
    )

    def said(**more):
        env = {k: v for k, v in os.environ.items() if k != "GAITCHAIN_PLAIN"}
        return subprocess.check_output(
            [sys.executable, "-c", code], env={**env, **more}, text=True
        )

    message = said()
    assert "pip install numba" in message
    assert "GAITCHAIN_PLAIN=1" in message
    assert said(GAITCHAIN_PLAIN="1") == "plain False\n"
