"""The certificate of a bound over a region: that of its grid, with polynomials and boxes."""

from typing import Any

import numpy as np

from criteria import Relaxable
from edtk.certificate.coverings import largest_on, tree_of
from edtk.certificate.recompute.covering import BOUNDED, COMBINED
from edtk.certificate.recompute.region import rounding_of_check
from edtk.design.bound import printed_form
from edtk.design.enclosure.boxes import Covering, Leaves, Reason
from edtk.design.enclosure.prove_region import ProvedRegion
from edtk.design.enclosure.region_polynomials import RegionPolynomials
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.system.typing import Array

TWICE = 2.0  # of the least factor of a slack that closes an infeasible box


def region_certificate(found: RelaxedRegion) -> dict[str, Any]:
    """What proves a relaxation over a region, as plain data for JSON.

    Its claims about candidates are those of its points and of the grid. A proved bound is among
    them where rows are polynomials, in the parameters as they are given, and one multiplier proves
    it; others have no certificate of their boxes.
    """
    content = found.on_grid().to_dict()
    if not isinstance(found, ProvedRegion) or not _has_words(found):
        return content
    covering = found.covering.coverings[0]
    assert isinstance(covering, Covering)
    polynomials = RegionPolynomials.of(found.judged.region)
    Z = found.covering.multipliers[0]
    Z = 0.5 * (Z + Z.T)
    size = np.abs(polynomials.rows).sum(axis=2) + polynomials.errors
    whole = float(np.einsum("ra,ab,rb->", size, np.abs(Z), size))
    tested = covering.enclosed.objectives[0].numerator
    limit = float(found.covering.upper[0]) + rounding_of_check(whole, tested.coefficients)
    leaves = covering.leaves[0]
    letters, factors = _closed(leaves, covering, limit)
    tree, combined = tree_of(leaves, letters, covering.grid.parts)
    criterion = found.judged.criterion
    assert isinstance(criterion, Relaxable)
    M = found.judged.region.problem(found.points).information(found.weights)
    cost = float(criterion.lower_bound(Z[None], np.array([limit]), M))
    low, high = found.region.limits
    content["bound_proved"] = printed_form(cost * (1 - found.accuracy), criterion.sense)
    content["region"] = {
        "low": low.tolist(),
        "high": high.tolist(),
        "sizes": list(polynomials.sizes),
        "rows": polynomials.rows.tolist(),
        "errors": polynomials.errors.tolist(),
        "slacks": [
            {
                "sizes": list(slack.coefficients.shape),
                "coefficients": slack.coefficients.ravel().tolist(),
                "error": slack.error,
            }
            for slack in covering.enclosed.slacks
        ],
        "multiplier": Z.tolist(),
        "limit": limit,
        "tree": tree,
        "factors": factors[combined].tolist(),
        "points": np.concatenate([found.points, found.grid]).tolist(),
    }
    return content


def _has_words(found: ProvedRegion) -> bool:
    """Whether a certificate can tell of the boxes."""
    covering = found.covering
    one = len(covering.coverings) == 1 and isinstance(covering.coverings[0], Covering)
    return one and found.judged.T is None and found.judged.criterion.degree > 0


def _closed(leaves: Leaves, covering: Covering, limit: float) -> tuple[list[str], Array]:
    """A letter for each leaf (b,), and its factors of the slacks (b, c).

    An infeasible box is closed by a factor of the slack that is negative there.
    """
    factors = leaves.penalties.copy()
    letters = [BOUNDED if own == Reason.BELOW else COMBINED for own in leaves.reason.tolist()]
    infeasible = np.flatnonzero(leaves.reason == Reason.INFEASIBLE)
    if not len(infeasible):
        return letters, factors
    slacks = covering.enclosed.slacks
    tops = np.array([largest_on(slack, leaves, covering.grid, infeasible) for slack in slacks])
    which = tops.argmin(axis=0)
    tested = covering.enclosed.objectives[0].numerator
    over = largest_on(tested, leaves, covering.grid, infeasible)
    excess = np.maximum(over - limit, 0.0) + abs(limit)
    factors[infeasible] = 0.0
    factors[infeasible, which] = TWICE * excess / -tops[which, np.arange(len(which))]
    return letters, factors
