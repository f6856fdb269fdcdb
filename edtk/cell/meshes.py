"""Meshes from files: STL, binary or text, OBJ and COLLADA; each fault is one line.

COLLADA (.dae) is read as ROS and pinocchio read it: the surfaces of its scene, placed by its nodes;
the file's unit counts, its up axis does not. Source: COLLADA 1.4.1 specification, chapters 4 and 5.
"""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from edtk.cell.shapes import Mesh
from edtk.robots.rotations import rotation
from edtk.system.errors import UserError
from edtk.system.files import decode, read_bytes
from edtk.system.parsing import Element, parse_xml
from edtk.system.typing import Array, Indices

MOST_MB = 60.0  # of a file: a million triangles
MOST_TRIANGLES = 1_000_000
MOST_CORNERS = 10_000  # of a face
HEADER, COUNT, RECORD = 80, 4, 50  # bytes of a binary STL: header, number of triangles, a triangle
SMALLEST, LARGEST = 1e-3, 200.0  # [m] that a part of a cell may measure
FORMATS = (".stl", ".obj", ".dae")

Unit = Literal["mm", "m", "inch"]
METRES: dict[Unit, float] = {"mm": 1e-3, "m": 1.0, "inch": 0.0254}

STATED = {b"MM": "mm", b"IN": "inch", b"INCH": "inch", b"INCHES": "inch", b"M": "m"}
STATES = re.compile(rb"UNITS?\s*=\s*(MM|INCHES|INCH|IN|M)\b", re.IGNORECASE)
CORNER = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
MOST_NODES = 10_000  # of a scene: a node that stands in many others multiplies them
# Of a count, a stride or an index in a file: far above what a million triangles need, and the same
# number as a float and as an integer of the machine.
LARGEST_WHOLE = 2**31
SURFACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def read_mesh(
    path: Path, unit: Unit = "mm", name: str | None = None, largest: float = LARGEST
) -> Mesh:
    """Read the triangles of a file.

    Args:
        path: A file that ends in .stl, .obj or .dae.
        unit: What one stands for in the file, if it does not say, as a .dae does.
        name: How messages name the file; defaults to its path.
        largest: What it may measure at most [m].

    Returns:
        The mesh, in metres, without triangles that are points.

    Raises:
        UserError: The file cannot be read, is too large, is cut off or no mesh, or its size shows
            that the unit is another one.
    """
    where = name or str(path)
    kind = path.suffix.lower()
    if kind not in FORMATS:
        message = f"ends in {kind or 'nothing'!r}; expected a mesh: {', '.join(FORMATS)}"
        raise UserError(message, where=where)
    try:
        content = read_bytes(path, MOST_MB)
    except UserError as error:
        raise UserError(error.message, where=where) from error
    try:
        corners = _corners(kind, content, path, unit)
    except ValueError as error:
        message = error.message if isinstance(error, UserError) else str(error)
        raise UserError(message, where=where) from error
    return _mesh(corners, "its own" if kind == ".dae" else unit, where, largest)


def open_edges(mesh: Mesh) -> int:
    """The number of edges that do not have two triangles; 0 of a surface that is closed."""
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    key = edges[:, 0] * len(mesh.vertices) + edges[:, 1]
    _, counts = np.unique(key, return_counts=True)
    return int((counts != 2).sum())


def _corners(kind: str, content: bytes, path: Path, unit: Unit) -> Array:
    """Corners (f, 3, 3) of a file's triangles [m]."""
    if kind == ".stl":
        return METRES[unit] * _stl(content, unit)
    text = decode(content, path)
    if kind == ".obj":
        return METRES[unit] * _obj(text)
    corners = collada_corners(text, MOST_TRIANGLES)
    _require_number(len(corners))
    return corners


def _mesh(corners: Array, unit: str, where: str, largest: float) -> Mesh:
    """The mesh of corners (f, 3, 3) [m], of a size that a part of a cell may have."""
    points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    whole = np.all(faces != np.roll(faces, 1, axis=1), axis=1)
    if not whole.any():
        raise UserError("has no triangle of any size; expected a mesh", where=where)
    size = float((points.max(axis=0) - points.min(axis=0)).max())
    if not SMALLEST <= size <= largest:
        message = (
            f"is {size:.3g} m across with {unit} as its unit; expected {SMALLEST:g} to "
            f"{largest:g} m: is it in another unit of {', '.join(METRES)}?"
        )
        raise UserError(message, where=where)
    return Mesh(points, faces[whole])


