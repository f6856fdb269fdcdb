"""Rows that can be those of markers on a rigid tool within reach, and points on the base."""

from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path

import numpy as np

from edtk.findings.finding import Data, Finding, Severity, Wording, rows_in_words
from edtk.findings.match_plan import CHANCE, pairs, resolution
from edtk.fit.distributions import poisson_tail
from edtk.fit.fitted_geometry import GeometricFit
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.place_robot import rigid_motion
from edtk.robots.frames import MM
from edtk.study.study_geometry import StudyGeometry
from edtk.study.study_model import on_robot
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices, Mask

# Times its usual scatter: a distance has changed, or a point on the base has moved.
SCATTERS = 10.0
EXPLAINED = 0.25  # of the change remains, where markers were swapped
MOST_MARKERS = 5  # whose orders are tried
# Times the reach, or twice the usual distance from the middle: no marker is there.
BEYOND_REACH = 3.0
SAME_PLACE = 1e-7  # [m] two markers as near are one: the last digit of any instrument is larger
FEWEST_COPIES = 2  # visits that two markers share


@dataclass(frozen=True)
class StandingPoints:
    """When a point stands on the base, and what its motions are."""

    still: float = 0.01  # of the way that others move: a point that moves less stands on the base
    far: float = 0.02  # [m] others have to move by as much
    on_marker: float = 1e-3  # [m] nearer than this two readings are of one point
    floor: float = 1e-4  # [m] below it a motion of a point on the base is that of the floor


STANDING = StandingPoints()


@dataclass(frozen=True)
class PlacesOfStudy:
    """When markers are elsewhere on the tool than the study says."""

    far: float = 0.1  # [m] no guess of where a marker is on a tool is as wrong
    swapped_by: float = 0.01  # [m] markers that are as far off may have been swapped


ON_TOOL = PlacesOfStudy()


@dataclass(frozen=True)
class ShapeOfTool:
    """When distances between the markers of a tool have changed, and what explains it."""

    least: float = 2e-4  # [m] below it a change of a distance is left to the fit
    orders_alike: float = 3.0  # times the least remaining change, two orders explain it alike
    clearly_nearer: float = 0.5  # times nearer to others, another visit shows the tool better
    agree: float = 0.4  # of the visits, at least, that show the tool as it is
    fewest: int = 5  # visits that can tell how it is
    most_tried: int = 200  # visits whose shape is tried as that of all


TOOL = ShapeOfTool()


@dataclass(frozen=True, eq=False)
class RigidTool:
    """Visits whose markers are not where those of other visits are beside each other.

    Attributes:
        swapped: Visit, and the markers whose positions are exchanged there.
        apart: Visit, the markers of which one is elsewhere on the tool, and by how much the
            distances to it differ [m].
    """

    swapped: tuple[tuple[int, tuple[str, ...]], ...] = ()
    apart: tuple[tuple[int, tuple[str, ...], float], ...] = ()

    def without_apart(self, data: MarkerPositions) -> MarkerPositions:
        """The positions without those of markers that were elsewhere on the tool."""
        measured = data.measured.copy()
        for visit, markers, _ in self.apart:
            measured[visit, [data.markers.index(name) for name in markers]] = np.nan
        return replace(data, measured=measured)

    def without_swapped(self, data: MarkerPositions) -> MarkerPositions:
        """The positions without visits in which markers are swapped."""
        measured = data.measured.copy()
        measured[[visit for visit, _ in self.swapped]] = np.nan
        return replace(data, measured=measured)


def rigid_tool(data: MarkerPositions) -> RigidTool:
    """Find swapped markers and markers that slipped, whatever the robot does.

    The usual distances are those of the visit with which most others agree: a median would be of
    neither kind where half of the visits have two markers swapped.

    Args:
        data: All visits; fewer than three markers tell nothing of which one is wrong.
    """
    k = len(data.markers)
    if k < 3 or len(data) < TOOL.fewest:
        return RigidTool()
    x = data.measured
    apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1)
    usual, least = _usual(apart)
    off = np.abs(apart - usual) > least
    swapped = []
    elsewhere = []
    for visit in np.flatnonzero(off.any(axis=(1, 2))):
        order = _order(apart[visit], usual) if data.seen[visit].all() else tuple(range(k))
        exchanged = tuple(data.markers[i] for i, j in enumerate(order) if i != j)
        if exchanged:
            swapped.append((int(visit), exchanged))
            continue
        alone = _alone(off[visit])
        if alone:
            size = float(np.nanmax(np.abs(apart[visit] - usual)))
            elsewhere.append((int(visit), tuple(data.markers[i] for i in alone), size))
    return RigidTool(tuple(swapped), tuple(elsewhere))


