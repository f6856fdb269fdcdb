"""The bodies of a robot: of its URDF, typed in its file, or the defaults of a built-in one; and
the load that hangs and swings below it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from edtk.cell.containing import containing
from edtk.cell.meshes import read_mesh
from edtk.cell.shapes import Body, Box, Capsule, Cylinder, Mesh, Shape, Source
from edtk.robots.frames import MILLIMETRE
from edtk.robots.load_robot import TOML, URDF, robot_content
from edtk.robots.robot import Robot
from edtk.robots.robot_file import BodyTable, RobotFile, RobotFileError, told_at
from edtk.robots.rotations import transform
from edtk.robots.urdf.chain import links_at_rest, links_below
from edtk.robots.urdf.load_urdf import XACRO, chain_of
from edtk.robots.urdf.parse_urdf import Urdf
from edtk.system.parsing import Element
from edtk.system.typing import Array

ARC = 8  # points of the arc on which the weight's lower rim swings
CAPSULES_OF_WEIGHT = 4  # capsules that hold all places of the weight
TIGHT_SWING = 0.01  # [m], see `containing`
SIDES = 24  # of the prism around a cylinder that capsules are to hold
PACKAGE, FILE = "package://", "file://"
MOST_FITTED = 64  # meshes whose capsules are kept, of the files that were read last
MOST_OF_ROBOT = 2_000_000  # triangles: a file of a few lines may name a mesh any number of times
LARGEST_PART = 20.0  # [m]; a larger part of an arm is in millimetres


def robot_bodies(
    robot: Robot,
    name: str,
    folder: Path | None = None,
    *,
    base: str | None = None,
    tip: str | None = None,
) -> tuple[Body, ...]:
    """The bodies of a robot that is built in or has a file.

    Args:
        robot: The robot.
        name: Its name, or the path of its file.
        folder: The folder to which a relative path is relative; defaults to the current one.
        base: Link of a URDF that stands in the world.
        tip: Link of a URDF that carries the tool.

    Returns:
        The bodies; none where a file in TOML has no `[[body]]`.

    Raises:
        RobotFileError: The file, a shape or a mesh cannot be read.
    """
    if name.endswith((URDF, XACRO)):
        return urdf_bodies((folder or Path()) / name, base, tip, name)
    tables = RobotFile.model_validate(robot_content(name, folder)).body
    source: Source = "typed" if name.endswith(TOML) else "default"
    return typed_bodies(robot, tables, source, f"robot {name}")


def typed_bodies(
    robot: Robot, tables: Sequence[BodyTable], source: Source = "typed", where: str | None = None
) -> tuple[Body, ...]:
    """The bodies of `[[body]]`: capsules of one name are one body.

    Raises:
        RobotFileError: A joint does not exist, or one body is on two joints.
    """
    for i, table in enumerate(tables):
        if table.joint is not None and table.joint not in robot.body_names:
            names = ", ".join(robot.body_names)
            message = f"no joint {table.joint!r}; this robot has {names}"
            raise RobotFileError(message, where=where, key=f"body.{i}.joint")
    capsules = [
        (
            table.name,
            None if table.joint is None else robot.body_names.index(table.joint),
            Capsule(
                MILLIMETRE * np.array(table.from_mm),
                MILLIMETRE * np.array(table.to_mm),
                MILLIMETRE * table.radius_mm,
            ),
        )
        for table in tables
    ]
    with told_at(where, "body"):
        found = merged(
            Body(name, carrier, (capsule,), source) for name, carrier, capsule in capsules
        )
    return tuple(body if body.carrier is not None else body.moved(robot.base) for body in found)


def merged(bodies: Iterable[Body]) -> tuple[Body, ...]:
    """Bodies of one name as one.

    Raises:
        ValueError: Two of one name are moved by different joints, or one of them hangs from a
            point alone.
    """
    found: dict[str, Body] = {}
    for body in bodies:
        first = found.setdefault(body.name, body)
        if first is body:
            continue
        if first.carrier != body.carrier:
            message = "is moved by two joints; expected one joint, or two names"
            raise ValueError(f"body {body.name!r}: {message}")
        if first.hangs_at is not body.hangs_at:
            message = "hangs, and a part that its joint turns has this name; expected two names"
            raise ValueError(f"body {body.name!r}: {message}")
        shapes = (*first.shapes, *body.shapes)
        meshes = (*first.meshes, *body.meshes)
        found[body.name] = replace(first, shapes=shapes, meshes=meshes)
    return tuple(found.values())


def default_tool(robot: Robot, radius: float) -> Body | None:
    """A capsule from the flange to the tool point; None where the one is the other."""
    ends: tuple[Array, Array] = (robot.flange[:3, 3], robot.tool[:3, 3])
    if np.allclose(*ends):
        return None
    return Body("tool", len(robot.chain) - 1, (Capsule(*ends, radius),), "default")


def hanging_bodies(
    name: str,
    carrier: int,
    point: Array,
    *,
    rope: float,
    radius: float,
    height: float,
    swing: float,
    rope_radius: float,
) -> tuple[Body, ...]:
    """The weight, and its rope, in all places to which they swing about the point.

    Rope and weight, an upright cylinder, swing as one by up to an angle to every side. What is at a
    distance d from the point and at an angle a from the rope gets to all angles up to
    ``a + swing``, at the same d. So both sweep bodies of revolution about the vertical, which
    capsules hold.

    Args:
        name: Name of the weight; that of the rope follows from it.
        carrier: Index of the joint that carries the point.
        point: The point (3,) in the frame of that joint [m].
        rope: Length of the rope [m]; there is no rope if it is 0.
        radius: Radius of the weight [m].
        height: Its height [m].
        swing: The angle [rad].
        rope_radius: Radius of the rope [m].
    """
    weight = _swept_weight(rope, radius, height, swing)
    shapes = containing(weight, TIGHT_SWING, CAPSULES_OF_WEIGHT)
    found = [Body(name, carrier, shapes, "typed", hangs_at=point)]
    if rope:
        parts = np.linspace(0.0, 1.0, 2 if swing == 0 else CAPSULES_OF_WEIGHT + 1)
        capsules = [
            _part_of_cone(rope, swing, low, high, rope_radius)
            for low, high in pairwise(parts.tolist())
        ]
        more = Body(f"rope of {name}", carrier, tuple(capsules), "typed", hangs_at=point)
        found.append(more)
    return tuple(found)


def _part_of_cone(rope: float, swing: float, low: float, high: float, radius: float) -> Capsule:
    """A capsule that holds a rope between two shares of its length, wherever it swings.

    It is about the vertical. A point at the distance d from the top swings to heights
    ``d cos(swing) .. d`` below it, and ``d sin(swing)`` to the side. Of the capsule between the
    heights ``low cos(swing)`` and ``high`` of these points with the radius ``high sin(swing)`` and
    that of the rope, each is within.
    """
    down = np.array([0.0, 0.0, -1.0])
    top = low * rope * np.cos(swing) * down
    return Capsule(top, high * rope * down, high * rope * np.sin(swing) + radius)


def _swept_weight(rope: float, radius: float, height: float, swing: float) -> Array:
    """Triangles (f, 3, 3) that enclose all places of the weight, the point at the origin [m]."""
    inner = np.array([rope, 0.0])
    upper, lower = np.array([rope, radius]), np.array([rope + height, radius])
    angle = np.arctan2(lower[1], lower[0])
    far = float(np.linalg.norm(lower))
    deepest = far * np.cos(max(angle - swing, 0.0))
    # The rim's arc, by points beyond it that the polygon of chords holds.
    turns = np.linspace(angle + swing, max(angle - swing, 0.0), ARC if swing else 1)
    step = (turns[0] - turns[-1]) / max(len(turns) - 1, 1)
    beyond = far / np.cos(step / 2)
    arc = beyond * np.column_stack([np.cos(turns), np.sin(turns)])
    outline = [_turned(inner, swing), _turned(upper, swing), *arc, np.array([deepest, 0.0])]
    # Where it swings past the vertical, the top of the other side is lowest in the middle.
    outline.insert(0, np.array([rope * np.cos(swing), 0.0]))
    profile = np.array(outline)
    profile[:, 1] /= np.cos(np.pi / SIDES)
    return _revolved(profile)


def _turned(point: Array, angle: float) -> Array:
    """A point (depth, side) turned away from the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])


