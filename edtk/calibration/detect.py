"""The power of a plan to notice a fault, to tell two apart, and which experiment would help."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from edtk.calibration.planned import planned_measurements
from edtk.design.candidate_source import sample_feasible
from edtk.design.detection import ENOUGH, LEVEL, Detection, Separation
from edtk.design.plan import Plan
from edtk.findings.causes.family import Family, families_with_known
from edtk.findings.causes.rarity import FACTORS, WEIGHTS
from edtk.fit.correlated_noise import RowNoise
from edtk.fit.distributions import chi_square_quantile, log_normal_below, noncentral_chi_square_tail
from edtk.fit.least_squares import Whitened
from edtk.fit.measurements import Measurements
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices

CANDIDATES = 300  # poses among which one more experiment is looked for
DRAWS = 1000  # simulated residuals of each fault: shares are right within 2 %
SEED = 0
MOST_TIMES = 100  # repetitions that anybody would make
ROUNDING = 1e-6  # of twice a logarithm
SHOWN = 1e-6  # of what a fault changes in the joint where it changes most: below it is rounding
HELPS = 0.02  # share by which an experiment has to help to be more than chance
# Unit of the size of each fault; those of a joint mean the joint in which it is hardest to see.
FAULTS = {
    "load_size": "%",
    "load_direction": "deg",
    "tool_x": "mm",
    "tool_y": "mm",
    "tool_z": "mm",
    "frame_rotation": "deg",
    "drift": "mm",
    "torque_sign": "%",
    "backlash": "deg",
    "joint_zero": "deg",
    "friction": "Nm",
    "link_length": "mm",
}


def with_candidates(study: Study, plan: Plan) -> tuple[int, Measurements]:
    """Measurements without their values: the plan's, and behind them those of feasible experiments.

    Args:
        study: The study.
        plan: All experiments.

    Returns:
        The number of the plan's rows, and all rows.
    """
    first = planned_measurements(study, plan)
    x = sample_feasible(study.space, CANDIDATES, study.specification.seed)
    more = planned_measurements(study, study.space.plan(x, np.ones(len(x), dtype=int)))
    return len(first), _joined(first, more)


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
    """A fault of a size, with what it adds to the measurements.

    Attributes:
        detection: Its name and size, and how likely it is noticed.
        family: The fault.
        size: Its size in SI units.
        D: What it adds (m, rows, dims), by a unit of the size in each of its parameters.
    """

    detection: Detection
    family: Family
    size: float
    D: Array


def separations(
    study: Study, plan: Plan, detections: Sequence[Detection]
) -> tuple[Separation, ...]:
    """Find how likely each two of some faults would be told apart by the measurements of a plan.

    Args:
        study: The study; its [simulation] says how compliant the joints are.
        plan: All experiments.
        detections: Faults with their sizes; those that are never noticed make no pair.

    Returns:
        A separation for each two faults.
    """
    seen = [detection for detection in detections if not detection.never]
    if len(seen) < 2:
        return ()
    m, both = with_candidates(study, plan)
    A = both.regressor(study.model)
    faults = _faults(study, both, A, seen)
    more = np.arange(m, len(both)).reshape(-1, len(study.model.instruments))
    planned = np.arange(m)

    def gram(rows: Indices, pair: tuple[SizedFamily, SizedFamily]) -> Array:
        """What residuals of some rows show of two faults, and of what both have in common."""
        whitened = Whitened.of(A[rows], both.noise[rows], study.model.parameters)
        columns = np.concatenate([fault.D[rows] for fault in pair], axis=-1)
        left = [whitened.residual(column).ravel() for column in np.moveaxis(columns, -1, 0)]
        return np.array(left) @ np.array(left).T

    found = []
    for pair in combinations(faults, 2):
        own = gram(planned, pair)
        right = right_share(own, pair)
        with_one = [right_share(gram(np.append(planned, one), pair), pair) for one in more]
        best = int(np.argmax(with_one))
        helps = with_one[best] > right + HELPS
        found.append(
            Separation(
                (pair[0].detection, pair[1].detection),
                right,
                both.q[more[best, 0]] if helps else None,
                max(with_one[best], right),
                None if both.covariance is not None else times_to_tell(own, pair),
            )
        )
    return tuple(found)


def _faults(
    study: Study, data: Measurements, A: Array, detections: Sequence[Detection]
) -> list[SizedFamily]:
    """The faults with what they add to the measurements; of joints that in which it is hardest."""
    k = study.compliances
    known = list(families_with_known(study.model, data, A, k, study.known))
    found = []
    for one in detections:
        family = next(
            family
            for family in known
            if family.joint == one.joint and _is(family, one.fault, one.unit)
        )
        size = one.size * UNITS[one.unit]
        found.append(SizedFamily(one, family, size, size * family.derivative_at_zero(k)))
    return found


def _is(family: Family, name: str, unit: str) -> bool:
    """Whether a family is that of a fault whose size has a unit: joints that slide have others."""
    return family.cause == name and family.unit.replace(" ", "") == unit


def right_share(gram: Array, faults: tuple[SizedFamily, SizedFamily]) -> float:
    """Share of residuals of either fault, at chance, in which that fault is the likelier one.

    Residuals r show a fault of size c as ``D c``; ``s = D'r`` is all that they say of it, with mean
    ``G c`` and covariance ``G = D'D``. The fault with the larger marginal likelihood over the sizes
    that it usually has is named, as `rank_faults` has it.

    Args:
        gram: ``G`` (dims, dims) of both faults, one behind the other, for sizes in units of the
            true ones.
        faults: The two faults.
    """
    rng = np.random.default_rng(SEED)
    values, vectors = np.linalg.eigh(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    first = faults[0].family.dims
    parts = (slice(0, first), slice(first, len(gram)))
    shares = []
    for true, part in enumerate(parts):
        c = np.zeros((DRAWS, len(gram)))
        c[:, part] = _directions(faults[true].family, rng)
        s = c @ gram + rng.standard_normal(c.shape) @ root.T
        both = zip(faults, parts, strict=True)
        gains = [_gain(s[:, one], gram[one, one], fault) for fault, one in both]
        ahead = gains[true] - gains[1 - true]
        # Faults that make the same differ by rounding alone: chance names them.
        shares.append(float(np.where(np.abs(ahead) < ROUNDING, 0.5, ahead > 0).mean()))
    return sum(shares) / 2


def _directions(family: Family, rng: np.random.Generator) -> Array:
    """Random unit vectors (DRAWS, dims); positive numbers where a size is never negative."""
    c = rng.standard_normal((DRAWS, family.dims))
    c /= np.linalg.norm(c, axis=1, keepdims=True)
    return np.abs(c) if family.only_positive else c


def _gain(s: Array, gram: Array, fault: SizedFamily) -> Array:
    """Twice the logarithm (DRAWS,) of the marginal likelihood of a fault over that of none.

    Over normal sizes of variance t^2 that is ``s'(I/t^2 + G)^-1 s - log det(I + t^2 G)``; see
    `rarity` for the mixture of such sizes.
    """
    family = fault.family
    values, vectors = np.linalg.eigh(gram)
    values = np.maximum(values, 0.0)[:, None]
    t2 = (family.usual / fault.size * FACTORS) ** 2 / family.dims
    posterior = t2 / (1 + t2 * values)  # (dims, factors)
    gains = (s @ vectors) ** 2 @ posterior - np.log1p(t2 * values).sum(axis=0)
    if family.only_positive:
        gains = gains + 2 * (np.log(2) + log_normal_below(s * np.sqrt(posterior)))
    most = gains.max(axis=1)
    mean = np.exp((gains - most[:, None]) / 2) @ WEIGHTS
    return np.asarray(most + 2 * np.log(mean) - 2 * np.log(family.tries))


def times_to_tell(gram: Array, faults: tuple[SizedFamily, SizedFamily]) -> int | None:
    """How often each experiment has to be measured until the right fault is named."""
    for times in range(1, MOST_TIMES + 1):
        if right_share(times * gram, faults) >= ENOUGH:
            return times
    return None


UNITS = {"mm": 1e-3, "deg": np.pi / 180, "%": 1e-2, "Nm": 1.0}


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


def sized_faults(
    study: Study,
    given: Mapping[str, str],
    units: Mapping[str, str] = FAULTS,
    by_springs: Collection[str] | None = None,
) -> tuple[SizedFault, ...]:
    """Read sizes of faults.

    Args:
        study: The study, whose [simulation] faults are judged by.
        given: Sizes with units, like "5mm", "2deg" or "3%", by the name of the fault; "load" is
            short for "load_size".
        units: Units of the faults that there are.
        by_springs: Those that are judged by compliances; default to all.

    Raises:
        UserError: The study has no [simulation]; a fault or a unit is not known.
    """
    found = tuple(
        _sized("load_size" if name == "load" else name, size, units) for name, size in given.items()
    )
    judged = any(by_springs is None or fault.name in by_springs for fault in found)
    if judged and study.specification.simulation is None:
        message = "expected a table with compliances, by which faults are judged"
        raise study.error("simulation", message)
    return found


def detect(study: Study, plan: Plan, faults: tuple[SizedFault, ...]) -> tuple[Detection, ...]:
    """Find how likely faults of a calibration would be noticed in the measurements of a plan.

    A fault of size c adds ``D c`` to the measurements. Of that the residuals show the part that the
    compliances do not take up, ``(I - QQ') D c``; its squared length in units of sigma is the
    noncentrality of the chi-square statistic that tests for the fault.

    Args:
        study: The study; its [simulation] says how compliant the joints are.
        plan: All experiments.
        faults: Faults with their sizes.

    Returns:
        The detections in the order of the faults.

    Raises:
        SingularPlanError: The plan leaves a compliance open.
    """
    if not faults:
        return ()
    m, both = with_candidates(study, plan)
    A = both.regressor(study.model)
    known = tuple(families_with_known(study.model, both, A, study.compliances, study.known))
    return tuple(_detection(study, m, both, A, known, fault) for fault in faults)


def _detection(
    study: Study,
    m: int,
    both: Measurements,
    A: Array,
    known: tuple[Family, ...],
    fault: SizedFault,
) -> Detection:
    """The power of the first m rows, and with each of the experiments behind them."""
    named = [family for family in known if _is(family, fault.name, fault.unit)]
    if named and not named[0].joint:
        named = named[:1]  # of the drifts the one that all readings share
    if not named:
        # Compliances take up a load of another size in full, in every plan, where none of them is
        # known; and a fault that depends on the sign of a torque is not there where no torque
        # changes its sign.
        return Detection(fault.name, fault.size, fault.unit, LEVEL, None, LEVEL)
    size = fault.size * UNITS[fault.unit]

    def power(rows: Indices, family: Family, D: Array) -> float:
        """Power of some rows against one fault."""
        return _power(A[rows], D[rows], both.noise[rows], study.model.parameters, family.dims)

    changes = [
        family.derivative_at_zero(study.compliances) @ np.full(family.dims, size / family.dims**0.5)
        for family in named
    ]
    # A link in front of all that bends shows in no displacement, and does no harm in any.
    sizes = np.array([np.linalg.norm(change) for change in changes])
    shown = np.flatnonzero(sizes > SHOWN * sizes.max())
    named, changes = [named[i] for i in shown], [changes[i] for i in shown]
    planned = np.arange(m)
    powers = [power(planned, *pair) for pair in zip(named, changes, strict=True)]
    hardest = int(np.argmin(powers))
    more = np.arange(m, len(both)).reshape(-1, len(study.model.instruments))  # an experiment each
    with_one = [power(np.append(planned, one), named[hardest], changes[hardest]) for one in more]
    best = int(np.argmax(with_one))
    helps = with_one[best] > powers[hardest]
    return Detection(
        fault.name,
        fault.size,
        fault.unit,
        powers[hardest],
        both.q[more[best, 0]] if helps else None,
        max(with_one[best], powers[hardest]),
        named[hardest].joint,
    )


def _power(A: Array, D: Array, sigma: RowNoise, parameters: tuple[str, ...], dims: int) -> float:
    """Probability that a change D (m, rows) of the measurements is noticed."""
    whitened = Whitened.of(A, sigma, parameters)
    noncentrality = float((whitened.residual(D) ** 2).sum())
    threshold = float(chi_square_quantile(1 - LEVEL, dims))
    return noncentral_chi_square_tail(threshold, dims, noncentrality)


def _sized(name: str, size: str, units: Mapping[str, str]) -> SizedFault:
    """A fault with the number that is written before its unit."""
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
