"""The chance that a plan tells two faults apart, and the experiment that would add most to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from edtk.calibration.causes.families_with_known import families_with_known
from edtk.calibration.causes.family import Family
from edtk.calibration.causes.rarity import FACTORS, WEIGHTS
from edtk.calibration.detect import UNITS
from edtk.calibration.with_candidates import with_candidates
from edtk.design.detection import Detection
from edtk.design.plan import Plan
from edtk.design.separation import ENOUGH, Separation
from edtk.inference.distributions import log_normal_below
from edtk.inference.least_squares import Whitened
from edtk.inference.measurements import Measurements
from edtk.study.study import Study
from edtk.system.typing import Array, Indices

DRAWS = 1000  # simulated residuals of each fault: shares are right within 2 %
SEED = 0
MOST_TIMES = 100  # repetitions that anybody would make
ROUNDING = 1e-6  # of twice a logarithm
HELPS = 0.02  # share by which an experiment has to help to be more than chance


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
            family for family in known if (family.cause, family.joint) == (one.fault, one.joint)
        )
        size = one.size * UNITS[one.unit]
        found.append(SizedFamily(one, family, size, size * family.derivative_at_zero(k)))
    return found


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
