"""Where the experiments of a model may lie, whatever its parameters are: candidates, or a box."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import qmc

from edtk.design.information import side_by_side
from edtk.design.problem import Problem
from edtk.design.problems import DescribedProblem, several_models
from edtk.design.region import Region, UserFunction, user_functions
from edtk.design.user_model import as_names
from edtk.system.errors import ArgumentError, real_numbers
from edtk.system.typing import Array, Mask

if TYPE_CHECKING:
    import pandas as pd

POINTS_TRIED = 128  # points of a box at which a model is tried

# What a model is made of at these sites.
Made = TypeVar("Made", Problem, Region)
# Points (n, d) to whitened rows (n, r, p).
RowsAt = Callable[[Any], Any]
RowsOfEach = Callable[[Any], Sequence[Any]]


@dataclass(frozen=True, eq=False)
class Sites(ABC, Generic[Made]):
    """Where experiments may lie.

    Attributes:
        trial: Points (n, d) at which a model is tried before any work.
        variables: Names (d,); None as long as nobody has told them.
    """

    trial: Array
    variables: tuple[str, ...] | None

    @property
    def has_noise(self) -> bool:
        """Whether places have a noise of their own, besides that of the model."""
        return False

    @abstractmethod
    def alone(self, rows: RowsAt, parameters: Sequence[str], prior: Any = None) -> Made:
        """The problem or the region of one model.

        Args:
            rows: Points (n, d) to whitened rows (n, r, p).
            parameters: Names (p,).
            prior: Prior information (p, p); None for none.
        """

    @abstractmethod
    def together(self, models: Sequence[Made], rows_of_each: RowsOfEach) -> Made:
        """Several models side by side, each with parameters of its own.

        Args:
            models: The problem or the region of each.
            rows_of_each: Points (n, d) to the whitened rows (n, r, p) of each.
        """

    @abstractmethod
    def allowed(self, x: Array) -> Mask:
        """Which points (n, d) an experiment may have; elsewhere a model need not be defined."""


@dataclass(frozen=True, eq=False)
class CandidateSites(Sites[Problem]):
    """Candidates, at all of which a model is tried.

    Attributes:
        noise: Standard deviations of each candidate, see `Problem`; None for none.
    """

    noise: Array | None = None

    @classmethod
    def of(
        cls,
        candidates: "ArrayLike | pd.DataFrame",
        variables: str | Sequence[str] | None,
        sigma: Any = None,
    ) -> "CandidateSites":
        """Points (n, d) or (n,), or a data frame whose columns are the variables.

        Args:
            candidates: The points.
            variables: Names (d,).
            sigma: Noise, which is kept here if there is one for each candidate.

        Raises:
            ArgumentError: They are no finite numbers.
        """
        names = tuple(map(str, candidates.columns)) if hasattr(candidates, "columns") else None
        try:
            points = np.asarray(candidates, dtype=float)
        except (TypeError, ValueError, OverflowError) as error:
            raise ArgumentError("expected numbers", argument="candidates") from error
        points = points[:, None] if points.ndim == 1 else points
        if points.ndim != 2 or 0 in points.shape:
            message = f"expected points (n, d) or (n,), not of shape {points.shape}"
            raise ArgumentError(message, argument="candidates")
        lost = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(lost):
            raise ArgumentError(f"point {lost[0]} is not finite", argument="candidates")
        is_array = sigma is not None and not callable(sigma) and not isinstance(sigma, str)
        noise = real_numbers(sigma, "sigma") if is_array else np.empty(())
        is_of_each = len(points) > 1 and noise.shape[:1] == (len(points),)
        return cls(points, _told(names, variables), noise if is_of_each else None)

    @property
    def has_noise(self) -> bool:
        """Whether each has a standard deviation."""
        return self.noise is not None

    @property
    def frame(self) -> "pd.DataFrame":
        """The candidates as a table."""
        import pandas as pd

        assert self.variables is not None
        return pd.DataFrame(self.trial, columns=list(self.variables))

    def alone(self, rows: RowsAt, parameters: Sequence[str], prior: Any = None) -> DescribedProblem:
        """The candidates under one model."""
        sigma = 1.0 if self.noise is None else self.noise
        found = DescribedProblem(rows(self.trial), tuple(parameters), prior, self.frame, sigma)
        if self.noise is None:
            found.rows_of = lambda other: np.asarray(rows(other.to_numpy(dtype=float)))
        return found

    def together(self, models: Sequence[Problem], rows_of_each: RowsOfEach) -> DescribedProblem:
        """The candidates under several models."""
        return DescribedProblem.of(several_models(models), self.frame)

    def allowed(self, x: Array) -> Mask:
        """All are."""
        return np.ones(len(x), dtype=bool)


@dataclass(frozen=True, eq=False)
class BoxSites(Sites[Region]):
    """A box under constraints, of which a model is tried at some points.

    Attributes:
        low: Lower bounds (d,).
        high: Upper bounds (d,).
        constraints: Functions of points whose values are zero or positive where one is allowed.
    """

    low: Array
    high: Array
    constraints: tuple[UserFunction, ...]

    @classmethod
    def of(cls, box: Any, variables: str | Sequence[str] | None, constraints: Any) -> "BoxSites":
        """(low, high) of one variable or of each, or a mapping with names.

        Raises:
            ArgumentError: They are no such pairs, or constraints are no functions.
        """
        names = None
        if isinstance(box, Mapping):
            names = tuple(box)
            box = list(box.values())
        try:
            pairs = np.atleast_2d(np.asarray(box, dtype=float))
        except (TypeError, ValueError, OverflowError) as error:
            raise ArgumentError("expected (low, high) of each variable", argument="box") from error
        fits = pairs.ndim == 2 and pairs.shape[1] == 2 and np.isfinite(pairs).all()
        if not fits or not (pairs[:, 0] < pairs[:, 1]).all():
            message = "expected finite (low, high) of each variable, low below high"
            raise ArgumentError(message, argument="box")
        low, high = pairs.T
        functions = user_functions(constraints, "constraints", pairs.T)
        halton = qmc.Halton(len(low), scramble=False).random(POINTS_TRIED)
        points = low + (high - low) * halton
        for constraint in functions:
            kept = constraint(points).reshape(len(points), -1).min(axis=1) >= 0
            points = points[kept] if kept.any() else points
        return cls(points, _told(names, variables), low, high, functions)

    def alone(self, rows: RowsAt, parameters: Sequence[str], prior: Any = None) -> Region:
        """The box under one model."""
        return Region(
            rows,
            self.low,
            self.high,
            constraints=[one.function for one in self.constraints],
            parameters=parameters,
            prior=prior,
            variables=self.variables,
        )

    def together(self, models: Sequence[Region], rows_of_each: RowsOfEach) -> Region:
        """The box under several models."""
        beside = several_models([model.problem(self.trial[:1]) for model in models])
        return self.alone(lambda x: side_by_side(rows_of_each(x)), beside.parameters, beside.prior)

    def allowed(self, x: Array) -> Mask:
        """Those that obey the constraints."""
        slacks = [constraint(x).reshape(len(x), -1) for constraint in self.constraints]
        return np.concatenate([np.zeros((len(x), 1)), *slacks], axis=1).min(axis=1) >= 0


def _told(
    names: tuple[str, ...] | None, variables: str | Sequence[str] | None
) -> tuple[str, ...] | None:
    """Names of variables: those that are stated, before those of a table."""
    return names if variables is None else as_names(variables)
