"""Recompute every claim of a certificate of a plan of whole experiments on a problem's candidates.

The certificate is an enemy's: the tree is replayed in code that the search does not use, and a
claim that is left out fails.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.array_criteria import BAYESIAN, FORMS, Part, as_cost
from edtk.certificate.recompute.arrays import Candidates, Design, Frame
from edtk.certificate.recompute.exact_tree import Replay, Tree
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, whole
from edtk.certificate.verify_certificate import AGREE, Claim
from edtk.certificate.verify_problem import (
    ProblemVerification,
    candidates_of,
    criterion_of,
    require_table,
    same_candidates,
)
from edtk.design.problem import Problem
from edtk.system.typing import Array, Indices

KIND = "exact plan of a problem"
KEYS = (
    "kind", "criterion", "candidates", "size", "kept", "plan", "value", "bound_exact",
    "proved_exact", "tree",
)  # fmt: skip
MOST_SIZE = 5000  # experiments of a plan
BEST = 4e-9  # relative distance to the bound at which a plan is the best: rounding


@dataclass(frozen=True, repr=False)
class ExactVerification(ProblemVerification):
    """All claims of a certificate of a plan of whole experiments, checked.

    Attributes:
        best: Whether the plan is said to be the best.
    """

    best: bool = False

    @property
    def proved(self) -> str:
        """What is proved, and on what."""
        if not self.valid:
            return "nothing is proved"
        plans = f"all plans of {self.experiments} experiments on these {self.candidates} candidates"
        if self.best:
            return f"for this problem; the plan is the best of {plans}"
        return f"for this problem; the bound holds for {plans}"

    @property
    def subject(self) -> str:
        """What the certificate is about, for a person."""
        return f"{self.label}, plan of {self.experiments} experiments"


def verify_exact(content: Any, problem: Problem) -> ExactVerification:
    """Check all claims of a certificate against the candidates that it is about.

    Args:
        content: What `store_exact` made, as JSON has it.
        problem: The candidates.

    Raises:
        ValueError: The content is no such certificate, or would take too long; one line says where.
    """
    with np.errstate(all="ignore"):
        table(content, KEYS, "certificate")
        require_table(content["criterion"])
        criterion = criterion_of(content["criterion"])
        size = whole(content["size"], 1, MOST_SIZE, "size")
        kept = _counts(content["kept"], problem.n, "kept")
        table(content["plan"], ("candidate", "count"), "plan")
        plan = _plan(content["plan"], problem.n)
        if not isinstance(content["proved_exact"], bool):
            raise ValueError("proved_exact: expected true or false")
        stated = {name: number(content[name], name) for name in ("value", "bound_exact")}
        tree = Tree.of(content["tree"], problem.n, problem.p)
        candidates = candidates_of(problem)
        claims = [same_candidates(content["candidates"], problem, candidates.sha256)]
        told = size - int(kept.sum())
        is_plan = told > 0 and plan.sum() == told
        reason = "" if is_plan else f"expected {told} experiments beside the kept ones"
        claims.append(Claim("plan", is_plan, float(size), float(plan.sum() + kept.sum()), reason))
        claims += _numbers(content, stated, candidates, tree, plan, kept, size, is_plan)
    return ExactVerification(
        criterion=criterion.name,
        kind="plan",
        robot="",
        poses=int((plan > 0).sum()),
        kept=int(kept.sum()),
        candidates=problem.n,
        claims=tuple(claims),
        experiments=size,
        about=criterion.label,
        best=content["proved_exact"],
    )


def _numbers(
    content: dict[str, Any],
    stated: dict[str, float],
    candidates: Candidates,
    tree: Tree,
    plan: Indices,
    kept: Indices,
    size: int,
    is_plan: bool,
) -> list[Claim]:
    """The claims about value, bound, and whether the plan is the best."""
    name = content["criterion"]["name"]
    names = ("value", "bound_exact", "proved_exact")
    if name.removeprefix("bayes_") not in FORMS:
        reason = f"the criterion {name} has no second implementation for whole plans"
        return [Claim(key, False, None, None, reason) for key in names]
    if not is_plan:
        return [Claim(key, False, None, None, "there is no plan") for key in names]
    part, known = _question(content["criterion"], candidates, kept, size)
    cost, most = part.cost(Design.of(known, Frame.of_candidates(known), plan.astype(float)))
    unsure = AGREE + (most / cost - 1 if 0 < cost < math.inf else math.inf)
    value = as_cost(name, stated["value"])
    holds = abs(value - cost) <= unsure * cost and unsure < 2 * AGREE
    reason = "" if holds else "the recomputed number differs"
    claims = [Claim("value", holds, stated["value"], as_cost(name, cost), reason)]
    bound = as_cost(name, stated["bound_exact"])
    why = "expected a positive number"
    if 0 < bound < math.inf:
        why = Replay(tree, part, known, int(plan.sum())).proves(bound)
    own = None if why else stated["bound_exact"]
    claims.append(Claim("bound_exact", not why, stated["bound_exact"], own, why, candidates.n))
    reason = ""
    if content["proved_exact"]:
        reason = "" if not why and cost * (1 - BEST) <= bound else "the plan is not the best"
    claims.append(Claim("proved_exact", not reason, None, None, reason, candidates.n))
    return claims


def _question(
    given: dict[str, Any], candidates: Candidates, kept: Indices, size: int
) -> tuple[Part, Candidates]:
    """The criterion, and the candidates with what every plan has as their prior."""
    known = candidates.with_prior((size - 1.0) * candidates.prior.astype(float))
    chosen = np.flatnonzero(kept)
    U = candidates.rows[chosen]
    of_kept = np.einsum("k,kri,krj->ij", kept[chosen], U, U)
    if candidates.information is not None:
        of_kept = np.tensordot(kept[chosen], candidates.information[chosen], axes=1)
    known = known.with_prior(np.asarray(of_kept, dtype=float))
    if given["name"] in BAYESIAN:
        p = candidates.p
        precision = numbers(given["precision"], (p, p), "criterion.precision")
        known = known.with_prior(0.5 * (precision + precision.T))
        given = {"name": given["name"].removeprefix("bayes_")}
    return Part.of(given, candidates.p), known


def _counts(given: Any, n: int, where: str) -> Indices:
    """How often each of n candidates stands in a list (n,)."""
    chosen = numbers(rows(given, MOST_SIZE, where), (None,), where)
    if (chosen != np.floor(chosen)).any() or (chosen < 0).any() or (chosen >= n).any():
        raise ValueError(f"{where}: expected whole numbers from 0 to {n - 1}")
    return np.bincount(chosen.astype(int), minlength=n)


def _plan(given: Any, n: int) -> Indices:
    """Counts (n,) of a plan's candidates."""
    places = _counts(given["candidate"], n, "plan.candidate")
    counts: Array = numbers(given["count"], (None,), "plan.count")
    chosen = np.array(given["candidate"], dtype=int)
    is_whole = (counts == np.floor(counts)).all() and (counts > 0).all() and counts.sum() < 1e6
    if len(counts) != len(chosen) or not is_whole or places.max(initial=0) > 1:
        raise ValueError("plan: expected each candidate once, with a whole number of experiments")
    return np.bincount(chosen, counts, n).astype(int)
