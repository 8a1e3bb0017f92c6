"""A robot is drawn as its file shows it, in any pose, and walks as before."""

import os
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from planned_library import planned_res
from toy_file import toy
from whole_robot import Whole

from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.discover.looks import find_looks, read_looks
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.identified import Identified
from gaitchain.sim.model import build_model

SHARED = Path(__file__).parents[3] / "shared" / "robots"
REAL = Path(os.environ.get("MENAGERIE_ROOT") or SHARED)
STOCK = ("robotis_op3/op3.xml", "unitree_g1/g1.xml", "pal_talos/talos.xml")
MESH, CAPSULE = mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_CAPSULE


def clothed(loaded, seed):
    """The file's robot and ours in its clothes, in one pose anywhere."""
    looks = read_looks(loaded.model, loaded.findings, loaded.robot)
    ours = build_model(loaded.robot, looks=looks)
    return Whole(loaded.model, loaded.findings, loaded.robot, seed, ours)


def shown(model):
    """Geoms of the robot that MuJoCo's viewer shows, in the file's order."""
    own = (model.geom_group <= 2) & (model.geom_bodyid > 0)
    seen = np.flatnonzero(own & (model.geom_rgba[:, 3] > 0.0)).tolist()
    number = {g: model.geom(g).name.partition("_look_")[2] for g in seen}
    return np.array(sorted(seen, key=lambda g: int(number[g] or 0)))


def touching(model):
    """Names of the geoms that can touch something."""
    geoms = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    return {model.geom(geom).name for geom in geoms}


def corners(model, data, geom):
    """Lowest and highest coordinates of a mesh in the world."""
    mesh = model.mesh(model.geom_dataid[geom])
    points = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
    placed = data.geom_xpos[geom] + points @ data.geom_xmat[geom].reshape(3, 3).T
    return np.array([placed.min(axis=0), placed.max(axis=0)])


@pytest.mark.parametrize("seed", range(3))
def test_every_shape_is_where_the_file_has_it(toy_path, seed):
    whole = clothed(load_with_findings(toy_path), seed)
    theirs, ours = shown(whole.model), shown(whole.ours)
    assert len(ours) == len(theirs)
    for one, other in zip(ours, theirs, strict=True):
        at = whole.skeleton.geom_xpos[one]
        np.testing.assert_allclose(at, whole.data.geom_xpos[other], atol=1e-9)
        axes = whole.skeleton.geom_xmat[one]
        np.testing.assert_allclose(axes, whole.data.geom_xmat[other], atol=1e-9)
        assert whole.ours.geom_type[one] == whole.model.geom_type[other]
        np.testing.assert_allclose(
            whole.ours.geom_size[one], whole.model.geom_size[other]
        )


@pytest.mark.parametrize("path", STOCK)
def test_a_vendors_meshes_are_where_the_file_has_them(path):
    if not (REAL / path).is_file():
        pytest.skip(f"no {REAL / path}; set MENAGERIE_ROOT")
    whole = clothed(load_with_findings(REAL / path), 0)
    theirs, ours = shown(whole.model), shown(whole.ours)
    assert len(ours) == len(theirs)
    fine = 0.01 * whole.robot.reduced.leg_length
    faces = 0
    for one, other in zip(ours, theirs, strict=True):
        if whole.model.geom_type[other] != MESH:
            continue
        faces += int(whole.ours.mesh_facenum[whole.ours.geom_dataid[one]])
        np.testing.assert_allclose(
            corners(whole.ours, whole.skeleton, one),
            corners(whole.model, whole.data, other),
            atol=fine,
        )
    assert 10_000 < faces < 60_000


def test_colours_are_those_of_the_material(tmp_path):
    file = tmp_path / "red.xml"
    text = toy().replace(
        "<worldbody>",
        '<asset><material name="paint" rgba="1 0 0 0.5"/></asset><worldbody>',
    )
    file.write_text(text.replace("<geom ", '<geom material="paint" '), "utf-8")
    loaded = load_with_findings(file)
    looks = read_looks(loaded.model, loaded.findings, loaded.robot)
    assert {tuple(look.colour) for look in looks} == {(1.0, 0.0, 0.0, 0.5)}


