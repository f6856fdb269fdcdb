"""Ranges of parameters that a design has to serve: a list of models stands in for all of them.

The worst theta of a design joins the list, and the next design is the best for the longer list,
until no theta is worse than those of it (constraint generation, as in semi-infinite programming:
Pronzato and Walter, Automatica 24, 1988). The list proves what no design can exceed anywhere in the
ranges; that no theta is worse than the worst one that was found rests on a search.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar, cast

import numpy as np

from criteria import Criterion
from edtk.design.user_model import as_names, point_text
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices, Mask

# A place within ranges, in parts of them: not the middle, where symmetric ranges have a zero, at
# which a model may lose a parameter.
OFF_MIDDLE = 0.618
THETA_TRIED = 256  # theta of a grid at most
MOST_LEVELS = 33
MOST_RANGES = 8  # of which the grid has both ends
SEARCHES = 6  # from the lowest of its local minima
ROUNDING_OF_ROOT = 1e-9  # of a root that is a whole number
NO_EFFICIENCY = 1e-300  # efficiency of a design that does not tell all that is asked for
# Part of the largest deviance that is tried up to which a rival is no other model.
SAME_MODEL = 1e-20
THETA_STEP = 1e-5  # of central differences, in parts of a range
# Of the distance to the nearest theta, up to which others are at its peak. It was tuned on ranges
# of biexponential models, of Michaelis and Menten's, and of models of compartments.
SAME_PEAK = 2.0
SAME_THETA = 1e-6  # parts of the ranges up to which two theta are one


@dataclass(frozen=True, eq=False)
class Robust:
    """Several models, of which one design is to be good for each.

    Attributes:
        kind: "bayes", the mean over the models, "maximin", the worst of them against the best
            design of each, or "rivals", the worst of them as it is.
        models: The problem or the region of each alone.
        weights: How much each counts in the mean (k,), of sum one.
        box: The `ThetaBox` that the models begin to stand in for; None of a plain list.
    """

    kind: str
    models: tuple[Any, ...]
    weights: Array
    box: "ThetaBox[Any] | None" = None


class Served(Protocol):
    """What is made of several models: a problem, or a region."""

    robust: Robust | None


# What a model is made of at these sites.
Made = TypeVar("Made", bound=Served)
# Points (n, d) to whitened rows (n, r, p).
RowsAt = Callable[[Any], Any]
Scale = Callable[[Array], Array | None]  # points (n, d) to (n, r)
RowsOfEach = Callable[[Any], Sequence[Any]]


@dataclass(frozen=True, eq=False)
class Sites(ABC, Generic[Made]):
    """Where experiments may lie.

    Attributes:
        trial: Points (n, d) at which a model is tried before any work.
        variables: Names (d,); None as long as nobody has told them.
        noise: Standard deviations (n,), (n, 1) or (n, r) that each candidate has besides those of
            the model; None for ones.
    """

    trial: Array
    variables: tuple[str, ...] | None
    noise: Array | None

    @abstractmethod
    def alone(self, rows: RowsAt, parameters: Sequence[str], prior: Any = None) -> Made:
        """The problem or the region of one model.

        Args:
            rows: Points (n, d) to whitened rows (n, r, p).
            parameters: Names (p,).
            prior: Prior information (p, p); None for none.
        """

    @abstractmethod
    def scaled(self, found: Made, scale: "Scale") -> None:
        """Tell the problem or the region of one model by what its rows were divided.

        Args:
            found: What `alone` has made.
            scale: Points (n, d) to positive numbers (n, r); to None, where rows are no multiples.
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


def told_names(
    names: tuple[str, ...] | None, variables: str | Sequence[str] | None
) -> tuple[str, ...] | None:
    """Names of variables: those that are stated, before those of a table."""
    return names if variables is None else as_names(variables)


@dataclass(frozen=True, eq=False)
class Shares:
    """How experiments are shared out among points.

    Attributes:
        x: Points (k, d).
        weights: Weights of rows (k, r), or of points (k, 1): parts of sum one, over the squares of
            the noise that a point has besides that of its model.
    """

    x: Array
    weights: Array

    @classmethod
    def of(cls, x: Array, numbers: Array, noise: Array | None = None) -> "Shares":
        """Points (n, d) with weights or counts (n,), of which those without any are left out.

        Args:
            x: The points.
            numbers: Weights or counts.
            noise: Standard deviations (n, 1) or (n, r) of each point; None for ones.
        """
        has = numbers > 0
        weights = np.asarray(numbers[has] / numbers.sum())[:, None]
        return cls(x[has], weights if noise is None else weights / noise[has] ** 2)

    def mixed(self, other: "Shares", part: float) -> "Shares":
        """These to a part, and the others to the rest."""
        weights = np.concatenate([part * self.weights, (1 - part) * other.weights])
        return Shares(np.concatenate([self.x, other.x]), weights)


