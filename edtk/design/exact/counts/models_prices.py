"""Prices of candidates that are rows of several models: of small blocks, and not of one matrix."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from criteria.linalg.models import Models, put, taken
from criteria.several_criteria import Alike, SeveralCriteria
from edtk.design.exact.counts.any_prices import AnyPrices, AnyPricing
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.exchange_costs import exchange_costs
from edtk.design.information import side_by_side
from edtk.system.typing import Array, Indices


class ModelScatter(Scatter):
    """Information about several models side by side, see `Models`, without blocks of experiments.

    Args:
        rows: Rows (n, r, p) of the candidates, each about one of the models alone; or the rows
            (n, r_j, s_j) about each model.
        limits: What every plan has and obeys.
        models: Where the models stand.
    """

    each: tuple[Array, ...]
    models: Models

    def __init__(self, rows: Array | Sequence[Array], limits: Limits, models: Models) -> None:
        each = _split(rows, models) if isinstance(rows, np.ndarray) else tuple(rows)
        object.__setattr__(self, "each", each)
        object.__setattr__(self, "limits", limits)
        object.__setattr__(self, "models", models)

    @cached_property
    def rows(self) -> Array:
        """The rows (n, r, p) about all models, most of them zeros."""
        return side_by_side(self.each)

    @property
    def n(self) -> int:
        """Number of candidates."""
        return len(self.each[0])

    def rows_of(self, numbers: Sequence[int] | Indices) -> Array:
        """The rows (g, n, r, s) about models of the same order, with zeros below the shorter."""
        some = [self.each[j] for j in numbers]
        n, _, s = some[0].shape
        found = np.zeros((len(some), n, max(own.shape[1] for own in some), s))
        for rows, own in zip(found, some, strict=True):
            rows[:, : own.shape[1]] = own
        return found

    @cached_property
    def alike(self) -> tuple[tuple[Indices, Array], ...]:
        """Places (g, s) and rows (g, n, r, s) of models of the same order."""
        sizes = np.array(self.models.sizes)
        groups = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
        return tuple((self.models.places(some), self.rows_of(some)) for some in groups)

    def information(self, places: Indices) -> Array:
        """Information (b, p, p) of plans (b, m), block by block."""
        M = np.tile(self.limits.base, (len(places), 1, 1))
        for at, rows in self.alike:
            U = rows[:, places].reshape(len(rows), len(places), -1, rows.shape[-1])
            own = np.swapaxes(np.swapaxes(U, -1, -2) @ U, 0, 1)
            put(M, at, taken(M, at) + own)
        return M

    def without(self, M: Array, places: Indices, place: int) -> tuple[Array, Array, float]:
        """Take the experiment at one place out of plans, block by block; there is no center."""
        rest = M.copy()
        for at, rows in self.alike:
            U = rows[:, places[:, place]]
            own = np.swapaxes(np.swapaxes(U, -1, -2) @ U, 0, 1)
            put(rest, at, taken(rest, at) - own)
        return rest, np.zeros((len(places), 1, 1)), 1.0


def _split(rows: Array, models: Models) -> tuple[Array, ...]:
    """The rows (n, r_j, s_j) about each model, of rows (n, r, p) about one of them each."""
    found = []
    for part in models.parts:
        own = rows[:, :, part]
        found.append(own[:, own.any(axis=(0, 2))])
    return tuple(found)


class ModelsPricing(AnyPricing):
    """Costs of exchanges under a criterion of several models.

    The losses of the models are updated each in its own block, and the criterion is of the losses.
    Of k models of order s that are ``k s^2`` entries in place of ``k^2 s^2``.
    """

    criterion: SeveralCriteria
    scatter: ModelScatter

    @property
    def entries(self) -> int:
        """Number of entries of all blocks."""
        return int(np.square(self.scatter.models.sizes).sum())

    @property
    def rows(self) -> int:
        """Largest number of rows of a candidate about one model."""
        return max(own.shape[1] for own in self.scatter.each)

    @cached_property
    def alike(self) -> tuple[tuple[Alike, Array], ...]:
        """Models with the same criterion, and their rows (g, n, r, s)."""
        return tuple((each, self.scatter.rows_of(each.numbers)) for each in self.criterion.alike)

    @cached_property
    def packed(self) -> tuple[tuple[Indices, Array], ...]:
        """Places (g, s), and the information (g s s, n) of each candidate about these models."""
        found = []
        for at, rows in self.scatter.alike:
            squares = np.swapaxes(rows, -1, -2) @ rows
            found.append((at, np.moveaxis(squares, 1, -1).reshape(-1, rows.shape[1])))
        return tuple(found)

    def prices(self, places: Indices, ridge: float, size: int) -> "ModelsPrices":
        """Prices of plans (b, m) for the candidates of largest sensitivity."""
        return ModelsPrices(self, places.copy(), ridge, size)


class ModelsPrices(AnyPrices):
    """Prices of plans on their way, see `ModelsPricing`."""

    pricing: ModelsPricing

    def joined_costs(
        self, rest: Array, center: Array, scale: float, old: Indices, some: Indices
    ) -> Array:
        """Costs (b, k) where candidates (b, k) join the rest of plans; there is no center."""
        criterion = self.pricing.criterion
        losses = np.empty((*some.shape, len(criterion.parts)))
        for each, rows in self.pricing.alike:
            own = np.swapaxes(each.blocks(rest), 0, 1)
            factors = rows[:, some]
            flat = factors.reshape(-1, *factors.shape[2:])
            of_rest = own.reshape(-1, *own.shape[2:])
            costs = exchange_costs(each.criterion, of_rest, flat, np.ones(len(flat)))
            best = criterion.best[each.numbers][:, None, None]
            found = (costs.reshape(factors.shape[:3]) / best) ** (1 / each.criterion.degree)
            losses[..., each.numbers] = np.moveaxis(found, 0, -1)
        return criterion.cost_of_losses(losses)

    def sensitivities(self, G: Array, center: Array) -> Array:
        """``sum_j <G_jj, U_j'U_j>`` (b, n)."""
        found = np.zeros((len(G), self.pricing.scatter.n))
        for at, packed in self.pricing.packed:
            found += taken(G, at).reshape(len(G), -1) @ packed
        return found