def _usual(apart: Array) -> tuple[Array, Array]:
    """The distances (k, k) of most visits, and by how much (k, k) one has to differ [m]."""
    whole = np.flatnonzero(np.isfinite(apart).all(axis=(1, 2)))
    if not len(whole):
        return np.full(apart.shape[1:], np.nan), np.full(apart.shape[1:], np.inf)
    tried = whole[np.unique(np.linspace(0, len(whole) - 1, TOOL.most_tried).round().astype(int))]
    best = np.inf
    usual = apart[tried[0]]
    near: Mask = np.ones(len(whole), dtype=bool)
    for visit in tried:
        differ = np.abs(apart[whole] - apart[visit]).max(axis=(1, 2))
        share = max(float(np.quantile(differ, TOOL.agree)), TOOL.least / 2)
        # Where two halves of the visits differ, the first of them counts as the usual one.
        if share < TOOL.clearly_nearer * best:
            best = share
            near = differ <= share
    # The nearest visits understate the scatter; all that are within many times of it do not.
    least = np.zeros(apart.shape[1:])
    for _ in range(3):
        usual = np.median(apart[whole][near], axis=0)
        scatter = 1.4826 * np.median(np.abs(apart[whole][near] - usual), axis=0)
        least = np.maximum(SCATTERS * scatter, TOOL.least)
        near = (np.abs(apart[whole] - usual) <= least).all(axis=(1, 2))
    return usual, least


def _order(apart: Array, usual: Array) -> tuple[int, ...]:
    """In which order the markers (k,) have the usual distances; their own unless far better."""
    k = len(usual)
    plain = tuple(range(k))
    if k > MOST_MARKERS:
        return plain
    sizes = {
        order: float(np.abs(apart - usual[np.ix_(order, order)]).max())
        for order in permutations(range(k))
    }
    # Of orders that explain a tool of two or three equal sides alike, that with fewest exchanges.
    likely = max(TOOL.orders_alike * min(sizes.values()), TOOL.least)
    alike = [order for order, size in sizes.items() if size <= likely]
    best = min(alike, key=lambda order: (sum(i != j for i, j in enumerate(order)), sizes[order]))
    return best if sizes[best] < EXPLAINED * sizes[plain] else plain


def _alone(off: Mask) -> list[int]:
    """The markers of which one alone may be elsewhere: all distances between others agree."""
    k = len(off)
    others = [np.delete(np.arange(k), i) for i in range(k)]
    return [i for i in range(k) if not off[np.ix_(others[i], others[i])].any()]


def with_standing(
    setting: StudyGeometry, data: MarkerPositions
) -> tuple[StudyGeometry, MarkerPositions, list[Finding]]:
    """The setting and the positions with markers that stand still among those on the base.

    Args:
        setting: The study, with the markers that it has on the tool and on the base.
        data: Their positions, those on the base last.

    Returns:
        Both, and a finding where there is such a marker: a note where the study names none.
    """
    k = len(setting.on_tool)
    absolute = data.absolute
    lost = (np.abs(np.nan_to_num(absolute.measured)) == 0).all(axis=-1, keepdims=True)
    x = np.where(lost, np.nan, absolute.measured)[:, :k]
    seen = np.isfinite(x).all(axis=-1).sum(axis=0)
    moves = np.zeros(k)
    for i in np.flatnonzero(seen):
        own = x[:, i][np.isfinite(x[:, i]).all(axis=-1)]
        moves[i] = np.median(np.linalg.norm(own - np.median(own, axis=0), axis=-1))
    most = moves.max(initial=0.0)
    still = [
        i
        for i in range(k)
        if seen[i] > 1 and most > STANDING.far and moves[i] < STANDING.still * most
    ]
    if not still:
        return setting, data, []
    moved = range(len(setting.markers))
    moving = [i for i in moved if i not in still]
    names = tuple(setting.markers[i] for i in still)
    order = [*moving, *range(len(moved), len(data.markers)), *still]
    there = replace(
        setting,
        markers=tuple(setting.markers[i] for i in moving),
        references=(*setting.references, *names),
    )
    ordered = data.of_markers(order)
    given = bool(setting.study.specification.marker)
    severity = Severity.WARNING if given else Severity.NOTE
    return there, ordered, [Finding.of(severity, WORDING, "standing", markers=names)]


