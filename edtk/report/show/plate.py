"""A plate of small pictures, one a pose: what the page shows, for those who print."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from edtk.cell.shapes import Box, Capsule, Cylinder
from edtk.report.figures import new_figure
from edtk.report.page import picture, section
from edtk.report.show.page import picture_ball
from edtk.report.show.stage import WORLD, Shade, Stage, carrier_of, place, place_of
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "poses.html"  # beside a report
POSES_OF_PLATE = 24  # poses of a plate
COLUMNS = 6
WIDTH = 1.42  # of a small picture [inch]
HEIGHT = 1.5
POINTS = 72  # an inch
# As the page sees the arm at first: from a corner, somewhat from above.
AZIMUTH, ELEVATION = -0.95, 0.32
OUT = np.array(
    [
        np.cos(ELEVATION) * np.cos(AZIMUTH),
        np.cos(ELEVATION) * np.sin(AZIMUTH),
        np.sin(ELEVATION),
    ]
)
RIGHT = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
UP = np.cross(OUT, RIGHT)
RAMP = ("#2f6fb0", "#7aa0c4", "#b9b9b5", "#dca263", "#d5731d")
ARM, JOINT, TOOL = "#b9c1ca", "#7d8791", "#d98a1f"
AROUND = "#a79f90"
LOAD = "#c8452d"
EDGE_BRIGHTNESS = 0.62  # brightness of the edge of a stroke
NAME = 0.17  # height of a name [inch]
FILLED = 0.92  # of a small picture
SMALLEST = 1e-3  # of an arm that is drawn [m]

Stroke = tuple[float, Array, float, str]  # depth, ends (2, 2), width [m], colour


def plate(stage: Stage) -> "Figure":
    """Draw the first poses beside each other, coloured like the page by the first shade.

    All strokes are one collection, the far ones first, so that a plate takes a fraction of a
    second.

    Args:
        stage: What is shown.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import to_rgb

    count = min(len(stage.q), POSES_OF_PLATE)
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    figure = new_figure(columns * WIDTH, rows * HEIGHT)
    ax = figure.add_subplot()
    drawn = [sorted(strokes(stage, i), key=lambda one: one[0]) for i in range(count)]
    low, high = _ends(drawn)
    scale = float(min((np.array([WIDTH, HEIGHT - NAME]) * FILLED) / (high - low)))
    paths, widths, colours = [], [], []
    for i, pose in enumerate(drawn):
        corner = np.array([WIDTH * (i % columns), -HEIGHT * (1 + i // columns)])
        middle = corner + np.array([WIDTH, HEIGHT - NAME]) / 2
        for _, ends, width, colour in pose:
            at = middle + scale * (ends - (low + high) / 2)
            for part, bright in ((1.0, EDGE_BRIGHTNESS), (0.72, 1.0)):
                paths.append(at)
                widths.append(max(part * POINTS * scale * width, 0.5))
                colours.append(tuple(bright * np.array(to_rgb(colour))))
        ax.text(corner[0] + 0.05, corner[1] + HEIGHT - 0.04, _title(stage, i), fontsize=8, va="top")
    lines = LineCollection(paths, linewidths=widths, colors=colours, capstyle="round")
    ax.add_collection(lines)
    ax.set(xlim=(0, columns * WIDTH), ylim=(-rows * HEIGHT, 0))
    ax.set_axis_off()
    return figure


def _ends(drawn: list[list[Stroke]]) -> tuple[Array, Array]:
    """Corners (2,) of the rectangle that holds the arm in all poses, as it is seen [m]."""
    own = [one for pose in drawn for one in pose if one[3] != AROUND]
    ends = np.array([one[1] for one in own])
    half = np.array([one[2] / 2 for one in own])[:, None]
    low, high = (ends.min(axis=1) - half).min(axis=0), (ends.max(axis=1) + half).max(axis=0)
    return low, np.maximum(high, low + SMALLEST)


def _title(stage: Stage, pose: int) -> str:
    """The name of a pose, and the number that colours it."""
    if not stage.shades or not np.isfinite(stage.shades[0].values[pose]):
        return stage.names[pose]
    unit = stage.shades[0].name.partition(" [")[2].rstrip("]")
    return f"{stage.names[pose]}: {stage.shades[0].values[pose]:.3g} {unit}"


def plate_words(stage: Stage) -> str:
    """What a plate shows, for its caption."""
    count = len(stage.q)
    shown = f"The {count} poses" if count > 1 else "The pose"
    if count > POSES_OF_PLATE:
        shown = f"The first {POSES_OF_PLATE} of {count + stage.left_out} poses"
    words = f"{shown}, {stage.ordered}".rstrip(", ")
    if stage.shades:
        words += f"; orange has the largest {stage.shades[0].name.partition(' [')[0]}"
    return f"{words}."


def poses_section(stage: Stage) -> str:
    """The plate in a report, with the page that lies beside it."""
    link = f'<p>Each of them from all sides, and bent by its load: <a href="{PAGE}">{PAGE}</a>.</p>'
    return section("The poses", picture(plate(stage), plate_words(stage)), link)


def shade_colour(shade: Shade, pose: int) -> str:
    """The colour of a pose by its number, as on the page."""
    from matplotlib.colors import LinearSegmentedColormap, to_hex

    value = shade.values[pose]
    if not np.isfinite(value):
        return ARM
    low, high = np.nanmin(shade.values), np.nanmax(shade.values)
    part = (value - low) / (high - low) if high > low else 0.5
    return str(to_hex(LinearSegmentedColormap.from_list("ramp", RAMP)(part)))


def strokes(stage: Stage, pose: int) -> Iterator[Stroke]:
    """The arm in a pose, its load and what surrounds it, as strokes of some width."""
    link = shade_colour(stage.shades[0], pose) if stage.shades else ARM
    colours = {"link": link, "joint": JOINT, "tool": TOOL, "load": LOAD, "around": AROUND}
    for part in stage.parts:
        rotation, origin = place_of(stage, part, pose)
        colour = ARM if part.carrier == WORLD and part.kind == "link" else colours[part.kind]
        for shape in part.shapes:
            for start, end, width in _segments(shape):
                yield _stroke(rotation @ start + origin, rotation @ end + origin, width, colour)
    force = stage.wrench[pose, :3]
    size = float(np.linalg.norm(force))
    if size:
        rotation, origin = place(stage, carrier_of(stage.load_point), pose)
        start = rotation @ np.ravel(stage.load_point.offset)[:3] + origin
        long = 0.25 * picture_ball(stage)[1]
        yield _stroke(start, start + long / size * force, 0.05 * long, LOAD)


def _stroke(start: Array, end: Array, width: float, colour: str) -> Stroke:
    """A segment as it is seen, with how near it is."""
    ends = np.array([start, end])
    seen = np.stack([ends @ RIGHT, ends @ UP], axis=1)
    return float((ends @ OUT).mean()), seen, width, colour


def _segments(shape: object) -> Iterator[tuple[Array, Array, float]]:
    """A shape as segments with a width [m]; none of a plane or of triangles."""
    match shape:
        case Capsule():
            yield shape.start, shape.end, 2 * shape.radius
        case Cylinder():
            axis = shape.half_height * shape.pose[:3, 2]
            # Round ends of the stroke shall not reach beyond the flat ones.
            axis = axis * max(0.1, 1 - 0.5 * shape.radius / shape.half_height)
            yield shape.pose[:3, 3] - axis, shape.pose[:3, 3] + axis, 2 * shape.radius
        case Box():
            middle, edges = shape.pose[:3, 3], shape.pose[:3, :3] * shape.half
            for k in range(3):
                u, v = edges[:, (k + 1) % 3], edges[:, (k + 2) % 3]
                for a, b in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
                    corner = middle + a * u + b * v
                    yield corner - edges[:, k], corner + edges[:, k], 0.04 * min(shape.half)
