"""What measurements tell of the compliances, and of combinations that a study is about."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import criteria
from criteria.linalg.estimable import combination, null_space
from edtk.fit.correlated_noise import whiten_columns
from edtk.fit.identify import Identification
from edtk.fit.least_squares import Whitened
from edtk.fit.measurements import Measurements
from edtk.fit.prior import PriorRows
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.study.evaluate import OpenInterestError
from edtk.study.study import Study
from edtk.system.typing import Array

ROUNDING = 1e-9  # of a column, which others leave of it if they make the same readings


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
    """

    asked: Study
    study: Study
    rigid: tuple[str, ...]
    stands_for: Mapping[str, str]

    @property
    def open(self) -> tuple[str, ...]:
        """Joints whose own compliances are not told."""
        unknown = self.asked.specification.joints.unknown
        return tuple(name for name in unknown if name in (*self.rigid, *self.stands_for))


def told_part(study: Study, data: Measurements) -> ToldPart:
    """Leave out what measurements leave open, where that is not of interest.

    Each open direction N_j has a joint of its own with the factor one, so that ``k - k_j N_j`` has
    none of it and makes the same displacements ``A k``, as ``A N_j = 0``.

    Args:
        study: The study; says what is of interest.
        data: The measurements, which do not tell all compliances.

    Raises:
        OpenInterestError: They do not tell what is of interest.
    """
    names = study.model.parameters
    rows = whiten_columns(data.regressor(study.model), data.noise).reshape(-1, len(names))
    M = rows.T @ rows
    missing = criteria.create("A", interest=study.interest).missing(M, names)
    if missing:
        raise OpenInterestError(tuple(missing))
    scaled, d = null_space(M)
    N = scaled / d[:, None]
    # In echelon form each direction has one entry of one that the others have not.
    single = np.isclose(np.abs(scaled).sum(axis=1), 1.0)
    own = [int(np.flatnonzero(single & np.isclose(column, 1.0))[0]) for column in scaled.T]
    N = N / N[own, range(len(own))]
    joints = study.specification.joints.unknown
    stands_for = {}
    for i in np.flatnonzero(N.any(axis=1)):
        if i not in own:
            factors = np.zeros(len(names))
            factors[i] = 1.0
            factors[own] = -N[i]
            stands_for[joints[i]] = combination(factors, names)
    rigid = tuple(joints[i] for i in own)
    return ToldPart(study, _without(study, rigid), rigid, stands_for)


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


@dataclass(frozen=True, eq=False)
class LeastSquaresInverse:
    """How estimates change with measurements: ``dk = A+ change``.

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
        noise = data.noise
        if prior is not None:
            noise = prior.noise_below(noise, A.shape[1])
            A = prior.below(A)
        return cls(Whitened.of(A, noise, model.parameters), prior, len(data))

    def solve(self, change: Array) -> Array:
        """Changes (..., p) of the estimates by changes (..., m, rows) of measurements."""
        below = change if self.prior is None else self.prior.zeros_below(change)
        return self.whitened.solve(below)

    def told(self, column: Array) -> float:
        """With which std a further parameter of this column (m, rows) would be told; may be inf."""
        below = column if self.prior is None else self.prior.zeros_below(column)
        left = float(np.linalg.norm(self.whitened.residual(below)))
        whole = float(np.linalg.norm(self.whitened.in_sigma(below)))
        return 1 / left if left > ROUNDING * whole else np.inf

    def shifts(self, changes: Array) -> Array:
        """Shifts (p, c) of the estimates by c changes (m, rows, c) of measurements."""
        return self.solve(np.moveaxis(changes, -1, 0)).T

    def by_reading(self) -> Array:
        """``W' Q`` (m, rows, p): what a unit of each measured coordinate adds to ``Q' W dp``."""
        return self.whitened.by_reading()[: self.count]
