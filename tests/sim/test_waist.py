"""A waist that gives way: the same robot, with an upper body on a spring."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from other_robots import with_legs

from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.base import Disturbances
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import CommandError
from gaitchain.gait.schedule import Segment
from gaitchain.messages import GRAVITY, Command
from gaitchain.robot.box_robot import box_legs, load_box_robot
from gaitchain.sim.model import build_model
from gaitchain.sim.push import Push
from gaitchain.sim.waist import AXES
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

RES = load_box_robot("res")
SAME = with_legs(RES, box_legs(RES.reduced))
ROBOTS = [RES, SAME]


def pair(robot, **world):
    """The robot with a rigid trunk, and with a loose one."""
    return [build_model(robot, World(waist=s, **world)) for s in (math.inf, 3.0)]


def posed(model):
    """Legs bent, waist straight; mass matrix and data."""
    data = mujoco.MjData(model)
    data.qpos[7 : 7 + model.nu] = np.linspace(-0.4, 0.5, model.nu)
    mujoco.mj_forward(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return matrix, data


@pytest.mark.parametrize("robot", ROBOTS, ids=["boxes", "skeleton"])
@pytest.mark.parametrize("payload", [0.0, 0.2])
@pytest.mark.parametrize("com_m", [0.0, 0.02])
def test_a_straight_waist_leaves_mass_com_and_inertia(robot, payload, com_m):
    rigid, loose = pair(robot, payload=payload, com_m=com_m)
    whole, before = posed(rigid)
    parts, after = posed(loose)
    own = rigid.nv
    np.testing.assert_allclose(parts[:own, :own], whole, atol=1e-9)
    np.testing.assert_allclose(after.subtree_com[1], before.subtree_com[1], atol=1e-12)
    np.testing.assert_allclose(after.qfrc_bias[:own], before.qfrc_bias, atol=1e-9)


@pytest.mark.parametrize("payload", [0.2, 1.0])
def test_a_flat_trunk_with_a_payload_stays_a_body(payload):
    """A payload in one point: what the cut takes for it may be more than there is."""
    least = np.linalg.eigvalsh(SAME.legs.trunk_inertia).min()
    flat = least * np.diag([0.85, 1.0, 0.31])  # the proportions of OP3's
    robot = replace(SAME, legs=replace(SAME.legs, trunk_inertia=flat))
    model = build_model(robot, World(waist=3.0, payload=payload))
    moments = np.sort(model.body("upper").inertia)
    assert 0.0 < moments[2] <= moments[0] + moments[1] + 1e-12


@pytest.mark.parametrize("height", [-0.1, -0.02, 0.0, 0.01])
def test_a_trunk_at_its_hips_or_below_has_a_waist_that_holds_it(height):
    """Wherever its CoM is, its upper body stands above the waist on a spring."""
    legs = replace(SAME.legs, trunk_com=[0.0, 0.0, height])
    rigid, loose = pair(replace(SAME, legs=legs))
    upper = loose.body("upper")
    lever, leg = upper.ipos[2], SAME.reduced.leg_length
    assert lever >= 0.1 * leg
    weight = upper.mass[0] * GRAVITY * lever
    springs = [loose.joint(name).stiffness[0] for name in AXES]
    np.testing.assert_allclose(springs, 3.0 * weight, rtol=1e-12)
    (whole, before), (parts, after) = posed(rigid), posed(loose)
    own = rigid.nv
    np.testing.assert_allclose(parts[:own, :own], whole, atol=1e-9)
    np.testing.assert_allclose(after.subtree_com[1], before.subtree_com[1], atol=1e-12)


@pytest.mark.parametrize("robot", ROBOTS, ids=["boxes", "skeleton"])
def test_a_trunk_well_above_its_hips_has_its_waist_at_a_quarter(robot):
    """To the last bit: finished libraries were walked on it."""
    rigid, loose = pair(robot)
    assert loose.body("upper").pos[2] == 0.25 * rigid.body("trunk").ipos[2]


@pytest.mark.parametrize("robot", ROBOTS, ids=["boxes", "skeleton"])
def test_a_payload_taken_up_is_in_both_parts_of_the_trunk(robot):
    """Mass and CoM of all are those of a robot that was built with it."""
    loaded = MujocoBackend(robot, World(waist=3.0))
    loaded.disturb(Disturbances(None, "still", 0.2))
    built = build_model(robot, World(waist=3.0, payload=0.2))
    np.testing.assert_allclose(loaded.model.body_mass, built.body_mass, rtol=1e-12)
    (_, found), (_, wanted) = posed(loaded.model), posed(built)
    np.testing.assert_allclose(found.subtree_com[1], wanted.subtree_com[1], atol=1e-12)


@pytest.mark.parametrize("robot", ROBOTS, ids=["boxes", "skeleton"])
def test_its_joints_come_last_and_have_no_servo(robot):
    rigid, loose = pair(robot)
    assert loose.nu == rigid.nu
    names = [loose.joint(j).name for j in range(loose.njnt)]
    assert names[rigid.njnt :] == list(AXES)
    assert names[: rigid.njnt] == [rigid.joint(j).name for j in range(rigid.njnt)]


@pytest.mark.parametrize("axis", AXES)
def test_it_leans_as_far_as_spring_and_weight_agree(axis):
    """In a tilted field of gravity: k q = m g h sin(q + tilt), solved by physics."""
    model, tilt = build_model(RES, World(waist=3.0)), 0.05
    aside = -math.sin(tilt) if axis == "waist_roll" else 0.0
    ahead = math.sin(tilt) if axis == "waist_pitch" else 0.0
    model.opt.gravity[:] = GRAVITY * np.array([ahead, aside, -math.cos(tilt)])
    joint, data = model.joint(axis), mujoco.MjData(model)
    upper = model.body("upper").id
    lever = model.body_ipos[upper][2]
    weight = model.body_mass[upper] * GRAVITY * lever
    assert model.jnt_stiffness[joint.id] == pytest.approx(3.0 * weight)
    lean = 0.0
    for _ in range(50):
        lean = math.sin(lean + tilt) / 3.0
    data.qpos[joint.qposadr[0]] = lean
    mujoco.mj_forward(model, data)
    dof = joint.dofadr[0]
    torque = data.qfrc_passive[dof] - data.qfrc_bias[dof]
    assert torque == pytest.approx(0.0, abs=2e-3 * weight)


def test_a_walk_is_recorded_without_the_waist(brisk):
    backend = MujocoBackend(brisk.robot, World(waist=6.0))
    walker = Walker(brisk)
    straight = (Segment(Command(0.3), 4.0),)
    walked = run_unrecorded(walker, backend, straight)
    assert walked.fell_at_s is None
    truth = backend.truth()
    assert len(truth.qpos) == 7 + backend.model.nu
    assert len(backend.read().joint_position) == backend.model.nu
    assert np.abs(backend.data.qpos[7 + backend.model.nu :]).max() > 1e-4, "it bends"


@pytest.mark.parametrize("arms", ["still", "random"])
def test_a_push_on_the_trunk_acts_on_both_of_its_parts(arms):
    """A waist as good as rigid is none, for the arms on the upper part, too."""
    ends = []
    for waist in (math.inf, 2000.0):
        push = Push(12.0, 0.0, 0.5)
        world = World(waist=waist, push=(push,), seed=3, arms=arms)
        backend = MujocoBackend(RES, world)
        backend.connect(np.array(RES.legs.stand))
        for _ in range(80):
            backend.write(np.array(RES.legs.stand))
        ends.append(np.concatenate([backend.data.qpos[:3], backend.data.qvel[:3]]))
    assert np.abs(ends[0][3:]).max() > 0.1, "it moves"
    np.testing.assert_allclose(ends[1], ends[0], atol=0.01)


def test_a_softer_waist_than_its_weight_needs_is_refused():
    with pytest.raises(CommandError, match=r"waist is 0\.9, must be at least 1\.1"):
        World(waist=0.9)
    assert replace(World(), waist=2.0).waist == 2.0
