"""What measurements tell of the compliances, and of combinations that a study is about."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import criteria
from criteria.linalg.estimable import SMALL, combination
from edtk.findings.fitted_data import HowFitted
from edtk.findings.nonlinear_part import known_part
from edtk.fit.correlated_noise import RowNoise, whiten_columns
from edtk.fit.equilibrium import LinearisedData, linearise
from edtk.fit.identify import Identification, identify
from edtk.fit.least_squares import SingularPlanError, Whitened
from edtk.fit.measurements import Measurements
from edtk.fit.prior import PriorRows
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import NoEquilibriumError
from edtk.measure.parameters import identifiable
from edtk.measure.task import all_compliances
from edtk.study.evaluate import OpenInterestError
from edtk.study.study import Study
from edtk.study.study_model import springs_of
from edtk.system.typing import Array

LEAST_COMPLIANCE = 1e-15  # of a joint that is softer than rigid [rad/(N m)]
TAKEN_UP = 1e-9  # of a column, which others leave of it if they make the same readings


@dataclass(frozen=True, eq=False)
class ToldPart:
    """A study of as many compliances as measurements tell.

    Of each open direction one joint counts as rigid. What is of interest is estimable, and so the
    same whichever joint that is; an estimate that is open by itself stands for a combination.

    Attributes:
        asked: The study as it was given.
        study: The same, of the joints whose columns are independent.
        rigid: Joints that count as rigid instead.
        stands_for: What the estimates of other open joints are of, in words, by joint:
            "k2 + 0.5 k3".
        words: A sentence for each of the joints that count as rigid.
    """

    asked: Study
    study: Study
    rigid: tuple[str, ...]
    stands_for: Mapping[str, str]
    words: tuple[str, ...]

    @property
    def open(self) -> tuple[str, ...]:
        """Joints whose own compliances are not told."""
        unknown = self.asked.specification.joints.unknown
        return tuple(name for name in unknown if name in (*self.rigid, *self.stands_for))


def told_part(study: Study, data: Measurements) -> ToldPart | None:
    """Leave out what measurements leave open, where that is not of interest.

    A minimal set of compliances makes all displacements that measurements see, see `identifiable`:
    with the shares S of the others in it, ``A k = A_kept (k_kept + S k_left)``.

    Args:
        study: The study, which may say what is of interest.
        data: The measurements, which do not tell all compliances.

    Returns:
        The part; None where there are fewer coordinates than compliances, or none are told.

    Raises:
        OpenInterestError: They do not tell what is of interest.
    """
    names = study.model.parameters
    rows = whiten_columns(data.regressor(study.model), data.noise).reshape(-1, len(names))
    if study.interest is not None:
        missing = criteria.create("A", interest=study.interest).missing(rows.T @ rows, names)
        if missing:
            raise OpenInterestError(tuple(missing))
    elif len(rows) < len(names):
        return None
    joints = study.specification.joints.unknown
    found = identifiable(rows, springs_of(study))
    if not len(found.kept) or not len(found.left):
        return None
    length = np.linalg.norm(rows, axis=0)
    # Shares of columns of unit length can be compared: rounding leaves none of size.
    size = np.abs(found.shares) * length[found.kept, None]
    shares = np.where(size > SMALL * length[found.left], found.shares, 0.0)
    stands_for = {}
    for own, kept in zip(shares, found.kept.tolist(), strict=True):
        if own.any():
            factors = np.zeros(len(names))
            factors[kept] = 1.0
            factors[found.left] = own
            stands_for[joints[kept]] = combination(factors, names)
    rigid = tuple(joints[i] for i in found.left)
    return ToldPart(study, _without(study, rigid), rigid, stands_for, found.words)


def _without(study: Study, rigid: tuple[str, ...]) -> Study:
    """The study in which some unknown joints count as rigid; it asks for no posterior."""
    keys: dict[str, Any] = study.to_dict()
    unknown = [name for name in keys["joints"]["unknown"] if name not in rigid]
    changed = {"joints": keys["joints"] | {"unknown": unknown}, "interest": None, "prior": None}
    if study.specification.simulation is not None:
        given = study.specification.simulation.compliance_rad_per_Nm
        kept = {name: value for name, value in given.items() if name not in rigid}
        changed["simulation"] = {"compliance_rad_per_Nm": kept}
    return study.replace(**changed)


def interest_estimates(
    asked: Study, fitted: Study, fit: Identification, combined: bool
) -> dict[str, tuple[float, float]]:
    """Find ``K'k`` and the roots of the diagonal of ``K' cov(k) K``.

    Args:
        asked: The study, which says what is of interest.
        fitted: The same, perhaps of fewer unknown joints: the others count as rigid.
        fit: The fit of these.
        combined: Whether some estimates are of combinations, which may be negative.

    Returns:
        Estimate and standard deviation of each combination, by its name; none where the study has
        no table `interest`.
    """
    if asked.interest is None:
        return {}
    joints = asked.specification.joints.unknown
    K = asked.interest[[joints.index(name) for name in fitted.specification.joints.unknown]]
    std = np.sqrt(np.einsum("ps,pq,qs->s", K, fit.covariance, K))
    k = fit.unbounded if combined else fit.k
    pairs = zip((k @ K).tolist(), std.tolist(), strict=True)
    return dict(zip(asked.interest_names, pairs, strict=True))


def measured_known(study: Study, data: Measurements, how: HowFitted) -> Study:
    """The study with its known compliances as the measurements tell them, too.

    A known compliance v with the standard deviation s is a parameter of which ``N(v, s^2)`` is
    known beforehand. All are fitted together, with the rows ``k_j / s = v / s`` below those of the
    measurements; the others are then least squares given these, as in the joint fit.

    Args:
        study: The study; a known compliance without a standard deviation stays as it is.
        data: The measurements.
        how: How they are fitted; by the loaded equilibrium about the estimate of the linear model,
            where not by that.

    Returns:
        The same study with other values; itself where nothing is uncertain, or where the
        measurements leave an unknown compliance open.
    """
    joint = study.with_known
    names = joint.specification.joints.unknown[len(study.unknown) :]
    if not names:
        return study
    known = study.specification.joints.known
    std = np.array([known[name].deviation for name in names])
    value = np.array([known[name].value for name in names])
    before = PriorRows(np.pad(np.diag(1 / std), ((0, 0), (len(study.unknown), 0))), value / std)
    noise = before.noise_below(data.noise, data.deflection.shape[1])

    def fit(A: Array, measured: Array) -> Array:
        rows, values = before.below(A), before.measured_below(measured)
        return identify(rows, values, noise, joint.model.parameters, how.robust).unbounded

    try:
        k = fit(data.regressor(joint.model), data.deflection - known_part(joint, data))
        if not how.linear:
            every = all_compliances(joint.model, np.maximum(k, 0.0), joint.known)
            seen = LinearisedData.of(data, linearise(joint.model, data, every))
            k = fit(seen.A, seen.measured)
    except SingularPlanError:
        return study
    except NoEquilibriumError:
        pass  # Such compliances are wrong in any case, which the residuals tell.
    found = zip(names, np.maximum(k[-len(names) :], LEAST_COMPLIANCE).tolist(), strict=True)
    values = {name: {"value": one, "std": known[name].deviation} for name, one in found}
    joints = study.to_dict()["joints"]
    told = joints["known_rad_per_Nm"] | values
    return study.replace(joints=joints | {"known_rad_per_Nm": told})


class Inverse(ABC):
    """How estimates change with measurements: ``dk = A+ change``."""

    @property
    @abstractmethod
    def p(self) -> int:
        """Number of estimates."""

    @abstractmethod
    def solve(self, change: Array) -> Array:
        """Changes (..., p) of the estimates by changes (..., m, rows) of measurements."""

    @abstractmethod
    def left_of(self, column: Array) -> Array:
        """What estimates leave of a column (m, rows), in units of the noise; zero of rounding."""

    @abstractmethod
    def in_sigma(self, change: Array) -> Array:
        """A change (m, rows) of measurements in units of the noise."""

    def told(self, column: Array) -> float:
        """With which std a further parameter of this column (m, rows) would be told; may be inf."""
        left = float(np.linalg.norm(self.left_of(column)))
        return 1 / left if left > 0 else np.inf

    def shifts(self, changes: Array) -> Array:
        """Shifts (p, c) of the estimates by c changes (m, rows, c) of measurements."""
        return self.solve(np.moveaxis(changes, -1, 0)).T


@dataclass(frozen=True, eq=False)
class LeastSquaresInverse(Inverse):
    """That of rows with their noise, and of a prior below them.

    Attributes:
        whitened: The factored regressors of the measurements, and of a prior below them.
        prior: The prior; None for none.
        count: Number of measurements.
    """

    whitened: Whitened
    prior: PriorRows | None
    count: int

    @classmethod
    def of(
        cls, model: ElastostaticModel, data: Measurements, A: Array, prior: PriorRows | None = None
    ) -> "LeastSquaresInverse":
        """Factor the regressors A (m, rows, p) of measurements.

        Raises:
            SingularPlanError: Measurements and prior leave a parameter open.
        """
        return cls.of_rows(A, data.noise, model.parameters, prior)

    @classmethod
    def of_rows(
        cls, A: Array, noise: RowNoise, names: tuple[str, ...], prior: PriorRows | None = None
    ) -> "LeastSquaresInverse":
        """The same of rows A (m, rows, p) with their noise, and of parameters (p,) by name."""
        count = len(A)
        if prior is not None:
            noise = prior.noise_below(noise, A.shape[1])
            A = prior.below(A)
        return cls(Whitened.of(A, noise, names), prior, count)

    @property
    def p(self) -> int:
        """Number of compliances."""
        return int(self.whitened.R.shape[-1])

    def solve(self, change: Array) -> Array:
        """The least-squares solutions."""
        below = change if self.prior is None else self.prior.zeros_below(change)
        return self.whitened.solve(below)

    def left_of(self, column: Array) -> Array:
        """The residual of the column."""
        below = column if self.prior is None else self.prior.zeros_below(column)
        left = self.whitened.residual(below)
        whole = float(np.linalg.norm(self.whitened.in_sigma(below)))
        return left if float(np.linalg.norm(left)) > TAKEN_UP * whole else np.zeros_like(left)

    def in_sigma(self, change: Array) -> Array:
        """With zeros below for the prior."""
        below = change if self.prior is None else self.prior.zeros_below(change)
        return self.whitened.in_sigma(below)

    def by_reading(self) -> Array:
        """``W' Q`` (m, rows, p): what a unit of each measured coordinate adds to ``Q' W dp``."""
        return self.whitened.by_reading()[: self.count]
