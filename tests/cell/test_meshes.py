"""Meshes are read from files of all kinds, and what is wrong with one is a line."""

import tracemalloc

import numpy as np
import pytest

from edtk.cell.meshes import open_edges, read_mesh
from edtk.cell.robot_bodies import urdf_bodies
from edtk.system.errors import UserError

CORNERS = np.array([[0, 0, 0], [100, 0, 0], [0, 50, 0], [0, 0, 25]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def binary(triangles, header=b"", count=None):
    record = np.zeros(
        len(triangles), np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("m", "<u2")])
    )
    record["c"] = triangles
    number = len(triangles) if count is None else count
    return header.ljust(80) + number.to_bytes(4, "little") + record.tobytes()


def text(triangles):
    lines = ["solid part"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"  vertex {x:g} {y:g} {z:g}" for x, y, z in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid"]).encode()


def obj(triangles):
    points = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in CORNERS)
    return (points + "".join(f"f {a + 1}/1 {b + 1}//2 {c - 4}\n" for a, b, c in FACES)).encode()


@pytest.mark.parametrize(
    ("write", "end"), [(binary, ".stl"), (text, ".STL"), (obj, ".obj")], ids=["bin", "text", "obj"]
)
def test_a_mesh_is_the_same_from_each_format(write, end, tmp_path) -> None:
    """Four triangles of four corners, in metres, closed."""
    path = tmp_path / f"part{end}"
    path.write_bytes(write(CORNERS[FACES]))
    mesh = read_mesh(path)
    assert np.allclose(
        np.sort(mesh.vertices[mesh.faces], axis=1), np.sort(CORNERS[FACES] / 1e3, axis=1)
    )
    assert len(mesh.vertices) == 4
    assert open_edges(mesh) == 0
    assert np.allclose(read_mesh(path, "inch").vertices, 25.4 * mesh.vertices)


def test_a_binary_file_may_begin_with_solid(tmp_path) -> None:
    """The length of a file says that it is binary, whatever its header is."""
    path = tmp_path / "part.stl"
    path.write_bytes(binary(CORNERS[FACES], b"solid by some CAD"))
    assert len(read_mesh(path).faces) == 4


def test_a_surface_with_a_hole_has_open_edges(tmp_path) -> None:
    """Without one triangle three edges have one triangle only."""
    path = tmp_path / "part.stl"
    path.write_bytes(binary(CORNERS[FACES[:3]]))
    assert open_edges(read_mesh(path)) == 3


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (binary(CORNERS[FACES])[:-7], "is cut off: 4 triangles take 284 bytes, and it has 277"),
        (binary(CORNERS[FACES], count=3), "is more than it says: 3 triangles take 234 bytes"),
        (binary(CORNERS[FACES][:0]), "has 0 triangles"),
        (binary(CORNERS[FACES], count=3_000_000), "has 3,000,000 triangles"),
        (binary(CORNERS[FACES], b"UNITS=inch"), 'expected unit = "inch"'),
        (binary(np.nan * CORNERS[FACES]), "not a finite number"),
        (binary(0 * CORNERS[FACES]), "no triangle of any size"),
        (binary(1e5 * CORNERS[FACES]), "is 1e+04 m across with mm as its unit"),
        (binary(1e-3 * CORNERS[FACES]), "is it in another unit"),
        (b"no mesh at all", "is no STL file"),
        (text(CORNERS[FACES]).replace(b"vertex", b"vertx"), "is no STL file"),
        (b"<html>" + 100 * b" not found ", "is no STL file"),
        (text(CORNERS[FACES]).replace(b"vertex 0 50 0", b"vertex 0 fifty 0"), "not three numbers"),
        (text(CORNERS[FACES]).replace(b"vertex 0 50 0", b"", 1), "has 11 vertices"),
        (b"", "is no STL file"),
    ],
)
def test_a_file_that_is_no_mesh_is_one_line(content: bytes, said: str, tmp_path) -> None:
    """The line names the file, what is wrong and what was expected."""
    path = tmp_path / "part.stl"
    path.write_bytes(content)
    with pytest.raises(UserError) as caught:
        read_mesh(path, name="part.stl")
    assert said in str(caught.value)
    assert str(caught.value).startswith("part.stl: ")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("part.step", "", "expected a mesh: .stl, .obj, .dae"),
        ("part.obj", "v 1 2\nf 1 1 1", "not three numbers"),
        ("part.obj", "v 1 2 3\nf 1 2 3", "line 2 is no face"),
        ("part.obj", "v 1 2 x", "line 1 is no vertex"),
        ("part.obj", "v 1 2 3\nf 0 0 0", "line 2 is no face"),
        ("none.stl", None, "no such file"),
    ],
)
def test_other_files_are_refused(name: str, content: str | None, said: str, tmp_path) -> None:
    """A format that is not read, a wrong line, and a file that is not there are one line each."""
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=said):
        read_mesh(tmp_path / name)