def _revolved(profile: Array) -> Array:
    """Triangles of a surface of revolution about the vertical, of points (depth, side)."""
    angle = 2 * np.pi * np.arange(SIDES + 1) / SIDES
    depth = np.broadcast_to(-profile[:, 0], (SIDES + 1, len(profile)))
    side = np.outer(np.cos(angle), profile[:, 1]), np.outer(np.sin(angle), profile[:, 1])
    grid = np.stack([*side, depth], axis=-1)
    a, b = grid[:-1, :-1], grid[1:, :-1]
    c, d = grid[:-1, 1:], grid[1:, 1:]
    one = np.stack([a, b, c], axis=-2).reshape(-1, 3, 3)
    return np.concatenate([one, np.stack([b, d, c], axis=-2).reshape(-1, 3, 3)])


def urdf_bodies(
    path: Path, base: str | None = None, tip: str | None = None, name: str | None = None
) -> tuple[Body, ...]:
    """One body for each link that has a shape: those of the chain, and all that is fixed to it.

    Links beside the chain stand at rest, see `links_below`. What no joint of the chain moves stands
    in the frame of the base.

    Args:
        path: The URDF, or a xacro file.
        base: Name of the base link; defaults to the root.
        tip: Name of the tip link; defaults to the only leaf.
        name: How messages name the file; defaults to its path.

    Raises:
        UserError: A shape or a mesh cannot be read; names the link.
    """
    where = f"robot {name or path}"
    tree, joints = chain_of(path, base, tip, where)
    moving = [joint for joint in joints if joint.kind != "fixed"]
    carriers = {joint.name for joint in moving}
    reader = _Shapes(tree, path, where)
    found = [
        reader.body(link, T, None) for link, T in links_at_rest(tree, joints[0].parent, carriers)
    ]
    for index, joint in enumerate(moving):
        below = links_below(tree, joint.child, carriers)
        found += [reader.body(link, T, index) for link, T in below]
    return tuple(body for body in found if body is not None)


