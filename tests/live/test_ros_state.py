"""Topics of a robot that was identified are in the axes of its file."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from telemetry_factory import seen

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.libraries import read_library
from gaitchain.live.ros_state import FOOTPRINT, RosFrames, imu
from gaitchain.robot.identified import Identified
from gaitchain.robot.urdf import BASE, SOLES
from gaitchain.walker.walker import Walker

TILT, OFFSET, KNEES = 0.1, 0.05, (3, 9)


@pytest.fixture(scope="module")
def stands():
    """A robot that has stood for a second, its telemetry, and its simulator."""
    shipped = read_library("res")
    offset = np.zeros(12)
    offset[list(KNEES)] = OFFSET
    tilt = np.array([0.0, TILT, 0.0])
    found = replace(Identified.of_file(12), offset=offset, tilt=tilt)
    robot = replace(shipped.robot, identified=found)
    walker = Walker(replace(shipped, poses=replace(shipped.poses, robot=robot)))
    backend = MujocoBackend(robot)
    backend.connect(walker.stand)
    for _ in range(100):
        target = walker.step(backend.read()).position
        backend.write(target)
    return robot, seen(walker, backend, 1.0, target), backend


def test_joints_are_those_of_the_file(stands):
    robot, t, backend = stands
    for knee in KNEES:
        truth = backend.data.joint(robot.legs.joint_names[knee]).qpos[0]
        assert t.joint_position[knee] == pytest.approx(truth, abs=0.01)
        assert abs(t.joint_target[knee] - truth) < 0.5 * OFFSET


def test_the_imu_agrees_with_its_own_orientation(stands):
    measured = imu(stands[1])
    q, a = measured.orientation, measured.linear_acceleration
    up = Rotation.from_quat([q.x, q.y, q.z, q.w]).apply([a.x, a.y, a.z])
    assert np.degrees(np.arctan2(np.hypot(*up[:2]), up[2])) < 0.5


def test_the_soles_are_flat_on_the_floor(stands):
    robot, t, _ = stands
    frames, turns = RosFrames(robot), {BASE: Rotation.identity()}
    for one in frames.links(t):
        q = one.transform.rotation
        own = Rotation.from_quat([q.x, q.y, q.z, q.w])
        turns[one.child_frame_id] = turns[one.header.frame_id] * own
    footprint = next(
        one for one in frames.base(t) if one.child_frame_id == FOOTPRINT
    ).transform.rotation
    level = Rotation.from_quat([footprint.x, footprint.y, footprint.z, footprint.w])
    for sole in SOLES:
        up = (level.inv() * turns[sole]).apply([0.0, 0.0, 1.0])
        assert np.degrees(np.arccos(up[2])) < 0.7
