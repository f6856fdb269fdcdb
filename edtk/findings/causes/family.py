"""Faults of one kind and any size, as models of the measurements with parameters of their own."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from criteria.linalg.inverse import ROUNDING
from edtk.fit.correlated_noise import RowNoise, whiten, whiten_columns
from edtk.fit.least_squares import Whitened
from edtk.system.typing import Array

NOISE = "sigma"  # the cause that is no fault: a noise of another size
OUTLIER = "outlier"  # a reading that is off; it has findings of its own, and is never named
POSE = "pose"  # readings of another pose than the one written down
PRIOR = "prior"  # what was known before is wrong; it has findings of its own, too
ITERATIONS = 8  # Gauss-Newton steps; two or three are the rule
CONVERGED = 1e-2  # step of a fault's size, in standard deviations, that changes nothing
# Fall of the sum of squares, after one step, that is too small for a fault to be named.
UNREMARKABLE = 8.0
STEP = 1e-6  # of numerical derivatives [rad, m or 1]; predictions are smooth over a thousand such

# Part of a fault's columns that no parameter takes up, from which one step tells enough.
CLEAR = 1e-3

Predict = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Cause:
    """One fault that explains the residuals better than noise does.

    Attributes:
        cause: Name of the fault.
        size: Its size, in `unit`; the length where it is a vector.
        unit: Unit of the size.
        std: Standard deviation of the size; None where it is one of a list of possibilities.
        p: Probability that good data of the stated noise look so much like this fault, after
            looking at all others as well.
        explained: Share of the misfit (chi-square beyond its expectation) that the fault explains.
        joint: The joint that it is in; empty if it is in none.
        rows: Rows that it is in, counted from 0; empty for all.
        times: Of a second cause: how often each experiment would have to be measured until the
            first one is told from it; None if that is not known, or a hundred times do not.
        grows: Whether it grows from row to row, up to its size.
        effect: By how much it makes a compensated robot err in the test poses, root mean square
            [m]; None where that is not known.
    """

    cause: str
    size: float
    unit: str
    std: float | None
    p: float
    explained: float = 1.0
    joint: str = ""
    rows: tuple[int, ...] = ()
    times: int | None = None
    grows: bool = False
    effect: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; rows are counted from 1."""
        return {
            "cause": self.cause,
            "size": self.size,
            "unit": self.unit,
            "std": self.std,
            "p": self.p,
            "explained": self.explained,
            "joint": self.joint or None,
            "rows": [row + 1 for row in self.rows],
            "times": self.times,
            "grows": self.grows,
            "effect_mm": None if self.effect is None else 1e3 * self.effect,
        }


@dataclass(frozen=True, eq=False)
class Added:
    """Predictions of a fault that adds something to the readings, whatever bends the robot.

    Attributes:
        A: Regressors (m, rows, p) of the parameters.
        columns: What is added (m, rows, dims) for a fault of size one.
    """

    A: Array
    columns: Array

    def __call__(self, c: Array) -> tuple[Array, Array]:
        """Regressors, and what a fault of size c (dims,) adds (m, rows)."""
        return self.A, self.columns @ c


