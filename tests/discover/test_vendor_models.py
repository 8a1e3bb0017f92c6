"""Walks in the vendors' own models: unlike the skeleton, nothing of them is ours.

Sensors are read and targets written in the order of the file, by joint names.
"""

import os
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from planned_library import planned_library

from gaitchain.backends.model import ModelBackend
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.messages import Command
from gaitchain.walker.walker import Walker

SHARED = Path(__file__).parents[3] / "shared" / "robots"
REAL = Path(os.environ.get("MENAGERIE_ROOT") or SHARED)
SECOND = 100
ROBOTS = {"robotis_op3/op3.xml": 0.15, "unitree_g1/g1.xml": 0.3}


@pytest.fixture(scope="module", params=ROBOTS)
def vendor(request):
    """A robot in its vendor's model, its library, and a speed to walk at."""
    path = REAL / request.param
    if not path.is_file():
        pytest.skip(f"no {path}; set MENAGERIE_ROOT")
    library = planned_library(load_robot(path))
    # Nobody has measured how far off its steps usually are; OP3's are by 0.08 to 0.14.
    leg = library.robot.reduced.leg_length
    library = replace(library, pair_error=np.full_like(library.pair_error, 0.1 * leg))
    spec = mujoco.MjSpec.from_file(str(path))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1])
    return ModelBackend(spec.compile(), library), library, ROBOTS[request.param]


def walk(walker, backend, speed, seconds=6):
    """Stand, walk straight ahead, stop; return the speed of the second half [m/s]."""
    backend.connect(walker.stand)
    for _ in range(2 * SECOND):
        backend.write(walker.step(backend.read()).position)
    walker.command(Command(speed))
    begin = np.zeros(2)
    for tick in range(seconds * SECOND):
        if 2 * tick == seconds * SECOND:
            begin = backend.data.qpos[:2].copy()
        backend.write(walker.step(backend.read()).position)
        assert not backend.fallen, f"fell after {tick / SECOND} s"
    moved = backend.data.qpos[:2] - begin
    walker.command(Command())
    for _ in range(3 * SECOND):
        backend.write(walker.step(backend.read()).position)
    assert not backend.fallen
    assert walker.standing
    return float(np.hypot(*moved)) / (0.5 * seconds)


@pytest.mark.slow
def test_it_walks_in_the_vendors_own_model_as_in_ours(vendor):
    robot, library, asked = vendor
    assert asked < library.command_range.vx[1]
    names = robot.joint_names
    assert len(names) > len(library.robot.legs.joint_names)  # arms as well
    walker = Walker(library, joint_names=names)
    speed = walk(walker, robot, asked)
    assert speed == pytest.approx(asked, rel=0.1)
    ours = Walker(library)
    same = walk(ours, MujocoBackend(library.robot), asked)
    assert speed == pytest.approx(same, rel=0.08)


@pytest.mark.slow
def test_its_joints_and_sensors_are_where_the_leg_model_has_them(vendor):
    """Standing on both soles, the vendor's model and ours measure the same."""
    robot, library, _ = vendor
    walker = Walker(library, joint_names=robot.joint_names)
    robot.connect(walker.stand)
    ours, stand = MujocoBackend(library.robot), Walker(library).stand
    ours.connect(stand)
    for _ in range(SECOND):
        robot.write(walker.stand)
        ours.write(stand)
    own, vendors = ours.read(), robot.read()
    assert np.allclose(vendors.acceleration, own.acceleration, atol=0.3)
    assert vendors.acceleration[2] == pytest.approx(9.81, abs=0.05)
    full = library.robot.legs
    rows = [robot.joint_names.index(name) for name in full.joint_names]
    sag = vendors.joint_position[rows] - own.joint_position
    assert np.abs(sag).max() < 0.03
    assert robot.model.body_mass.sum() == pytest.approx(
        library.robot.reduced.mass, rel=1e-6
    )
