"""Recompute every claim of a certificate of a plan of whole experiments on a problem's candidates.

The certificate is an enemy's: the tree is replayed in code that the search does not use, and a
claim that is left out fails.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from edtk.certificate.recompute.array_criteria import BAYESIAN, FORMS, Part
from edtk.certificate.recompute.arrays import Candidates, Design, Frame
from edtk.certificate.recompute.exact_tree import (
    MOST_SIZE,
    Budget,
    Replay,
    Tree,
    counts_of,
    plan_of,
)
from edtk.certificate.recompute.plain_data import number, numbers, table, whole
from edtk.certificate.verify_certificate import AGREE, Claim, exact_claims, unproved_exact
from edtk.certificate.verify_problem import (
    LIMITS,
    ProblemVerification,
    candidates_of,
    label_of,
    numbers_of,
    require_table,
    same_candidates,
)
from edtk.design.problem import Problem
from edtk.system.typing import Indices

KIND = "exact plan of a problem"
KEYS = (
    "kind", "criterion", "candidates", "size", "kept", "plan", "value", "bound_exact",
    "proved_exact", "tree",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class ExactVerification(ProblemVerification):
    """All claims of a certificate of a plan of whole experiments, checked.

    Attributes:
        best: Whether the plan is said to be the best.
        sized: Whether all plans have as many experiments.
    """

    best: bool = False
    sized: bool = True

    @property
    def proved(self) -> str:
        """What is proved, and on what."""
        if not self.valid:
            return "nothing is proved"
        number = f" of {self.experiments} experiments" if self.sized else ""
        plans = f"all plans{number} on these {self.candidates} candidates"
        if self.kept:
            plans += f" that hold the {self.kept} kept"
        if LIMITS in self.told:
            plans += " within these limits"
        if self.best:
            return f"{self.question}; the plan is the best of {plans}"
        return f"{self.question}; the bound holds for {plans}"

    @property
    def subject(self) -> str:
        """What the certificate is about, for a person."""
        return f"{self.label}, plan of {self.experiments} experiments"


def _limits(given: Any, kept: Indices) -> Indices | None:
    """How often each candidate may be chosen beside the kept ones (n,); None for no limit."""
    if given is None:
        return None
    found = numbers(given, (len(kept),), "most")
    if (found != np.floor(found)).any() or (found < kept).any() or (found > MOST_SIZE).any():
        raise ValueError(f"most: expected whole numbers up to {MOST_SIZE}, not below what is kept")
    return np.asarray(found.astype(int) - kept)


def _budget(given: dict[str, Any], n: int) -> Budget | None:
    """What the new experiments may cost together; None for no limit."""
    if ("costs" in given) != ("cost_budget" in given) or ("places" in given) > ("costs" in given):
        raise ValueError("costs: expected beside cost_budget")
    if "costs" not in given:
        return None
    costs = numbers(given["costs"], (n,), "costs")
    funds = number(given["cost_budget"], "cost_budget")
    if not (costs > 0).all() or not funds > 0:
        raise ValueError("costs: expected above 0, and a cost_budget above 0")
    return Budget(np.append(costs, np.zeros(int("places" in given))), funds)


@dataclass(frozen=True, eq=False)
class _Asked:
    """A plan, and what all plans that it is compared with obey.

    Attributes:
        size: Number of experiments, with the kept ones.
        kept: How often each candidate is kept (n,).
        plan: How often each is chosen anew (n,).
        told: Number of new experiments; where it is free, of places for them.
        sized: Whether all plans have as many experiments.
        limits: How often each candidate may be chosen anew (n,); None for no limit.
        budget: What the new experiments may cost together; None for no limit.
    """

    size: int
    kept: Indices
    plan: Indices
    told: int
    sized: bool
    limits: Indices | None
    budget: Budget | None

    @classmethod
    def of(cls, content: dict[str, Any], n: int) -> "_Asked":
        """Read them.

        Raises:
            ValueError: They are no such numbers; one line says where.
        """
        size = whole(content["size"], 1, MOST_SIZE, "size")
        kept = counts_of(content["kept"], n, "kept")
        table(content["plan"], ("candidate", "count"), "plan")
        plan = plan_of(content["plan"], n)
        budget = _budget(content, n)
        sized = "places" not in content
        made = size - int(kept.sum())
        told = made if sized else whole(content["places"], made, MOST_SIZE, "places")
        return cls(size, kept, plan, told, sized, _limits(content.get("most"), kept), budget)

    @property
    def wrong(self) -> str:
        """Why it is no plan of so many experiments within limits; empty if it is."""
        plan, limits, budget = self.plan, self.limits, self.budget
        made = self.size - int(self.kept.sum())
        if plan.sum() != made or (self.sized and made <= 0):
            return f"expected {made} experiments beside the kept ones"
        if budget is not None and plan @ budget.costs[: len(plan)] > budget.most:
            return "the plan costs more than it may"
        if not self.sized:
            assert budget is not None
            affordable = budget.number(limits)
            return f"expected {affordable} places" if self.told < affordable else ""
        if limits is not None and (plan > limits).any():
            return "a candidate is measured more often than it may be"
        return ""

    @property
    def claim(self) -> Claim:
        """That it is a plan."""
        found = float(self.plan.sum() + self.kept.sum())
        return Claim("plan", not self.wrong, float(self.size), found, self.wrong)


def _cost(replay: Replay, plan: Indices) -> tuple[float, float]:
    """The cost of a plan (n,), and its relative error."""
    known = replay.candidates
    design = Design.of(known, Frame.of_candidates(known), plan.astype(float))
    cost, most = replay.part.cost(design)
    return replay.given(cost), AGREE + (most / cost - 1 if 0 < cost < math.inf else math.inf)


def has_whole_plans(name: str) -> bool:
    """Whether plans for a criterion of this name are bounded by a second implementation."""
    return name.removeprefix("bayes_") in FORMS


def verify_exact(content: Any, problem: Problem) -> ExactVerification:
    """Check all claims of a certificate against the candidates that it is about.

    Args:
        content: What `store_exact` made, as JSON has it.
        problem: The candidates.

    Raises:
        ValueError: The content is no such certificate, or would take too long; one line says where.
    """
    with np.errstate(all="ignore"):
        table(content, KEYS, "certificate", ("most", "costs", "cost_budget", "places"))
        require_table(content["criterion"])
        label = label_of(content["criterion"])
        asked = _Asked.of(content, problem.n)
        if not isinstance(content["proved_exact"], bool):
            raise ValueError("proved_exact: expected true or false")
        candidates = candidates_of(problem)
        claims = [same_candidates(content["candidates"], problem, candidates.sha256), asked.claim]
        claims += _proof(content, asked, candidates)
    return ExactVerification(
        criterion=content["criterion"]["name"],
        kind="plan",
        robot="",
        poses=int((asked.plan > 0).sum()),
        kept=int(asked.kept.sum()),
        candidates=problem.n,
        claims=tuple(claims),
        experiments=asked.size,
        about=label,
        told=_told(content, int(asked.kept.sum())),
        best=content["proved_exact"],
        sized=asked.sized,
    )


def _proof(content: dict[str, Any], asked: _Asked, candidates: Candidates) -> list[Claim]:
    """What the tree proves of the plan, by a replay of it."""
    name = content["criterion"]["name"]
    stated = {key: number(content[key], key) for key in ("value", "bound_exact")}
    positions = len(asked.plan) + (0 if asked.sized else 1)
    tree = Tree.of(content["tree"], positions, candidates.p, int(asked.budget is not None))
    if not has_whole_plans(name):
        reason = f"the criterion {name} has no second implementation for whole plans"
        return unproved_exact(reason)
    if asked.wrong:
        return unproved_exact("there is no plan")
    # Powers of two change no digit, and products of numbers near one stay numbers.
    power = candidates.power
    part, known = _question(content["criterion"], candidates, asked.kept, asked.size, power)
    stated["proved_exact"] = content["proved_exact"]
    # So has what the criterion is about a unit of its own.
    size = int(np.frexp(np.abs(part.K).max())[1])
    part = replace(part, K=np.ldexp(part.K, -size))
    units = known.units
    part, known = part.scaled(units), known.scaled(units)
    tree = replace(tree, T=np.ldexp(tree.T, -power - units[:, None]))
    replay = Replay(tree, part, known, asked.told, asked.limits, asked.budget, power + size)
    return exact_claims(name, stated, replay, *_cost(replay, asked.plan))


def _told(content: dict[str, Any], kept: int) -> tuple[str, ...]:
    """What the certificate alone says of the question."""
    found = [f"{kept} kept experiment{'' if kept == 1 else 's'}"] if kept else []
    found += [LIMITS] if {"most", "costs"} & set(content) else []
    return (*found, *numbers_of(content["criterion"]))


def _question(
    given: dict[str, Any], candidates: Candidates, kept: Indices, size: int, power: int
) -> tuple[Part, Candidates]:
    """The criterion, and the candidates with what every plan has as their prior, in a unit."""
    candidates = candidates.scaled(power)
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
        known = known.with_prior(np.ldexp(0.5 * (precision + precision.T), 2 * power))
        given = {"name": given["name"].removeprefix("bayes_")}
    return Part.of(given, candidates.p), known