def _stl(content: bytes, unit: Unit) -> Array:
    """Corners (f, 3, 3) of an STL file in its own unit.

    A binary one may begin with "solid" as one of text does, so its length decides. What has no zero
    byte is text, whatever number of triangles its letters would say.
    """
    start = HEADER + COUNT
    count = int.from_bytes(content[HEADER:start], "little") if len(content) >= start else -1
    is_text = content.lstrip()[:5].lower() == b"solid" and CORNER.search(content) is not None
    may_be_cut = count > 0 and not is_text and b"\0" in content
    if len(content) == start + RECORD * count or may_be_cut:
        return _binary_stl(content, count, unit)
    if not is_text:
        raise ValueError("is no STL file: neither text with vertices nor binary with triangles")
    corners = CORNER.findall(content)
    if len(corners) % 3:
        raise ValueError(f"has {len(corners)} vertices; expected three for each triangle")
    _require_number(len(corners) // 3)
    try:
        found = np.array(corners, dtype=float).reshape(-1, 3, 3)
    except ValueError:
        raise ValueError("has a vertex that is not three numbers") from None
    return _finite(found)


def _binary_stl(content: bytes, count: int, unit: Unit) -> Array:
    """Corners (f, 3, 3) of a binary STL file."""
    start = HEADER + COUNT
    _require_number(count)
    missing = start + RECORD * count - len(content)
    if missing > 0 or missing <= -RECORD:  # a few bytes more are some exporter's
        what = "cut off" if missing > 0 else "more than it says"
        message = f"is {what}: {count:,} triangles take {start + RECORD * count:,} bytes"
        raise ValueError(f"{message}, and it has {len(content):,}")
    said = STATES.search(content[:HEADER])
    if said is not None and STATED[said[1].upper()] != unit:
        stated = STATED[said[1].upper()]
        raise ValueError(f'its header says that it is in {stated}; expected unit = "{stated}"')
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    found = np.frombuffer(content, record, count, start)["corners"]
    return _finite(found.astype(float))


def _obj(text: str) -> Array:
    """Corners (f, 3, 3) of an OBJ file; faces of more corners are fans of triangles."""
    points: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split(maxsplit=MOST_CORNERS + 1)
        if words[:1] == ["f"] and len(words) > MOST_CORNERS + 1:
            raise ValueError(f"line {number} is a face of more than {MOST_CORNERS:,} corners")
        try:
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                faces += _fan([_place(word, len(points)) for word in words[1:]])
        except (ValueError, IndexError):
            what = "vertex" if words[0] == "v" else "face"
            raise ValueError(f"line {number} is no {what}: {line[:60]!r}") from None
        # Looked at after each line, as each of them is many times as large in memory as on disk.
        _require_number(max(len(faces), 1))
        if len(points) > 3 * MOST_TRIANGLES:
            raise ValueError(f"has more than {3 * MOST_TRIANGLES:,} vertices; expected fewer")
    _require_number(len(faces))
    if any(len(point) != 3 for point in points):
        raise ValueError("has a vertex that is not three numbers")
    return _finite(np.array(points).reshape(-1, 3)[np.array(faces, dtype=int)])


def _place(word: str, count: int) -> int:
    """The index of a face's corner, which OBJ counts from one, or backwards from the last."""
    given = int(word.split("/")[0])
    index = given - 1 if given > 0 else count + given
    if not 0 <= index < count or not given:
        raise IndexError
    return index


def _fan(corners: Sequence[int]) -> list[tuple[int, int, int]]:
    """Triangles about the first corner."""
    if len(corners) < 3:
        raise ValueError
    return [(corners[0], *pair) for pair in pairwise(corners[1:])]


def _require_number(triangles: int) -> None:
    if not 0 < triangles <= MOST_TRIANGLES:
        message = f"has {triangles:,} triangles; expected 1 to {MOST_TRIANGLES:,}"
        raise ValueError(message if not triangles else f"{message}: let CAD export a coarser mesh")


def _finite(corners: Array) -> Array:
    if not np.isfinite(corners).all():
        raise ValueError("has a vertex that is not a finite number")
    return corners


def collada_corners(text: str, most: int) -> Array:
    """Corners (f, 3, 3) of the triangles of a COLLADA file [m].

    Args:
        text: The file.
        most: No more surfaces are placed once there are more triangles than this.

    Raises:
        ValueError: The file is no COLLADA, or has a part that is not read; says which.
    """
    root = parse_xml(text)
    if root.tag != "COLLADA":
        raise ValueError(f"its first element is <{root.tag}>; expected <COLLADA>")
    file = _Collada(root)
    placed: list[Array] = [np.zeros((0, 3, 3))]
    count = 0
    for geometry, T in file.placed_geometries():
        corners = file.corners(geometry) @ T[:3, :3].T + T[:3, 3]
        placed.append(corners)
        count += len(corners)
        if count > most:
            break
    return np.asarray(file.metres * np.concatenate(placed))


class _Collada:
    """The elements of a file, each with an `id` by it."""

    def __init__(self, root: Element) -> None:
        self.root = root
        self.named = {
            element.attributes["id"]: element
            for element in root.everything()
            if "id" in element.attributes
        }
        self.metres = self._unit()
        self.read: dict[int, Array] = {}

    def _unit(self) -> float:
        asset = self.root.first("asset")
        unit = None if asset is None else asset.first("unit")
        if unit is None or "meter" not in unit.attributes:
            return 1.0
        return float(_numbers(unit.attributes["meter"], unit, 1)[0])

    def placed_geometries(self) -> Iterator[tuple[Element, Array]]:
        """Each geometry of the scene with its transform; without a scene, all as they are."""
        scene = self._scene()
        if scene is None:
            for library in self.root.all("library_geometries"):
                yield from ((geometry, np.eye(4)) for geometry in library.all("geometry"))
            return
        waiting: list[tuple[tuple[Element, ...], Array]]
        waiting = [((node,), np.eye(4)) for node in scene.all("node")]
        count = 0
        while waiting:
            count += 1
            if count > MOST_NODES:
                raise ValueError(f"its scene has more than {MOST_NODES:,} nodes")
            path, above = waiting.pop()
            node = path[-1]
            if node.first("instance_controller") is not None:
                raise ValueError("has a skin (<instance_controller>); expected surfaces that stand")
            T = above @ _transform(node)
            for used in node.all("instance_geometry"):
                yield self._target(used, "url", "geometry"), T
            elsewhere = [self._target(used, "url", "node") for used in node.all("instance_node")]
            for child in node.all("node") + elsewhere:
                if any(child is passed for passed in path):
                    raise ValueError(f"line {child.line}: the <node> stands in itself")
                waiting.append(((*path, child), T))

    def _scene(self) -> Element | None:
        """The scene that the file shows, else its first one."""
        shown = self.root.first("scene")
        used = None if shown is None else shown.first("instance_visual_scene")
        if used is not None:
            return self._target(used, "url", "visual_scene")
        library = self.root.first("library_visual_scenes")
        return None if library is None else library.first("visual_scene")

    def _target(self, element: Element, key: str, tag: str) -> Element:
        """The element of a tag that another one names."""
        name = element.attributes.get(key, "")
        found = self.named.get(name.removeprefix("#"))
        if found is None or found.tag != tag:
            where = f"line {element.line}: <{element.tag}>"
            raise ValueError(f"{where} names {name!r}; expected a <{tag}> of this file")
        return found

    def corners(self, geometry: Element) -> Array:
        """Corners (f, 3, 3) of a geometry in its own frame and unit."""
        key = id(geometry)
        if key not in self.read:
            mesh = geometry.first("mesh")
            if mesh is None:
                raise ValueError(f"line {geometry.line}: the <geometry> has no <mesh>")
            surfaces = [part for part in mesh.children if part.tag in SURFACES]
            parts = [np.zeros((0, 3, 3)), *map(self._surface, surfaces)]
            self.read[key] = np.concatenate(parts)
        return self.read[key]

    def _surface(self, surface: Element) -> Array:
        """Corners (f, 3, 3) of one set of polygons, strips or fans."""
        inputs = surface.all("input")
        offsets = [_attribute(used, "offset") for used in inputs]
        semantics = [used.attributes.get("semantic") for used in inputs]
        if "VERTEX" not in semantics:
            raise ValueError(f"line {surface.line}: <{surface.tag}> has no input VERTEX")
        place = semantics.index("VERTEX")
        points = self._positions(inputs[place])
        step = max(offsets) + 1
        faces = []
        for run in surface.all("p"):
            index = _whole(run.text, run)
            if len(index) % step:
                message = f"line {run.line}: <p> has {len(index)} numbers; expected a multiple"
                raise ValueError(f"{message} of {step}")
            corners = index.reshape(-1, step)[:, offsets[place]]
            faces.append(_triangles(surface, corners))
        found = np.concatenate([np.zeros((0, 3), dtype=int), *faces])
        if (found >= len(points)).any():
            raise ValueError(f"line {surface.line}: <{surface.tag}> has a corner without a vertex")
        return np.asarray(points[found])

    def _positions(self, used: Element) -> Array:
        """Points (v, 3) of an input VERTEX."""
        vertices = self._target(used, "source", "vertices")
        inputs = {given.attributes.get("semantic"): given for given in vertices.all("input")}
        if "POSITION" not in inputs:
            raise ValueError(f"line {vertices.line}: <vertices> has no input POSITION")
        source = self._target(inputs["POSITION"], "source", "source")
        common = source.first("technique_common")
        accessor = None if common is None else common.first("accessor")
        if accessor is None:
            raise ValueError(f"line {source.line}: <source> has no accessor")
        array = self._target(accessor, "source", "float_array")
        values = _numbers(array.text, array)
        count = _attribute(accessor, "count")
        stride = _attribute(accessor, "stride", "1")
        offset = _attribute(accessor, "offset", "0")
        if stride < 3 or len(values) < offset + stride * count:
            raise ValueError(f"line {accessor.line}: <accessor> asks for other numbers than it has")
        return values[offset : offset + stride * count].reshape(count, stride)[:, :3]


def _triangles(surface: Element, corners: Indices) -> Indices:
    """Triangles (f, 3) of the corners of one <p>; polygons are fans about their first corner."""
    tag = surface.tag
    n = len(corners)
    if tag == "triangles":
        if n % 3:
            raise ValueError(f"line {surface.line}: <triangles> has {n} corners; expected threes")
        return corners.reshape(-1, 3)
    if tag == "tristrips":
        strip = np.arange(max(n - 2, 0))[:, None] + np.arange(3)
        return np.asarray(corners[strip])
    counts = np.array([n])
    if tag == "polylist":
        given = surface.first("vcount")
        counts = np.zeros(0, dtype=int) if given is None else _whole(given.text, given)
    if (counts < 3).any() or counts.sum() != n:
        raise ValueError(f"line {surface.line}: <{tag}> has {n} corners in polygons that differ")
    first = np.repeat(np.cumsum(counts) - counts, counts - 2)
    begins = np.cumsum(counts - 2) - (counts - 2)
    within = np.arange(len(first)) - np.repeat(begins, counts - 2)
    return np.asarray(corners[np.column_stack([first, first + within + 1, first + within + 2])])


def _transform(node: Element) -> Array:
    """The product (4, 4) of a node's transforms, in their order."""
    T = np.eye(4)
    for element in node.children:
        step = np.eye(4)
        if element.tag == "matrix":
            step = _numbers(element.text, element, 16).reshape(4, 4)
        elif element.tag == "translate":
            step[:3, 3] = _numbers(element.text, element, 3)
        elif element.tag == "scale":
            step[:3, :3] = np.diag(_numbers(element.text, element, 3))
        elif element.tag == "rotate":
            *axis, angle_deg = _numbers(element.text, element, 4)
            size = np.linalg.norm(axis)
            step[:3, :3] = rotation(np.array(axis) * (np.deg2rad(angle_deg) / (size or 1.0)))
        elif element.tag in ("skew", "lookat"):
            raise ValueError(f"line {element.line}: <{element.tag}> is no transform of a part")
        T = T @ step
    return T


def _numbers(text: str, element: Element, count: int | None = None) -> Array:
    """The finite numbers of a text that an element holds."""
    try:
        found = np.array(text.split(), dtype=float)
    except ValueError:
        found = np.full(1, np.nan)
    if not np.isfinite(found).all() or count not in (None, len(found)):
        number = "numbers" if count is None else f"{count} finite number" + "s" * (count > 1)
        raise ValueError(
            f"line {element.line}: <{element.tag}> has {text[:40]!r}; expected {number}"
        )
    return found


def _attribute(element: Element, key: str, default: str = "") -> int:
    """The whole number of an attribute."""
    return int(_whole(element.attributes.get(key, default), element, 1)[0])


def _whole(text: str, element: Element, count: int | None = None) -> Indices:
    """The whole numbers of a text, none of them negative."""
    found = _numbers(text, element, count)
    if ((found != np.round(found)) | (found < 0) | (found > LARGEST_WHOLE)).any():
        raise ValueError(f"line {element.line}: <{element.tag}> has other than whole numbers")
    return found.astype(int)