class _Shapes:
    """Reads the shapes of links; all messages name the file and the link."""

    def __init__(self, tree: Urdf, path: Path, where: str) -> None:
        self.tree = tree
        self.path = path
        self.where = where
        self.triangles = 0

    def body(self, link: str, T: Array, carrier: int | None) -> Body | None:
        """The body of a link whose frame is T in that of its carrier; None without a shape."""
        element = self.tree.elements[link]
        with told_at(self.where, f"link {link}"):
            parts = self._parts(element)
            if not parts:
                return None
            shapes = held(parts, stands=carrier is None)
        return Body(link, carrier, shapes, "URDF", tuple(map(_mesh_of, parts))).moved(T)

    def _parts(self, link: Element) -> list[Shape | Mesh]:
        """The shapes and meshes of a link, in its frame."""
        found: list[Shape | Mesh] = []
        for element in link.all("collision") or link.all("visual"):
            geometry = element.first("geometry")
            if geometry is None or not geometry.children:
                raise ValueError(f"its <{element.tag}> has no geometry")
            found.append(self._part(geometry.children[0]).moved(_origin(element)))
        return found

    def _part(self, geometry: Element) -> Shape | Mesh:
        """A shape in its own frame."""
        tag = geometry.tag
        if tag == "box":
            return Box(np.eye(4), _numbers(geometry, "size", 3) / 2)
        if tag == "sphere":
            return Capsule(np.zeros(3), np.zeros(3), float(_numbers(geometry, "radius", 1)[0]))
        if tag in ("cylinder", "capsule"):
            radius, length = (float(_numbers(geometry, key, 1)[0]) for key in ("radius", "length"))
            if tag == "cylinder":
                return Cylinder(np.eye(4), radius, length / 2)
            end = np.array([0.0, 0.0, length / 2])
            return Capsule(-end, end, radius)
        if tag != "mesh":
            raise ValueError(f"<{tag}> is no shape; expected box, cylinder, sphere or mesh")
        return self._mesh(geometry)

    def _mesh(self, geometry: Element) -> Mesh:
        name = geometry.attributes.get("filename", "")
        file = self._file(name)
        if file is None:
            message = f"found no file {name!r}; expected it in a folder above the robot's file"
            raise ValueError(message)
        scale = _numbers(geometry, "scale", 3) if "scale" in geometry.attributes else np.ones(3)
        mesh = read_mesh(file, "m", f"mesh {file.name}", largest=np.inf)
        self.triangles += len(mesh.faces)
        if self.triangles > MOST_OF_ROBOT:
            message = f"with mesh {file.name} the robot has {self.triangles:,} triangles"
            raise ValueError(
                f"{message}; expected at most {MOST_OF_ROBOT:,}: export coarser meshes"
            )
        vertices = mesh.vertices * scale
        size = float(np.ptp(vertices, axis=0).max())
        if size > LARGEST_PART:
            message = f"mesh {file.name} is {size:.3g} m across; expected metres, or a scale"
            raise ValueError(f'{message} as scale="0.001 0.001 0.001" of millimetres')
        return Mesh(vertices, mesh.faces)

    def _file(self, name: str) -> Path | None:
        """The file of a mesh: beside the robot's, or in a package above or beside that.

        A package is looked for in all folders above the robot's file, as each of them or in it.
        """
        folder = self.path.resolve().parent
        if not name.startswith(PACKAGE):
            found = folder / name.removeprefix(FILE)
            return found if found.is_file() else None
        package, _, rest = name.removeprefix(PACKAGE).partition("/")
        for above in (folder, *folder.parents):
            for root in ([above] if above.name == package else []) + [above / package]:
                if (root / rest).is_file():
                    return root / rest
        return None


