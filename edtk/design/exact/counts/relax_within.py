"""The convex relaxation within limits on counts: weights of plans that obey them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.inverse import eigenpairs
from edtk.design.bound import Bound, BoundKind
from edtk.design.exact.counts.counts_bound import Decomposition
from edtk.design.problem import Problem, RankDeficientError
from edtk.design.problems import absorb_prior
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relaxation import Relaxation, RelaxationWithin
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.design.relaxation.setting import OrderOne, opened, solvable
from edtk.design.relaxation.weight_limits import WeightLimits
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array
from edtk.system.workers import one_thread

WITHIN_GAP = 1e-6  # relative gap at which to stop
MASTER_ROUNDS = 1000  # master problems; a criterion with kinks takes some hundreds
FADED = 1e-8  # part of the largest eigenvalue that a regular start has in every direction
SOLVER = "mixtures of plans"


class PlansWithin:
    """Counts (n,) of candidates within limits, not whole, for a `Decomposition`.

    Args:
        problem: The candidates, with the prior of each experiment.
        limits: What counts must obey.
    """

    def __init__(self, problem: Problem, limits: WeightLimits) -> None:
        self.problem = problem
        self.limits = limits

    def information(self, plan: Array) -> Array:
        """Information (p, p) of counts (n,)."""
        return np.asarray(self.problem.information(plan))

    def largest(self, Z: Array) -> tuple[float, Sequence[Array]]:
        """The plan of the largest sensitivities."""
        top, _, counts = self.limits.largest(self.problem.sensitivities(Z[None])[0])
        return top, [counts]

    def regular(self) -> Array:
        """Counts (n,) that tell every direction that any counts within the limits tell.

        In the direction of the least eigenvalue a linear program finds the plan that tells the
        most; what none tells is left alone. The mean of all these plans is within the limits.
        """
        p = self.problem.p
        size = np.sqrt(np.diag(self.problem.mean))
        unit = np.divide(1.0, size, out=np.zeros(p), where=size > 0)
        plans = [self.largest(np.diag(unit**2))[1][0]]
        silent = np.zeros((p, p))
        for _ in range(2 * p):
            M = unit[:, None] * self.information(np.mean(plans, axis=0)) * unit
            values, V = eigenpairs(M + silent)
            least = FADED * float(np.trace(M))
            if values[0] > least:
                break
            own = V[:, 0]
            told, more = self.largest(np.outer(unit * own, unit * own))
            if told > least:
                plans.append(more[0])
            else:
                silent += np.trace(M) * np.outer(own, own)
        return np.asarray(np.mean(plans, axis=0))


def relax_within(
    problem: Problem, criterion: Criterion, limits: WeightLimits, gap: float = WITHIN_GAP
) -> RelaxationWithin:
    """Find the weights within limits that minimise a criterion's cost, and prove a bound.

    The limits leave a polytope of counts, and every design in it obeys ``<Z, M> <= T(Z)``, the
    value of a linear program, for the multiplier Z; T takes the place of the largest sensitivity in
    a criterion's bound (`Relaxable.lower_bound`). The program over the polytope is solved by
    Dantzig and Wolfe's decomposition, see `Decomposition`. Cost and bound are computed anew from
    counts and multipliers, and T from the multipliers of the linear program alone.

    Args:
        problem: The candidates (n).
        criterion: A criterion that can be relaxed.
        limits: What counts must obey; some counts do.
        gap: Relative gap at which to stop. The gap of the result may be larger.

    Raises:
        ArgumentError: The criterion has no bound under limits.
        RankDeficientError: No counts within the limits identify the parameters.
        RelaxationError: No solver found a design.
    """
    criterion = require_relaxable(criterion)
    if criterion.degree == 0:
        message = f"{criterion.label} has no bound under limits on counts; leave them out"
        raise ArgumentError(message, argument="criterion")
    plain, base = absorb_prior(problem, criterion)
    sized = OrderOne.of(plain)
    with one_thread():
        found, counts = _relaxed(sized.problem, require_relaxable(base), limits, gap)
    told = replace(found.in_given_unit(sized), criterion=criterion, problem=problem)
    return RelaxationWithin.of(told, limits, float(counts.sum()))


def _relaxed(
    problem: Problem, criterion: Relaxable, limits: WeightLimits, gap: float
) -> tuple[Relaxation, Array]:
    """The relaxation of candidates whose information is of order one, and its counts (n,)."""
    setting, closed = solvable(problem, criterion)
    plans = PlansWithin(closed, limits)
    start = plans.regular()
    if not np.isfinite(setting.criterion.cost(plans.information(start))):
        missing = criterion.missing(problem.information(start), problem.parameters)
        words = " or ".join(missing) or "all parameters"
        raise RankDeficientError(f"within the limits no experiments tell {words}")
    search = Decomposition(plans, setting.criterion, [start], plans.information(start))
    search.run(gap, MASTER_ROUNDS)
    if not len(search.proof):
        raise RelaxationError("no solver found weights within the limits")
    counts = search.mixture
    Z = search.proof
    if closed is not setting.problem:
        Z = opened(setting.problem, Z)
    M = setting.problem.information(counts / limits.unit)
    largest = limits.largest_of(setting.problem.sensitivities(Z))
    cost = float(setting.criterion.cost(M))
    bound = setting.criterion.lower_bound(Z, largest, M)
    found = Relaxation(
        criterion=setting.criterion,
        weights=counts / counts.sum(),
        cost=cost,
        proved_bound=Bound.of(setting.criterion, bound, cost, BoundKind.PROVED_ON_CANDIDATES),
        multipliers=Z,
        solver=SOLVER,
        iterations=len(search.plans),
    )
    return found.outward(setting), counts