def test_a_huge_file_is_refused_before_it_is_read(tmp_path, monkeypatch) -> None:
    """The limit is said."""
    monkeypatch.setattr("edtk.cell.meshes.MOST_MB", 1e-4)
    path = tmp_path / "part.stl"
    path.write_bytes(binary(CORNERS[FACES]))
    with pytest.raises(UserError, match=r"larger than 0\.0001 MB"):
        read_mesh(path)


@pytest.mark.parametrize(
    "body", ["f " + "1 2 3 " * 50_000, "f 1 2 3\n" * 20_000, "v 0 0 0\n" * 50_000]
)
def test_a_file_of_many_faces_is_refused_as_soon_as_they_are_too_many(
    body: str, tmp_path, monkeypatch
) -> None:
    """Not when all of them are in memory, where each is many times as large as on disk."""
    monkeypatch.setattr("edtk.cell.meshes.MOST_TRIANGLES", 1000)
    path = tmp_path / "part.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{body}\n")
    tracemalloc.start()
    with pytest.raises(
        UserError, match=r"has 1,00\d triangles|more than (10,000 corners|3,000 vertices)"
    ):
        read_mesh(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 15 * len(body)


@pytest.mark.parametrize("corner", ["{0}", "{0}/1", "{0}//1"])
def test_a_face_has_all_of_its_corners_or_is_refused(corner: str, tmp_path, monkeypatch) -> None:
    """The last corner is one of them, and a longer face is never cut off."""
    monkeypatch.setattr("edtk.cell.meshes.MOST_CORNERS", 8)
    path = tmp_path / "part.obj"
    for count in (8, 9):
        angles = 2 * np.pi * np.arange(count) / count
        points = [f"v {np.cos(a)} {np.sin(a)} 0" for a in angles]
        face = "f " + " ".join(corner.format(i + 1) for i in range(count))
        path.write_text("\n".join([*points, "# " + "word " * 20, face]))
        if count == 8:
            assert len(read_mesh(path).faces) == 6
    with pytest.raises(UserError, match=r"line 11 is a face of more than 8 corners"):
        read_mesh(path)


def test_a_robot_that_names_a_mesh_many_times_is_refused(tmp_path, monkeypatch) -> None:
    """Thirty kilobytes that name one mesh 300 times took a minute, and 10 GB."""
    monkeypatch.setattr("edtk.cell.robot_bodies.MOST_OF_ROBOT", 40)
    (tmp_path / "part.stl").write_bytes(binary(1e-3 * CORNERS[FACES]))
    body = '<collision><geometry><mesh filename="part.stl"/></geometry></collision>'
    joint = '<joint name="q1" type="revolute"><parent link="a"/><child link="b"/></joint>'
    path = tmp_path / "arm.urdf"
    for number in (10, 11):
        path.write_text(
            f'<robot name="r"><link name="a">{body * number}</link><link name="b"/>{joint}</robot>'
        )
        if number == 10:
            assert len(urdf_bodies(path)) == 1
    with pytest.raises(UserError, match=r"link a: with mesh part\.stl the robot has 44 triangles"):
        urdf_bodies(path)
