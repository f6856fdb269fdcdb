"""How the errors of a plan's runs hang together: strata, correlation in time or space, trends.

A plan of m runs in order, with rows X, reads ``y = X k + N c + e``. N are columns of nuisance of
which nothing is known, and ``cov e = V`` in units of the noise of one run:

    V = V0 + sum_s v_s Z_s Z_s' + sum_t v_t F_t F_t' ,

with the groups Z_s of a stratum, a trend F_t, and V0 the identity unless runs are correlated.
Generalised least squares then tells ``M = X' W X`` about k, with the precision beside nuisance

    W = V^-1 - V^-1 N (N' V^-1 N)^+ N' V^-1 .

A run of several rows has effects of its own for each of them.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from criteria.linalg.inverse import EPS
from edtk.system.arguments import checked, is_number
from edtk.system.errors import LARGEST_NUMBER, ArgumentError, finite_numbers, whole_number
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

# Part of the largest eigenvalue of a covariance below which it counts as singular: what is left of
# the noise of single runs must be far above rounding.
SINGULAR = 1e-10
# Of effects, in units of the noise's: what runs tell between groups alone is right to eps times it,
# as a difference of entries of W.
LARGEST_VARIANCE = 1e8

Groups = int | Sequence[int] | Array
Hard = str | Sequence[str] | Array
METRICS = ("euclidean", "cityblock")


@dataclass(frozen=True, eq=False)
class Stratum:
    """Groups of runs, each with an effect of its own on all its runs.

    Attributes:
        name: What a group is called, such as "whole plot".
        groups: The number of groups of equal size in order, their sizes, or the group of each run.
        variance: Variance of the effects, in units of that of a run's noise; infinite where nothing
            is known about them (fixed effects).
        hard: The factors that keep their setting in a group: columns of the candidates' frame, or
            labels of the candidates' settings (n,). None for no factor.
        parts: Equal parts of the plan, one after the other, in each of which all groups come.
    """

    name: str
    groups: Groups
    variance: float
    hard: Hard | None = None
    parts: int = 1

    @property
    def plural(self) -> str:
        """What several groups are called."""
        if re.search("(s|x|z|ch|sh)$", self.name):
            return f"{self.name}es"
        return re.sub("(?<=[^aeiou])y$", "ie", self.name) + "s"

    def labels(self, m: int) -> Indices:
        """The group (m,) of each of m runs, counted from 0.

        Raises:
            ArgumentError: So many runs have no such groups.
        """
        if m % self.parts:
            message = f"{m} runs do not make {self.parts} rows of one length"
            raise ArgumentError(message, argument=self.name)
        return np.tile(group_labels(self.groups, m // self.parts, self.name), self.parts)


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlated noise of the runs themselves.

    Attributes:
        words: What it is, for people.
        of_size: Gives the covariance (m, m) of m runs.
        size: Number of runs that it is about; None for any.
    """

    words: str
    of_size: Callable[[int], Array]
    size: int | None = None


@dataclass(frozen=True, eq=False)
class Trend:
    """What drifts in the order of the runs, as a polynomial.

    Attributes:
        order: Its degree; the constant is no part of it.
        variance: Variance of its coefficients, of columns with mean square one; infinite where
            nothing is known about them.
        series: Groups of runs, each with a trend of its own.
    """

    order: int
    variance: float
    series: Groups

    def columns(self, m: int) -> Array:
        """Columns (m, q), orthogonal within a series, of mean square one there."""
        labels = group_labels(self.series, m, "series")
        found = []
        for group in range(labels.max() + 1):
            own = np.flatnonzero(labels == group)
            if len(own) <= self.order:
                message = f"a series of {len(own)} runs has no trend of order {self.order}"
                raise ArgumentError(message, argument="order", given=self.order)
            powers = np.vander(np.linspace(-1, 1, len(own)), self.order + 1, increasing=True)
            columns = np.zeros((m, self.order))
            columns[own] = np.linalg.qr(powers)[0][:, 1:] * np.sqrt(len(own))
            found.append(columns)
        return np.concatenate(found, axis=1)


