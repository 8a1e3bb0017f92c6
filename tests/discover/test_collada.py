"""COLLADA meshes of a URDF: the same robot as with STL, its units, ups and colours."""

import re

import mujoco
import numpy as np
import pytest

from gaitchain.discover.load import load_model

CORNERS = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1]])
FACES = (0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)
COM = (0.02, -0.03, 0.4)

DAE = """<?xml version="1.0"?>{head}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified>
  <unit meter="{unit}" name="some"/><up_axis>{up}</up_axis></asset>
 <library_effects><effect id="e"><profile_COMMON><technique sid="t"><lambert>
  <diffuse><color>1 0.2 0 1</color></diffuse></lambert></technique></profile_COMMON>
 </effect></library_effects>
 <library_materials><material id="m"><instance_effect url="#e"/></material>
 </library_materials>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="12">{corners}</float_array>
   <technique_common><accessor source="#a" count="4" stride="3">
    <param name="X" type="float"/><param name="Y" type="float"/>
    <param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="4" material="s"><input semantic="VERTEX" source="#v" offset="0"/>
   <p>{faces}</p></triangles></mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="w"><node id="n">
  <instance_geometry url="#g"><bind_material><technique_common>
   <instance_material symbol="s" target="#m"/></technique_common></bind_material>
  </instance_geometry></node></visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#w"/></scene>
</COLLADA>"""

URDF = """<robot name="toy"><link name="base"><inertial><origin xyz="{com}"/>
 <mass value="1"/><inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>
 </inertial>{shapes}</link><link name="leg"><inertial><mass value="1"/>
 <inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
 <joint name="hip" type="revolute"><parent link="base"/><child link="leg"/>
 <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="3" velocity="5"/></joint>
 </robot>"""
SHAPE = (
    '<{kind}><origin xyz="0.1 0 0.2" rpy="0.3 -0.2 0.5"/><geometry><mesh '
    'filename="part.dae" scale="1 2 1"/></geometry>{more}</{kind}>'
)
BOTH = SHAPE.format(kind="visual", more="") + SHAPE.format(kind="collision", more="")


def dae(unit=1.0, up="Z_UP", head="", corners=CORNERS):
    """The text of a tetrahedron's file."""
    told = " ".join(f"{x / unit:.9g}" for x in np.ravel(corners))
    faces = " ".join(map(str, FACES))
    return DAE.format(head=head, unit=unit, up=up, corners=told, faces=faces)


def load(folder, text, com=COM, shapes=BOTH):
    """A URDF beside that file; its compiled model and what was said."""
    (folder / "part.dae").write_text(text, "utf-8")
    file = folder / "toy.urdf"
    told = " ".join(f"{x:.9g}" for x in com)
    file.write_text(URDF.format(com=told, shapes=shapes), "utf-8")
    robot = load_model(file)
    return robot.spec.compile(), " ".join(robot.notes)


def corners_of(model, geom=0):
    """Where the corners of a mesh's geom are in its body, in a fixed order."""
    mesh = model.mesh(model.geom_dataid[geom])
    corners = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    places = model.geom_pos[geom] + corners @ turn.reshape(3, 3).T
    return places[np.lexsort(places.round(6).T)]


def expected(corners=CORNERS):
    """The same by the URDF's definition of <origin> and scale."""
    roll, pitch, yaw = 0.3, -0.2, 0.5
    turns = []
    for angle, (i, j) in ((yaw, (0, 1)), (pitch, (2, 0)), (roll, (1, 2))):
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = np.cos(angle)
        turn[i, j], turn[j, i] = -np.sin(angle), np.sin(angle)
        turns.append(turn)
    places = (corners * [1, 2, 1]) @ (turns[0] @ turns[1] @ turns[2]).T
    places += np.array([0.1, 0.0, 0.2])
    return places[np.lexsort(places.round(6).T)]


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.0254])
def test_its_corners_are_where_the_urdf_puts_them_whatever_the_unit(tmp_path, unit):
    model, notes = load(tmp_path, dae(unit))
    assert model.ngeom == 2
    for geom in range(2):
        np.testing.assert_allclose(corners_of(model, geom), expected(), atol=1e-6)
    assert "left out" not in notes
    assert "y up" not in notes


def test_y_up_is_turned_where_the_coms_say_so_and_left_as_rviz_does_elsewhere(tmp_path):
    turned = CORNERS[:, [0, 2, 1]] * [1, -1, 1]
    for meant, said in ((CORNERS, False), (turned, True)):
        com = (expected(meant).min(axis=0) + expected(meant).max(axis=0)) / 2
        model, notes = load(tmp_path, dae(up="Y_UP"), com)
        np.testing.assert_allclose(corners_of(model), expected(meant), atol=1e-6)
        assert ("1 mesh file (part.dae) turned from y up to z up" in notes) == said


def test_colours_are_those_of_the_mesh_unless_the_urdf_has_some(tmp_path):
    own = [1.0, 0.2, 0.0, 1.0]
    blue = '<material name="b"><color rgba="0 0 1 1"/></material>'
    black = '<material name="t"><color rgba="0 0 0 1"/><texture/></material>'
    for more, colour in (("", own), (blue, [0, 0, 1, 1]), (black, own)):
        shape = SHAPE.format(kind="visual", more=more)
        model, _ = load(tmp_path, dae(), shapes=shape)
        np.testing.assert_allclose(model.geom_rgba[0], colour, atol=0.01)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<COLLADA/>",
        dae()[:900],
        dae(corners=np.full((4, 3), np.nan)),
        dae(head='<!DOCTYPE a [<!ENTITY b "b">]>'),
    ],
)
def test_what_cannot_be_read_is_left_out_and_said(tmp_path, text):
    model, notes = load(tmp_path, text)
    assert not model.ngeom
    assert re.search(r"mesh file \(part\.dae.*left out", notes)
