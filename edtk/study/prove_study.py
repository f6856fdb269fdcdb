"""What is proved about all plans of as many experiments on a study's candidate poses."""

from dataclasses import replace

import numpy as np

from edtk.design.exact.counts.find_counts import find_counts
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.exact_plan import ExactPlan, OnCandidates
from edtk.study.plan_study import RunOptions
from edtk.system.errors import UserError

ROUNDING = 1e-9  # relative difference that two ways to compute a cost may make


def prove_on_candidates(
    found: ExactPlan, seconds: float, candidates: int | None, options: RunOptions
) -> ExactPlan:
    """Prove the best plan of as many experiments on candidates, or a bound, beside a found plan.

    Visits of a pose that share errors of the model tell less together than the proof takes them to
    tell: its bound holds for them, but its best plan need not be the best where it repeats a pose.

    The found plan may be off the candidates, and then above or below what is proved of these. What
    is known beforehand, and kept experiments, count in both.

    Args:
        found: A plan of a study.
        seconds: Time to spend; candidates, and a first plan of them, are waited for.
        candidates: Number of candidates; defaults to those of the relaxation.
        options: Where progress goes.

    Raises:
        UserError: Nothing can be proved for this criterion, or no weights were found.
    """
    relaxed = found.relaxed
    number = relaxed.candidates if candidates is None else candidates
    m = found.plan.experiments
    space = relaxed.space
    base = np.zeros((space.p, space.p)) if space.prior is None else m * space.prior
    poses = relaxed.source.take(number)
    best = find_counts(
        poses.problem,
        relaxed.criterion,
        Limits(m, base),
        np.zeros(number, dtype=int),
        progress=options.progress,
        prove=seconds,
    )
    if best.proof is None or best.exact_bound is None:
        raise UserError(f"no weights of the {number:,} candidates were found: {best.basis}")
    plan = space.plan(poses.x[best.support], best.counts[best.support])
    cost = best.cost
    if space.shares_errors:
        cost = space.cost(relaxed.criterion, plan, found.kept)
    on_them = OnCandidates(
        candidates=number,
        bound=best.exact_bound,
        best=cost,
        plan=plan,
        counts=best.counts,
        tree=best.proof.tree,
        proved=best.proved_exact and cost <= best.cost * (1 + ROUNDING),
        seconds=best.seconds,
        ended=best.ended,
    )
    return replace(found, on_candidates=on_them)