@dataclass(frozen=True, eq=False)
class Errors(Presented):
    """The structure of the errors of a plan's runs, for `edtk.plan(problem, errors=...)`.

    Several of them are added: `Errors.split_plot("oven", 6) + Errors.trend()`. All variances are in
    units of that of the noise of a single run.

    Attributes:
        levels: Strata of groups of runs, each with its hard-to-change factors.
        correlation: Correlated noise of the runs; None where they are independent.
        trends: Trends in the order of the runs.
        size: Number of runs, where the structure says it.

    Example:
        >>> import edtk
        >>> edtk.Errors.split_plot("temperature", whole_plots=4, variance=1.0)
        <Errors: 4 whole plots (variance 1) with one temperature each>
    """

    levels: tuple[Stratum, ...] = ()
    correlation: Correlation | None = None
    trends: tuple[Trend, ...] = ()
    size: int | None = None

    @classmethod
    def split_plot(cls, hard: Hard, whole_plots: Groups, variance: float = 1.0) -> "Errors":
        """Whole plots, in each of which some factors keep their setting.

        Args:
            hard: Factors that are hard to change: columns of the candidates' frame, or labels of
                the candidates' settings (n,).
            whole_plots: Number of whole plots of equal size, or their sizes.
            variance: Variance of the whole plots' effects.
        """
        found = cls.strata({"whole plot": whole_plots}, variance, {"whole plot": hard})
        sizes = np.asarray(whole_plots)
        if sizes.ndim == 0:
            return found
        m = int(finite_numbers(whole_plots, "whole_plots").sum())
        group_labels(whole_plots, m, "whole_plots")
        return replace(found, size=m)

    @classmethod
    def strip_plot(
        cls,
        row_factors: Hard,
        column_factors: Hard,
        rows: int,
        columns: int,
        row_variance: float = 1.0,
        column_variance: float = 1.0,
        each: int = 1,
    ) -> "Errors":
        """Rows that cross columns: some factors keep their setting in a row, others in a column.

        Runs are in the order of the rows, and in a row in that of the columns.

        Args:
            row_factors: Factors that keep their setting in a row, see `split_plot`.
            column_factors: Factors that keep their setting in a column.
            rows: Number of rows.
            columns: Number of columns.
            row_variance: Variance of the rows' effects.
            column_variance: Variance of the columns' effects.
            each: Number of runs in each cell of a row and a column.
        """
        rows = whole_number(rows, "rows", 1)
        columns = whole_number(columns, "columns", 1)
        size = rows * columns * whole_number(each, "each", 1)
        row_variance = variance_of_effects(row_variance, "row_variance")
        column_variance = variance_of_effects(column_variance, "column_variance")
        _require_factors(row_factors)
        _require_factors(column_factors)
        return cls(
            (
                Stratum("row", rows, row_variance, row_factors),
                Stratum("column", columns, column_variance, column_factors, parts=rows),
            ),
            size=size,
        )

    @classmethod
    @checked
    def strata(
        cls,
        groups: Mapping[str, Groups],
        variance: float | Mapping[str, float] = 1.0,
        hard: Mapping[str, Hard] | None = None,
    ) -> "Errors":
        """Any strata, nested or crossed: split-split plots, days with batches, operators.

        Args:
            groups: Of each stratum by its name: the number of groups of equal size in the order of
                the runs, their sizes, or the group of each run.
            variance: Variance of the effects of all strata, or of each by its name; infinite for
                fixed effects, of which nothing is known.
            hard: The factors that keep their setting in the groups of a stratum, by its name.
        """
        if not isinstance(groups, Mapping) or not groups:
            message = "expected groups by the name of their stratum, such as {'day': 4}"
            raise ArgumentError(message, argument="groups")
        for name, own in groups.items():
            _require_groups(own, str(name))
        held = {} if hard is None else dict(hard)
        for kept in held.values():
            _require_factors(kept)
        given = dict(variance) if isinstance(variance, Mapping) else dict.fromkeys(groups, variance)
        for argument, named in (("hard", held), ("variance", given)):
            unknown = [name for name in named if name not in groups]
            if unknown:
                message = f"there is no stratum {unknown[0]!r}; expected {', '.join(groups)}"
                raise ArgumentError(message, argument=argument)
        missing = [name for name in groups if name not in given]
        if missing:
            message = f"expected one for the stratum {missing[0]!r} too"
            raise ArgumentError(message, argument="variance")
        levels = [
            Stratum(str(name), own, variance_of_effects(given[name], "variance"), held.get(name))
            for name, own in groups.items()
        ]
        return cls(tuple(levels))

    @classmethod
    @checked
    def autoregressive(cls, correlation: float, series: Groups = 1) -> "Errors":
        """Runs in the order of time, whose noise is correlated by ``correlation^|s - t|``.

        Args:
            correlation: That of two runs after each other, between -1 and 1.
            series: Number of equal series that are independent of each other, or their sizes.
        """
        # The least eigenvalue is above (1 - |c|)/2 for any number of runs.
        if not is_number(correlation) or not 1 - abs(correlation) >= SINGULAR:
            message = f"expected a number between -1 and 1, at least {SINGULAR:.0e} away from both"
            raise ArgumentError(message, argument="correlation", given=correlation)
        _require_groups(series, "series")
        words = f"noise that is correlated by {correlation:g} from run to run"
        return cls(correlation=Correlation(words, partial(_autoregressive, correlation, series)))

    @classmethod
    @checked
    def spatial(
        cls, positions: ArrayLike, length: float, nugget: float = 0.0, metric: str = "euclidean"
    ) -> "Errors":
        """Runs at places, whose noise is correlated by ``(1 - nugget) exp(-distance/length)``.

        Args:
            positions: The place of each run (m, d) or (m,); runs are in this order.
            length: The distance at which the correlation is 1/e of what it is nearby.
            nugget: Part of the variance that is a run's own.
            metric: "euclidean", or "cityblock" for the product of correlations along the axes.
        """
        x = finite_numbers(positions, "positions")
        if x.ndim not in (1, 2) or not len(x):
            raise ArgumentError("expected places (m, d) of m runs", argument="positions")
        if not is_number(length) or not 0 < length < np.inf:
            raise ArgumentError("expected a distance above 0", argument="length", given=length)
        if not is_number(nugget) or not 0 <= nugget <= 1:
            raise ArgumentError("expected a part from 0 to 1", argument="nugget", given=nugget)
        if metric not in METRICS:
            message = f"expected {' or '.join(METRICS)}"
            raise ArgumentError(message, argument="metric", given=metric)
        places = x.reshape(len(x), -1)
        V = (1 - nugget) * np.exp(-cdist(places, places, metric) / length)
        np.fill_diagonal(V, 1.0)
        return cls._of_matrix(V, f"noise that is correlated over a distance of {length:g}")

    @classmethod
    @checked
    def covariance(cls, V: ArrayLike) -> "Errors":
        """Any covariance (m, m) of the m runs' noise, in the order of the runs."""
        found = finite_numbers(V, "V")
        if found.ndim != 2 or found.shape[0] != found.shape[1] or not len(found):
            raise ArgumentError("expected a matrix (m, m)", argument="V")
        if not np.allclose(found, found.T, rtol=1e-9, atol=0):
            raise ArgumentError("expected a symmetric matrix", argument="V")
        return cls._of_matrix(0.5 * (found + found.T), "noise of a given covariance")

    @classmethod
    def _of_matrix(cls, V: Array, words: str) -> "Errors":
        """Noise of a covariance (m, m), which must be definite."""
        r = np.linalg.eigvalsh(V)
        if not r[0] > SINGULAR * r[-1]:
            message = "the covariance of the runs is not positive definite"
            hint = ", some runs are at one place: expected a nugget above 0"
            is_one_place = "distance" in words and r[0] > -SINGULAR * r[-1]
            raise ArgumentError(message + (hint if is_one_place else ""), argument="V")
        if not r[0] > 1.0 / LARGEST_NUMBER:
            message = f"expected variances of at least {1.0 / LARGEST_NUMBER:.0e}"
            raise ArgumentError(message, argument="V")
        return cls(correlation=Correlation(words, partial(_given, V), len(V)), size=len(V))

    @classmethod
    @checked
    def trend(cls, order: int = 1, variance: float = np.inf, series: Groups = 1) -> "Errors":
        """A drift in the order of the runs, as a polynomial without its constant.

        Args:
            order: Its degree.
            variance: Variance of its coefficients, of orthogonal columns with mean square one;
                infinite, the default, for a trend of which nothing is known.
            series: Number of equal series of runs with a trend each, or their sizes.
        """
        order = whole_number(order, "order", 1)
        _require_groups(series, "series")
        return cls(trends=(Trend(order, variance_of_effects(variance, "variance"), series),))

    def __add__(self, other: "Errors") -> "Errors":
        """Both together: their covariances are added, but for the noise of single runs.

        Raises:
            ArgumentError: Both say how runs are correlated, or of how many runs they are.
        """
        if not isinstance(other, Errors):
            return NotImplemented
        if self.correlation is not None and other.correlation is not None:
            message = "both say how runs are correlated; expected one, or their sum as a covariance"
            raise ArgumentError(message, argument="errors")
        sizes = {own for own in (self.size, other.size) if own is not None}
        if len(sizes) > 1:
            message = f"they are about {self.size} and {other.size} runs"
            raise ArgumentError(message, argument="errors")
        names = [stratum.name for stratum in (*self.levels, *other.levels)]
        if len(set(names)) < len(names):
            raise ArgumentError("two strata have one name", argument="errors")
        return Errors(
            (*self.levels, *other.levels),
            other.correlation if self.correlation is None else self.correlation,
            (*self.trends, *other.trends),
            sizes.pop() if sizes else None,
        )

    def headline(self) -> str:
        """What hangs together, in words."""
        parts = [_stratum_words(stratum) for stratum in self.levels]
        if self.correlation is not None:
            parts.append(self.correlation.words)
        parts += [f"a trend of order {trend.order}" for trend in self.trends]
        return ", ".join(parts) if parts else "independent runs"

    def size_of(self, size: int | None) -> int:
        """The number of runs: the given one, or that of the structure.

        Raises:
            ArgumentError: There is none, or they differ.
        """
        if size is None and self.size is None:
            raise ArgumentError("expected the number of runs", argument="size")
        if size is not None and self.size is not None and size != self.size:
            message = f"the errors are those of {self.size} runs"
            raise ArgumentError(message, argument="size", given=size)
        return whole_number(self.size if size is None else size, "size", 1)

    def of_runs(self, m: int) -> "RunErrors":
        """The same for m runs.

        Raises:
            ArgumentError: So many runs have no such structure.
        """
        labels = tuple(stratum.labels(m) for stratum in self.levels)
        V0 = np.eye(m) if self.correlation is None else self.correlation.of_size(m)
        trends = tuple(trend.columns(m) for trend in self.trends)
        return RunErrors(self, V0, labels, trends)


