"""The power of a plan to notice a fault, to tell two apart, and which experiment would help."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.calibration.planned import planned_measurements
from edtk.calibration.template import visit_order
from edtk.design.candidate_source import sample_feasible
from edtk.design.detection import ENOUGH, FALSE_ALARM, Detection, Separation
from edtk.design.plan import Plan
from edtk.findings.causes.evidence import FACTORS, WEIGHTS
from edtk.findings.causes.family import Family
from edtk.findings.causes.faults import FAULTS, UNITS_OF_SIZES
from edtk.findings.causes.find_causes import MOST_TIMES
from edtk.findings.causes.scene import Displacements, Scene, since_first
from edtk.fit.correlated_noise import CorrelatedNoise, RowNoise, whiten_columns
from edtk.fit.distributions import chi_square_quantile, log_normal_below, noncentral_chi_square_tail
from edtk.fit.measurements import Measurements
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    from edtk.calibration.geometry_question import GeometryQuestion


@dataclass(frozen=True)
class Simulated:
    """How faults are simulated, and when one more experiment helps."""

    candidates: int = 300  # poses among which one more experiment is looked for
    visits: int = 100  # the same of visits, whose rows are more
    draws: int = 1000  # simulated residuals of each fault: shares are right within 2 %
    seed: int = 0
    rounding: float = 1e-6  # of twice a logarithm
    # Of what a fault changes in the joint where it changes most: below it is rounding.
    visible: float = 1e-6
    helps: float = 0.02  # share by which an experiment has to help to be more than chance
    # Singular value of scaled columns, beside the largest, that is rounding.
    dependent: float = 1e-9


SIMULATED = Simulated()


@dataclass(frozen=True)
class SizedFault:
    """A fault with its size.

    Attributes:
        name: Its name.
        size: Its size, in its unit.
        unit: That unit.
    """

    name: str
    size: float
    unit: str

    @property
    def si(self) -> float:
        """The size in SI units."""
        return self.size * UNITS_OF_SIZES[self.unit]


def sized_faults(
    study: Study, given: Mapping[str, str], positions: bool = False
) -> tuple[SizedFault, ...]:
    """Read sizes of faults.

    Args:
        study: The study, whose [simulation] faults are judged by.
        given: Sizes with units, like "5mm", "2deg" or "3%", by the name of the fault; "load" is
            short for "load_size".
        positions: Whether positions are measured in the frame of the instrument. Displacements show
            no fault without compliances.

    Raises:
        UserError: A fault or a unit is not known; what is measured cannot show it; or the study has
            no [simulation], and the fault needs it.
    """
    named = {"load_size" if name == "load" else name: size for name, size in given.items()}
    found = tuple(_sized(name, size) for name, size in named.items())
    for fault in (FAULTS[one.name] for one in found):
        if fault.in_positions and not positions:
            message = f"{fault.name} shows in positions, and this study measures displacements"
            raise ArgumentError(message, argument="detect")
        judged = fault.by_compliances or not positions
        if judged and study.specification.simulation is None:
            message = "expected a table with compliances, by which faults are judged"
            raise study.error("simulation", message)
        if judged:
            _ = study.compliances  # which says what it lacks
        if fault.by_springs and not study.unknown:
            message = f"{fault.name} shows in springs, and this study has none that is unknown"
            raise ArgumentError(message, argument="detect")
    return found


def _sized(name: str, size: str) -> SizedFault:
    """A fault with the number that is written before its unit."""
    units = {fault.name: fault.unit for fault in FAULTS.values() if fault.unit}
    if name not in units:
        message = f"no fault {name!r}; expected one of {', '.join(units)}"
        raise ArgumentError(message, argument="detect")
    number, unit, rest = size.partition(units[name])
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if not unit or rest or not np.isfinite(value):
        message = f"{name}={size}: expected a number with its unit, {units[name]}"
        raise ArgumentError(message, argument="detect")
    if value == 0:
        raise ArgumentError(f"{name}={size}: expected a size other than 0", argument="detect")
    return SizedFault(name, value, units[name])


@dataclass(frozen=True, eq=False)
class Promised:
    """Readings of a plan without their values, and behind them those of feasible experiments.

    Attributes:
        scene: What faults change.
        noise: The noise of the readings.
        q: Their poses (m, n) [rad or m].
        planned: Number of the plan's readings.
        each: Readings of an experiment.
    """

    scene: Scene
    noise: RowNoise
    q: Array
    planned: int
    each: int

    @classmethod
    def displacements(cls, study: Study, plan: Plan) -> "Promised":
        """Displacements under loads.

        Args:
            study: The study; its [simulation] says how compliant the joints are.
            plan: All experiments.
        """
        first = planned_measurements(study, plan)
        x = sample_feasible(study.space, SIMULATED.candidates, study.specification.seed)
        more = planned_measurements(study, study.space.plan(x, np.ones(len(x), dtype=int)))
        both = _joined(first, more)
        A = both.regressor(study.model)
        scene = Displacements(study.model, both, A, study.compliances, study.known)
        return cls(scene, both.noise, both.q, len(first), len(study.model.instruments))

    @classmethod
    def visits(cls, question: "GeometryQuestion", plan: Plan) -> "Promised":
        """Positions, in the order of the sheet that `edtk template` writes.

        All is to first order about the drawing.

        Args:
            question: The question of the study.
            plan: All visits.
        """
        # Plans of springs need nothing of geometry.
        from edtk.calibration.geometry_plan import visited

        study = question.study
        order = visit_order(study, plan)
        x = sample_feasible(question.space, SIMULATED.visits, study.specification.seed)
        more = question.space.plan(x, np.ones(len(x), dtype=int))
        q = np.concatenate([plan.q[order], more.q])
        wrench = np.concatenate([plan.wrench[order], more.wrench])
        time = np.append(since_first(len(order)), np.ones(len(x)))
        scene = visited(question, q, wrench, time)
        return cls(scene, np.ones(scene.A.shape[:2]), q, len(order), 1)

    @property
    def further(self) -> Indices:
        """Readings (c, each) of each further experiment."""
        return np.arange(self.planned, len(self.q)).reshape(-1, self.each)

    def better(self, best: int) -> Array:
        """The pose of one of these."""
        return np.asarray(self.q[self.further[best, 0]])


def _joined(first: Measurements, second: Measurements) -> Measurements:
    """The rows of both."""

    def both(name: str) -> Any:
        """One column of both; None where there is none."""
        columns = (getattr(first, name), getattr(second, name))
        return None if columns[0] is None else np.concatenate(columns)

    noise = None
    if first.covariance is not None and second.covariance is not None:
        noise = first.covariance.and_then(second.covariance)
    names = ("q", "wrench", "deflection", "sigma", "marker", "sensor", "turn")
    columns = {name: both(name) for name in names}
    return Measurements(**columns, covariance=noise, absolute=first.absolute)


@dataclass(frozen=True, eq=False)
class SizedFamily:
    """A fault of a size, with what it adds to readings.

    Attributes:
        detection: Its name and size, and how likely it is noticed.
        family: The fault.
        size: Its size in SI units.
    """

    detection: Detection
    family: Family
    size: float


Pair = tuple[SizedFamily, SizedFamily]


def detect(
    promised: Promised, faults: Sequence[SizedFault]
) -> tuple[tuple[Detection, ...], tuple[Separation, ...]]:
    """Find how likely faults would be noticed in the readings of a plan, and told apart.

    A fault of size c adds ``D c`` to the readings. Of that the residuals show the part that the
    parameters do not take up, ``(I - QQ') D c``; its squared length in units of sigma is the
    noncentrality of the chi-square statistic that tests for the fault. Of faults of one joint or
    link that counts in which it is hardest to see.

    Args:
        promised: The readings.
        faults: Faults with their sizes.

    Returns:
        Detections in the order of the faults, and separations of each two that are ever noticed.
    """
    known = [_families(promised.scene, fault) for fault in faults]
    shown = _Shown.of(promised, [family for families in known for family in families])
    sized = []
    found = []
    for fault, families in zip(faults, known, strict=True):
        hardest = shown.hardest(fault, families)
        found.append(shown.detection(fault, hardest))
        if hardest is not None:
            sized.append(SizedFamily(found[-1], hardest, fault.si))
    seen = [one for one in sized if not one.detection.never]
    return tuple(found), tuple(shown.separation(pair) for pair in combinations(seen, 2))


def _families(scene: Scene, fault: SizedFault) -> list[Family]:
    """The models of a fault whose size has a unit: joints that slide have others."""
    every = scene.families(FAULTS[fault.name].models)
    found = [
        one for one in every if one.cause == fault.name and one.unit.replace(" ", "") == fault.unit
    ]
    # Of the drifts the one that all readings share, if they can share any.
    return found[:1] if found and not found[0].joint else found


@dataclass(frozen=True, eq=False)
class _Shown:
    """What residuals show of faults, for a plan and with each of some further experiments.

    Attributes:
        promised: The readings.
        families: The faults.
        sizes: Lengths of what a unit of each adds to all readings.
        planned: ``D'(I - QQ')D`` (dims, dims) of all faults together, for SI sizes of one.
        with_one: The same with each further experiment (c, dims, dims).
    """

    promised: Promised
    families: list[Family]
    sizes: list[float]
    planned: Array
    with_one: Array

    @classmethod
    def of(cls, promised: Promised, families: list[Family]) -> "_Shown":
        """Project what faults add on what the parameters do not."""
        scene, noise = promised.scene, promised.noise
        A = whiten_columns(scene.A, noise)
        A = A / np.linalg.norm(A.reshape(-1, A.shape[-1]), axis=0)
        of_each = [whiten_columns(one.derivative_at_zero(scene.k), noise) for one in families]
        D = np.concatenate([np.empty((*A.shape[:2], 0)), *of_each], axis=-1)
        planned = np.arange(promised.planned)
        more = [_left(A, D, np.append(planned, rows)) for rows in promised.further]
        sizes = [float(np.linalg.norm(one)) for one in of_each]
        return cls(promised, families, sizes, _left(A, D, planned), np.array(more))

    def _part(self, family: Family) -> Indices:
        """Where a fault is among the dimensions of all."""
        before = self.families[: self.families.index(family)]
        return sum(other.dims for other in before) + np.arange(family.dims)

    def power(self, gram: Array, family: Family, fault: SizedFault) -> float:
        """The probability that a fault is noticed."""
        part = self._part(family)
        c = np.full(family.dims, fault.si / family.dims**0.5)
        noncentrality = max(float(c @ gram[np.ix_(part, part)] @ c), 0.0)
        threshold = float(chi_square_quantile(1 - FALSE_ALARM, family.dims))
        return noncentral_chi_square_tail(threshold, family.dims, noncentrality)

    def hardest(self, fault: SizedFault, families: list[Family]) -> Family | None:
        """The joint or link in which a fault is hardest to see; None where there is no such fault.

        A link in front of all that bends shows in no displacement, and does no harm in any.
        """
        sizes = [self.sizes[self.families.index(family)] for family in families]
        least = SIMULATED.visible * max(sizes, default=0.0)
        there = [one for one, size in zip(families, sizes, strict=True) if size > least]
        return min(there, key=lambda one: self.power(self.planned, one, fault), default=None)

    def detection(self, fault: SizedFault, family: Family | None) -> Detection:
        """The power of the plan, and of the experiment that adds most to it.

        Compliances take up a load of another size in full, in every plan, where none of them is
        known; and a fault that depends on the sign of a torque is not there where no torque changes
        its sign.
        """
        if family is None:
            return Detection(fault.name, fault.size, fault.unit, FALSE_ALARM, None, FALSE_ALARM)
        power = self.power(self.planned, family, fault)
        with_one = [self.power(gram, family, fault) for gram in self.with_one]
        best = int(np.argmax(with_one))
        return Detection(
            fault.name,
            fault.size,
            fault.unit,
            power,
            self.promised.better(best) if with_one[best] > power else None,
            max(with_one[best], power),
            family.joint,
        )

    def separation(self, pair: Pair) -> Separation:
        """The chance that of two faults the right one is named."""
        places = np.concatenate([self._part(one.family) for one in pair])
        sizes = np.repeat([one.size for one in pair], [one.family.dims for one in pair])

        def of_pair(gram: Array) -> Array:
            return np.asarray(gram[np.ix_(places, places)] * sizes[:, None] * sizes)

        own = of_pair(self.planned)
        right = right_share(own, pair)
        with_one = [right_share(of_pair(gram), pair) for gram in self.with_one]
        best = int(np.argmax(with_one))
        shared = isinstance(self.promised.noise, CorrelatedNoise)
        return Separation(
            (pair[0].detection, pair[1].detection),
            right,
            self.promised.better(best) if with_one[best] > right + SIMULATED.helps else None,
            max(with_one[best], right),
            None if shared else times_to_tell(own, pair),
        )


def _left(A: Array, D: Array, rows: Indices) -> Array:
    """``D'(I - UU')D`` for the column space U of some rows of A."""
    U, s, _ = np.linalg.svd(A[rows].reshape(-1, A.shape[-1]), full_matrices=False)
    U = U[:, s > SIMULATED.dependent * s[0]]
    flat = D[rows].reshape(len(U), D.shape[-1])
    left = flat - U @ (U.T @ flat)
    left = left - U @ (U.T @ left)  # once more: a fault may be taken up but for a millionth
    return np.asarray(left.T @ left)


def right_share(gram: Array, faults: Pair) -> float:
    """Share of residuals of either fault, at chance, in which that fault is the likelier one.

    Residuals r show a fault of size c as ``D c``; ``s = D'r`` is all that they say of it, with mean
    ``G c`` and covariance ``G = D'D``. The fault with the larger marginal likelihood over the sizes
    that it usually has is named, as `rank_faults` has it.

    Args:
        gram: ``G`` (dims, dims) of both faults, one behind the other, for sizes in units of the
            true ones.
        faults: The two faults.
    """
    rng = np.random.default_rng(SIMULATED.seed)
    values, vectors = eigenpairs(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    first = faults[0].family.dims
    parts = (slice(0, first), slice(first, len(gram)))
    shares = []
    for true, part in enumerate(parts):
        c = np.zeros((SIMULATED.draws, len(gram)))
        c[:, part] = _directions(faults[true].family, rng)
        s = c @ gram + rng.standard_normal(c.shape) @ root.T
        both = zip(faults, parts, strict=True)
        gains = [_gain(s[:, one], gram[one, one], fault) for fault, one in both]
        ahead = gains[true] - gains[1 - true]
        # Faults that make the same differ by rounding alone: chance names them.
        shares.append(float(np.where(np.abs(ahead) < SIMULATED.rounding, 0.5, ahead > 0).mean()))
    return sum(shares) / 2


def _directions(family: Family, rng: np.random.Generator) -> Array:
    """Random unit vectors (draws, dims); positive numbers where a size is never negative."""
    c = rng.standard_normal((SIMULATED.draws, family.dims))
    c /= np.linalg.norm(c, axis=1, keepdims=True)
    return np.abs(c) if family.only_positive else c


def _gain(s: Array, gram: Array, fault: SizedFamily) -> Array:
    """Twice the logarithm (draws,) of the marginal likelihood of a fault over that of none.

    Over normal sizes of variance t^2 that is ``s'(I/t^2 + G)^-1 s - log det(I + t^2 G)``; see
    `rarity` for the mixture of such sizes.
    """
    family = fault.family
    values, vectors = eigenpairs(gram)
    values = np.maximum(values, 0.0)[:, None]
    t2 = (family.usual / fault.size * FACTORS) ** 2 / family.dims
    posterior = t2 / (1 + t2 * values)  # (dims, factors)
    gains = (s @ vectors) ** 2 @ posterior - np.log1p(t2 * values).sum(axis=0)
    if family.only_positive:
        gains = gains + 2 * (np.log(2) + log_normal_below(s * np.sqrt(posterior)))
    most = gains.max(axis=1)
    mean = np.exp((gains - most[:, None]) / 2) @ WEIGHTS
    return np.asarray(most + 2 * np.log(mean) - 2 * np.log(family.tries))


def times_to_tell(gram: Array, faults: Pair) -> int | None:
    """How often each experiment has to be measured until the right fault is named."""
    for times in range(1, MOST_TIMES + 1):
        if right_share(times * gram, faults) >= ENOUGH:
            return times
    return None
