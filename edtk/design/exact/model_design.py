"""Designs of all kinds for a linear(ised) model, seen as rows: what they tell and predict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

import criteria
from criteria import Criterion, Relaxable
from edtk.design.exact.arranged.arranged_plan import ArrangedPlan
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.plan_region import RegionPlan
from edtk.design.information import Known
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relax_region import relax_region
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.design.relaxation.search_region import RegionGrid
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Indices, Mask

PREDICTED_PLACES = 2000  # points of a region at which a design predicts
FEWEST_PLACES = 200  # of them, below which they do not tell
TEST_LEVEL = 0.05  # of a test
LEFT_OF_COLUMN = 1e-9  # part of a column that others leave of it, below which it is theirs
NUMBERS = "iuf"  # kinds of columns whose values are numbers; of others they are levels of a factor
OPEN = 1e-13  # singular value, in parts of the largest in units of the columns, that is rounding

Design = ProblemPlan | RegionPlan | Relaxation | RelaxedRegion


@dataclass(frozen=True, eq=False)
class Places:
    """Experiments of a model: their rows, and the variables that tell where they are.

    Attributes:
        rows: Whitened rows (n, r, p).
        names: Names (d,) of the variables that are numbers.
        values: Their values (n, d).
    """

    rows: Array
    names: tuple[str, ...]
    values: Array

    @classmethod
    def of_problem(cls, problem: Problem, chosen: Any = slice(None)) -> "Places":
        """Candidates; those without a frame have their number as the only variable."""
        rows = problem.factors(chosen)
        if problem.frame is None:
            return cls(rows, ("candidate",), np.arange(float(problem.n))[chosen][:, None])
        numbers = problem.frame.select_dtypes("number")
        values = numbers.to_numpy(dtype=float)[chosen]
        return cls(rows, tuple(map(str, numbers.columns)), values)

    @classmethod
    def of_region(cls, region: Region, x: Array) -> "Places":
        """Points x (n, d)."""
        return cls(region.rows_at(x), region.variables, x)


def places_of(model: Problem | Region, name: str) -> dict[str, Any]:
    """Where a model predicts for a criterion that does not say where: at all its places.

    Those of a problem are its candidates. Of a region a mean of predictions (I) is that over all
    points, see `Region.mean_over_points`. The largest one (prediction_G) has to be told its places
    there: of no finite list it is known that a peak between its points is not larger.
    """
    if isinstance(model, Problem):
        return {"points": model.factors()}
    if "weights" in criteria.parameters_of(name):
        rows, weights = model.mean_over_points()
        return {"points": rows, "weights": weights}
    return {}


def _coded(problem: Problem) -> tuple[tuple[str, ...], Indices, Mask, Array]:
    """Columns (n, c) of a frame as numbers, with a column for each level of a factor but its first.

    Its levels are in the order of the formula. One of more levels than columns of the model, and
    one that the formula does not use, has none.

    Returns:
        Names (c,), of which column of the frame each is, whether it is a level, and the numbers.
    """
    found: list[tuple[str, int, bool, Array]] = []
    frame, used = problem.frame, problem.needed
    assert frame is not None
    assert used is not None
    for i, (name, column) in enumerate(frame.items()):
        if column.dtype.kind in NUMBERS:
            found.append((str(name), i, False, column.to_numpy(dtype=float)))
            continue
        codes = column.astype("category").cat if name in used else None
        levels: list[Any] = [] if codes is None else list(codes.categories)
        for level in levels[1:] if len(levels) <= problem.p + 1 else ():
            found.append((f"{name}[{level}]", i, True, (column == level).to_numpy(dtype=float)))
    columns = np.reshape([one[3] for one in found], (len(found), len(frame))).T
    of, is_level = np.array([one[1] for one in found]), np.array([one[2] for one in found], bool)
    return tuple(one[0] for one in found), of, is_level, columns


@dataclass(frozen=True, eq=False)
class ModelDesign:
    """A design, seen as the rows that it measures.

    Attributes:
        criterion: What it was made for.
        model: The problem or the region.
        support: The experiments that are made.
        counts: How often each (k,), or its weight.
        size: Number of experiments; None of weights, which are those of one.
        known: What is known beside them, shared by `size` experiments; None for nothing.
        kept: Number of experiments at hand that are none of the support.
        chosen: Numbers (k,) of the support among the candidates; None in a region.
        arranged: The plan, where the errors of its runs hang together.
    """

    criterion: Criterion
    model: Problem | Region
    support: Places
    counts: Array
    size: int | None
    known: Known | None
    kept: int = 0
    chosen: Indices | None = None
    arranged: ArrangedPlan | None = None

    @classmethod
    def of(cls, design: Design) -> "ModelDesign":
        """See a plan or a relaxation in this way.

        Raises:
            UserError: It does not hold its candidates, or not all that was measured.
        """
        if isinstance(design, RegionPlan | RelaxedRegion):
            return cls._of_region(design)
        if not isinstance(design, ProblemPlan | Relaxation):
            raise UserError(
                f"expected a plan or weights of a Problem or a Region, not {type(design).__name__}"
            )
        problem = design.problem
        if problem is None:
            raise UserError("the weights do not hold their candidates; edtk.relax keeps them")
        if isinstance(design, Relaxation):
            return cls.of_counts(problem, design.criterion, design.weights, None)
        if design.block_counts is not None or design.elsewhere:
            raise UserError(
                "blocks and experiments kept elsewhere are no candidates; expected counts alone"
            )
        found = cls.of_counts(problem, design.criterion, design.counts, design.size)
        return replace(found, arranged=design) if isinstance(design, ArrangedPlan) else found

    @classmethod
    def of_counts(
        cls, problem: Problem, criterion: Criterion, shares: Array | Indices, size: int | None
    ) -> "ModelDesign":
        """Counts or weights (n,) of the candidates of a problem."""
        chosen = np.flatnonzero(shares)
        places = Places.of_problem(problem, chosen)
        counts = np.asarray(shares[chosen], dtype=float)
        return cls(criterion, problem, places, counts, size, problem.known, chosen=chosen)

    @classmethod
    def _of_region(cls, design: RegionPlan | RelaxedRegion) -> "ModelDesign":
        places = Places.of_region(design.region, design.points)
        known = design.region.known
        if isinstance(design, RelaxedRegion):
            weights = design.weights
            return cls(design.criterion, design.region, places, weights, None, known)
        # What was kept is part of the region's prior, in equal parts for each new experiment.
        size = design.size
        counts = design.counts.astype(float)
        return cls(design.criterion, design.region, places, counts, size, known, design.kept)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names (p,)."""
        return self.model.parameters

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    @cached_property
    def places(self) -> Places:
        """Where a design is judged: all candidates, or points spread evenly over the region."""
        if isinstance(self.model, Problem):
            return Places.of_problem(self.model)
        from scipy.stats import qmc

        low, high = self.model.limits
        x = low + (high - low) * qmc.Halton(self.model.size, scramble=False).random(
            PREDICTED_PLACES
        )
        inside = x[self.model.at(x).feasible]
        # Of a region that fills little of its box some points are moved onto its walls.
        found = (
            inside
            if len(inside) >= FEWEST_PLACES
            else RegionGrid.of(self.model, PREDICTED_PLACES).x
        )
        return Places.of_region(self.model, found)

    @cached_property
    def rows(self) -> Array:
        """Rows F (k, p) with ``F'F = M``: each times the root of its count, and what is known."""
        A = self.support.rows * np.sqrt(self.counts)[:, None, None]
        parts = [A.reshape(-1, self.p) if self.arranged is None else self.arranged.turned]
        if self.known is not None:
            # Weights are of one experiment, and new experiments share what is known.
            parts.append(np.sqrt(float(self.counts.sum())) * self.known.root)
        return np.concatenate(parts)

    @cached_property
    def root(self) -> Array:
        """Triangle R (p, p) with ``R'R = M``.

        Raises:
            UserError: The design leaves parameters open.
        """
        R, unit = self._triangle
        if self.is_open:
            raise UserError("the design leaves parameters open")
        return np.asarray(R * unit)

    @cached_property
    def is_open(self) -> bool:
        """Whether the design does not tell some parameters."""
        R, _ = self._triangle
        is_square = len(R) == self.p and np.diag(R).all()
        return bool(not is_square or np.linalg.svd(R, compute_uv=False)[-1] <= OPEN)

    @cached_property
    def _triangle(self) -> tuple[Array, Array]:
        """R at unit lengths of the columns, and the lengths (p,)."""
        lengths = np.linalg.norm(self.rows, axis=0)
        unit = np.where(lengths > 0, lengths, 1.0)
        return np.asarray(np.linalg.qr(self.rows / unit, mode="r")), unit

    @cached_property
    def covariance(self) -> Array:
        """Covariance (p, p) of the estimates, in units of the noise; of weights for one."""
        inverse = solve_triangular(self.root, np.eye(self.p))
        return np.asarray(inverse @ inverse.T)

    @property
    def freedom(self) -> int:
        """Degrees of freedom that are left for the noise; none of weights."""
        if self.size is None:
            return 0
        measured = np.any(self.support.rows != 0, axis=2).sum(axis=1) @ self.counts
        return max(0, int(measured) + self.kept * self.support.rows.shape[1] - self.p)

    def variances(self, rows: Array) -> Array:
        """Variances (n,) of predictions ``trace(A cov A')`` of rows (n, r, p), by the noise."""
        solved = solve_triangular(self.root, rows.reshape(-1, self.p).T, trans="T")
        return np.asarray(np.square(solved).sum(axis=0).reshape(rows.shape[:2]).sum(axis=1))

    def cost(self, criterion: Criterion) -> float:
        """A criterion's cost of all experiments together; of weights, of one."""
        T = solve_triangular(self.root, np.eye(self.p))
        own = criterion.transformed(T)
        if own is not None:
            return float(own.cost(np.eye(self.p)))
        return float(criterion.cost(self.rows.T @ self.rows))

    def powers(
        self,
        effects: Array,
        level: float = TEST_LEVEL,
        freedom: int | None = None,
        size: float = 1.0,
    ) -> Array:
        """Power (e, p) of the test that a parameter is zero, if it has a given size.

        The statistic ``(k / s)^2`` has the non-central distribution ``F(1, f, effect^2 / var)``
        with f degrees of freedom left for the noise. Without any the noise is taken for known, and
        it is the chi-square distribution.

        Args:
            effects: Sizes (e,), or (e, p), in units of the parameters.
            level: Probability of a false alarm.
            freedom: Degrees of freedom for the noise; defaults to those of the design.
            size: Number of experiments that weights stand for.
        """
        from scipy.stats import chi2, f, ncf, ncx2  # takes a second, which a stopped run has not

        variance = np.diag(self.covariance) / size
        given = np.asarray(effects, dtype=float)
        lam = (given if given.ndim == 2 else given[:, None]) ** 2 / variance
        df = self.freedom if freedom is None else freedom
        if df:
            power = ncf.sf(f.isf(level, 1, df), 1, df, lam)
        else:
            power = ncx2.sf(chi2.isf(level, 1), 1, lam)
        # Without an effect the distribution is the central one.
        return np.asarray(np.where(lam > 0, power, level))

    @property
    def new(self) -> float:
        """Number of new experiments, among which what is known is shared; one of weights."""
        return 1.0 if self.size is None else float(self.size - self.kept)

    def efficiency(self, criterion: Criterion) -> float:
        """``bound / cost`` against every design of as many experiments on this model."""
        return self.bound(criterion, self.new) / self.cost(criterion)

    def bound(self, criterion: Criterion, new: float) -> float:
        """No design of so many new experiments on this model has a lower cost."""
        if criterion is self.largest_prediction:
            # It is at least the mean over the design itself, which is p (Kiefer, Wolfowitz 1960).
            return self.p / new
        return self._least(criterion.for_size(new)) * new**-criterion.degree

    def _least(self, criterion: Criterion) -> float:
        """The bound on the cost of weights."""
        if criterion not in self._found:
            if isinstance(self.model, Problem):
                found = relax(self.model, criterion).proved_bound
            else:
                found = relax_region(self.model, criterion).told_bound
            self._found[criterion] = found.cost
        return self._found[criterion]

    @cached_property
    def _found(self) -> dict[Criterion, float]:
        """Bounds that were computed already."""
        return {}

    @cached_property
    def largest_prediction(self) -> Criterion | None:
        """The largest variance of a prediction; None where a prior hides its bound.

        Its places are all candidates; in a region a grid with the walls, and the support.
        """
        if self.known is not None:
            return None
        rows = self.places.rows
        if isinstance(self.model, Region):
            grid = RegionGrid.of(self.model, PREDICTED_PLACES).x
            rows = np.concatenate([self.model.rows_at(grid), self.support.rows])
        return criteria.create("prediction_G", points=rows)

    def other_criteria(self, names: Sequence[Any] | None = None) -> dict[str, Criterion]:
        """Criteria by their labels; by default those that any model has.

        They are its own, D, A, E, the largest variance of a parameter (G), and the mean and the
        largest variance of predictions: I, see `places_of`, and prediction_G where it has a bound,
        see `largest_prediction`.

        Raises:
            ArgumentError: A criterion has no bound.
        """
        if names is not None:
            found = [self._asked(one) for one in names]
            if not found:
                raise ArgumentError("expected at least one", argument="criteria")
            for one in found:
                if not isinstance(one, Relaxable):
                    message = f"{one.label} has no convex form, and so no bound"
                    raise ArgumentError(message, argument="criteria")
            return {one.label: one for one in found}
        asked: list[Criterion] = [self.criterion] if isinstance(self.criterion, Relaxable) else []
        asked += [criteria.create(name) for name in ("D", "A", "E", "G")]
        asked.append(criteria.create("I", **places_of(self.model, "I")))
        if self.largest_prediction is not None:
            asked.append(self.largest_prediction)
        return {one.label: one for one in asked}

    def _asked(self, one: Any) -> Criterion:
        """The criterion that somebody names, with the places of `other_criteria`."""
        if isinstance(one, str) and one == "prediction_G" and self.largest_prediction is not None:
            return self.largest_prediction
        return criteria.as_criterion(one, self.parameters, lambda name: places_of(self.model, name))

    def columns(self, beyond: Any = None) -> tuple[tuple[str, ...], Array, Array]:
        """Columns of the model and of terms that it leaves out, at the support.

        Args:
            beyond: The terms: an array (n, q) of all candidates, or a function of points (k, d); a
                mapping of names to columns (n,). By default products of two variables, levels of a
                factor among them, or of two regressors where the candidates have none.

        Returns:
            Names (q,) of the terms, columns (k r, p) of the model, and (k r, q) of the terms.
        """
        X = self.support.rows.reshape(-1, self.p)
        if beyond is None:
            names, Z = self._products()
        else:
            names, Z = self._given(beyond)
            Z = np.repeat(Z, self.support.rows.shape[1], axis=0)
        return names, X, self._whitened(Z, self.support)

    def _products(self) -> tuple[tuple[str, ...], Array]:
        """Products (k r, q) of two variables that the model does not have already."""
        names, of, every, own = self._variables()
        pairs = [(i, j) for i, j in combinations(range(len(names)), 2) if of[i] != of[j]]
        if not pairs:
            return (), np.zeros((len(own), 0))
        i, j = np.transpose(pairs)
        is_new = self._left_out(every[:, i] * every[:, j])
        called = (f"{names[a]} {names[b]}" for a, b in pairs)
        new = tuple(name for name, is_left in zip(called, is_new, strict=True) if is_left)
        return new, own[:, i[is_new]] * own[:, j[is_new]]

    def _variables(self) -> tuple[tuple[str, ...], Sequence[int], Array, Array]:
        """Names (c,) of columns, of which variable each is, and the columns themselves.

        A variable that is a number has one column. A factor of the model has one for each level but
        the first, as in a formula. Candidates without a frame have their regressors.

        Returns:
            Names and variables (c,), and columns (n r, c) at all places, (k r, c) of the support.
        """
        r = self.support.rows.shape[1]
        if isinstance(self.model, Region):
            every, own = (np.repeat(at.values, r, axis=0) for at in (self.places, self.support))
            return self.support.names, range(self.model.size), every, own
        if self.model.frame is None:
            rows = self.places.rows
            noise = self._noise(self.places).reshape(-1, r, 1)
            every = np.multiply(rows, noise, where=rows != 0, out=np.zeros(rows.shape))
            own = every[self.chosen].reshape(-1, self.p)
            return self.parameters, range(self.p), every.reshape(-1, self.p), own
        names, numbers, is_level, coded = _coded(self.model)
        of_model = ~(is_level & self._left_out(np.repeat(coded, r, axis=0)))
        names = tuple(name for name, is_kept in zip(names, of_model, strict=True) if is_kept)
        every = coded[:, of_model]
        own = every[self.chosen]
        return (
            names,
            numbers[of_model].tolist(),
            np.repeat(every, r, axis=0),
            np.repeat(own, r, axis=0),
        )

    def _left_out(self, Z: Array) -> Mask:
        """Which terms (n r, q) at all places are no combination of the model's columns."""
        rows = self.places.rows.reshape(-1, self.p)
        whole = self._whitened(Z, self.places)
        left = whole - rows @ np.linalg.lstsq(rows, whole, rcond=None)[0]
        return np.asarray(
            np.linalg.norm(left, axis=0) > LEFT_OF_COLUMN * np.linalg.norm(whole, axis=0)
        )

    def _whitened(self, Z: Array, places: Places) -> Array:
        """Terms (k r, q) of all places or of the support, divided as rows are."""
        return np.asarray(Z / self._noise(places))

    def _noise(self, places: Places) -> Array:
        """By what rows of all places or of the support were divided, (k r, 1).

        Raises:
            UserError: Rows are no multiples of derivatives.
        """
        sigma: Array | float | None = None
        if self.model.robust is None and isinstance(self.model, Region):
            sigma = self.model.noise_at(places.values)
        elif self.model.robust is None and isinstance(self.model, Problem):
            sigma = self.model.noise
            if isinstance(sigma, np.ndarray) and places is self.support:
                sigma = sigma[self.chosen]
        if sigma is None:
            raise UserError(
                "terms beyond a model have no rows where errors of responses hang together, noise "
                "depends on theta, or models are several"
            )
        return np.broadcast_to(sigma, places.rows.shape[:2]).reshape(-1, 1)

    def _given(self, beyond: Any) -> tuple[tuple[str, ...], Array]:
        """Terms (k, q) as they were given, with their names.

        Raises:
            ArgumentError: They are not one column for each candidate.
        """
        names: tuple[str, ...] | None = None
        if isinstance(beyond, Mapping):
            names = tuple(map(str, beyond))
            beyond = np.stack([np.asarray(column, dtype=float) for column in beyond.values()], -1)
        if isinstance(self.model, Problem):
            n = self.model.n
            message = f"expected columns (n, q) of {n} candidates, or a mapping of names to columns"
        else:
            n = len(self.support.values)
            message = "expected a function of points (k, d) with columns (k, q)"
            if not callable(beyond):
                raise ArgumentError(message, argument="beyond")
            beyond = beyond(self.support.values)
        try:
            Z = np.asarray(beyond, dtype=float)
        except (TypeError, ValueError, OverflowError) as error:
            raise ArgumentError(message, argument="beyond") from error
        if Z.ndim != 2 or len(Z) != n or not np.isfinite(Z).all():
            raise ArgumentError(message, argument="beyond")
        if isinstance(self.model, Problem):
            Z = Z[self.chosen]
        return names or tuple(f"term {i + 1}" for i in range(Z.shape[1])), Z

    def aliases(self, beyond: Any = None) -> tuple[tuple[str, ...], Array]:
        """Names (q,) of terms that the model leaves out, and the bias (p, q) that each brings.

        It is ``inv(M) X1' X2``: what the estimates change by if the term's coefficient is one.
        Where errors hang together, their precision stands between X1' and X2.
        """
        names, X, Z = self.columns(beyond)
        if self.arranged is not None:
            assert self.chosen is not None
            runs = np.searchsorted(self.chosen, self.arranged.places)
            k, r = self.support.rows.shape[:2]
            Z = self.arranged.turn(Z.reshape(k, r, len(names))[runs])
            return names, np.asarray(self.covariance @ (self.arranged.turned.T @ Z))
        w = np.repeat(self.counts, self.support.rows.shape[1])
        return names, np.asarray(self.covariance @ (X.T @ (w[:, None] * Z)))

    def correlations(self, beyond: Any = None) -> tuple[tuple[str, ...], Array]:
        """Names (c,) of all columns and their correlations (c, c) over the experiments.

        Columns that do not vary are left out. If the model has a constant, correlations are about
        means; without one they are cosines.
        """
        names, X, Z = self.columns(beyond)
        columns = np.concatenate([X, Z], axis=1)
        w = np.repeat(self.counts, self.support.rows.shape[1]).astype(float)
        w = w / w.sum()
        rows = self.places.rows.reshape(-1, self.p)
        one = np.ones(len(rows))
        rest = one - rows @ np.linalg.lstsq(rows, one, rcond=None)[0]
        if np.linalg.norm(rest) <= LEFT_OF_COLUMN * np.sqrt(len(rows)):
            columns = columns - w @ columns
        sizes = np.sqrt(w @ columns**2)
        largest = np.abs(np.concatenate([X, Z], axis=1)).max(axis=0)
        varies = sizes > LEFT_OF_COLUMN * largest
        unit = columns[:, varies] / sizes[varies]
        every = (*self.parameters, *names)
        told = tuple(name for name, is_kept in zip(every, varies, strict=True) if is_kept)
        return told, np.asarray(np.clip(unit.T @ (w[:, None] * unit), -1, 1))