# The criterion of one model, which may be about places where the model at a theta predicts.
Own = Callable[["ThetaBox[Any]", Array], Criterion]
# The best cost of one model alone, and how experiments are shared out then.
Optimum = Callable[[Any, Criterion], tuple[float, Shares]]


@dataclass(frozen=True)
class WorstTheta:
    """Where in the ranges a design is worst, as far as a search has seen.

    Attributes:
        theta: The parameters by their names.
        value: The least efficiency of the design: that of its weights, or of its counts over their
            number, against the best weights at the theta. Of rivals the least deviance of one
            experiment.
        thetas: The list (k, p) that the bound is proved of. No design does better at its worst
            theta of the list, and so of the ranges.
        what: What the value is, in words.
    """

    theta: Mapping[str, float]
    value: float
    thetas: Array
    what: str

    def __str__(self) -> str:
        where = point_text(tuple(self.theta), np.array(list(self.theta.values())))
        return f"{self.what} {self.value:.5g} at {where} (searched; {len(self.thetas)} theta)"


@dataclass(frozen=True, eq=False)
class ThetaBox(ABC, Generic[Made]):
    """Ranges of theta, and the model at each of them.

    Attributes:
        rows: Theta (t, p) and points (n, d) to whitened rows (n, r, s) of each.
        sites: Where experiments may lie.
        limits: Bounds (2, p) of theta; a parameter without a range has equal ones.
        names: Names (p,) of theta.
        parameters: Names (s,) of what the rows are about.
    """

    rows: Callable[[Array, Any], Sequence[Any]]
    sites: Sites[Made]
    limits: Array
    names: tuple[str, ...]
    parameters: tuple[str, ...]
    _models: dict[bytes, Made] = field(default_factory=dict)

    kind = "maximin"
    what = "least efficiency"

    @property
    def free(self) -> Indices:
        """Numbers of the parameters that have a range."""
        return np.asarray(np.flatnonzero(self.limits[0] < self.limits[1]))

    def at(self, u: Array) -> Array:
        """Theta (..., p) from the free parameters in parts (..., q) of their ranges."""
        low, high = self.limits
        theta = np.tile(low, (*np.shape(u)[:-1], 1))
        theta[..., self.free] += np.clip(u, 0, 1) * (high - low)[self.free]
        return np.clip(theta, low, high)

    def among(self, sites: Sites[Any]) -> "ThetaBox[Any]":
        """The same ranges for other sites."""
        return cast("ThetaBox[Any]", replace(self, sites=sites, _models={}))

    def model(self, theta: Array) -> Made:
        """The problem or the region of one theta alone, once."""
        key = theta.tobytes()
        if key not in self._models:
            self._models[key] = self.sites.alone(
                lambda x: self.finite_rows(theta[None], x)[0], self.parameters
            )
        return self._models[key]

    def finite_rows(self, thetas: Array, x: Any) -> Sequence[Any]:
        """Rows of each theta (t, p) at points x (n, d), or at whatever has arithmetic.

        Raises:
            ArgumentError: They are not finite where an experiment may be; theta and point are
                named.
        """
        each = self.rows(thetas, x)
        if x.dtype == object:
            return each
        lost = ~np.isfinite(each).all(axis=(2, 3))
        if lost.any():
            lost &= self.sites.allowed(x)
        if lost.any():
            assert self.sites.variables is not None
            i, point = np.argwhere(lost)[0]
            where = point_text(self.sites.variables, x[point])
            message = f"at {point_text(self.names, thetas[i])} the model is not finite at {where}"
            raise ArgumentError(message, argument="theta")
        return each

    def listed(self, thetas: Sequence[Array]) -> Made:
        """The problem or the region of a list of theta."""
        each = tuple(self.model(theta) for theta in thetas)
        listed = np.array(thetas)
        found = self.sites.together(each, lambda x: self.finite_rows(listed, x))
        found.robust = Robust(self.kind, each, np.full(len(each), 1 / len(each)))
        return found

    def inside(self) -> Array:
        """A theta (p,) within the ranges."""
        return self.at(np.full(len(self.free), OFF_MIDDLE))

    def first(self) -> Made:
        """The problem or the region of one theta, which knows the ranges."""
        found = self.listed([self.inside()])
        assert found.robust is not None
        found.robust = replace(found.robust, box=self)
        return found

    @cached_property
    def tried(self) -> Array:
        """Parts (t, q) of the ranges: a grid with its ends."""
        q = len(self.free)
        levels = np.linspace(0, 1, self._levels)
        return np.stack(np.meshgrid(*[levels] * q, indexing="ij"), axis=-1).reshape(-1, q)

    @property
    def _levels(self) -> int:
        """Levels of the grid by each free parameter."""
        within = int(THETA_TRIED ** (1 / len(self.free)) + ROUNDING_OF_ROOT)
        return min(within, MOST_LEVELS)

    def lowest(self, values: Array) -> Indices:
        """The lowest of those of the grid (t,) that no neighbour is below."""
        from scipy.ndimage import minimum_filter

        cube = values.reshape([self._levels] * len(self.free))
        is_low = (minimum_filter(cube, size=3, mode="nearest") == cube).ravel()
        order = np.argsort(values, kind="stable")
        return np.asarray(order[is_low[order]][:SEARCHES])

    def worst(
        self,
        design: Shares,
        own: Own,
        optimum: Optimum,
        known: Sequence[Array],
        among: "ThetaBox[Any] | None" = None,
    ) -> tuple[Array, float]:
        """The worst theta for a design that a search finds, and its value.

        Args:
            design: How experiments are shared out.
            own: The criterion of one model, at a theta of this box.
            optimum: Finds the best weights for one model alone.
            known: Theta where the search begins, too.
            among: The same ranges for candidates, whose best weights tell where else to begin.
        """

        def values(thetas: Array) -> Array:
            return self.values(thetas, design, own, optimum)

        scanned = (among or self).values(self.at(self.tried), design, own, optimum)
        lowest: Array = self.tried[self.lowest(scanned)]
        begun = self._parts(known)[np.argmin(values(np.array(known)))]
        starts: list[Array] = [begun, *lowest]
        ends: list[Array] = [self.descend(u, design, own, optimum) for u in starts]
        thetas = self.at(np.array([*ends, *starts]))
        found = values(thetas)
        i = int(np.argmin(found))
        return thetas[i], float(found[i])

    def _parts(self, thetas: Sequence[Array]) -> Array:
        """Theta (k, q) in parts of the ranges."""
        low, high = self.limits[:, self.free]
        return np.asarray((np.array(thetas)[:, self.free] - low) / (high - low))

    def slope(self, function: Callable[[Array], Array], u: Array) -> Array:
        """Central differences (q, r) of a function of theta (t, p), by the parts u (q,)."""
        steps = np.eye(len(u)) * THETA_STEP
        ends = np.clip(np.stack([u + steps, u - steps]), 0, 1)
        up, down = function(self.at(ends.reshape(-1, len(u)))).reshape(2, len(u), -1)
        widths = np.diagonal(ends[0] - ends[1])
        return np.asarray((up - down) / widths[:, None])

    @abstractmethod
    def values(self, thetas: Array, design: Shares, own: Own, optimum: Optimum) -> Array:
        """How good a design is at each theta (t, p); the worst theta has the least."""

    @abstractmethod
    def descend(self, u: Array, design: Shares, own: Own, optimum: Optimum) -> Array:
        """Parts (q,) of the ranges of a local minimum of the value."""

    def between(self, theta: Array, thetas: Sequence[Array], parts: Array) -> Array:
        """About the theta (p,) of a peak that several of a list (k) stand for.

        Where a peak lies inside the ranges, theta on both sides of it share its part in the proof.
        The worst theta halves their distance, while their mean by parts is off by its square.

        Args:
            theta: The worst theta (p,) of the best design of the list.
            thetas: The list.
            parts: The part (k,) that each has in what proves that design.
        """
        away = np.abs(self._parts(thetas) - self._parts([theta])).max(axis=1)
        own = away <= SAME_PEAK * away.min()
        return np.asarray(np.average(np.array(thetas)[own], axis=0, weights=parts[own]))

    def is_new(self, theta: Array, thetas: Sequence[Array]) -> bool:
        """Whether a theta is none of a list."""
        far = np.abs(self._parts(thetas) - self._parts([theta]))
        return bool((far.max(axis=1) > SAME_THETA).all())