@dataclass(frozen=True, eq=False)
class RunErrors:
    """The structure of the errors of m runs, as matrices.

    Attributes:
        errors: What is said about them.
        noise: Covariance V0 (m, m) of the runs' own noise.
        labels: The group (m,) of each run, of each stratum.
        trends: Columns (m, q) of each trend.
    """

    errors: Errors
    noise: Array
    labels: tuple[Indices, ...]
    trends: tuple[Array, ...]

    @property
    def m(self) -> int:
        """Number of runs."""
        return len(self.noise)

    @cached_property
    def effects(self) -> tuple[tuple[Array, float], ...]:
        """Columns (m, k) of strata and trends, each with the variance of its coefficients."""
        groups = (
            ((own[:, None] == np.arange(own.max() + 1)).astype(float), stratum.variance)
            for own, stratum in zip(self.labels, self.errors.levels, strict=True)
        )
        drifts = (
            (columns, trend.variance)
            for columns, trend in zip(self.trends, self.errors.trends, strict=True)
        )
        return (*groups, *drifts)

    @property
    def covariance(self) -> Array:
        """V (m, m), without what nothing is known about."""
        V = self.noise.copy()
        for columns, variance in self.effects:
            if np.isfinite(variance):
                V += variance * columns @ columns.T
        return V

    @cached_property
    def nuisance(self) -> Array:
        """Columns N (m, q) of effects of which nothing is known."""
        known = [columns for columns, variance in self.effects if np.isinf(variance)]
        return np.concatenate([np.zeros((self.m, 0)), *known], axis=1)

    @cached_property
    def whitening(self) -> Array:
        """R (m, m) that whitens the runs: ``R' R = W`` is what they tell beside all nuisance.

        With ``V0 = L L'`` and ``L^-1 C = U S Z'``, where the columns C have the roots of their
        variances, ``(V0 + C C')^-1 = R' R`` for ``R = (I + S^2)^-1/2 U' L^-1``, which keeps its
        digits where effects are large. Effects N of which nothing is known are projected out:
        ``R - Q Q' R`` with an orthonormal basis Q of R N.
        """
        own = np.linalg.inv(np.linalg.cholesky(self.noise))
        known = [np.sqrt(size) * columns for columns, size in self.effects if np.isfinite(size)]
        C = np.concatenate([np.zeros((self.m, 0)), *known], axis=1)
        U, s, _ = np.linalg.svd(own @ C)
        spread = np.zeros(self.m)
        spread[: len(s)] = s
        R = (U / np.hypot(1.0, spread)).T @ own
        N = self.nuisance
        if N.shape[1]:
            # An orthonormal basis: groups of several strata sum to the same constant.
            U, s, _ = np.linalg.svd(N, full_matrices=False)
            Q, _ = np.linalg.qr(R @ U[:, s > SINGULAR * s[0]])
            for _ in range(2):  # the second time for what rounding left
                R = R - Q @ (Q.T @ R)
        return R

    @cached_property
    def precision(self) -> Array:
        """W (m, m): what the runs tell beside all that is nuisance, ``R' R``."""
        return np.asarray(self.whitening.T @ self.whitening)


