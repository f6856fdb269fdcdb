"""COLLADA files are read as their specification has them, and what is wrong with one is a line."""

import numpy as np
import pytest

from edtk.cell.meshes import collada_corners

SQUARE = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]
TURNED = "<rotate>0 0 2 90</rotate><translate>10 0 0</translate>"
POLYGONS = {
    "triangles": '<triangles count="2">{0}<p>0 9 1 9 2 9 0 9 2 9 3 9</p></triangles>',
    "polylist": '<polylist count="1">{0}<vcount>4</vcount><p>0 9 1 9 2 9 3 9</p></polylist>',
    "polygons": '<polygons count="1">{0}<p>0 9 1 9 2 9 3 9</p></polygons>',
    "tristrips": '<tristrips count="1">{0}<p>1 9 2 9 0 9 3 9</p></tristrips>',
    "trifans": '<trifans count="1">{0}<p>0 9 1 9 2 9 3 9</p></trifans>',
}
INPUTS = (
    '<input semantic="VERTEX" source="#vertices" offset="0"/>'
    '<input semantic="NORMAL" source="#nothing" offset="1"/>'
)
SCENE = (
    '<library_visual_scenes><visual_scene id="all"><node>{0}'
    '<instance_geometry url="#square"/></node></visual_scene></library_visual_scenes>'
    '<scene><instance_visual_scene url="#all"/></scene>'
)


def collada(
    surface: str = POLYGONS["triangles"], scene: str = SCENE.format(""), unit: str = "0.5"
) -> str:
    """A square of 2 by 1, whose points stand after two other numbers and four apart."""
    numbers = "7 7 " + " ".join(f"{x} {y} {z} 8" for x, y, z in SQUARE)
    return f"""<?xml version="1.0" encoding="utf-8"?>
    <COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
    <asset><unit meter="{unit}"/><up_axis>Y_UP</up_axis></asset>
    <library_geometries><geometry id="square"><mesh>
      <source id="points"><float_array id="array" count="18">{numbers}</float_array>
        <technique_common><accessor source="#array" count="4" stride="4" offset="2"/>
        </technique_common></source>
      <vertices id="vertices"><input semantic="POSITION" source="#points"/></vertices>
      <lines count="1"><p>0 1</p></lines>
      {surface.format(INPUTS)}
    </mesh></geometry></library_geometries>
    {scene}</COLLADA>"""


def area(corners: np.ndarray) -> float:
    a, b, c = np.moveaxis(corners, 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("surface", POLYGONS.values(), ids=POLYGONS)
def test_a_square_is_the_same_in_each_kind_of_polygons(surface: str) -> None:
    """Two triangles, half a metre squared in all: the unit counts, and the up axis does not."""
    corners = collada_corners(collada(surface), 10)
    assert corners.shape == (2, 3, 3)
    assert area(corners) == pytest.approx(0.5)
    points = np.unique(corners.reshape(-1, 3), axis=0)
    assert np.allclose(points, np.unique(np.array(SQUARE) / 2, axis=0))


def test_nodes_place_what_stands_in_them() -> None:
    """Transforms act in their order, of nodes in nodes, and of a node that stands in two."""
    scene = f"""<library_nodes><node id="part"><scale>1 1 3</scale>
    <instance_geometry url="#square"/>
    </node></library_nodes><library_visual_scenes><visual_scene id="all">
    <node>{TURNED}<instance_node url="#part"/></node>
    <node><matrix>1 0 0 0 0 1 0 0 0 0 1 5 0 0 0 1</matrix><node><instance_node url="#part"/></node>
    </node></visual_scene></library_visual_scenes>"""
    corners = collada_corners(collada(scene=scene, unit="1"), 10)
    low = corners.reshape(2, -1, 3).min(axis=1)
    high = corners.reshape(2, -1, 3).max(axis=1)
    assert np.allclose(sorted(low.tolist()), [[-1, 10, 0], [0, 0, 5]])
    assert np.allclose(sorted(high.tolist()), [[0, 12, 0], [2, 1, 5]])


def test_without_a_scene_surfaces_stand_as_they_are() -> None:
    """Some programs write the surfaces alone."""
    assert area(collada_corners(collada(scene="", unit="1"), 10)) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<robot/>", "first element is <robot>"),
        ("<COLLADA", "not valid XML"),
        ("<!DOCTYPE x><COLLADA/>", "DOCTYPE"),
        (collada(unit="far"), "<unit> has 'far'; expected 1 finite number"),
        (collada().replace("0 9 1", "0 9 x", 1), "<p> has '0 9 x"),
        (collada().replace("0 9 1", "0 9 -1", 1), "other than whole numbers"),
        (collada().replace("3 9</p>", "4 9</p>"), "a corner without a vertex"),
        (collada().replace("3 9</p>", "3</p>"), "expected a multiple of 2"),
        (collada(POLYGONS["polylist"]).replace("<vcount>4", "<vcount>5"), "polygons that differ"),
        (collada(POLYGONS["trifans"]).replace("9 2 9 3 9", "9"), "polygons that differ"),
        (collada().replace('source="#points"', 'source="#vertices"'), "expected a <source>"),
        (collada().replace('count="4"', 'count="5"'), "asks for other numbers"),
        (collada().replace('stride="4"', 'stride="1e300"'), "other than whole numbers"),
        (collada().replace("VERTEX", "TEXCOORD"), "has no input VERTEX"),
        (collada().replace("POSITION", "NORMAL"), "has no input POSITION"),
        (collada().replace("mesh>", "spline>"), "has no <mesh>"),
        (collada(scene=SCENE.format("<skew>1 2 3 4 5 6 7</skew>")), "<skew> is no transform"),
        (collada(scene=SCENE.format("<matrix>1 2 3</matrix>")), "expected 16 finite numbers"),
        (collada(scene=SCENE.format("<instance_controller/>")), "a skin"),
        (collada().replace('url="#square"', 'url="#circle"'), "names '#circle'"),
        (
            collada(scene=SCENE.format('<node id="a"><instance_node url="#a"/></node>')),
            "stands in itself",
        ),
    ],
)
def test_what_is_not_read_is_one_line(text: str, said: str) -> None:
    """No part of a surface is left out without a word."""
    with pytest.raises(ValueError, match=said) as caught:
        collada_corners(text, 10)
    assert "\n" not in str(caught.value)


def test_nodes_that_multiply_end() -> None:
    """Twenty nodes that hold the next one twice are a million places."""
    nodes = "".join(
        f'<node id="n{i}"><instance_node url="#n{i + 1}"/><instance_node url="#n{i + 1}"/></node>'
        for i in range(20)
    )
    library = f'<library_nodes>{nodes}<node id="n20"/></library_nodes>'
    scene = SCENE.format('<instance_node url="#n0"/>')
    with pytest.raises(ValueError, match="more than 10,000 nodes"):
        collada_corners(collada(scene=library + scene), 10)