def without_beyond_reach(
    data: MarkerPositions, reach: float
) -> tuple[MarkerPositions, list[Finding]]:
    """The positions without those that a wrong number has put where the arm cannot be.

    A position of which all three coordinates are as far is kept: it may be in another unit or
    frame, which is looked for later.

    Args:
        data: Positions of markers on the tool.
        reach: No point of the arm is farther from its base [m].
    """
    apart = np.abs(data.measured - np.median(data.measured[data.seen], axis=0))
    usual = float(np.median(apart[data.seen].max(axis=-1)))
    far = apart > BEYOND_REACH * max(reach, 2 * usual)
    typed = np.asarray(far.any(axis=-1) & ~far.all(axis=-1))
    if not typed.any():
        return data, []
    measured = np.where(typed[..., None], np.nan, data.measured)
    return replace(data, measured=measured), [_beyond(data, typed, far, reach)]


def _beyond(data: MarkerPositions, typed: Mask, far: Mask, reach: float) -> Finding:
    """What is said of them, with the coordinate that is farthest."""
    rows = tuple(sorted({int(row) for row in data.row[typed]}))
    there = np.where(far & typed[..., None], np.abs(data.measured), 0.0)
    visit, marker, axis = np.unravel_index(int(np.argmax(there)), there.shape)
    return Finding.of(
        Severity.WARNING,
        WORDING,
        "beyond_reach",
        rows=rows,
        marker=data.markers[marker],
        axis="xyz"[axis],
        value=float(data.measured[visit, marker, axis]),
        positions=int(typed.sum()),
        reach=reach,
    )


def refuse_copied_visits(data: MarkerPositions, sigma: float, path: Path) -> None:
    """Refuse a sheet in which visits of a pose are the same to the last digit.

    Two readings of a coordinate with the standard deviation sigma and the resolution d agree with
    the probability ``d / (2 sqrt(pi) sigma)`` at most; the number of visits that agree in all
    coordinates is about Poisson's. Readings that are as coarse as that may agree by chance.

    Args:
        data: All visits.
        sigma: Standard deviation of a reading [m].
        path: The sheet, for the message.

    Raises:
        UserError: More visits agree than chance explains.
    """
    x = np.nan_to_num(data.measured.reshape(len(data), -1), nan=-1.0)
    lengths = data.rows_seen[..., :3]
    seen = data.seen.any(axis=1)
    _, first, number = np.unique(
        np.column_stack([data.pose, x]), axis=0, return_index=True, return_inverse=True
    )
    earlier = first[number.reshape(-1)]
    copies = np.flatnonzero(seen & (earlier != np.arange(len(data))))
    if not len(copies):
        return
    step = resolution(1e3 * data.measured[lengths]) / 1e3
    agree = min(step / (2 * np.sqrt(np.pi) * sigma), 1.0) ** lengths.sum(axis=(1, 2)).min()
    expected = float(pairs(data.pose) * agree)
    if float(poisson_tail(len(copies) - 1, expected)) > CHANCE:
        return
    later = copies[0]
    rows = [
        int(data.row[visit][data.row[visit] >= 0].min()) + 1 for visit in (later, earlier[later])
    ]
    more = len(copies) - 1
    others = (
        f", and {more} more visit{'s have' if more > 1 else ' has'} such a twin" if more else ""
    )
    raise UserError(
        f"row {rows[0]} is row {rows[1]} to the last digit, in all columns{others}; expected "
        "measurements anew",
        where=path,
    )


