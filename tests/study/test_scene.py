"""`[scene]`: the cell of a study, from its keys and its robot, and what is wrong with one."""

import numpy as np
import pytest

from edtk import Study, load_study
from edtk.cell.shapes import Box, Capsule, Cylinder, Plane
from edtk.system.errors import Note, UserError

KEYS = {
    "robot": "kuka_kr270",
    "tool": {"position_mm": [400, 0, -300]},
    "load": {"F_N": [0, 0, -2500]},
    "measurement": {"sigma_mm": 0.03},
    "joints": {"unknown": ["q2", "q3"], "fixed_deg": {"q1": 0}},
}
TABLE = {"name": "table", "size_mm": [600, 800, 700], "position_mm": [2200, 0, 350]}
URDF = """<robot name="arm">
  <link name="foot"><collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision></link>
  <link name="one"><visual><origin xyz="0 0 0.5"/><geometry><cylinder radius="0.05" length="1"/>
    </geometry></visual></link>
  <link name="two"><collision><geometry><sphere radius="0.1"/></geometry></collision>
    <visual><geometry><box size="9 9 9"/></geometry></visual></link>
  <link name="tip"><collision><geometry><mesh filename="package://parts/hand.stl"
    scale="0.001 0.001 0.001"/></geometry></collision></link>
  <joint name="a" type="revolute"><parent link="foot"/><child link="one"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3"/></joint>
  <joint name="b" type="revolute"><parent link="one"/><child link="two"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 1"/><limit lower="-2" upper="2"/></joint>
  <joint name="c" type="fixed"><parent link="two"/><child link="tip"/>
    <origin xyz="0.2 0 0"/></joint>
</robot>"""
HAND = """solid hand
facet
vertex 0 0 0
vertex 50 0 0
vertex 0 50 0
endfacet
facet
vertex 0 0 0
vertex 0 50 0
vertex 0 0 50
endfacet
endsolid"""


def study_with(scene, **keys):
    return Study(**KEYS | keys | {"scene": scene})


def test_without_a_scene_there_is_no_cell() -> None:
    """A study that says nothing of a cell has none, and no home."""
    study = Study(**KEYS)
    assert study.cell is None
    assert study.home is None


def test_a_cell_has_the_robot_the_tool_and_what_is_named() -> None:
    """Shapes are in metres where their keys place them; parts of one name are one body."""
    study = study_with(
        {
            "margin_mm": 25,
            "box": [TABLE],
            "cylinder": [
                {
                    "name": "post",
                    "radius_mm": 100,
                    "height_mm": 2000,
                    "position_mm": [0, 1800, 1000],
                },
                {"name": "post", "radius_mm": 200, "height_mm": 100, "position_mm": [0, 1800, 50]},
            ],
            "plane": [{"name": "wall", "normal": [2, 0, 0], "position_mm": [-2500, 0, 0]}],
            "home_deg": [0, -90, 90, 0, 0, 0],
        }
    )
    cell = study.cell
    assert cell is not None
    assert cell.margin == 0.025
    bodies = {body.name: body for body in cell.bodies}
    assert [body.source for body in cell.bodies].count("default") == 8
    (tool,) = bodies["tool"].shapes
    assert isinstance(tool, Capsule)
    assert np.allclose(tool.end, [0.4, 0, -0.3])
    (box,) = bodies["table"].shapes
    assert isinstance(box, Box)
    assert box.half == pytest.approx([0.3, 0.4, 0.35])
    assert box.pose[:3, 3] == pytest.approx([2.2, 0, 0.35])
    assert [type(shape) for shape in bodies["post"].shapes] == [Cylinder, Cylinder]
    (wall,) = bodies["wall"].shapes
    assert isinstance(wall, Plane)
    assert wall.normal.tolist() == [1, 0, 0]
    assert wall.offset == -2.5
    assert study.home == pytest.approx(np.deg2rad([0, -90, 90, 0, 0, 0]))
    assert cell.free(study.home)
    assert not cell.free(np.deg2rad([0, -20, 50, 0, 0, 0]))


