"""What weights and multipliers prove, judged as if an enemy had written them."""

import numpy as np

from criteria import Relaxable
from criteria.linalg.inverse import EPS
from criteria.linalg.spectrum import least_scaled_eigenvalue
from edtk.design.conditioning import Conditioning
from edtk.design.problem import SYMMETRIC, Problem
from edtk.design.problems import Whitened, absorb_prior
from edtk.design.relaxation.proof import InnerProof, normalised
from edtk.design.relaxation.setting import OrderOne, Setting
from edtk.design.relaxation.weight_limits import WeightLimits
from edtk.system.typing import Array

SUM = 1e-9  # difference of a sum of weights from one that is rounding
# Negative eigenvalue at unit diagonal that may be rounding. The multiplier is lifted by as much, so
# that nothing is gained by it.
NEGATIVE = 1e-9


def certify(
    problem: Problem,
    criterion: Relaxable,
    weights: Array,
    multipliers: Array,
    inner: InnerProof | None = None,
    limits: WeightLimits | None = None,
    experiments: float = 1.0,
) -> tuple[float, float]:
    """Compute the cost of weights and the bound of multipliers, of which nothing is believed.

    A multiplier proves a bound whatever it is, if it is positive semidefinite where the criterion
    is monotone. One that is not proves nothing. One that is but for rounding is lifted until it is;
    of other criteria sensitivities are rounded up, since their terms may cancel.

    Args:
        problem: The candidates (n).
        criterion: What the weights minimise.
        weights: Weights (n,).
        multipliers: Multipliers (r, p, p).
        inner: The same multipliers with more digits; what differs from `multipliers` is ignored.
        limits: What counts, of which weights are shares, must obey; None for no limits.
        experiments: Their sum, where limits leave it free.

    Returns:
        Cost, and a lower bound on the cost of all weights; zero where nothing is proved.

    Raises:
        ValueError: Weights or multipliers are not finite, of a wrong shape or not symmetric, or
            weights are negative or have a sum that is not one.
    """
    plain, base = absorb_prior(problem, criterion)
    assert isinstance(base, Relaxable)
    w = _weights(weights, plain.n)
    Z = _multipliers(multipliers, plain.p)
    sized = OrderOne.of(plain)
    plain = sized.problem
    # The cost is computed in parameters that nobody but the candidates has chosen.
    setting = Setting.of(plain, base)
    own = w if limits is None else w * (experiments / limits.unit)
    cost = float(setting.criterion.cost(setting.problem.information(own)))
    exact = _exact(plain, base, Z, inner)
    if exact is not None and inner is not None:
        setting = exact
        Z = inner.Z
    else:
        own_multipliers = setting.inward(Z)
        assert own_multipliers is not None
        Z = own_multipliers
    near = own if np.isfinite(cost) else np.full(plain.n, 1.0 / plain.n)
    bound = _bound(setting, Z, near, limits)
    return sized.cost(cost, base), sized.cost(bound, base)


def _bound(setting: Setting, Z: Array, weights: Array, limits: WeightLimits | None) -> float:
    """The bound that multipliers (r, p, p) prove near weights (n,), less its rounding."""
    problem = setting.problem
    criterion = setting.criterion
    judged = normalised(problem, criterion)
    # A multiplier proves the same at any length; those far from one would leave doubles on the way.
    length = np.abs(Z).max(axis=(1, 2))
    Z = Z[length > 0] / length[length > 0, None, None]
    if criterion.monotone:
        Z = semidefinite(Z)
        each = judged.sensitivities(Z)
    else:
        each = judged.sensitivities(Z) + _cancelled(judged, Z)
    t = each.max(axis=-1) if limits is None else limits.largest_of(each)
    if not len(Z):
        return 0.0
    found = float(criterion.lower_bound(Z, t, problem.information(weights)))
    _, error = setting.errors(weights, Z)
    lowered = found * (1 - error)
    return max(lowered, 0.0) if np.isfinite(lowered) else 0.0


def semidefinite(Z: Array) -> Array:
    """Those of multipliers (r, p, p) that are positive semidefinite but for rounding, lifted to be.

    With ``Z + (e + 2 p eps) diag(Z)``, e the largest negative eigenvalue at unit diagonal.
    """
    p = Z.shape[-1]
    least = least_scaled_eigenvalue(Z)
    proves = least >= -NEGATIVE * p
    lift = 2 * p * EPS + np.maximum(-least[proves], 0.0)
    own = np.diagonal(Z[proves], axis1=1, axis2=2)
    return np.asarray(Z[proves] + (lift[:, None] * own)[:, :, None] * np.eye(p))