class EfficiencyBox(ThetaBox[Made]):
    """Ranges over which the least efficiency ``(best(theta) / cost(w, theta))^(1/d)`` counts."""

    def values(self, thetas: Array, design: Shares, own: Own, optimum: Optimum) -> Array:
        """The efficiencies (t,) of a design at theta (t, p)."""
        best = np.array([optimum(self.model(one), own(self, one))[0] for one in thetas])
        degree = own(self, thetas[0]).degree
        return np.asarray((best / self._costs(thetas, own, design)) ** (1 / degree))

    def descend(self, u: Array, design: Shares, own: Own, optimum: Optimum) -> Array:
        """A local minimum of the efficiency, by quasi-Newton steps.

        The slope of the best cost is that of the cost of the best weights, held fixed (Danskin).
        """
        from scipy.optimize import minimize

        def logarithm(v: Array) -> float:
            (value,) = self.values(self.at(v)[None], design, own, optimum)
            return float(np.log(max(value, NO_EFFICIENCY)))

        def slope(v: Array) -> Array:
            here = self.at(v)
            of_here = own(self, here)
            _, ideal = optimum(self.model(here), of_here)
            return self.slope(
                lambda thetas: (
                    np.log(self._costs(thetas, own, ideal) / self._costs(thetas, own, design))
                    / of_here.degree
                ),
                v,
            )[:, 0]

        bounds = [(0.0, 1.0)] * len(u)
        return np.asarray(minimize(logarithm, u, jac=slope, bounds=bounds, method="L-BFGS-B").x)

    def _costs(self, thetas: Array, own: Own, design: Shares) -> Array:
        """Costs (t,) of a design at theta (t, p)."""
        rows = np.asarray(self.finite_rows(thetas, design.x))
        M = np.einsum("nr,tnrp,tnrq->tpq", design.weights, rows, rows)
        return np.array([own(self, one).cost(each) for one, each in zip(thetas, M, strict=True)])


