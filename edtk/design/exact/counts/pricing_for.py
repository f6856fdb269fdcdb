"""The quickest way to price the candidates of a problem under a criterion, and to search them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from criteria import Criterion, Relaxable, create
from criteria.criterion import DeterminantCriterion
from criteria.linalg.inverse import eigenpairs, root
from criteria.linalg.models import Models
from criteria.several_criteria import SeveralCriteria
from edtk.design.exact.counts.any_prices import AnyPricing
from edtk.design.exact.counts.convex_loss import convex_loss
from edtk.design.exact.counts.counts_bound import RelaxedCounts, Scatter
from edtk.design.exact.counts.counts_search import CountsSearch
from edtk.design.exact.counts.determinant_prices import DeterminantPricing
from edtk.design.exact.counts.largest_variance_prices import LargestVariancePricing
from edtk.design.exact.counts.least_eigenvalue_prices import LeastEigenvaluePricing
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.linear_prices import LinearPricing
from edtk.design.exact.counts.mean_variance_prices import MeanVariancePricing
from edtk.design.exact.counts.models_prices import ModelScatter, ModelsPricing
from edtk.design.exact.counts.prices import Pricing
from edtk.design.exact.counts.several_rows_pricing import SeveralRowsPricing
from edtk.design.exact.counts.two_level_prices import TwoLevelPricing, two_levels
from edtk.design.exact.exchange_costs import constant_slope
from edtk.design.information import side_by_side
from edtk.design.problem import Problem
from edtk.system.typing import Array

MOST_VARIANCES = 2_000_000  # of a look at all candidates; beyond it short lists are quicker
# Condition number of an order of matrices that keeps the digits of eigenvalues.
KEEPS_EIGENVALUES = 1e8
MANY_PRODUCTS = 3e4  # for a look at all candidates, from which on a bound that spares it pays
FEWEST_CORNERS = 4096  # of a cube; all of fewer are priced as quickly as coordinates are exchanged


def pricing_for(criterion: Criterion, scatter: Scatter, mean: Array) -> Pricing:
    """Choose the prices for a criterion and candidates.

    Args:
        criterion: The criterion to minimise.
        scatter: Rows of the candidates, in parameters of order one, with a candidate of zeros where
            places may stay empty.
        mean: Mean information (p, p) of a place, regular.
    """
    limits = scatter.limits
    if isinstance(scatter, ModelScatter):
        return _of_models(criterion, scatter, mean)
    if limits.blocks and not criterion.smooth:
        # Where two eigenvalues are the least, no exchange of one place may be an improvement.
        guide = pricing_for(create("D").plan_criterion, scatter, mean)
        return AnyPricing(criterion, scatter, mean, guide=guide)
    if scatter.rows.shape[1] > 1:
        return _of_several_rows(criterion, scatter, mean) or AnyPricing(criterion, scatter, mean)
    rows = scatter.rows[:, 0]
    if isinstance(criterion, DeterminantCriterion):
        corners = two_levels(rows) if may_be_corners(rows, limits) else None
        if corners is not None:
            return TwoLevelPricing(rows, limits, *corners)
        return DeterminantPricing(rows, limits)
    slope = constant_slope(criterion, mean)
    if slope is not None:
        return LinearPricing(rows, limits, slope)
    own = None if limits.blocks else _with_kinks(criterion, rows, limits, mean)
    return own or AnyPricing(criterion, scatter, mean)


def _of_models(criterion: Criterion, scatter: ModelScatter, mean: Array) -> Pricing:
    """Prices of several models, of a sum of variances without a look at short lists first."""
    if isinstance(criterion, SeveralCriteria):
        return ModelsPricing(criterion, scatter, mean)
    slope = constant_slope(criterion, mean)
    own = None if slope is None else MeanVariancePricing.of(scatter, slope, mean)
    whole = Scatter(scatter.rows, scatter.limits)
    return own or _of_several_rows(criterion, whole, mean) or AnyPricing(criterion, whole, mean)


def _of_several_rows(criterion: Criterion, scatter: Scatter, mean: Array) -> Pricing | None:
    """Prices that leave most candidates out, where they are very many and it can be told which."""
    few = scatter.rows.size * len(mean) < MANY_PRODUCTS
    if few or scatter.limits.blocks or scatter.limits.linear is not None:
        return None
    loss = convex_loss(criterion, mean)
    return None if loss is None else SeveralRowsPricing(criterion, scatter, mean, loss)


def _with_kinks(criterion: Criterion, rows: Array, limits: Limits, mean: Array) -> Pricing | None:
    """Prices of a largest variance or of a least eigenvalue, if the criterion is one."""
    p = len(mean)
    # Beside constraints on sums, worse exchanges have prices too.
    if not isinstance(criterion, Relaxable) or limits.linear is not None:
        return None
    targets = criterion.variance_rows(p)
    if targets is not None:
        few = targets.size // p * len(rows) <= MOST_VARIANCES
        return LargestVariancePricing(rows, limits, targets) if few else None
    band = criterion.spectral_band(p)
    if band is None or band.a or p == 1:
        return None
    values, V = eigenpairs(band.floor)
    if not values[0] * KEEPS_EIGENVALUES > values[-1]:
        return None
    # The least t with M >= t F is an eigenvalue in parameters in which F is the identity.
    T = V / np.sqrt(values)
    own = replace(limits, base=T.T @ limits.base @ T)
    guide = LinearPricing(rows, limits, band.floor)
    return LeastEigenvaluePricing(rows @ T, own, T.T @ mean @ T, guide)


def search_for(
    bare: Problem,
    criterion: Criterion,
    limits: Limits,
    relaxed: RelaxedCounts | None,
    thorough: bool,
) -> CountsSearch:
    """A search for the best plan of a problem, in parameters of order one.

    Args:
        bare: The candidates; what every plan has is `Limits.base`.
        criterion: The criterion to minimise.
        limits: What plans must obey.
        relaxed: The relaxation, if there is one.
        thorough: Whether no exchange of one place shall improve the plan.
    """
    T = _of_each_model(bare, criterion.plan_criterion, limits)
    transformed = criterion.transformed(T)
    if transformed is None:
        T = np.eye(bare.p)
        transformed = criterion
    problems, places = _apart(bare, T)
    rows = [one.factors() @ T[at, at] for one, at in zip(problems, places, strict=True)]
    # From the rows: squares of those as given may have no digits left.
    squares = np.zeros((bare.p, bare.p))
    for each, at in zip(rows, places, strict=True):
        flat = each.reshape(-1, each.shape[-1])
        squares[at, at] = flat.T @ flat
    base = T.T @ limits.base @ T
    # Beside blocks nothing tells a constant. What is asked for does not depend on it, whatever is
    # known of it; with something known all plans can be regular.
    silent = (np.diag(squares) == 0) & (np.diag(base) == 0)
    base[silent, silent] = limits.m
    mean = squares / bare.n + base / limits.m
    if not limits.sized:
        rows = [np.concatenate([each, np.zeros((1, *each.shape[1:]))]) for each in rows]
    own = replace(limits, base=base)
    models = bare.models if len(problems) > 1 else None
    scatter = scatter_for(transformed.plan_criterion, rows, own, models)
    pricing = pricing_for(transformed.plan_criterion, scatter, mean)
    return CountsSearch(
        criterion=transformed,
        scatter=scatter,
        pricing=pricing if thorough else pricing.brief(),
        telling=pricing_for(create("D").plan_criterion, scatter, mean),
        relaxed=np.zeros(bare.n) if relaxed is None else relaxed.counts,
        bound=0.0 if relaxed is None else relaxed.cost,
    )


def _apart(bare: Problem, T: Array) -> tuple[list[Problem], tuple[slice, ...]]:
    """The problem of each model, and its parameters; of all together where T mixes them."""
    if len(bare.models) > 1 and bare.models.are_apart(T):
        return bare.each, bare.models.parts
    return [bare], (slice(None),)


def scatter_for(
    criterion: Criterion, rows: Sequence[Array], limits: Limits, models: Models | None = None
) -> Scatter:
    """The information of rows, of several models that nothing mixes in blocks.

    Args:
        criterion: Tells the models, if it is made of criteria of each.
        rows: Rows (n, r_j, p_j) about each model, or those (n, r, p) of all alone.
        limits: What every plan has and obeys.
        models: Those that the rows are about, if they are several lists.
    """
    if isinstance(criterion, SeveralCriteria):
        models = criterion.models
    mixes = models is None or bool(limits.blocks) or not models.are_apart(limits.base)
    if models is not None and not mixes and models.sizes == tuple(one.shape[-1] for one in rows):
        return ModelScatter(rows, limits, models)
    whole = side_by_side(rows) if len(rows) > 1 else rows[0]
    if models is None or mixes:
        return Scatter(whole, limits)
    return ModelScatter(whole, limits, models)


def _of_each_model(bare: Problem, criterion: Criterion, limits: Limits) -> Array:
    """See `working_parameters`; those of several models are of each alone, so that none mix."""
    if len(bare.models) == 1 or not bare.models.are_apart(limits.base):
        return working_parameters(criterion, bare.factors(), limits)
    found = []
    for one, at in zip(bare.each, bare.models.parts, strict=True):
        own = replace(limits, base=limits.base[at, at])
        found.append(working_parameters(criterion, one.factors(), own))
    return bare.models.diagonal(found)


def working_parameters(criterion: Criterion, rows: Array, limits: Limits) -> Array:
    """T (p, p) for parameters k' with ``k = T k'``, in which a search works.

    The mean information about k' is the identity, but for parameters of which no row tells. It
    comes from a QR of the rows (n, r, p), whose condition number is the root of their
    information's. Corners of a cube are only scaled, so that they remain corners.
    """
    flat = rows.reshape(-1, rows.shape[-1])
    may_be = isinstance(criterion, DeterminantCriterion) and may_be_corners(flat, limits)
    if may_be and rows.shape[1] == 1 and two_levels(flat) is not None:
        return np.diag(1.0 / np.abs(flat).max(axis=0))
    parts = [flat / np.sqrt(len(rows))]
    if limits.base.any():
        parts.append(root(limits.base / limits.m))
    told = np.vstack(parts)
    R = np.asarray(np.linalg.qr(told, mode="r"))
    silent = ~told.any(axis=0)
    R[silent, silent] = 1.0  # such a parameter stays as it is
    return np.asarray(np.linalg.inv(R))


def may_be_corners(rows: Array, limits: Limits) -> bool:
    """Whether rows (n, p) are so many that it pays to look whether they are corners of a cube."""
    return len(rows) >= FEWEST_CORNERS and not limits.restricts and not limits.blocks