def held(parts: Iterable[Shape | Mesh], stands: bool) -> tuple[Shape, ...]:
    """Convex shapes that hold some parts: as they are where that goes, else fitted.

    What stands keeps its shapes, and its meshes are held by boxes and capsules. What moves is held
    by capsules.
    """
    found: list[Shape] = []
    corners: list[Array] = []
    for part in parts:
        if isinstance(part, Capsule) or (stands and not isinstance(part, Mesh)):
            found.append(part)
        else:
            corners.append(_triangles(part))
    if corners:
        found += _fitted(np.concatenate(corners), stands)
    return tuple(found)


def _fitted(triangles: Array, stands: bool) -> tuple[Shape, ...]:
    """`containing`, of which results are kept: a command asks for the same robot several times."""
    return _of_bytes(np.ascontiguousarray(triangles).tobytes(), stands)


@lru_cache(maxsize=MOST_FITTED)
def _of_bytes(content: bytes, stands: bool) -> tuple[Shape, ...]:
    triangles = np.frombuffer(content).reshape(-1, 3, 3)
    return containing(triangles, boxes=stands)


def _mesh_of(part: Shape | Mesh) -> Mesh:
    """A part as triangles."""
    if isinstance(part, Mesh):
        return part
    triangles = _triangles(part)
    return Mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def _triangles(part: Shape | Mesh) -> Array:
    """Triangles (f, 3, 3) that enclose a part [m]."""
    if isinstance(part, Mesh):
        return part.triangles
    if isinstance(part, Box):
        corners = np.array([[x, y, 1] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        return _prism(corners * part.half, part.pose)
    if isinstance(part, Cylinder):
        angle = 2 * np.pi * np.arange(SIDES) / SIDES
        radius = part.radius / np.cos(np.pi / SIDES)
        height = np.full(SIDES, part.half_height)
        return _prism(
            np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height]), part.pose
        )
    if isinstance(part, Capsule):
        way = part.end - part.start
        frame = np.eye(4)
        frame[:3, 3] = (part.start + part.end) / 2
        if part.length > 0:
            _, _, rows = np.linalg.svd(way[None])
            frame[:3, :3] = np.stack([rows[1], rows[2], rows[0]], axis=1)
        half = part.length / 2 + part.radius
        return _triangles(Cylinder(frame, part.radius, half))
    raise ValueError("a plane has no end; expected a body that an arm can carry")


def _prism(top: Array, pose: Array) -> Array:
    """Triangles of a prism with an upper face (k, 3) and the same one below."""
    bottom = top * [1, 1, -1]
    k = len(top)
    points = np.concatenate([top, bottom]) @ pose[:3, :3].T + pose[:3, 3]
    i = np.arange(k)
    j = (i + 1) % k
    fan = np.column_stack([np.zeros(k - 2, dtype=int), i[1:-1], i[2:]])
    sides = np.concatenate([np.column_stack([i, j, i + k]), np.column_stack([j, j + k, i + k])])
    return np.asarray(points[np.concatenate([fan, fan + k, sides])])


def _origin(element: Element) -> Array:
    """Transform (4, 4) of the element's <origin> [m]."""
    origin = element.first("origin")
    if origin is None:
        return np.eye(4)
    given = origin.attributes
    return transform(*(_numbers(origin, k, 3) if k in given else (0, 0, 0) for k in ("xyz", "rpy")))


def _numbers(element: Element, key: str, count: int) -> Array:
    """Finite numbers of an attribute."""
    text = element.attributes.get(key, "")
    try:
        found = np.array(text.split(), dtype=float)
    except ValueError:
        found = np.zeros(0)
    if len(found) != count or not np.isfinite(found).all():
        number = "a number" if count == 1 else f"{count} numbers"
        raise ValueError(f"{element.tag}: {key} is {text!r}; expected {number}")
    return found
