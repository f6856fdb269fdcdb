"""The power of a plan of visits to notice faults and to tell them apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from edtk.calibration.causes.family import Family
from edtk.calibration.detect import UNITS as SI
from edtk.calibration.detect import SizedFault, sized_faults
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.position_rows import PositionRows
from edtk.calibration.geometry_design.position_sheet import visit_order
from edtk.calibration.geometry_design.visits import (
    BY_LOADS,
    BY_SPRINGS,
    UNITS,
    VisitFault,
    Visits,
)
from edtk.calibration.separations import HELPS, SizedFamily, right_share, times_to_tell
from edtk.design.detection import LEVEL, Detection
from edtk.design.plan import Plan
from edtk.design.sample_feasible import sample_feasible
from edtk.design.separation import Separation
from edtk.inference.distributions import chi_square_quantile, noncentral_chi_square_tail
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices

CANDIDATES = 100  # visits among which one more is looked for
DEPENDENT = 1e-9  # singular value of scaled columns, beside the largest, that is rounding


def sized_visit_faults(study: Study, given: Mapping[str, str]) -> tuple[SizedFault, ...]:
    """Read sizes of faults, like "5mm" or "3%", by the name of the fault.

    Args:
        study: The study, with [parameters].
        given: The sizes; "load" is short for "load_size".

    Raises:
        UserError: A fault or a unit is not known; nothing loads the springs; or the fault needs
            compliances, and the study has no [simulation].
    """
    faults = sized_faults(study, given, UNITS, BY_SPRINGS)
    for fault in faults:
        if fault.name in BY_LOADS and not study.unknown:
            message = f"{fault.name} shows in springs, and this study has none that is unknown"
            raise ArgumentError(message, argument="detect")
    return faults


def detect_in_visits(
    question: GeometryQuestion, plan: Plan, faults: Sequence[SizedFault]
) -> tuple[tuple[Detection, ...], tuple[Separation, ...]]:
    """Find how likely faults of a day would be noticed in the visits of a plan, and told apart.

    A fault of size c adds ``D c`` to the whitened positions. Of that the residuals show what no
    parameter takes up, ``(I - QQ') D c``; its squared length is the noncentrality of the chi-square
    statistic that tests for the fault. All is to first order about the drawing, and the visits are
    in the order of the sheet that `edtk template` writes.

    Args:
        question: The question of the study.
        plan: All visits.
        faults: Faults with their sizes.

    Returns:
        Detections in the order of the faults, and separations of each two that are ever noticed.
    """
    if not faults:
        return (), ()
    visits, count = _visits(question, plan)
    k = None
    if any(fault.name in BY_SPRINGS for fault in faults):
        k = question.study.compliances
    every = [list(visits.faults(fault.name, k)) for fault in faults]
    shown = _Shown.of(visits, count, [one for ones in every for one in ones])
    found = []
    hardest: list[VisitFault] = []
    for fault, ones in zip(faults, every, strict=True):
        if not ones:  # a fault by the sign of a load, where no load changes its sign
            found.append(Detection(fault.name, fault.size, fault.unit, LEVEL, None, LEVEL))
            continue
        powers = [shown.power(shown.planned, one, fault) for one in ones]
        one = ones[int(np.argmin(powers))]
        hardest.append(one)
        found.append(shown.detection(fault, one))
    seen = [detection for detection in found if not detection.never]
    of = {one.name: one for one in hardest}
    pairs = combinations([(detection, of[detection.fault]) for detection in seen], 2)
    return tuple(found), tuple(shown.separation(*pair) for pair in pairs)


def _visits(question: GeometryQuestion, plan: Plan) -> tuple[Visits, int]:
    """The visits in their order, and behind them feasible ones; and how many there are."""
    study = question.study
    order = visit_order(study, plan)
    x = sample_feasible(question.space, CANDIDATES, study.specification.seed)
    more = question.space.plan(x, np.ones(len(x), dtype=int))
    q = np.concatenate([plan.q[order], more.q])
    wrench = np.concatenate([plan.wrench[order], more.wrench])
    time = np.append(np.linspace(0, 1, len(order)), np.ones(len(x)))
    return Visits(question, q, wrench, time), len(order)


@dataclass(frozen=True, eq=False)
class _Shown:
    """What residuals show of faults, for a plan and with each of some further visits.

    Attributes:
        visits: The visits of the plan, then the further ones.
        faults: The faults.
        planned: ``D'(I - QQ')D`` (dims, dims) of all faults together, for SI sizes of one.
        with_one: The same with each further visit (c, dims, dims).
        count: Number of visits of the plan.
    """

    visits: Visits
    faults: list[VisitFault]
    planned: Array
    with_one: Array
    count: int

    @classmethod
    def of(cls, visits: Visits, count: int, faults: list[VisitFault]) -> "_Shown":
        """Project what faults add on what the parameters do not."""
        question = visits.question
        rows = PositionRows(question.model, question.setting.loads, question.setting.noise)
        A = rows(visits.q, visits.wrench)
        A = A / np.linalg.norm(A.reshape(-1, A.shape[-1]), axis=0)
        D = np.concatenate([np.empty((*A.shape[:2], 0)), *(one.D for one in faults)], axis=-1)
        planned = np.arange(count)
        more = range(count, len(visits.q))
        grams = [_left(A, D, planned), *(_left(A, D, np.append(planned, i)) for i in more)]
        return cls(visits, faults, grams[0], np.array(grams[1:]), count)

    def _part(self, one: VisitFault) -> slice:
        """Where a fault is among the dimensions of all."""
        first = sum(other.dims for other in self.faults[: self.faults.index(one)])
        return slice(first, first + one.dims)

    def power(self, gram: Array, one: VisitFault, fault: SizedFault) -> float:
        """The probability that a fault is noticed."""
        part = self._part(one)
        c = np.full(one.dims, fault.size * SI[fault.unit] / one.dims**0.5)
        noncentrality = max(float(c @ gram[part, part] @ c), 0.0)
        threshold = float(chi_square_quantile(1 - LEVEL, one.dims))
        return noncentral_chi_square_tail(threshold, one.dims, noncentrality)

    def detection(self, fault: SizedFault, one: VisitFault) -> Detection:
        """The power of the plan, and of the visit that adds most to it."""
        power = self.power(self.planned, one, fault)
        with_one = [self.power(gram, one, fault) for gram in self.with_one]
        best = int(np.argmax(with_one))
        helps = with_one[best] > power
        return Detection(
            fault.name,
            fault.size,
            fault.unit,
            power,
            self.visits.q[self.count + best] if helps else None,
            max(with_one[best], power),
            one.joint,
        )

    def separation(
        self, first: tuple[Detection, VisitFault], second: tuple[Detection, VisitFault]
    ) -> Separation:
        """The chance that of two faults the right one is named."""
        pair = (_sized(*first), _sized(*second))
        places = np.concatenate(
            [np.arange(part.start, part.stop) for part in map(self._part, (first[1], second[1]))]
        )
        sizes = np.repeat([one.size for one in pair], [one.family.dims for one in pair])

        def of_pair(gram: Array) -> Array:
            return gram[np.ix_(places, places)] * sizes[:, None] * sizes

        own = of_pair(self.planned)
        right = right_share(own, pair)
        with_one = [right_share(of_pair(gram), pair) for gram in self.with_one]
        best = int(np.argmax(with_one))
        helps = with_one[best] > right + HELPS
        return Separation(
            (first[0], second[0]),
            right,
            self.visits.q[self.count + best] if helps else None,
            max(with_one[best], right),
            times_to_tell(own, pair),
        )


def _left(A: Array, D: Array, rows: Indices) -> Array:
    """``D'(I - UU')D`` for the column space U of some rows of A."""
    U, s, _ = np.linalg.svd(A[rows].reshape(-1, A.shape[-1]), full_matrices=False)
    U = U[:, s > DEPENDENT * s[0]]
    flat = D[rows].reshape(-1, D.shape[-1])
    left = flat - U @ (U.T @ flat)
    left = left - U @ (U.T @ left)  # once more: a fault may be taken up but for a millionth
    return np.asarray(left.T @ left)


def _sized(detection: Detection, one: VisitFault) -> SizedFamily:
    """A fault of a size, as the room of causes has it; its residuals are known already."""

    def predict(c: Array) -> tuple[Array, Array]:
        raise NotImplementedError

    size = detection.size * SI[detection.unit]
    family = Family(
        one.name,
        detection.unit,
        1 / SI[detection.unit],
        one.dims,
        one.usual,
        predict,
        one.tries,
        one.joint,
        only_positive=one.only_positive,
    )
    return SizedFamily(detection, family, size, one.D)
