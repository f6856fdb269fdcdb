"""What criteria that are made of several others share: compound and minimax."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from criteria.criterion import Criterion
from criteria.curvature import Curvature
from criteria.errors import CriterionError
from criteria.interest import Interest
from criteria.linalg.estimable import estimable_inverse
from criteria.linalg.inverse import (
    ROUNDING,
    eigenpairs,
    full_rank_root,
    guarded_inverse,
    unit_spectrum,
)
from criteria.linalg.models import Models, put, taken
from criteria.linalg.spectrum import is_semidefinite
from criteria.linalg.typing import Array, Indices, Mask
from criteria.one_model import OneModel, in_models
from criteria.relaxable import Relaxable

FLOOR = 1e-12  # least eigenvalue, of the largest, of what splits a multiplier into parts


@dataclass(frozen=True, eq=False)
class Alike:
    """Parts with the same criterion, which are computed together.

    Attributes:
        criterion: The criterion.
        numbers: Which parts (g,) they are.
        places: Their parameters (g, s); None for a part that is about all of them.
    """

    criterion: Relaxable
    numbers: Indices
    places: Indices | None

    @classmethod
    def of(cls, parts: Sequence[Relaxable]) -> "tuple[Alike, ...]":
        """Sort parts by what they are about."""
        if not isinstance(parts[0], OneModel):
            return tuple(cls(part, np.array([i]), None) for i, part in enumerate(parts))
        groups: dict[tuple[int, int], list[OneModel]] = {}
        for part in parts:
            assert isinstance(part, OneModel)
            size = part.models.sizes[part.number]
            groups.setdefault((id(part.base), size), []).append(part)
        found = []
        for some in groups.values():
            numbers = np.array([part.number for part in some])
            found.append(cls(some[0].base, numbers, some[0].models.places(numbers)))
        return tuple(found)

    def blocks(self, M: Array) -> Array:
        """What they are about (..., g, s, s) of matrices (..., p, p)."""
        return M[..., None, :, :] if self.places is None else taken(M, self.places)

    def costs(self, M: Array, cov: Array) -> Array:
        """Costs (..., g) of regular M (..., p, p) with their inverses."""
        return self.criterion.cost_of_regular(self.blocks(M), self.blocks(cov))

    def slopes(self, M: Array, cov: Array) -> Array:
        """Minus the gradients (..., g, s, s) of the logarithms of the losses."""
        own = self.blocks(M)
        inverse = self.blocks(cov)
        cost = self.criterion.cost_of_regular(own, inverse)
        G = self.criterion.gradient_of_regular(own, inverse)
        return np.asarray(-G / (self.criterion.degree * cost)[..., None, None])


class SeveralCriteria(Relaxable):
    """A criterion of the losses ``f_j(M) = (cost_j(M) / best_j)^(1/d_j)`` of several others.

    With the least cost that can be had as best_j, the loss is the inverse of the efficiency: how
    many times as many experiments this design needs as the best one for criterion j alone. A cost
    that is convex and homogeneous of degree d has convex sublevel sets, so that ``1/f_j``, which is
    homogeneous of degree one, is concave, and f_j is convex.

    **Several models.** Let ``M = diag(M_1, .., M_k)`` be the information about k models side by
    side, see `edtk.several_models`. With `sizes` the criterion j is about model j alone. Costs,
    slopes and curvatures are then those of the blocks, of which models with the same criterion are
    computed together, and the parts of a multiplier are its own blocks.

    **Dual bound.** Of any parts ``Z_j >= 0`` with ``sum Z_j <= Z`` each bounds its own loss,
    ``f_j(X) >= q_j / y_j`` where ``y_j = <Z_j, X>`` and q_j is the polar of f_j, and
    ``sum y_j <= t`` bounds all of them together, see `_combined`.

    Args:
        criteria: Criteria, their names, or dictionaries of name and parameters. Each is convex,
            monotone and smooth.
        best: The best value of each (k,), as its formula prints it; defaults to one.
        sizes: Number of parameters of the model that each criterion is about; by default all
            criteria are about the same model.

    Raises:
        CriterionError: A criterion, the best values or the sizes are not such.
    """

    sense = "min"
    degree = 1.0
    needs_parameters = True
    takes_interest = False

    def _fill(
        self,
        criteria: Sequence[Criterion | str | Mapping[str, Any]],
        best: ArrayLike | None,
        sizes: Sequence[int] | None,
    ) -> None:
        """Check and keep what the constructors share."""
        # Imported late: the registry imports all criteria.
        from criteria.registry import as_criterion

        # A name that stands there several times is one criterion, and its parts are alike.
        named = {each: as_criterion(each) for each in criteria if isinstance(each, str)}
        made = [named[each] if isinstance(each, str) else as_criterion(each) for each in criteria]
        self._given = [_smooth(self.name, each) for each in made]
        if not self._given:
            raise CriterionError(f"criterion {self.name!r}: expected at least one criterion")
        self.sizes = None if sizes is None else tuple(int(size) for size in sizes)
        self._set_title()
        self.best = _best_costs(self.name, self._given, best)
        self._take(self._given if self.sizes is None else in_models(self._given, self.sizes))
        for part in self.parts:
            if part.order is not None and self.order is not None:
                part.require_order(self.order)

    def _set_title(self) -> None:
        self.title = f"{type(self).title} of {self._parts}"

    def named(self, parameters: tuple[str, ...]) -> Self:
        """The same parts, in words of these parameters where there is one model."""
        other = self._copy()
        if self.sizes is None:
            other._given = [part.named(parameters) for part in self._given]
            other._set_title()
        return other

    def _take(self, parts: Sequence[Relaxable]) -> None:
        """Set the criteria, each about its part of the parameters."""
        self.parts = tuple(parts)
        self.alike = Alike.of(self.parts)
        self.models = parts[0].models if isinstance(parts[0], OneModel) else None
        needed = [each.criterion.needs_all for each in self.alike]
        self.needs_all = any(needed) if self.models is None else all(needed)
        self.unit_free = all(part.unit_free for part in parts)

    @property
    def order(self) -> int | None:
        """That of the parts, if one of them has one."""
        return next((part.order for part in self.parts if part.order is not None), None)

    @property
    def label(self) -> str:
        """Such as "minimax of D, A"."""
        return f"{self.name} of {self._parts}"

    @property
    def _parts(self) -> str:
        """The parts in words; one criterion of several models is told once."""
        labels = [part.label for part in self._given]
        if self.sizes is not None and len(labels) > 1 and len(set(labels)) == 1:
            return f"{labels[0]} in {len(labels)} models"
        return ", ".join(labels)

    @property
    def arguments(self) -> dict[str, Any]:
        """What the constructor took, with the best values as costs' printed forms."""
        found: dict[str, Any] = {"criteria": [part.to_dict() for part in self._given]}
        values = [
            float(cost if part.sense == "min" else 1 / cost)
            for part, cost in zip(self._given, self.best, strict=True)
        ]
        found["best"] = values
        return found if self.sizes is None else {**found, "sizes": list(self.sizes)}

    def in_units(self, T: Array) -> Self:
        """The parts in other units; a best cost that the units change is changed with them."""
        other = self._copy()
        parts = [part.in_units(T) for part in self.parts]
        identity = np.eye(len(T))
        factors = [
            float(after.cost(T.T @ T) / before.cost(identity)) if before.unit_free else 1.0
            for before, after in zip(self.parts, parts, strict=True)
        ]
        other.best = self.best * factors
        other._take(parts)
        return other

    def transformed(self, T: Array) -> Self | None:
        """The parts as functions of other parameters; what they cost stays as it is.

        Returns:
            The criterion; None where T mixes parameters of several models.
        """
        if self.models is not None and not self.models.are_apart(T):
            return None
        parts = [part.transformed(T) for part in self.parts]
        # A multiple goes into the best cost, so that parts that differ by it alone stay alike.
        reduced = [part.as_multiple for part in parts if isinstance(part, Relaxable)]
        other = self._copy()
        other.best = self.best / [factor for _, factor in reduced]
        other._take([part for part, _ in reduced])
        return other

    def inverse(self, M: Array) -> tuple[Array, Array, Mask]:
        """An inverse that is good enough for all parts; of several models, block by block.

        Raises:
            CriterionError: The parts are about models, and M is not block diagonal.
        """
        if self.models is not None:
            return self._inverse_of_models(M, self.models)
        if self.needs_all:
            return guarded_inverse(M)
        rounded = max(part.rounded for part in self.interests)
        return estimable_inverse(M, np.hstack([part.K for part in self.interests]), rounded)

    def _inverse_of_models(self, M: Array, models: Models) -> tuple[Array, Array, Mask]:
        """The inverses of the blocks, with zeros beside them."""
        if not models.are_apart(M):
            raise CriterionError(
                f"criterion {self.name!r}: sizes are those of models side by side; expected "
                "information of several_models, which has zeros between them"
            )
        safe = np.zeros(M.shape)
        cov = np.zeros(M.shape)
        regular = np.ones(M.shape[:-2], dtype=bool)
        for each in self.alike:
            assert each.places is not None
            own, inverse, good = each.criterion.inverse(each.blocks(M))
            put(safe, each.places, own)
            put(cov, each.places, inverse)
            regular &= good.all(axis=-1)
        return safe, cov, regular

    def whitener(self, M: Array) -> Array:
        """T (p, r) with ``T' M T = I``; of several models, block by block."""
        if self.models is None:
            return super().whitener(M)
        return np.hstack([part.whitener(M) for part in self.parts])

    def strayed(self, M: Array) -> float:
        """The largest of the parts'."""
        return max(part.strayed(M) for part in self.parts)

    def missing(self, M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
        """What each part misses, once."""
        found = (word for part in self.parts for word in part.missing(M, parameters))
        return tuple(dict.fromkeys(found))

    def losses(self, M: Array, cov: Array) -> Array:
        """The losses f_j (..., k) of regular M (..., p, p) with their inverses."""
        found = np.empty((*M.shape[:-2], len(self.parts)))
        for each in self.alike:
            best = self.best[each.numbers]
            found[..., each.numbers] = (each.costs(M, cov) / best) ** (1 / each.criterion.degree)
        return found

    def slopes(self, M: Array, cov: Array) -> Array:
        """Minus the gradients of ``log f_j`` (..., k, p, p)."""
        p = M.shape[-1]
        found = np.zeros((*M.shape[:-2], len(self.parts), p, p))
        for each in self.alike:
            if each.places is None:
                found[..., each.numbers, :, :] = each.slopes(M, cov)
                continue
            rows = each.places[:, :, None]
            own = each.numbers[:, None, None]
            found[..., own, rows, each.places[:, None, :]] = each.slopes(M, cov)
        return found

    def mixed_slope(self, shares: Array, M: Array, cov: Array) -> Array:
        """``sum_j u_j G_j`` (..., p, p) of the slopes, for shares u (..., k)."""
        found = np.zeros(M.shape)
        for each in self.alike:
            own = shares[..., each.numbers, None, None] * each.slopes(M, cov)
            if each.places is None:
                found += own.sum(axis=-3)
            else:
                put(found, each.places, own)
        return found

    def logs_and_slopes(self, M: Array) -> tuple[Array, Array]:
        """``log f_j`` (k,) and their slopes (k, p, p) at M (p, p); inf where M is singular."""
        safe, cov, regular = self.inverse(M)
        losses = np.where(regular, self.losses(safe, cov), np.inf)
        return np.log(losses), self.slopes(safe, cov)

    def loss_curvatures(self, R: Array) -> tuple[Curvature, ...] | None:
        """The derivatives of each ``log f_j`` at a root R (p, p) of the covariance, if known."""
        found = []
        for part in self.parts:
            term = part.curvature(R)
            if term is None:
                return None
            found.append(term.power(1 / part.degree))
        return tuple(found)

    def dependence(self, scale: Array) -> float:
        """The largest of the parts'."""
        return max(part.dependence(scale) for part in self.parts)

    def rounding(self, W: Array) -> float:
        """The largest of the parts'."""
        return max(part.rounding(W) for part in self.parts)

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Whether the bound of a part does."""
        return any(part.rests_on_solver(Z, M) for part in self.parts)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The best of ``polar(Z_j) / t_j``.

        Of parts that are about combinations, Q holds all of them: as ``X >= Q C_Q(X) Q'``, the
        multiplier Q'Z Q bounds ``C_Q(X)``, which is regular where X need not be. See `Interest`.
        """
        if not self.needs_all and self.models is None:
            Q, N, regular = self._regular(M)
            # Q'Z Q may be semidefinite although Z is not, and then proves nothing.
            within = np.where(is_semidefinite(Z)[:, None, None], Q.T @ Z @ Q, np.nan)
            return regular.lower_bound(within, t, N)
        proves = (t > 0) & is_semidefinite(Z)
        return max(
            self.polar(z, M) / top if proved else 0.0
            for z, top, proved in zip(Z, t, proves, strict=True)
        )

    def _regular(self, M: Array) -> tuple[Array, Array, Self]:
        """Q (p, s), the regular ``C_Q(M)`` (s, s), and this criterion of Q'k."""
        Q, regular = self._about_all_combinations
        _, cov, _ = self.inverse(M)
        return Q, guarded_inverse(Q.T @ cov @ Q)[1], regular

    @cached_property
    def _about_all_combinations(self) -> tuple[Array, Self]:
        """Q (p, s) with the span of all combinations, and this criterion of Q'k."""
        Q = full_rank_root(np.sum([part.K @ part.K.T for part in self.interests], axis=0))
        unit = np.linalg.norm(Q, axis=1, keepdims=True)
        unit = np.where(unit > 0, unit, 1.0)
        other = self._copy()
        other._take([part.of(_factors(Q / unit, part.K / unit)) for part in self.interests])
        other.needs_all = True
        return Q, other

    @property
    def interests(self) -> tuple[Interest, ...]:
        """The parts that are about combinations."""
        return tuple(part for part in self.parts if isinstance(part, Interest))

    @abstractmethod
    def cost_of_losses(self, losses: Array) -> Array:
        """The costs (...) of losses (..., k)."""

    @abstractmethod
    def polar(self, Z: Array, M: Array) -> float:
        """A lower bound on the cost of every X with ``<Z, X> <= 1``."""

    def part_polars(self, Z: Array, M: Array, shares: Array) -> Array:
        """Polars q_j (k,) of the losses for parts Z_j of a multiplier Z (p, p) near a design M.

        Let ``Z = R'R`` with R (r, p), and ``W_j = R^-T (u_j G_j) R^-1`` with the slopes G_j and the
        shares u_j. Then ``Z_j = R' S W_j S R`` with ``S = (sum W_j)^(-1/2)`` are semidefinite and
        add up to Z, whatever the shares are; where Z is ``sum u_j G_j``, S is the identity, and the
        parts are what the optimality of M asks for. Of several models they are the blocks of Z,
        ``<Z, X> = sum <Z_jj, X_j>``, whatever the shares are.
        """
        if self.models is not None:
            return self._polars_of_parts([Z] * len(self.parts), M)
        R, inverse = _factor(Z)
        if not len(R):
            return np.zeros(len(self.parts))
        safe, cov, _ = self.inverse(M)
        W = inverse.T @ (shares[:, None, None] * self.slopes(safe, cov)) @ inverse
        values, V = eigenpairs(W.sum(axis=0))
        if not values[-1] > 0:
            return np.zeros(len(self.parts))
        S = (V * np.maximum(values, FLOOR * values[-1]) ** -0.5) @ V.T
        # A part that is zero in some parameters is so but for rounding: it is a square, which is
        # semidefinite whatever rounding did.
        w, U = eigenpairs(W)
        roots = np.sqrt(np.maximum(w, 0.0))[..., None] * np.swapaxes(U, 1, 2) @ S
        # Nor must rounding let the parts add up to more than the whole.
        whole = np.einsum("jai,jak->ik", roots, roots)
        most = max(1.0, float(np.linalg.eigvalsh(whole)[-1])) * (1 + len(Z) * ROUNDING)
        roots = roots / np.sqrt(most)
        # Slopes of low rank, as of c, leave directions out; each part takes its share of these.
        r, V = eigenpairs(np.eye(len(R)) - whole / most)
        left = np.sqrt(np.maximum(r - len(Z) * ROUNDING, 0.0))[:, None] * V.T
        given = np.sqrt(shares / shares.sum())[:, None, None] * left
        roots = np.concatenate([roots, given], axis=1) @ R
        return self._polars_of_parts(np.swapaxes(roots, 1, 2) @ roots, M)

    def _polars_of_parts(self, Z: Sequence[Array] | Array, M: Array) -> Array:
        """Polars q_j (k,) of the losses, each for a multiplier (p, p) of its own."""
        one = np.ones(1)
        return np.array(
            [
                (criterion.lower_bound(z[None], one, M) / best) ** (1 / criterion.degree)
                for criterion, z, best in zip(self.parts, Z, self.best, strict=True)
            ]
        )

    def _copy(self) -> Self:
        """An equal criterion, whose attributes may be changed."""
        other = copy(self)
        other.__dict__.pop("_about_all_combinations", None)
        return other


def _factor(Z: Array) -> tuple[Array, Array]:
    """R (r, p) with ``R'R <= Z``, without what rounding leaves, and R^-1 (p, r) on its rows."""
    r, V, d = unit_spectrum(Z)
    kept = r > len(Z) * ROUNDING * max(float(r[-1]), 0.0)
    size = np.sqrt(r[kept])
    # A parameter of which Z has nothing has nothing in R, and nothing in its inverse.
    inverse = np.divide(1.0, d, out=np.zeros_like(d), where=d > 0)
    return size[:, None] * V[:, kept].T * d, V[:, kept] * inverse.T / size


def _factors(Q: Array, K: Array) -> Array:
    """B (s, r) with ``Q B = K``, where the columns of K lie in the range of Q."""
    return np.asarray(np.linalg.lstsq(Q, K, rcond=None)[0])


def _smooth(name: str, part: Criterion) -> Relaxable:
    """The criterion, if its loss has a convex form and its multiplier can be split.

    Raises:
        CriterionError: It has not.
    """
    obeys = part.smooth and part.convex and part.monotone and part.degree > 0
    is_plain = part.precision is None and not isinstance(part, SeveralCriteria)
    if not (isinstance(part, Relaxable) and obeys and is_plain):
        raise CriterionError(
            f"criterion {name!r}: {part.label!r} cannot be a part of it; expected smooth, convex "
            "and monotone ones, such as D, A, I, c, Ds or phi"
        )
    return part


def _best_costs(name: str, parts: Sequence[Criterion], best: ArrayLike | None) -> Array:
    """The best costs (k,), from values as formulas print them."""
    if best is None:
        return np.ones(len(parts))
    values = np.asarray(best, dtype=float)
    if values.shape != (len(parts),) or not (np.isfinite(values) & (values > 0)).all():
        raise CriterionError(
            f"criterion {name!r}: best: expected a positive value of each of {len(parts)} criteria"
        )
    is_cost = np.array([part.sense == "min" for part in parts])
    return np.where(is_cost, values, 1 / values)