def test_pairs_of_one_joint_are_not_looked_at() -> None:
    """Neighbours of the arm are left out; what stands is looked at with the first joint's body."""
    cell = study_with({"box": [TABLE]}).cell
    assert cell is not None
    pairs = {frozenset(pair) for pair in cell.pairs}
    assert frozenset(("carousel", "table")) in pairs
    assert frozenset(("upper arm", "forearm")) not in pairs or "elbow" in str(pairs)
    for pair in (("base", "carousel"), ("forearm", "wrist"), ("wrist", "tool"), ("base", "table")):
        assert frozenset(pair) not in pairs
    less = study_with({"box": [TABLE], "ignore": [["table", "forearm"]]}).cell
    assert less is not None
    assert pairs - {frozenset(pair) for pair in less.pairs} == {frozenset(("table", "forearm"))}


@pytest.mark.slow
def test_a_weight_hangs_down_in_every_pose() -> None:
    """The weight is below the tool point by its rope, however the flange is turned."""
    hanging = {"rope_mm": 400, "radius_mm": 100, "height_mm": 200, "swing_deg": 0}
    study = study_with({"hanging": hanging, "plane": [{"name": "floor"}], "margin_mm": 0})
    cell = study.cell
    assert cell is not None
    index = [set(pair) for pair in cell.pairs].index({"floor", "load"})
    q = np.deg2rad([[0, -60, 60, 10, 20, 30], [20, -90, 40, 100, -50, 0]])
    height = study.robot.forward(q)[:, 2, 3]
    found = cell.distances(q)[:, index]
    assert np.all(found <= height - 0.6 + 1e-9)
    assert np.all(found > height - 0.6 - 0.08)


@pytest.mark.slow
def test_the_bodies_of_a_urdf_are_held_by_capsules(tmp_path) -> None:
    """Collision shapes count, or else visual ones; links behind a fixed joint do too."""
    (tmp_path / "arm.urdf").write_text(URDF)
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "hand.stl").write_text(HAND)
    study = Study(
        robot="arm.urdf",
        folder=tmp_path,
        tool={"position_mm": [0, 0, 0]},
        load={"F_N": [0, 0, -10]},
        measurement={"sigma_mm": 0.1},
        joints={"unknown": ["b"]},
        scene={"margin_mm": 0},
    )
    cell = study.cell
    assert cell is not None
    assert [(body.name, body.carrier) for body in cell.bodies] == [
        ("foot", None),
        ("one", 0),
        ("two", 1),
        ("tip", 1),
    ]
    foot, one, two, tip = cell.bodies
    assert isinstance(foot.shapes[0], Box)
    ends = np.array([[shape.start, shape.end] for shape in one.capsules])
    assert ends[:, :, 2].min() < 0.1
    assert ends[:, :, 2].max() > 0.9
    assert two.capsules[0].radius == 0.1
    assert np.allclose(tip.meshes[0].vertices.max(axis=0), [0.25, 0.05, 0.05])


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        (
            {"box": [TABLE | {"position_mm": [0, 0, 600]}]},
            r"'table' and 'carousel'|'carousel' and 'table' touch in each of \d+ poses",
        ),
        ({"box": [TABLE | {"name": "base"}]}, "a part of the robot has the name 'base'"),
        ({"box": [TABLE | {"joint": "q9"}]}, r"scene\.box\.0\.joint: no joint 'q9'"),
        ({"box": [TABLE, TABLE | {"joint": "q3"}]}, "'table': is moved by two joints"),
        ({"box": [TABLE | {"size_mm": [1, 0, 1]}]}, "expected at least 0.1"),
        ({"box": [TABLE | {"size_mm": [1]}]}, r"size_mm: has 1 entry; expected 3; it is"),
        ({"plane": [{"name": "floor", "normal": [0, 0, 0]}]}, "expected a direction"),
        ({"ignore": [["base", "base"]]}, r"scene\.ignore\.0: 'base' is named twice; expected two"),
        ({"ignore": [["table", "base"]]}, r"scene\.ignore\.0: no body 'table'; the cell has base"),
        ({"mesh": [{"name": "part", "file": "none.stl"}]}, r"scene\.mesh\.0: none\.stl: no such"),
        ({"home_deg": [0, 0]}, "home_deg: has 2 entries, expected 6"),
        ({"home_deg": [0, 10, 0, 0, 0, 0]}, "q2 = 10 is outside its limits -146 .. 0"),
        (
            {"hanging": {"rope_mm": 100, "radius_mm": 10, "height_mm": 5, "swing_deg": 90}},
            "less than",
        ),
    ],
)
def test_what_is_wrong_with_a_scene_is_one_line(scene, said) -> None:
    """The line names the key, what is wrong, and what was expected."""
    with pytest.raises(UserError, match=said) as caught:
        assert study_with(scene).cell
    assert "\n" not in str(caught.value)