class RivalBox(ThetaBox[Made]):
    """Ranges of the parameters of a rival: rows are what its means lack, in parts of the noise.

    A list of rivals is a list of models of one parameter, whose information is the deviance
    ``sum w_i d(x_i, theta)``.
    """

    kind = "rivals"
    what = "least deviance"

    def values(self, thetas: Array, design: Shares, own: Own, optimum: Optimum) -> Array:
        """The deviances (t,) of one experiment."""
        return self._deviances(thetas, design)

    def descend(self, u: Array, design: Shares, own: Own, optimum: Optimum) -> Array:
        """A local minimum of the deviance, by least squares."""
        return self._fitted(u, design)

    def require_apart(self) -> None:
        """Check that some point that is tried tells the rival, whatever its parameters are.

        Raises:
            ArgumentError: The rival can be what it is told from; its parameters are named.
        """
        even = Shares.of(self.sites.trial, np.ones(len(self.sites.trial)))
        near = self.inside()[None]
        size = 0.0
        if len(self.free):
            sizes = self._deviances(self.at(self.tried), even)
            size = max(sizes)
            near = self.at(
                np.array([self._fitted(u, even) for u in self.tried[self.lowest(sizes)]])
            )
        for theta in near:
            if self._deviances(theta[None], even)[0] <= SAME_MODEL * size:
                where = point_text(self.names, theta)
                message = f"it is f at all points for {where}; expected parameters without that"
                raise ArgumentError(message, argument="rival_theta")

    def _fitted(self, u: Array, design: Shares) -> Array:
        from scipy.optimize import least_squares

        found = least_squares(
            lambda v: self._residuals(self.at(v)[None], design)[0],
            np.clip(u, THETA_STEP, 1 - THETA_STEP),
            jac=lambda v: self.slope(lambda thetas: self._residuals(thetas, design), v).T,
            bounds=(0.0, 1.0),
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        )
        return np.asarray(found.x)

    def _deviances(self, thetas: Array, design: Shares) -> Array:
        return np.asarray(np.square(self._residuals(thetas, design)).sum(axis=1))

    def _residuals(self, thetas: Array, design: Shares) -> Array:
        """Roots (t, n r) of the parts of the deviance at each theta (t, p)."""
        rows = np.asarray(self.finite_rows(thetas, design.x))[..., 0]
        return np.asarray((np.sqrt(design.weights) * rows).reshape(len(rows), -1))
