"""Visits whose positions cannot be those of the markers: swapped, of another pose, elsewhere."""

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from edtk.calibration.geometry.consensus import Consensus
from edtk.calibration.geometry.explain_visits import WrongVisit, explain_visits
from edtk.calibration.geometry.rigid_tool import EXPLAINED, MOST_MARKERS, RigidTool, rigid_tool
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.model.robot import Robot
from edtk.system.typing import Array

MUCH = 6.0  # times the typical distance: no pose of a sound sheet is as far off
LEAST = 2e-3  # [m] below it a distance is left to the fit


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """Visits that do not fit the others.

    Attributes:
        swapped: Visit, and the markers whose positions are exchanged there.
        wrong: Other visits that are far off.
        apart: Visits in which one marker is elsewhere on the tool: see `RigidTool`.
    """

    swapped: tuple[tuple[int, tuple[str, ...]], ...] = ()
    wrong: tuple[WrongVisit, ...] = ()
    apart: tuple[tuple[int, tuple[str, ...], float], ...] = ()

    @property
    def visits(self) -> list[int]:
        """All that do not count."""
        return sorted({visit for visit, _ in self.swapped} | {one.visit for one in self.wrong})

    def without_apart(self, data: MarkerPositions) -> MarkerPositions:
        """The positions without those of markers that were elsewhere on the tool."""
        measured = data.measured.copy()
        for visit, markers, _ in self.apart:
            measured[visit, [data.markers.index(name) for name in markers]] = np.nan
        return replace(data, measured=measured)


def gross_errors(robot: Robot, data: MarkerPositions) -> GrossErrors:
    """Find visits far from where the others say that they are, and what is wrong with them.

    Distances between markers of one tool are the same in all poses whatever the robot does: they
    show swaps and markers that slipped. Then visits much farther from the place that the others
    agree with than these are looked at: positions of swapped markers fit in another order, and
    others in another unit, at another pose or after a motion of the frame.

    Args:
        robot: The drawing, whose own errors make the typical distance.
        data: All visits.
    """
    rigid = rigid_tool(data)
    sound = GrossErrors(rigid.swapped, (), rigid.apart).without_apart(data)
    blank = sound.measured.copy()
    blank[[visit for visit, _ in rigid.swapped]] = np.nan
    sound = replace(sound, measured=blank)
    agreed = Consensus.of(robot, sound)
    if agreed is None:
        return GrossErrors(rigid.swapped, (), rigid.apart)
    return _far(agreed, sound, rigid)


def _far(agreed: Consensus, data: MarkerPositions, rigid: RigidTool) -> GrossErrors:
    """The visits that are far off."""
    near = max(MUCH * agreed.typical, LEAST)
    predicted = agreed.predict(data.q)
    swapped = list(rigid.swapped)
    wrong: list[int] = []
    for visit in np.flatnonzero(agreed.distance > near):
        order = _order(data.measured[visit], predicted[visit], data.seen[visit])
        exchanged = tuple(data.markers[i] for i, j in enumerate(order) if i != j)
        if exchanged:
            swapped.append((int(visit), exchanged))
        else:
            wrong.append(int(visit))
    explained = explain_visits(agreed, data, wrong, near)
    return GrossErrors(tuple(sorted(swapped)), explained, rigid.apart)


def _order(measured: Array, predicted: Array, seen: Array) -> tuple[int, ...]:
    """In which order the markers (k,) of a visit fit best; their own unless far better."""
    there = np.flatnonzero(seen)
    plain = tuple(range(len(measured)))
    if not 1 < len(there) <= MOST_MARKERS:
        return plain
    own = np.linalg.norm(measured[there] - predicted[there])
    sizes = {}
    for order in permutations(there.tolist()):
        sizes[order] = float(np.linalg.norm(measured[there] - predicted[list(order)]))
    best = min(sizes, key=sizes.__getitem__)
    if sizes[best] > EXPLAINED * own:
        return plain
    found = list(plain)
    for place, one in zip(there.tolist(), best, strict=True):
        found[place] = one
    return tuple(found)
