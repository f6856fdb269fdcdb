"""What a stored relaxation proves, judged as if an enemy had written it."""

import numpy as np

from criteria import Relaxable
from criteria.linalg.is_semidefinite import least_scaled_eigenvalue
from edtk.design.absorb_prior import absorb_prior
from edtk.design.conditioning import Conditioning
from edtk.design.problem import Problem
from edtk.design.relaxation.inner_proof import InnerProof
from edtk.design.relaxation.normalised import normalised
from edtk.design.relaxation.order_one import OrderOne
from edtk.design.relaxation.setting import Setting
from edtk.design.whitened import Whitened
from edtk.system.typing import Array

EPS = float(np.finfo(float).eps)
SUM = 1e-9  # difference of a sum of weights from one that is rounding
SYMMETRIC = 1e-9  # difference across the diagonal, at unit diagonal, that is rounding
# Negative eigenvalue at unit diagonal that may be rounding. The multiplier is lifted by as much, so
# that nothing is gained by it.
NEGATIVE = 1e-9


def certify(
    problem: Problem,
    criterion: Relaxable,
    weights: Array,
    multipliers: Array,
    inner: InnerProof | None = None,
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
    cost = float(setting.criterion.cost(setting.problem.information(w)))
    exact = _exact(plain, base, Z, inner)
    if exact is not None and inner is not None:
        setting = exact
        Z = inner.Z
    else:
        inside = setting.inward(Z)
        assert inside is not None
        Z = inside
    near = w if np.isfinite(cost) else np.full(plain.n, 1.0 / plain.n)
    bound = _bound(setting, Z, near)
    return sized.cost(cost, base), sized.cost(bound, base)


def _bound(setting: Setting, Z: Array, weights: Array) -> float:
    """The bound that multipliers (r, p, p) prove near weights (n,), less its rounding."""
    problem = setting.problem
    criterion = setting.criterion
    judged = normalised(problem, criterion)
    # A multiplier proves the same at any length; those far from one would leave doubles on the way.
    length = np.abs(Z).max(axis=(1, 2))
    Z = Z[length > 0] / length[length > 0, None, None]
    if criterion.monotone:
        least = least_scaled_eigenvalue(Z)
        proves = least >= -NEGATIVE * problem.p
        lift = 2 * problem.p * EPS + np.maximum(-least[proves], 0.0)
        own = np.diagonal(Z[proves], axis1=1, axis2=2)
        Z = Z[proves] + (lift[:, None] * own)[:, :, None] * np.eye(problem.p)
        t = judged.sensitivities(Z).max(axis=-1)
    else:
        t = (judged.sensitivities(Z) + _cancelled(judged, Z)).max(axis=-1)
    if not len(Z):
        return 0.0
    found = float(criterion.lower_bound(Z, t, problem.information(weights)))
    _, error = setting.errors(weights, Z)
    lowered = found * (1 - error)
    return max(lowered, 0.0) if np.isfinite(lowered) else 0.0


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
    found = Setting.by(problem, criterion, Whitened.by(problem, T))
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
