"""Meshes from files: STL, binary or text, OBJ and COLLADA; each fault is one line."""

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from edtk.cell.collada import collada_corners
from edtk.cell.shapes import Mesh
from edtk.system.errors import UserError
from edtk.system.files import decode, read_bytes
from edtk.system.typing import Array

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
