"""The abstract criterion, the laws that every criterion obeys, and its plainest kinds."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Any, Literal, Self, final

import numpy as np
from numpy.typing import ArrayLike

from criteria.curvature import Curvature
from criteria.errors import CriterionError
from criteria.linalg.estimable import open_directions, range_whitener
from criteria.linalg.inverse import guarded_inverse, unit_scale
from criteria.linalg.models import Models
from criteria.linalg.typing import Array, Indices, Mask, triangle

DESCRIBED = (
    "name",
    "title",
    "formula",
    "sense",
    "degree",
    "convex",
    "smooth",
    "monotone",
    "unit_free",
)
# Of an entry of M, in parts of the root of the product of its two diagonal entries. A one-sided
# difference errs by the step (truncation) and by eps/step (rounding), here 1e-6 and 2e-10.
STEP = 1e-6
# Least eigenvalue of M at unit diagonal from which on costs have nine digits.
LOSES_DIGITS = 1e-6
RECIPROCAL = {"rad/(N m)": "N m/rad", "m/N": "N/m"}  # of units of compliance, as people write them


Sense = Literal["min", "max"]


class Criterion(ABC):
    """A number that says how good an information matrix M is, of shape (..., p, p) and symmetric.

    To add a criterion, declare the class attributes and write `_cost` and `_gradient`. Both are
    called with regular M only, and with the inverse of M. A criterion that can be optimised by the
    convex relaxation derives from `criteria.ConvexCriterion` or `criteria.Relaxable` instead.

    One test suite checks these laws for every registered criterion:
        homogeneous: ``cost(c M) = c**-degree * cost(M)`` for c > 0.
        symmetric: a permutation of the parameters changes nothing.
        monotone (where declared): M2 - M1 positive semidefinite implies cost(M2) <= cost(M1).
        convex (where declared): ``cost(M2) >= cost(M1) + <gradient(M1), M2 - M1>``.
        unit-free (where declared): the parameters' units do not change the ratio of two costs.
        singular M: ``cost = inf``, never an exception.

    Attributes:
        name: Registry name, used in studies and tables.
        title: The name that a person reads.
        formula: Definition of `value`, in plain text.
        sense: Whether `value` is minimised or maximised.
        degree: Degree of homogeneity of `cost`.
        convex: Whether `cost` is convex in M.
        smooth: Whether `cost` is differentiable everywhere on the regular matrices.
        monotone: Whether more information never raises `cost`.
        unit_free: Whether efficiencies do not depend on the parameters' units.
        needs_target: Whether the constructor takes the target matrix A0.
        needs_all: Whether the cost is finite only where M tells all parameters.
        needs_parameters: Whether the constructor takes arguments that nobody can guess, such as W
            or q. Such a criterion is used only where it is asked for with them.
        takes_interest: Whether it can be about some of the parameters only, see `Interest`.
        per_task: Whether it takes a target of each task (tasks, rows, p) instead of one of all.
        batched_curvature: Whether `curvature` takes roots (..., p, p) of several covariances.
        models: Of several models side by side that it does not mix; None of one.
        precision: Prior information (p, p) that the cost adds to M; None but for Bayesian criteria.
        shown: Factor and unit with which `value` is printed; the unit may be empty.
    """

    name: str
    title: str
    formula: str
    sense: Sense
    degree: float
    convex: bool = True
    smooth: bool = True
    monotone: bool = True
    unit_free: bool = False
    needs_target: bool = False
    per_task: bool = False
    needs_all: bool = True
    needs_parameters: bool = False
    takes_interest: bool = True
    batched_curvature: bool = False
    models: Models | None = None
    precision: Array | None = None
    shown: tuple[float, str] = (1.0, "")

    @abstractmethod
    def _cost(self, M: Array, cov: Array) -> Array:
        """Cost (...) of regular M (..., p, p) whose inverse is cov (..., p, p)."""

    @abstractmethod
    def _gradient(self, M: Array, cov: Array) -> Array:
        """G (..., p, p) with d cost = <G, dM>; at a kink, any subgradient."""

    @property
    def trace_root(self) -> Array | None:
        """B (p, q) of the trace ``<B B', M>`` by which designs of degree zero are normalised.

        None stands for the trace of M itself.
        """
        return None

    @property
    def arguments(self) -> dict[str, Any]:
        """What the constructor took, as plain numbers and lists: {"q": 2.0}; empty for nothing."""
        return {}

    def to_dict(self) -> dict[str, Any]:
        """Name and arguments, for JSON: `criteria.from_dict` makes an equal criterion of them."""
        return {"name": self.name, **self.arguments}

    @property
    def plan_criterion(self) -> "Criterion":
        """The criterion to search plans for: it has the same optimal plans as this one.

        Criteria that share it need one search only. It is the criterion itself, or the base of a
        power such as O1 = D^(1/2).
        """
        return self

    def cost_from_plan_criterion(self, cost: float) -> float:
        """The cost under this criterion of a plan whose cost under `plan_criterion` is known.

        The function is increasing, so it turns lower bounds into lower bounds.
        """
        return cost

    @property
    def without_prior(self) -> "Criterion":
        """The criterion of M + R that a Bayesian criterion is; the others are their own."""
        return self

    def for_size(self, size: float) -> Self:
        """The criterion of one of `size` like experiments, such that

            cost(size M) = size^-degree for_size(size).cost(M) .

        It is the criterion itself, unless experiments share a prior.
        """
        return self

    def smoothed(self, sharpness: float) -> Self:
        """A smooth criterion whose cost is at least that of this one; this one if it is smooth.

        Args:
            sharpness: Exponent, above one, of the soft maximum that replaces a maximum. The larger
                it is, the closer are the costs.
        """
        return self

    def named(self, parameters: tuple[str, ...]) -> Self:
        """The same criterion, which calls the parameters (p,) by these names in tables."""
        return self

    def in_units(self, T: Array) -> Self:
        """The same criterion for parameters k' with k = T k'; only a target changes.

        Args:
            T: Regular matrix (p, p).
        """
        return self

    def transformed(self, T: Array) -> "Criterion | None":
        """This criterion of k as a function of the information about k', where ``k = T k'``.

        Its cost of ``T'M T`` is this one's of M, the same number, but computed without squares of
        a T that brings an ill-conditioned M to order one.

        Args:
            T: Regular matrix (p, p).

        Returns:
            The criterion; None where there is none, as of one that cannot be relaxed.
        """
        return None

    @property
    def label(self) -> str:
        """The name that a person reads in a table: "D", or "D of k2, k3"."""
        return self.name

    def curvature(self, R: Array) -> Curvature | None:
        """First and second derivative of ``log cost`` in closed form, for Newton's method.

        Without it a relaxation over many parameters takes far longer.

        Args:
            R: Root (p, p) of a covariance, ``R R' = cov``, at which the cost is smooth; or those
                (..., p, p) of several, see `batched_curvature`.

        Returns:
            The derivatives; None where the criterion has no such form.
        """
        return None

    def curvatures(self, R: Array) -> tuple[Curvature, ...]:
        """The terms whose sum the derivatives of ``log cost`` are.

        Args:
            R: See `curvature`.

        Returns:
            The curvature alone, unless the cost is a product of others; none where there is none.
        """
        found = self.curvature(R)
        return () if found is None else (found,)

    def dependence(self, scale: Array) -> float:
        """Condition number of what the criterion is about, for parameters in units of a scale (p,).

        Combinations that differ only in parameters of small variances are nearly dependent there,
        and their covariance loses the square of it in roundings.
        """
        return 1.0

    def rounding(self, W: Array) -> float:
        """Relative error, of a variance, that rounding of what the criterion was given can make.

        It matters where parameters are nearly dependent: combinations that are well told then are
        differences of large numbers.

        Args:
            W: Whitens a design (p, r), ``W' M W = I``, in the parameters as they were given.
        """
        return 0.0

    @property
    def order(self) -> int | None:
        """Number p of parameters that its target or its combinations have; None for any."""
        return None

    def require_order(self, p: int) -> None:
        """Check that the criterion is about so many parameters.

        Raises:
            CriterionError: It is not.
        """
        if self.order not in (None, p):
            raise CriterionError(
                f"criterion {self.label!r} is about {self.order} parameters; expected {p}, as the "
                "information matrix has"
            )

    def inverse(self, M: Array) -> tuple[Array, Array, Mask]:
        """The inverse that costs and gradients take, and which M are good enough for it.

        Args:
            M: Symmetric matrices (..., p, p).

        Returns:
            ``(safe, cov, regular)``, see `guarded_inverse`: M and its inverse, and the mask (...)
            of the matrices of finite cost.
        """
        return guarded_inverse(M)

    def strayed(self, M: Array) -> float:
        """How much of what the criterion is about M (p, p) leaves open, though its cost is finite.

        It is a rounding where M is as it should be. A search that is free to move what M tells may
        find designs at which it is more, and whose cost is too low by about that part.
        """
        return 0.0

    def whitener(self, M: Array) -> Array:
        """T (p, r) with ``T' M T = I``, which brings the parts of M that count to order one."""
        return range_whitener(M)

    def missing(self, M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
        """What M (p, p) leaves open of all that this criterion needs, in words.

        Args:
            M: Information matrix (p, p).
            parameters: Names (p,).

        Returns:
            Directions such as "k4" or "k2 - 0.5 k3"; none if the cost is finite.
        """
        return open_directions(M, parameters)

    @final
    def cost(self, M: ArrayLike) -> Array:
        """Smaller is better: `value` where it is minimised, its reciprocal where it is maximised.

        Args:
            M: Information matrices (..., p, p).

        Returns:
            Array (...); inf where M is singular to working precision, nan where it is not finite.
        """
        M = np.asarray(M, dtype=float)
        self.require_order(M.shape[-1])
        # One test of singularity for all criteria: they agree on which plans are worthless.
        safe, cov, regular = self.inverse(M)
        cost = np.asarray(self._cost(safe, cov))
        if not regular.all():
            cost = np.where(regular, cost, np.inf)
            cost = np.where(np.isfinite(M).all(axis=(-2, -1)), cost, np.nan)
        return cost[()]

    @final
    def cost_by_rows(self, M: Array, rows: Callable[[int], Array]) -> Array:
        """Costs (...) of information ``M = B'B``, as sharp as whitened rows B tell them.

        M has the square of the rows' condition number. A plan that all but leaves a direction
        open, as one for a target may, loses six digits of its cost in it. Such costs are computed
        for parameters ``k = T k'`` in which the rows are orthonormal, where T is of their QR
        factorization. Which M are worthless is decided as in `cost`, and M that leaves something
        open, which no such T exists for, keeps its cost.

        Args:
            M: Information matrices (..., p, p).
            rows: The rows (n, p) of the one of this number; only those that are needed are asked.
        """
        costs = np.array(self.cost(M))
        is_blurred = np.isfinite(costs) & ~guarded_inverse(M, LOSES_DIGITS)[2]
        each = M.reshape(-1, *M.shape[-2:])
        blurred = np.flatnonzero(is_blurred)
        for i in blurred[guarded_inverse(each[blurred])[2]].tolist():
            B = rows(i)
            lengths = np.linalg.norm(B, axis=0)
            T = np.linalg.inv(np.linalg.qr(B / lengths, mode="r")) / lengths[:, None]
            own = self.transformed(T)
            if own is not None:
                costs.flat[i] = own.cost(np.eye(len(T)))
        return costs[()]

    # Exchanges and differences update inverses by low-rank lemmas; another inversion, with its
    # test of singularity, would be paid for every trial.
    @final
    def cost_of_regular(self, M: Array, cov: Array) -> Array:
        """Costs (...) of matrices whose inverses are known, for instance after a low-rank update.

        Regularity is not checked.

        Args:
            M: Regular information matrices (..., p, p).
            cov: Their inverses (..., p, p).
        """
        return self._cost(M, cov)

    @final
    def value(self, M: ArrayLike) -> Array:
        """The number that `formula` defines; at singular M it is 0 if maximised, inf if minimised.

        Args:
            M: Information matrices (..., p, p).
        """
        cost = self.cost(M)
        return cost if self.sense == "min" else 1.0 / cost

    @final
    def gradient(self, M: ArrayLike) -> Array:
        """Gradient G (..., p, p) of `cost`, symmetric: d cost = <G, dM>; nan where M is singular.

        Args:
            M: Information matrices (..., p, p).
        """
        return self.cost_and_gradient(np.asarray(M, dtype=float))[1]

    @final
    def cost_and_gradient(self, M: Array) -> tuple[Array, Array]:
        """`cost` (...) and `gradient` (..., p, p) of finite M (..., p, p), with one inversion."""
        self.require_order(M.shape[-1])
        safe, cov, regular = self.inverse(M)
        cost = np.asarray(self._cost(safe, cov))
        G = self.gradient_of_regular(safe, cov)
        if regular.all():
            return cost, G
        return np.where(regular, cost, np.inf), np.where(regular[..., None, None], G, np.nan)

    @final
    def gradient_of_regular(self, M: Array, cov: Array) -> Array:
        """Gradients (..., p, p) of matrices whose inverses are known, see `cost_of_regular`."""
        G = self._gradient(M, cov)
        # A gradient that is computed from eigenvectors is symmetric only up to rounding.
        return 0.5 * (G + np.swapaxes(G, -1, -2))

    @final
    def efficiency(self, M: ArrayLike, best: ArrayLike) -> Array:
        """Ratio of costs ``cost(best) / cost(M)``: 1 for a plan as good as the best one.

        Args:
            M: Information matrices (..., p, p).
            best: Information matrices (..., p, p) to compare with.
        """
        return self.cost(best) / self.cost(M)

    @classmethod
    def describe(cls) -> dict[str, Any]:
        """The declared properties as a plain dictionary, for tables and JSON."""
        return {key: getattr(cls, key) for key in DESCRIBED}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"


def _entries(p: int, i: Indices, j: Indices) -> Array:
    """Symmetric matrices (1 + q, p, p): zero, then ones at each place (i, j) of a triangle."""
    E = np.zeros((1 + len(i), p, p))
    k = np.arange(1, 1 + len(i))
    E[k, i, j] = 1.0
    E[k, j, i] = 1.0
    return E


def derivatives(
    criterion: Criterion, M: Array, models: Models | None = None
) -> tuple[Array, Array, Array]:
    """Cost, gradient, and second derivative by the entries of the upper triangle.

    With dM given by its triangle v (q,), row by row, q = p (p + 1)/2, the cost is
    ``f + <G, dM> + v' K v / 2`` up to third order. K is that of the curvature where it is known of
    all matrices at once, or else of differences of the gradient.

    Args:
        criterion: A criterion that is smooth near M.
        M: Information matrices (b, p, p).
        models: Models side by side; the entries are then those of `Models.triangles`.

    Returns:
        Costs f (b,), gradients G (b, p, p) and K (b, q, q); inf, nan and nan where M is singular.
    """
    entries = triangle(M.shape[-1]) if models is None else models.triangles
    safe, cov, regular = criterion.inverse(M)
    cost = np.where(regular, criterion.cost_of_regular(safe, cov), np.inf)
    is_known = criterion.batched_curvature and criterion.needs_all
    R = _root(cov) if is_known else cov
    terms = criterion.curvatures(R) if is_known else ()
    if terms:
        G = criterion.gradient_of_regular(safe, cov)
        K = _by_curvature(terms, R, cost, entries)
    else:
        G, K = _by_differences(criterion, safe, cov, entries)
    nan = np.where(regular, 0.0, np.nan)[:, None, None]
    return cost, G + nan, K + nan


def _root(cov: Array) -> Array:
    """R (b, p, p) with ``R R' = cov``."""
    d = unit_scale(np.diagonal(cov, axis1=1, axis2=2))
    return d[:, :, None] * np.linalg.cholesky(cov / (d[:, :, None] * d[:, None]))


def _by_curvature(
    terms: tuple[Curvature, ...], R: Array, cost: Array, entries: tuple[Indices, Indices]
) -> Array:
    """Second derivatives (b, q, q) of costs (b,) whose logarithms are sums of terms."""
    slope, K = terms[0].by_entries(R, *entries)
    for term in terms[1:]:
        own_slope, own = term.by_entries(R, *entries)
        slope += own_slope
        K += own
    # The second derivative of a cost, in parts of it, is that of its log and a square.
    K += slope[:, :, None] * slope[:, None]
    K *= np.where(np.isfinite(cost), cost, 0.0)[:, None, None]
    return K


def _by_differences(
    criterion: Criterion, safe: Array, cov: Array, entries: tuple[Indices, Indices]
) -> tuple[Array, Array]:
    """Gradients (b, p, p) and second derivatives (b, q, q) at regular matrices and their inverses.

    One call evaluates all differences of all matrices; the inverse changes by
    ``-cov (dM - dM cov dM) cov``, to second order.
    """
    i, j = entries
    # Steps follow the diagonal of M, so that parameters may have any units.
    d = unit_scale(np.diagonal(safe, axis1=1, axis2=2))
    dM = STEP * (d[:, :, None] * d[:, None])[:, None] * _entries(safe.shape[-1], i, j)
    C = np.broadcast_to(cov[:, None], dM.shape)
    change = dM @ C
    G = criterion.gradient_of_regular(safe[:, None] + dM, C - C @ (change - change @ change))
    difference = G[:, 1:, i, j] - G[:, :1, i, j]
    # An entry off the diagonal stands for two entries of M.
    weight = np.where(i == j, 1.0, 2.0)
    K = difference * weight / (STEP * d[:, i] * d[:, j])[..., None]
    return G[:, 0], 0.5 * (K + np.swapaxes(K, 1, 2))


def unit_of(criterion: Criterion | type[Criterion], units: Iterable[str]) -> str:
    """Unit of a criterion's values; empty where parameters have several, or its own have some.

    A cost of degree d has the unit of the parameters to the power 2 d, as M has it to the power -2.

    Args:
        criterion: The criterion, or its class.
        units: Units of the parameters.
    """
    own = sorted(set(units))
    if criterion.shown[1] or criterion.needs_parameters or len(own) != 1:
        return criterion.shown[1]
    power = round(2 * criterion.degree)
    unit = own[0] if criterion.sense == "min" else RECIPROCAL.get(own[0], f"1/({own[0]})")
    return "" if power == 0 else unit if power == 1 else f"({unit})^{power}"


def printed(
    criterion: Criterion | type[Criterion],
    value: float,
    units: Iterable[str] = (),
    digits: int = 6,
) -> str:
    """A criterion's value as people read it: "0.00659 mm".

    Args:
        criterion: The criterion, or its class.
        value: The value, of parameters in their units.
        units: Units of the parameters.
        digits: Number of digits.
    """
    return f"{criterion.shown[0] * value:.{digits}g} {unit_of(criterion, units)}".rstrip()


class CovarianceCriterion(Criterion):
    """A criterion whose `_cost` needs the covariance, and never looks at the information.

    A criterion of a part of the parameters has their covariance at hand; it then saves the inverse.
    """

    @abstractmethod
    def covariance_slope(self, cov: Array) -> Array:
        """S (..., p, p) with d cost = <S, d cov>, so that the gradient is ``-cov S cov``."""

    def cost_of_root(self, L: Array) -> Array:
        """Costs (...) of the covariances ``L L'`` of roots L (..., p, p)."""
        cov = L @ np.swapaxes(L, -1, -2)
        return self._cost(cov, cov)

    def slope_of_root(self, L: Array) -> Array:
        """``L' S L`` (..., p, p), with S the slope at the covariances ``L L'``."""
        transposed = np.swapaxes(L, -1, -2)
        return np.asarray(transposed @ self.covariance_slope(L @ transposed) @ L)


class DeterminantCriterion(Criterion):
    """A criterion whose cost is a function of det M.

    An exchange of experiments evaluates such a criterion by the matrix determinant lemma, which
    needs no update of an inverse.
    """

    @abstractmethod
    def cost_of_log_determinant(self, log_det: Array, p: int) -> Array:
        """Costs (...) of regular (p, p) matrices, given their log det M (...)."""

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.cost_of_log_determinant(np.linalg.slogdet(M).logabsdet, M.shape[-1])


class KinkedCriterion(Criterion):
    """A criterion that takes a largest eigenvalue or variance, so that its cost has kinks.

    A descent needs a smooth cost. It minimises `smoothed` criteria, one sharper than the other,
    that replace the maximum by a `soft_maximum`.

    Args:
        sharpness: Exponent of the soft maximum, above one; inf for the maximum itself.
    """

    smooth = False

    def __init__(self, sharpness: float = np.inf) -> None:
        self.sharpness = sharpness
        self.smooth = bool(np.isfinite(sharpness))

    def smoothed(self, sharpness: float) -> Self:
        """The same criterion with a soft maximum in place of the maximum."""
        return type(self)(sharpness)