def without_copied_markers(
    data: MarkerPositions,
) -> tuple[MarkerPositions, list[Finding]]:
    """The positions without markers that are where another one is, in all rows.

    Two reflectors are never at one place: the columns of one were copied, and would count twice.

    Args:
        data: Positions of the markers on the tool.
    """
    findings = []
    copied: list[int] = []
    for j in range(len(data.markers)):
        for i in range(j):
            both = data.seen[:, i] & data.seen[:, j]
            if i in copied or both.sum() < FEWEST_COPIES:
                continue
            apart = np.abs(data.measured[both, i] - data.measured[both, j]).max()
            if apart > SAME_PLACE:
                continue
            pair = {"marker": data.markers[i], "copy": data.markers[j], "visits": int(both.sum())}
            findings.append(Finding.of(Severity.WARNING, WORDING, "equal_markers", **pair))
            copied.append(j)
            break
    if not copied:
        return data, []
    return data.of_markers([i for i in range(len(data.markers)) if i not in copied]), findings


def marker_findings(fit: GeometricFit, setting: StudyGeometry) -> list[Finding]:
    """Compare where the drawing's robot has the markers on its tool with where the study has them.

    A study need not say where they are; a place of zero counts as none. Names that are swapped in
    all rows leave no residual: only the study's places show them.
    """
    asked = setting.study.specification.parameters
    if asked is None or not asked.tool:
        return []
    stated = {name: np.array(one.position_mm) / MM for one, name in on_robot(setting.study)}
    names = [
        name
        for name in fit.data.markers
        if stated.get(name, np.zeros(3)).any() and name in setting.on_tool
    ]
    if not names:
        return []
    there = np.array([stated[name] for name in names])
    placed = fit.fitted.placed[[fit.data.markers.index(name) for name in names]]
    order = _order_of_places(placed, there)
    exchanged = [name for i, name in enumerate(names) if order[i] != i]
    apart = MM * np.linalg.norm(placed - there, axis=1)
    if exchanged:
        data = {"markers": tuple(exchanged), "off_mm": float(apart.max())}
        return [Finding.of(Severity.WARNING, WORDING, "swapped_names", **data)]
    far = np.flatnonzero(apart > MM * ON_TOOL.far)
    if not len(far):
        return []
    worst = int(np.argmax(apart))
    data = {
        "marker": names[worst],
        "off_mm": float(apart[worst]),
        "place_mm": (MM * placed[worst]).tolist(),
        "others": len(far) - 1,
    }
    return [Finding.of(Severity.WARNING, WORDING, "marker_elsewhere", **data)]


def _order_of_places(placed: Array, stated: Array) -> tuple[int, ...]:
    """In which order the stated places (k, 3) fit best; their own unless far better."""
    k = len(placed)
    plain = tuple(range(k))
    own = float(np.linalg.norm(placed - stated, axis=1).max())
    if not 1 < k <= MOST_MARKERS or own < ON_TOOL.swapped_by:
        return plain
    sizes = {
        order: float(np.linalg.norm(placed - stated[list(order)], axis=1).max())
        for order in permutations(range(k))
    }
    best = min(sizes, key=sizes.__getitem__)
    return best if sizes[best] < EXPLAINED * own else plain


@dataclass(frozen=True, eq=False)
class References:
    """What the points on the base tell.

    Attributes:
        findings: What moved.
        frames: For each visit the motion (v, 4, 4) that takes its positions back to where the
            frame of the instrument was at most times; the identity where it did not move.
    """

    findings: tuple[Finding, ...]
    frames: Array


def reference_points(points: MarkerPositions, tool: MarkerPositions) -> References:
    """Tell a point that moved from a frame that moved with all of them.

    A point moved where it is far from its median place alone; the frame of the instrument did where
    most points are, and a rigid motion brings all of them back.

    Args:
        points: Positions of the points on the base, lost ones NaN.
        tool: Those of the markers on the tool in the same visits: a beam may have been on one.
    """
    v, r = points.seen.shape
    frames = np.tile(np.eye(4), (v, 1, 1))
    if not r:
        return References((), frames)
    place = np.nanmedian(points.measured, axis=0)
    apart = np.linalg.norm(points.measured - place, axis=-1)
    usual = 1.4826 * np.nanmedian(apart, axis=0)
    moved: Mask = apart > np.maximum(SCATTERS * usual, STANDING.floor)
    together = (moved.sum(axis=1) > points.seen.sum(axis=1) / 2) & (points.seen.sum(axis=1) > 2)
    findings = []
    if together.any():
        for visit in np.flatnonzero(together):
            seen = points.seen[visit]
            frames[visit] = rigid_motion(points.measured[visit][seen], place[seen])
        findings.append(_frame_moved(points, together, apart))
    for i in range(r):
        alone = np.flatnonzero(moved[:, i] & ~together)
        if len(alone):
            findings += _moved_alone(points, tool, alone, i, apart[alone, i])
    return References(tuple(findings), frames)