def test_a_robot_without_bodies_is_refused_unless_it_is_left_out() -> None:
    """Nothing is said to be free of a robot that nobody described; `bodies = false` says so."""
    table = {
        "name": "arm",
        "source": "test",
        "joints": [
            {"name": "a", "origin_m": [0, 0, 1], "axis": [0, 1, 0], "limits_deg": [-90, 90]},
            {"name": "b", "origin_m": [1, 0, 0], "axis": [0, 1, 0], "limits_deg": [-90, 90]},
        ],
    }
    keys = {"robot": table, "joints": {"unknown": ["a", "b"]}}
    with pytest.raises(UserError, match="the robot has no bodies; expected"):
        assert study_with({}, **keys).cell
    cell = study_with({"bodies": False, "plane": [{"name": "floor"}]}, **keys).cell
    assert cell is not None
    assert [body.name for body in cell.bodies] == ["floor"]
    body = {"name": "rod", "joint": "a", "from_mm": [0, 0, 0], "to_mm": [1000, 0, 0]}
    typed = table | {"body": [body | {"radius_mm": 50}]}
    cell = study_with({}, **keys | {"robot": typed}).cell
    assert cell is not None
    assert [(body.name, body.source) for body in cell.bodies] == [
        ("rod", "typed"),
        ("tool", "default"),
    ]
    wrong = table | {"body": [body | {"radius_mm": 50, "joint": "c"}]}
    with pytest.raises(UserError, match=r"body\.0\.joint: no joint 'c'"):
        assert study_with({}, **keys | {"robot": wrong}).cell


def test_an_open_mesh_is_told_and_its_file_moves_with_the_study(tmp_path) -> None:
    """A line says that the inside of an open surface does not count; paths stay right."""
    (tmp_path / "part.stl").write_text(HAND)
    mesh = {"name": "part", "file": "part.stl", "position_mm": [2500, 0, 0], "unit": "mm"}
    study = study_with({"mesh": [mesh]}, folder=tmp_path)
    with pytest.warns(Note, match=r"scene\.mesh\.0: part\.stl is open at \d edges"):
        cell = study.cell
    assert cell is not None
    other = tmp_path / "other"
    other.mkdir()
    study.to_toml(other / "study.toml")
    again = load_study(other / "study.toml")
    assert again.specification.scene is not None
    assert again.specification.scene.mesh[0].file == "../part.stl"
    assert (tmp_path / "part.stl").resolve() in [path.resolve() for path in again.reads]


def test_a_study_with_other_keys_keeps_its_cell() -> None:
    """Cells are built once for all forms of a study whose robot, tool and scene are the same."""
    study = study_with({"box": [TABLE]})
    cell = study.cell
    assert study.replace(seed=3).cell is cell
    assert study.excluding(None).cell is cell
    assert study.replace(tool={"position_mm": [0, 0, 100]}).cell is not study.cell