def group_labels(groups: Groups, m: int, name: str) -> Indices:
    """The group (m,) of each of m runs.

    Args:
        groups: A number of groups of equal size in order, their sizes, or the group of each run.
        m: Number of runs.
        name: What a group is called.

    Raises:
        ArgumentError: So many runs have no such groups.
    """
    given = np.asarray(groups)
    if given.ndim == 0:
        number = whole_number(groups, name, 1)
        if m % number:
            message = f"{m} runs do not make {number} of one size; expected sizes that sum to {m}"
            raise ArgumentError(message, argument=name)
        return np.repeat(np.arange(number), m // number)
    if given.shape == (m,):
        return np.unique(given, return_inverse=True)[1].reshape(-1)
    whole = given.ndim == 1 and np.issubdtype(given.dtype, np.integer) and (given > 0).all()
    if not whole or given.sum() != m:
        message = f"expected a number, sizes that sum to {m}, or a label for each of {m} runs"
        raise ArgumentError(message, argument=name)
    return np.repeat(np.arange(len(given)), given)


def _autoregressive(correlation: float, series: Groups, m: int) -> Array:
    """``correlation^|s - t|`` (m, m), zero between series."""
    labels = group_labels(series, m, "series")
    lags = np.abs(np.subtract.outer(np.arange(m), np.arange(m)))
    return np.where(labels[:, None] == labels, float(correlation) ** lags, 0.0)


def _given(V: Array, m: int) -> Array:
    """A covariance that is given."""
    if len(V) != m:
        raise ArgumentError(f"the errors are those of {len(V)} runs", argument="size", given=m)
    return V


def variance_of_effects(given: object, argument: str) -> float:
    """A variance in units of that of the noise, which may be infinite.

    Raises:
        ArgumentError: It is none, or the rounding of the noise hides it, or what it leaves of that.
    """
    if not is_number(given) or not given >= EPS:
        message = f"expected above 0, at least {EPS:.1g} of the noise's"
        raise ArgumentError(message, argument=argument, given=given)
    if LARGEST_VARIANCE < given < np.inf:
        message = f"expected at most {LARGEST_VARIANCE:g} of the noise's, or inf for fixed effects"
        raise ArgumentError(message, argument=argument, given=given)
    return float(given)


def _require_groups(given: Groups, name: str) -> None:
    """Check that groups are a number, or a row of sizes or labels that can be sorted."""
    message = "expected a number of groups, their sizes, or a label for each run"
    try:
        found = np.asarray(given)
        is_label = (found == found).all()  # which nan is not
        if found.ndim:
            np.unique(found)
    except (ValueError, TypeError):  # rows of several lengths, or labels that have no order
        raise ArgumentError(message, argument=name) from None
    if found.ndim == 0:
        whole_number(given, name, 1)
    elif not is_label:
        raise ArgumentError(message, argument=name)


def _require_factors(hard: object) -> None:
    """Check that something names factors, or labels candidates.

    Raises:
        ArgumentError: It does not.
    """
    if np.ndim(hard) == 0 and not isinstance(hard, str):  # type: ignore[arg-type]
        message = "expected names of factors, or a label for each candidate"
        raise ArgumentError(message, argument="hard", given=repr(hard))


def _stratum_words(stratum: Stratum) -> str:
    """A stratum in words."""
    given = np.asarray(stratum.groups)
    known = f"variance {stratum.variance:g}" if np.isfinite(stratum.variance) else "fixed"
    number = f"{int(given)} " if given.ndim == 0 else ""
    words = f"{number}{stratum.name if number == '1 ' else stratum.plural} ({known})"
    if stratum.hard is None:
        return words
    return f"{words} with one {' and '.join(hard_names(stratum.hard))} each"


def hard_names(hard: Hard) -> tuple[str, ...]:
    """Names of the factors that are hard to change; "setting" where labels say which."""
    if isinstance(hard, str):
        return (hard,)
    names = tuple(hard)
    return names if all(isinstance(name, str) for name in names) else ("setting",)