def _moved_alone(
    points: MarkerPositions, tool: MarkerPositions, visits: Indices, i: int, apart: Array
) -> list[Finding]:
    """The findings that name the visits in which one point is elsewhere, by where it is."""
    here = np.linalg.norm(tool.measured[visits] - points.measured[visits, i, None], axis=-1)
    on = [
        int(np.nanargmin(one)) if np.nanmin(one, initial=1.0) < STANDING.on_marker else -1
        for one in here
    ]
    found = []
    for marker in sorted(set(on)):
        chosen = np.flatnonzero(np.array(on) == marker)
        rows = tuple(int(row) for row in points.row[visits[chosen], i])
        data = {
            "point": points.markers[i],
            "off": float(apart[chosen].max()),
            "marker": tool.markers[marker] if marker >= 0 else None,
        }
        found.append(Finding.of(Severity.WARNING, WORDING, "reference_moved", rows=rows, **data))
    return found


def _frame_moved(points: MarkerPositions, together: Mask, apart: Array) -> Finding:
    """The finding that names the visits in which all points moved."""
    visits = np.flatnonzero(together)
    rows = tuple(sorted({int(row) for row in points.row[visits].ravel() if row >= 0}))
    off = float(np.nanmax(np.nanmedian(apart[visits], axis=1)))
    return Finding.of(Severity.WARNING, WORDING, "frame_moved", rows=rows, off=off)


def _standing(data: Data) -> str:
    """Markers that count as points on the base."""
    names = data["markers"]
    one = "s" * (len(names) == 1)
    return (
        f"{', '.join(names)} stay{one} in place while others move, and count{one} as on the base; "
        'expected [[marker]] with joint = "base"'
    )


def _beyond_reach(data: Data) -> str:
    """Positions where no arm is, by the farthest coordinate."""
    alone = data["positions"] == 1
    return (
        f"{rows_in_words(data['rows'])}: {data['axis']} of {data['marker']} is "
        f"{'' if alone else 'up to '}{1e3 * data['value']:.6g} mm, and the arm reaches "
        f"{1e3 * data['reach']:.4g} mm; a wrong number? "
        f"{'This position does' if alone else 'These positions do'} not count"
    )


def _marker_elsewhere(data: Data) -> str:
    """A marker that is not where the study has it."""
    more = f", and {data['others']} more" if data["others"] else ""
    place = ", ".join(f"{x:.0f}" for x in data["place_mm"])
    return (
        f"marker {data['marker']} is {data['off_mm']:.3g} mm from where the study has it on the "
        f"tool{more}: at ({place}) mm. Is it another tool, or another frame? Plans and test poses "
        "rest on position_mm"
    )


def _reference_moved(data: Data) -> str:
    """A point that moved; or a beam that was on a marker of the tool."""
    what = f"moved, by up to {1e3 * data['off']:.3g} mm"
    if data["marker"] is not None:
        what = f"is where the marker {data['marker']} on the tool is"
    rows = rows_in_words(data["rows"])
    return f"{rows}: the point {data['point']} on the base {what}; it does not count"


WORDING: Wording = {
    "standing": _standing,
    "beyond_reach": _beyond_reach,
    "equal_markers": lambda data: (
        f"markers {data['marker']} and {data['copy']} are at the same place in all "
        f"{data['visits']} visits: were columns copied? {data['copy']} does not count"
    ),
    "swapped_names": lambda data: (
        f"markers {' and '.join(data['markers'])} look swapped in all rows: they are up to "
        f"{data['off_mm']:.3g} mm from where the study has them on the tool, and each is where it "
        "has another one; expected the names of the study"
    ),
    "marker_elsewhere": _marker_elsewhere,
    "reference_moved": _reference_moved,
    "frame_moved": lambda data: (
        f"{rows_in_words(data['rows'])}: the frame of the instrument moved, by up to "
        f"{1e3 * data['off']:.3g} mm at the base; positions there are taken back by the points on "
        "the base"
    ),
}
