"""The page of a plan's poses: one HTML file that asks nobody for anything."""

import base64
import hashlib
import json
from dataclasses import dataclass
from functools import cache, cached_property
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

from edtk.cell.shapes import Box, Capsule, Cylinder, Mesh, Plane, Shape
from edtk.report.page import table
from edtk.report.show.stage import TIP, WORLD, Mark, Part, Shade, Stage, carrier_of, place
from edtk.robots.joint import Ties
from edtk.robots.robot import Robot
from edtk.system.presented import Presented
from edtk.system.typing import Array
from edtk.version import __version__

DIGITS = 10  # of a number in the page: places of links keep a millionth of a millimetre
GRIDS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)  # [m]
CELLS = 8  # of the grid, at least, across the arm
ROOM_AROUND = 1.12  # around the arm
POSES_OPEN = 30  # poses up to which their table is open at first
NAMED_POSES = 10  # poses in a line
FRAME_HEIGHT = 760  # of the page in a notebook [px]
KEYS = (
    ("\N{LEFTWARDS ARROW} \N{RIGHTWARDS ARROW}", "pose"),
    ("Home End", "first, last"),
    ("p", "play"),
    ("g", "all poses"),
    ("d", "bent"),
    ("b", "beams"),
    ("n", "names"),
    ("c", "colour"),
    ("1 to 5", "views"),
    ("shift and arrows", "turn"),
    ("+ -", "zoom"),
)


@cache
def _source(name: str) -> str:
    """A file of this folder."""
    return files("edtk.report.show").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """A text by its digest, as a content policy names it."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"


@dataclass(frozen=True, eq=False)
class ShownPage(Presented):
    """A page with poses of a robot, for a browser or a notebook.

    Attributes:
        stage: What it shows.
    """

    stage: Stage

    def headline(self) -> str:
        """Title, and the number of poses."""
        return f"{self.stage.title}, {_counted(len(self.stage.q))}"

    @cached_property
    def html(self) -> str:
        """The file's text."""
        return page_html(self.stage)

    def _repr_html_(self) -> str:
        """The page in a frame of a notebook."""
        return (
            f'<iframe srcdoc="{escape(self.html)}" title="{escape(self.stage.title)}" '
            f'style="width:100%;height:{FRAME_HEIGHT}px;border:0"></iframe>'
        )


def page_html(stage: Stage) -> str:
    """The text of the file, in which nothing runs but the script of this folder."""
    style = _source("page.css")
    script = _source("page.js")
    policy = (
        f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )
    keys = " ".join(f"<kbd>{escape(key)}</kbd> {escape(words)}," for key, words in KEYS)
    return Template(_source("page.html")).substitute(
        title=escape(stage.title),
        subtitle=escape(_subtitle(stage)),
        policy=policy,
        alarms="".join(f'<p class="notice">{escape(text)}</p>\n' for text in _alarms(stage)),
        style=style,
        script=script,
        count=len(stage.q),
        keys=f"Keys: {keys.rstrip(',')}. The mouse or a finger turns the picture.",
        open=" open" if len(stage.q) <= POSES_OPEN else "",
        table=pose_table(stage),
        footer=escape(f"edtk {__version__}. Lengths in mm, angles in deg as the controller shows."),
        data=_json(page_data(stage)),
    )


def _counted(poses: int) -> str:
    return f"{poses} pose{'' if poses == 1 else 's'}"


def _subtitle(stage: Stage) -> str:
    """What is to be seen, in a line."""
    more = f", of {len(stage.q) + stage.left_out}" if stage.left_out else ""
    parts = [stage.robot.name, f"{_counted(len(stage.q))}{more}", stage.ordered]
    sketched = {part.name for part in stage.parts if part.kind == "joint"}
    if sketched:
        whole = sketched >= {joint.name for joint in stage.robot.chain}
        what = "bodies are a sketch" if whole else "links without a body are thin rods"
        parts.append(f"{what} from joint to joint")
    return "; ".join(filter(None, parts))


def _alarms(stage: Stage) -> list[str]:
    """What a person has to know before the arm moves; nothing where all is free."""
    found = []
    for shade in stage.shades:
        below = -np.inf if shade.alarm is None else shade.alarm
        touching = tuple(np.flatnonzero(shade.values < below).tolist())
        if touching:
            found.append(f"Something touches in {_poses(stage, touching)}.")
    if stage.blocked:
        found.append(f"No free way was found to {_poses(stage, stage.blocked)}.")
    return found


def _poses(stage: Stage, chosen: tuple[int, ...]) -> str:
    """Some poses by name."""
    names = [stage.names[i] for i in chosen if i < len(stage.names)]
    shown = ", ".join(names[:NAMED_POSES]) + (" and others" if len(names) > NAMED_POSES else "")
    return f"pose{'s' if len(names) > 1 else ''} {shown}"