@dataclass(frozen=True, eq=False)
class Family:
    """Predictions ``A(c) k + b(c)`` of the measurements, where a fault has the size c.

    Attributes:
        cause: Name of the fault.
        unit: Unit of its size for people.
        per_unit: Units per SI unit.
        dims: Number of its parameters.
        usual: Length of the size that such a fault usually has, in SI units; much larger and much
            smaller ones are less likely beforehand.
        predict: Regressors A (m, rows, p) and constants b (m, rows) of a size c (dims,), in SI
            units; A(0) and b(0) = 0 are the model itself.
        tries: How many families of the same kind there are: one a joint, one a pose; less
            where this one is likelier than the others.
        joint: Name of the joint that the fault is in; empty if it is in none.
        rows: Rows of the measurements that the fault is in, counted from 0; empty for all.
        only_positive: Whether there is no such fault of a negative size.
        grows: Whether the fault grows from row to row, up to its size.
        shape: Which of several shapes of one fault it is, counted from 0.
    """

    cause: str
    unit: str
    per_unit: float
    dims: int
    usual: float
    predict: Predict
    tries: float = 1
    joint: str = ""
    rows: tuple[int, ...] = ()
    only_positive: bool = False
    grows: bool = False
    shape: int = 0
    _at_zero: dict[bytes, Array] = field(default_factory=dict, init=False, repr=False)

    def derivative(self, c: Array, k: Array) -> Array:
        """Derivatives (m, rows, dims) of the predictions by the size of the fault."""
        if isinstance(self.predict, Added):
            return self.predict.columns
        size = STEP * max(self.usual, 1.0)  # torques are a thousand times one
        columns = []
        for step in size * np.eye(self.dims):
            ahead = self.predict(c + step)
            behind = self.predict(c - step)
            change = (ahead[0] - behind[0]) @ k + ahead[1] - behind[1]
            columns.append(change / (2 * size))
        return np.stack(columns, axis=-1)

    def derivative_at_zero(self, k: Array) -> Array:
        """Derivatives (m, rows, dims) of the predictions where there is no fault yet."""
        key = k.tobytes()
        if key not in self._at_zero:
            self._at_zero[key] = self.derivative(np.zeros(self.dims), k)
        return self._at_zero[key]


@dataclass(frozen=True, eq=False)
class FamilyFit:
    """The size of a fault, fitted together with all parameters.

    Attributes:
        c: Size of the fault (dims,), SI.
        covariance: Of the size (dims, dims), for the stated noise.
        chi2: Sum of squares of the residuals over sigma.
    """

    c: Array
    covariance: Array
    chi2: float


def fit_families(
    families: Sequence[Family], whitened: Whitened, measured: Array, sigma: RowNoise, k: Array
) -> list[FamilyFit | None]:
    """Fit parameters and the size of each of some faults to measurements (m, rows).

    Most faults end at their first step, which is one for all of them, see `_first_steps`.

    Args:
        families: The faults.
        whitened: The regressors without a fault, factored.
        measured: Readings (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad], or correlated noise.
        k: Parameters (p,) of the fit without the fault.

    Returns:
        The fits; None where the measurements cannot tell a fault from the compliances, or the steps
        do not settle.
    """
    first = _first_steps(families, whitened, measured, k)
    return [
        first[i] if i in first else _fit_family(family, measured, sigma, k)
        for i, family in enumerate(families)
    ]


def _fit_family(family: Family, measured: Array, sigma: RowNoise, k: Array) -> FamilyFit | None:
    """Gauss-Newton from no fault.

    Each step solves the least-squares problem of the parameters and of the change of size together.
    A fault ends at a step that lowers the sum of squares by too little.
    """
    c = np.zeros(family.dims)
    p = len(k)
    A, b = family.predict(c)
    by_size = family.derivative_at_zero(k)
    without = float((whiten(measured - b - A @ k, sigma) ** 2).sum())
    for _ in range(ITERATIONS):
        columns = np.concatenate([A, by_size], axis=-1)
        solved = _solved(columns, measured - b, sigma)
        if solved is None:
            return None
        solution, root = solved
        k = solution[:p]
        c = c + solution[p:]
        covariance = root[p:] @ root[p:].T
        if np.abs(solution[p:] / np.sqrt(np.diag(covariance))).max() < CONVERGED:
            break
        left = float((whiten(measured - b - columns @ solution, sigma) ** 2).sum())
        if without - left < UNREMARKABLE:
            return FamilyFit(c, covariance, left)
        A, b = family.predict(c)
        by_size = family.derivative(c, k)
    z = whiten(measured - b - A @ k, sigma)
    return FamilyFit(c, covariance, float((z**2).sum()))


def _solved(columns: Array, measured: Array, sigma: RowNoise) -> tuple[Array, Array] | None:
    """Least squares of columns (m, rows, n), of unit length as ``U S V'`` in units of the noise.

    Returns:
        The solution (n,) and a root of its covariance (n, n); None where that is lost in rounding,
        as in `guarded_inverse`, of whose eigenvalues the singular values are roots.
    """
    n = columns.shape[-1]
    X = whiten_columns(columns, sigma).reshape(-1, n)
    scale = np.linalg.norm(X, axis=0)
    if not (np.isfinite(scale).all() and scale.all()):
        return None
    U, s, Vt = np.linalg.svd(X / scale, full_matrices=False)
    if len(s) < n or s[-1] ** 2 <= n * ROUNDING:
        return None
    root = Vt.T / s / scale[:, None]
    return root @ (U.T @ whiten(measured, sigma).ravel()), root