def test_a_colour_of_its_own_counts_before_the_materials(tmp_path):
    """As in MuJoCo's viewer; what is clear there is not drawn."""
    file = tmp_path / "painted.xml"
    paint = '<asset><material name="paint" rgba="1 0 0 1"/></asset>'
    own = '<geom size="0.1" mass="0" material="paint" rgba="{}"/>'
    shapes = own.format("0 0 1 1") + own.format("0 0 1 0") + own.format("0.5 0.5 0.5 1")
    text = toy().replace("<worldbody>", f"{paint}<worldbody>")
    file.write_text(text.replace("<freejoint/>", f"<freejoint/>{shapes}"), "utf-8")
    loaded = load_with_findings(file)
    balls = [
        look.colour
        for look in read_looks(loaded.model, loaded.findings, loaded.robot)
        if look.size[0] == pytest.approx(0.1) and look.body == "trunk"
    ]
    assert sorted(map(tuple, balls)) == [(0.0, 0.0, 1.0, 1.0), (1.0, 0.0, 0.0, 1.0)]


def test_a_mesh_smaller_than_what_is_drawn_stays_as_it_is(tmp_path):
    """As a screw: its points would all become one."""
    file = tmp_path / "pinned.xml"
    corners = "0 0 0 4e-4 0 0 0 4e-4 0 0 0 4e-4"
    text = toy().replace(
        "<worldbody>",
        f'<asset><mesh name="pin" vertex="{corners}"/></asset><worldbody>',
    )
    pin = '<geom type="mesh" mesh="pin" contype="0" conaffinity="0" mass="0"/>'
    text = text.replace("<freejoint/>", f"<freejoint/>{pin}")
    file.write_text(text, "utf-8")
    loaded = load_with_findings(file)
    looks = read_looks(loaded.model, loaded.findings, loaded.robot)
    (pin,) = [look for look in looks if look.surface is not None]
    assert pin.surface.faces.shape == (4, 3)
    build_model(loaded.robot, looks=looks)


def test_clothes_weigh_nothing_and_touch_nothing(toy_path):
    loaded = load_with_findings(toy_path)
    bare = build_model(loaded.robot)
    looks = read_looks(loaded.model, loaded.findings, loaded.robot)
    model = build_model(loaded.robot, looks=looks)
    for name in ("body_mass", "body_inertia", "body_ipos", "jnt_range"):
        np.testing.assert_array_equal(getattr(model, name), getattr(bare, name))
    touching = [
        sorted(
            m.geom(g).name for g in np.flatnonzero(m.geom_contype | m.geom_conaffinity)
        )
        for m in (bare, model)
    ]
    assert touching[0] == touching[1]


def test_a_library_is_drawn_as_its_file_while_that_is_there(
    toy_path, toy_library, tmp_path, caplog
):
    library = replace(
        toy_library, config=replace(toy_library.config, robot=str(toy_path))
    )
    assert len(find_looks(library)) == 9
    gone = replace(library.config, robot=str(tmp_path / "gone.xml"))
    assert find_looks(replace(library, config=gone)) == ()
    assert "gone.xml: no such file to draw the robot from; work in" in caplog.text
    other = tmp_path / "other.xml"
    other.write_text(toy(kp=250.0), "utf-8")
    changed = replace(library.config, robot=str(other))
    assert find_looks(replace(library, config=changed)) == ()
    assert f"{other} has changed in what walking needs" in caplog.text


def test_boxes_that_were_identified_have_no_file_to_be_drawn_from(caplog):
    """It was told that the file of RES had changed."""
    own = planned_res()
    found = own.robot.as_identified(Identified.of_file(12))
    config = replace(own.config, robot="res")
    mine = replace(own, poses=replace(own.poses, robot=found), config=config)
    assert find_looks(mine) == ()
    assert not caplog.text


def test_a_robot_of_boxes_has_clothes_of_ours():
    res = load_box_robot("res")
    model = build_model(res, looks=())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    ours = shown(model)
    assert len(ours) > 25
    assert (model.geom_type[ours] == CAPSULE).any()
    lowest = data.geom_xpos[ours, 2].min()
    assert 0.0 < lowest < 0.02, "the soles are on the floor"
    assert shown(build_model(res)).size == 7