def _json(content: dict[str, Any]) -> str:
    """Data inside a script element, which no text of a study can end."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _numbers(values: Any) -> Any:
    """Numbers of an array with the digits of a page; None for NaN."""
    if np.ndim(values):
        return [_numbers(one) for one in np.asarray(values)]
    return float(f"{float(values):.{DIGITS}g}") + 0.0 if np.isfinite(values) else None


def _motion(T: Array) -> list[float]:
    """A rigid motion (4, 4) as three rows of four numbers."""
    found: list[float] = _numbers(np.asarray(T)[:3].ravel())
    return found


def page_data(stage: Stage) -> dict[str, Any]:
    """All that the script draws, in SI units."""
    return {
        "title": stage.title,
        **_arm(stage.robot),
        "q": _numbers(stage.q),
        "shown": _shown(stage),
        "names": list(stage.names),
        "repeats": stage.repeats.tolist(),
        "parts": [_part(part) for part in stage.parts],
        "marks": [_mark(mark) for mark in stage.marks],
        "eyes": [{"name": name, "at": _numbers(at)} for name, at in stage.eyes],
        "hidden": [list(pose) for pose in stage.hidden],
        "ways": [_numbers(way) for way in stage.ways],
        **_loads(stage),
        "turns": None if stage.turns is None else _numbers(stage.turns),
        "springs": stage.springs,
        "shades": [_shade(one) for one in stage.shades],
        **_views(stage),
    }


def _arm(robot: Robot) -> dict[str, Any]:
    """The chain of joints, from which the script finds where all is in a pose."""
    ties = robot.ties or Ties(np.eye(robot.n), np.zeros(robot.n), list(range(robot.n)))
    return {
        "chain": [
            {
                "name": joint.name,
                "origin": _motion(joint.origin),
                "axis": _numbers(joint.axis),
                "slides": joint.kind == "prismatic",
            }
            for joint in robot.chain
        ],
        "base": _motion(robot.base),
        "tool": _motion(robot.tool),
        "ties": _numbers(ties.matrix),
        "offset": _numbers(ties.offset),
        "joints": list(robot.joint_names),
    }


def _mark(mark: Mark) -> dict[str, Any]:
    """What an instrument looks at."""
    return {
        "name": mark.name,
        "on": carrier_of(mark.point),
        "at": _numbers(np.ravel(mark.point.offset)[:3]),
        "anchor": None if mark.anchor is None else _numbers(mark.anchor),
        "normal": None if mark.normal is None else _numbers(mark.normal),
    }


def _loads(stage: Stage) -> dict[str, Any]:
    """Where loads act, and how large they are."""
    force, levers = stage.wrench[:, :3], stage.wrench[:, 6:]
    levers = levers if levers.size else np.zeros((len(force), 3))
    point = stage.load_point
    return {
        "load": {"on": carrier_of(point), "at": _numbers(np.ravel(point.offset)[:3])},
        "forces": _numbers(force),
        "levers": _numbers(np.nan_to_num(levers)),
        "largest": _numbers(max(np.linalg.norm(force, axis=1).max(initial=0.0), 1e-9)),
        "loads": [_load_in_words(one) for one in stage.wrench],
    }


def _views(stage: Stage) -> dict[str, Any]:
    """What the picture has to hold, without and with what stands around, and its grid."""
    middle, size = picture_ball(stage)
    middle_of_all, size_of_all = picture_ball(stage, far=True)
    return {
        "middle": _numbers(middle),
        "size": _numbers(size),
        "middle_of_all": _numbers(middle_of_all),
        "size_of_all": _numbers(size_of_all),
        "floor": _numbers(_floor(stage)),
        "grid": next((step for step in GRIDS if CELLS * step >= size), GRIDS[-1]),
    }


def _shown(stage: Stage) -> list[list[str]]:
    """What the controller shows of each pose, with units."""
    units = ["mm" if joint.kind == "prismatic" else "deg" for joint in stage.robot.joints]
    return [
        [f"{value:.3f} {unit}" for value, unit in zip(row, units, strict=True)]
        for row in stage.shown
    ]


def _load_in_words(wrench: Array) -> str:
    """Force and torque; empty without a load."""
    parts = []
    for values, unit in ((wrench[:3], "N"), (wrench[3:6], "N m")):
        if np.any(values):
            parts.append(f"({', '.join(f'{x:.4g}' for x in values)}) {unit}")
    return " and ".join(parts)


def _shade(one: Shade) -> dict[str, Any]:
    """A number of each pose, with the least and the largest."""
    known = one.values[np.isfinite(one.values)]
    ends = (known.min(), known.max()) if len(known) else (0.0, 0.0)
    return {
        "name": one.name,
        "words": one.words,
        "values": _numbers(one.values),
        "beside": list(one.beside),
        "alarm": one.alarm,
        "low": _numbers(ends[0]),
        "high": _numbers(ends[1]),
    }


def _part(part: Part) -> dict[str, Any]:
    """A part of the picture; what stands still has a place for its name."""
    found: dict[str, Any] = {"name": part.name, "kind": part.kind, "on": part.carrier}
    found["shapes"] = [_shape(shape) for shape in part.shapes]
    found["hangs"] = None if part.hangs_at is None else _numbers(part.hangs_at)
    if part.kind == "around":
        corners = np.vstack([_corners(shape) for shape in part.shapes] or [np.zeros((1, 3))])
        if len(corners):
            found["middle"] = _numbers((corners.min(axis=0) + corners.max(axis=0)) / 2)
    return found


def _shape(shape: Shape | Mesh) -> dict[str, Any]:
    """A shape by its kind."""
    match shape:
        case Capsule():
            return {"capsule": _numbers_of(shape.start, shape.end, shape.radius)}
        case Cylinder():
            return {
                "cylinder": [_motion(shape.pose), *_numbers_of(shape.radius, shape.half_height)]
            }
        case Box():
            return {"box": [_motion(shape.pose), _numbers(shape.half)]}
        case Plane():
            return {"plane": _numbers_of(shape.normal, shape.offset)}
    vertices = np.round(shape.vertices, 5).ravel().tolist()
    return {"mesh": [vertices, np.asarray(shape.faces).ravel().tolist()]}


def _numbers_of(*values: Any) -> list[Any]:
    return [_numbers(one) for one in values]


def _corners(shape: Shape | Mesh) -> Array:
    """Points (k, 3) between which a shape lies, in its carrier's frame; none of a plane."""
    match shape:
        case Capsule():
            ends = np.array([shape.start, shape.end])
            return np.vstack([ends - shape.radius, ends + shape.radius])
        case Cylinder() | Box():
            half = (
                shape.half if isinstance(shape, Box) else [shape.radius] * 2 + [shape.half_height]
            )
            signs = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
            return np.asarray(signs * half @ shape.pose[:3, :3].T + shape.pose[:3, 3])
        case Plane():
            return np.zeros((0, 3))
    return np.asarray(shape.vertices)