def _first_steps(
    families: Sequence[Family], whitened: Whitened, measured: Array, k: Array
) -> dict[int, FamilyFit]:
    """The first steps from no fault, where one is clearly seen and no other step is needed.

    With whitened regressors ``Q R`` and columns D of the fault, what the parameters leave of these
    is ``E = (I - Q Q') D``, and the size ``c = (E'E)^-1 E'z`` with the covariance ``(E'E)^-1``
    (Frisch and Waugh 1933). That spares a factorization for each fault, and one product leaves the
    columns of all of them.

    Returns:
        The fits by the faults' places.
    """
    if not families:
        return {}
    dims = np.array([family.dims for family in families])
    owner = np.repeat(np.arange(len(dims)), dims)
    columns = [np.moveaxis(family.derivative_at_zero(k), -1, 0) for family in families]
    D = whitened.in_sigma(np.concatenate(columns)).reshape(len(owner), -1)
    length = np.linalg.norm(D, axis=1)
    Q = whitened.Q.reshape(-1, len(k))
    E = D - (D @ Q) @ Q.T
    E = E - (E @ Q) @ Q.T  # once more, against rounding
    E = E / np.where(length > 0, length, 1.0)[:, None]
    z = whitened.residual(measured).ravel()
    found = {}
    for size in np.unique(dims):
        own = np.flatnonzero(dims[owner] == size).reshape(-1, size)
        own = own[np.linalg.eigvalsh(E[own] @ np.swapaxes(E[own], 1, 2))[:, 0] > CLEAR**2]
        inverse = np.linalg.inv(E[own] @ np.swapaxes(E[own], 1, 2))
        c = (inverse @ (E[own] @ z)[..., None])[..., 0]
        left = np.square(z - (c[:, None] @ E[own])[:, 0]).sum(axis=1)
        std = np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))
        settled = np.abs(c / std).max(axis=1) < CONVERGED
        for i in np.flatnonzero(~settled):
            at, scale = int(owner[own[i, 0]]), length[own[i]]
            # Of what is added to the readings, whatever its size, the first step is the last one.
            if z @ z - left[i] < UNREMARKABLE or isinstance(families[at].predict, Added):
                covariance = inverse[i] / np.outer(scale, scale)
                found[at] = FamilyFit(c[i] / scale, covariance, float(left[i]))
    return found


@dataclass(frozen=True, eq=False)
class Tried:
    """A fault that was tried: its deviance, and what is to be said of it.

    Attributes:
        cause: The fault with its size; p is that of its own test.
        deviance: Twice the negative logarithm of the likelihood: the sum of squares that is left.
        dims: Number of its parameters.
        tries: How many faults of the same kind there are: one a joint, one a pose; less
            where this one is likelier than the others.
        rarity: What the parameters cost where their usual size is known, see `rarity`.
        family: The family that it is one of; None for faults of single rows and of noise.
        size: Size of the fault (dims,) in that family, SI; None without one.
        share: Share of what springs do that the model leaves out beside the fault, where that was
            fitted too; zero else.
    """

    cause: Cause
    deviance: float
    dims: int
    tries: float
    rarity: float | None = None
    family: Family | None = None
    size: Array | None = None
    share: float = 0.0

    @property
    def is_told(self) -> bool:
        """Whether its size is told from zero, where it has one."""
        std = None if self.family is None else self.cause.std
        return std is None or abs(self.cause.size) > std

    def score(self, coordinates: int) -> float:
        """Deviance, with what the parameters and the alternatives of the same kind cost.

        Parameters without a usual size cost as in Bayes' information criterion.
        """
        rarity = self.dims * math.log(coordinates) if self.rarity is None else self.rarity
        return self.deviance + rarity + 2 * math.log(self.tries)