def _cancelled(problem: Problem, Z: Array) -> Array:
    """Bounds (r, n) on the rounding of sensitivities ``<Z, M_i>`` whose terms may cancel.

    It is below ``16 p eps`` times ``|Z| trace(M_i)``, and times ``(sum_a s_a (M_i)_aa^(1/2))^2``
    for any s with ``|Z_ab| <= s_a s_b``, which does not depend on the units of the parameters.
    """
    size = np.abs(np.linalg.eigvalsh(Z)).max(axis=-1)
    s = np.sqrt(np.abs(np.diagonal(Z, axis1=1, axis2=2)))
    products = s[:, :, None] * s[:, None]
    ratio = np.divide(np.abs(Z), products, out=np.full(Z.shape, np.inf), where=products > 0)
    most = ratio.max(axis=(1, 2))
    roots = np.sqrt(np.maximum(problem.diagonals(), 0.0))
    of_entries = np.square(s @ roots.T)
    told = np.isfinite(most)
    of_entries = np.where(told, most, 1.0)[:, None] * of_entries
    whole = size[:, None] * problem.traces()
    least = np.where(told[:, None], np.minimum(of_entries, whole), whole)
    return np.asarray(16 * problem.p * EPS * least)


def _exact(
    problem: Problem, criterion: Relaxable, Z: Array, inner: InnerProof | None
) -> Setting | None:
    """The setting of multipliers with all digits; None where they are not those that are stated."""
    if inner is None:
        return None
    p = problem.p
    T = np.asarray(inner.T, dtype=float)
    if T.shape != (p, p) or np.shape(inner.Z) != Z.shape:
        return None
    if not (np.isfinite(T).all() and np.isfinite(inner.Z).all()):
        return None
    if not np.array_equal(inner.outward(), Z) or np.linalg.matrix_rank(T, 0.0) < p:
        return None
    try:
        found = Setting.by(problem, criterion, Whitened.by(problem, T))
    except np.linalg.LinAlgError:
        return None  # a factorization calls it singular, which singular values do not
    return found if found is not None and _whitens(problem, found.problem) else None


def _whitens(given: Problem, white: Problem) -> bool:
    """Whether a change of parameters is good for what it is meant, and leaves open nothing more.

    Any other would hide rounding in terms that cancel.
    """
    found = Conditioning.of_information(white.mean)
    return bool(found.is_well and found.is_open.sum() == given.conditioning.is_open.sum())


def _weights(weights: Array, n: int) -> Array:
    """Weights (n,) of a design.

    Raises:
        ValueError: They are none.
    """
    w = np.asarray(weights, dtype=float)
    if w.shape != (n,):
        raise ValueError(f"weights of shape {w.shape}; expected ({n},), one for each candidate")
    if not np.isfinite(w).all() or (w < 0).any():
        raise ValueError("weights must be finite and not negative")
    if abs(w.sum() - 1) > SUM:
        raise ValueError(f"weights have the sum {w.sum():.9g}; expected 1")
    return w


def _multipliers(multipliers: Array, p: int) -> Array:
    """Symmetric multipliers (r, p, p).

    Raises:
        ValueError: They are none.
    """
    Z = np.asarray(multipliers, dtype=float)
    if Z.ndim != 3 or Z.shape[1:] != (p, p) or not len(Z):
        raise ValueError(f"multipliers of shape {Z.shape}; expected (r, {p}, {p}), at least one")
    if not np.isfinite(Z).all():
        raise ValueError("multipliers must be finite")
    transposed = np.swapaxes(Z, 1, 2)
    size = np.abs(Z).max(axis=(1, 2), keepdims=True)
    if (np.abs(Z - transposed) > SYMMETRIC * size).any():
        raise ValueError("multipliers must be symmetric")
    return 0.5 * (Z + transposed)


def inside(
    problem: Problem, criterion: Relaxable, multipliers: Array, inner: InnerProof | None
) -> tuple[Problem, Relaxable, Array]:
    """The problem, the criterion and the multipliers (r, p, p) with all their digits.

    What else a certificate holds does not depend on the parameters; the digits from which it
    follows do. Nor does it depend on the length of a multiplier, whose squares may leave doubles.
    """
    plain, base = absorb_prior(problem, criterion)
    assert isinstance(base, Relaxable)
    plain = OrderOne.of(plain).problem
    setting = _exact(plain, base, multipliers, inner)
    Z = multipliers
    if setting is not None and inner is not None:
        plain, base, Z = setting.problem, setting.criterion, inner.Z
    length = np.abs(Z).max(axis=(1, 2), keepdims=True)
    return plain, base, Z / np.where(length > 0, length, 1.0)