def picture_ball(stage: Stage, far: bool = False) -> tuple[Array, float]:
    """Middle (3,) and radius of a ball that holds the arm in all poses [m].

    Args:
        stage: What is shown.
        far: Whether what stands around the arm counts, and the tracker.
    """
    points = _points(stage, far)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return middle, ROOM_AROUND * max(float(np.linalg.norm(points - middle, axis=1).max()), 1e-3)


def _points(stage: Stage, far: bool) -> Array:
    """Points (k, 3) that the picture has to hold [m]."""
    frames = stage.frames
    own = np.concatenate([frames.origins, frames.position[None]])
    points = [np.moveaxis(own, 1, -1).reshape(-1, 3), stage.robot.base[None, :3, 3]]
    for part in stage.parts:
        if part.carrier == WORLD and (far or part.kind != "around"):
            points += [_corners(shape) for shape in part.shapes]
    if far:
        points += [np.array([at, [*at[:2], 0.0]]) for _, at in stage.eyes]
        points += [mark.anchor[None] for mark in stage.marks if mark.anchor is not None]
    return np.vstack(points)


def _floor(stage: Stage) -> float:
    """The height on which the grid lies [m]."""
    flat = [
        shape.offset
        for part in stage.parts
        for shape in part.shapes
        if isinstance(shape, Plane) and shape.normal[2] > 1 - 1e-9
    ]
    return float(max(flat, default=min(0.0, float(stage.robot.base[2, 3]))))


def pose_table(stage: Stage) -> str:
    """All poses: what the controller shows, the load, the tool point, and what colours them."""
    units = ["mm" if joint.kind == "prismatic" else "deg" for joint in stage.robot.joints]
    header = ["pose", "measured"]
    header += [f"{n} [{u}]" for n, u in zip(stage.robot.joint_names, units, strict=True)]
    header += [
        "tool x [mm]",
        "tool y [mm]",
        "tool z [mm]",
        "load",
        *(shade.name for shade in stage.shades),
    ]
    rows = []
    for i, name in enumerate(stage.names):
        tip = place(stage, TIP, i)[1]
        numbers = [f"{value:.3f}" for value in stage.shown[i]]
        at = [f"{1e3 * x:.1f}" for x in tip]
        told = [_told(shade.values[i]) for shade in stage.shades]
        load = _load_in_words(stage.wrench[i])
        rows.append([name, stage.repeats[i], *numbers, *at, load, *told])
    return table(header, rows, full=True)


def _told(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "-"
