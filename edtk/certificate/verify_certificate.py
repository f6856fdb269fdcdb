"""Recompute every claim of a certificate from its poses and multipliers, in code of its own.

A certificate is treated as an enemy's: its claims are computed anew, numbers that prove a bound
must have the properties that the proof needs, and a claim that is left out fails.
"""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from criteria.linalg.estimable import combination
from edtk.certificate.case import Case
from edtk.certificate.recompute import values
from edtk.certificate.recompute.array_criteria import as_cost
from edtk.certificate.recompute.day import ROUNDING_OF_FUNDS
from edtk.certificate.recompute.exact_tree import Replay
from edtk.certificate.recompute.setting import TINY
from edtk.certificate.recompute.setting import TINY as TINY_LOAD
from edtk.system.presented import Presented

AGREE = 1e-8  # relative difference that two ways of rounding may make; 1e-13 is the rule
AGREE_ON_BOXES = 1e-7  # the same where all roundings of both are counted, from above
ABSOLUTE = 1e-8  # difference of a gap or an efficiency, which are of order one
EXCESS = 1e-3  # relative excess of a sensitivity found here over those that a search rests on
BOUNDS = ("bound", "bound_searched", "bound_proved")
BEST = 4e-9  # relative distance to the bound at which a plan is the best: rounding
EXACT_CLAIMS = ("value_exact", "bound_exact", "proved_exact")
ORDER = ("value", *BOUNDS, "gap", "efficiency")


@dataclass(frozen=True)
class Claim:
    """One claim of a certificate.

    Attributes:
        claim: Name: "feasible", "value", "bound", ...
        holds: Whether the recomputed number agrees with the stated one.
        stated: The number in the certificate; None for a claim without a number.
        recomputed: The number found here; None where nothing could be computed.
        reason: Why the claim does not hold, in one line; empty if it does.
        candidates: Number of candidates over which a bound is proved; None for other claims.
    """

    claim: str
    holds: bool
    stated: float | None
    recomputed: float | None
    reason: str = ""
    candidates: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, which knows no infinity: such a number becomes None."""
        return {
            name: None if isinstance(part, float) and not math.isfinite(part) else part
            for name, part in asdict(self).items()
        }


@dataclass(frozen=True, repr=False)
class Verification(Presented):
    """All claims of a certificate, checked.

    Attributes:
        criterion: Name of the criterion.
        kind: "relaxation" or "plan".
        robot: Name of the robot.
        poses: Number of poses of the design.
        kept: Number of experiments that the certificate takes as carried out already.
        candidates: Number of candidates over which a bound is proved.
        claims: The claims, in the order in which they were checked.
        prior: Whether the certificate takes something as known beforehand.
        of: Combinations of the compliances that the criterion is about; none if about all.
        sampling: How the candidates are drawn: "random" or "sobol"; empty where they are given.
        searched: Whether a bound over all poses is stated.
        covered: Whether a proved one is.
        experiments: Number of experiments of a plan, the kept ones not counted.
        budget: What a plan may cost; None without a budget.
        sized: Whether a plan within a budget is judged beside plans of its own size alone.
        exact: What is proved of all plans of whole experiments on candidates, in words; empty where
            nothing is said of them.
        of_study: Whether a study stood beside the certificate, so that its setting is not the
            file's own word.
        other_seed: Whether the candidates have another seed than the study's, as `--seed` asks for.
    """

    criterion: str
    kind: str
    robot: str
    poses: int
    kept: int
    candidates: int
    claims: tuple[Claim, ...]
    of: tuple[str, ...] = ()
    prior: bool = False
    sampling: str = ""
    searched: bool = False
    covered: bool = False
    experiments: int = 0
    budget: float | None = None
    sized: bool = False
    exact: str = ""
    of_study: bool = False
    other_seed: bool = False

    @property
    def label(self) -> str:
        """The criterion, and what it is about if not all compliances: "D of k2, k3"."""
        return f"{self.criterion} of {', '.join(self.of)}" if self.of else self.criterion

    @property
    def valid(self) -> bool:
        """Whether every claim holds."""
        return all(claim.holds for claim in self.claims)

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the claims that do not hold."""
        return tuple(claim.claim for claim in self.claims if not claim.holds)

    @property
    def proved(self) -> str:
        """What is proved, and on what: a sentence that cannot be read as more."""
        if not self.valid:
            return "nothing is proved"
        if not self.exact:
            return self._of_weights
        seed = f"{self._seed}," if self._seed else ""
        return f"{self._of_weights}; {self.exact}{seed} is proved"

    @property
    def _seed(self) -> str:
        """That candidates are not those of the study: of many seeds one has the poorest."""
        return ", drawn with another seed than the study's" if self.other_seed else ""

    @property
    def _of_weights(self) -> str:
        """What the bound of weights proves."""
        where = "for this study" if self.of_study else "in a setting that is the file's own word"
        searched = "searched over all poses, not proved"
        if self.kind == "plan" and self.covered:
            return f"{where}; its efficiency beside {self._plans}, in any poses, is proved"
        if self.kind == "plan" and self.searched:
            return f"{where}; its efficiency beside {self._plans} is {searched}"
        plural = "" if self.candidates == 1 else "s"
        drawn = f"{self.candidates:,} {self.sampling} candidate pose{plural} alone{self._seed}"
        of = f" on {self._plans}" if self.kind == "plan" else ""
        beyond = "other poses may be better"
        if self.searched:
            beyond = "over all poses it is searched, not proved"
        if self.covered:
            beyond = "another one is proved over all poses"
        return f"{where}; the bound{of} is proved on {drawn}: {beyond}"

    @property
    def subject(self) -> str:
        """What the certificate is about, for a person."""
        some = f"{self.kept} kept experiment{'' if self.kept == 1 else 's'}"
        beside = f", beside {some}, taken as carried out" if self.kept else ""
        prior = ", with a prior that is taken as given" if self.prior else ""
        plural = "" if self.poses == 1 else "s"
        return f"{self.label}, {self.kind} of {self.poses} pose{plural}{beside}{prior}"

    @property
    def whose(self) -> str:
        """Whose setting it is, where it is the file's own; empty where something stands beside."""
        if self.of_study:
            return ""
        robot = "".join(letter if letter.isprintable() else "?" for letter in self.robot)[:40]
        return f"{robot}; robot, load, noise and limits as the certificate has them"

    @property
    def _plans(self) -> str:
        """The plans beside which a plan is judged."""
        plural = "" if self.experiments == 1 else "s"
        of = f" of {self.experiments} new experiment{plural}"
        if self.budget is None:
            return f"all plans{of}"
        return f"all plans{of if self.sized else ''} within a budget of {self.budget:g}"

    def headline(self) -> str:
        """The subject, and whether all claims hold."""
        verdict = "valid" if self.valid else f"NOT valid ({', '.join(self.failed)})"
        return f"certificate of a {self.kind}, {self.label}: {verdict}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: `valid`, what the certificate is about, and the claims."""
        return {
            "valid": self.valid,
            "criterion": self.criterion,
            "kind": self.kind,
            "robot": self.robot,
            "poses": self.poses,
            "kept": self.kept,
            "candidates": self.candidates,
            "proved": self.proved,
            "of_study": self.of_study,
            **({"prior": True} if self.prior else {}),
            **({"interest": list(self.of)} if self.of else {}),
            "claims": [claim.to_dict() for claim in self.claims],
        }


def verify_certificate(content: dict[str, Any]) -> Verification:
    """Check all claims of a certificate.

    Args:
        content: The certificate, as `certificate` makes it.

    Returns:
        Each claim with the stated and the recomputed number.

    Raises:
        ValueError: The content is no certificate; one line says where.
    """
    # Numbers of an enemy overflow. What comes of it is infinite or no number, and fails.
    with np.errstate(all="ignore"):
        case = Case.from_dict(content)
        claims = [_feasible(case), _loads(case), _amounts(case)]
        claims += _costs(case)
        if len(case.kept):
            claims.append(_kept(case))
        claims += _numbers(case)
        if "bound_searched" in case.stated:
            claims.append(_search(case))
        if case.on_candidates is not None:
            claims += _exact(case)
    return Verification(
        criterion=case.name,
        kind=case.kind,
        robot=case.setting.name,
        poses=len(case.made),
        kept=int(case.kept.amount.sum()),
        candidates=case.candidates,
        claims=tuple(claims),
        of=_words(case),
        prior=case.setting.prior is not None,
        sampling=case.proof.sampling,
        searched="bound_searched" in case.stated,
        covered="bound_proved" in case.stated,
        experiments=int(case.made.amount.sum()) if case.amounts_are_sound else 0,
        budget=None if case.day is None else case.day.budget,
        sized=case.day is not None and case.day.visits is not None,
        exact=_exact_in_words(case),
    )


def _exact_in_words(case: Case) -> str:
    """What is said of all plans of whole experiments on candidates; empty for nothing."""
    one = case.on_candidates
    if one is None or not case.amounts_are_sound:
        return ""
    number = int(case.made.amount.sum())
    plans = f"plans of {number} experiment{'' if number == 1 else 's'}"
    what = "the best of all" if one.stated["proved_exact"] else "a bound on all"
    return f"{what} {plans} on the first {one.number:,} candidates"


def _exact(case: Case) -> list[Claim]:
    """The claims about all plans of whole experiments on candidates, which are drawn anew."""
    one = case.on_candidates
    assert one is not None
    made = case.made.amount.sum()
    if one.counts.sum() != made:
        return unproved_exact(f"expected a plan of {made:g} experiments", EXACT_CLAIMS)
    try:
        part = one.part(case.name)
        known = one.beside(case.known_to_all)
        cost = values.cost(case.name, case.value_exact)
    except (ValueError, ArithmeticError) as error:
        return unproved_exact(f"cannot be recomputed: {' '.join(str(error).split())}", EXACT_CLAIMS)
    # Rows were computed in another way: a bound as good but for that is proved.
    replay = Replay(one.tree, part, known, int(made))
    found = exact_claims(case.name, one.stated, replay, cost, AGREE, AGREE)
    return [replace(claim, claim=name) for claim, name in zip(found, EXACT_CLAIMS, strict=False)]


def unproved_exact(
    reason: str, names: tuple[str, ...] = ("value", "bound_exact", "proved_exact")
) -> list[Claim]:
    """The claims about whole plans where nothing is proved."""
    return [Claim(name, False, None, None, reason) for name in names]


def exact_claims(
    name: str,
    stated: dict[str, Any],
    replay: Replay,
    cost: float,
    unsure: float,
    slack: float = 0.0,
) -> list[Claim]:
    """The claims about value, bound, and whether a plan is the best of all on some candidates.

    Args:
        name: The criterion.
        stated: What is claimed: `value`, `bound_exact` and `proved_exact`.
        replay: Why no plan is better.
        cost: The cost of the plan, recomputed.
        unsure: Its relative error.
        slack: Relative difference between these candidates and those of the search.
    """
    n = replay.candidates.n
    value = as_cost(name, stated["value"])
    holds = abs(value - cost) <= unsure * cost and unsure < 2 * AGREE
    reason = "" if holds else "the recomputed number differs"
    if not holds and unsure >= 2 * AGREE:
        reason = f"rounding leaves it open: it is recomputed to {unsure:.0e} only"
    claims = [Claim("value", holds, stated["value"], as_cost(name, cost), reason)]
    bound = as_cost(name, stated["bound_exact"])
    why = "expected a positive number"
    if 0 < bound < math.inf:
        why = replay.proves(bound * (1 - slack))
    own = None if why else stated["bound_exact"]
    claims.append(Claim("bound_exact", not why, stated["bound_exact"], own, why, n))
    if stated["proved_exact"]:
        is_best = not why and cost * (1 - BEST - slack) <= bound
        reason = "" if is_best else "the plan is not the best"
        claims.append(Claim("proved_exact", is_best, None, None, reason, n))
    return claims


def _words(case: Case) -> tuple[str, ...]:
    """What the criterion is about, in names of parameters; none for all of them."""
    if case.interest is None:
        return ()
    names = case.setting.parameters
    return tuple(combination(column, names) for column in case.interest.T)


def _feasible(case: Case) -> Claim:
    """All poses satisfy the joint limits, the workspace and the fixed joints."""
    violation = float(np.max(case.setting.violation(case.made.q)))
    return _at_most("feasible", violation, TINY, "a pose violates a constraint")


def _loads(case: Case) -> Claim:
    """All wrenches are among those that may be applied."""
    excess = float(np.max(case.setting.load.excess(case.made.wrench)))
    return _at_most("loads", excess, TINY_LOAD, "a load is not among the allowed ones")


def _kept(case: Case) -> Claim:
    """Kept experiments lie within the workspace, but for the rounding of their file.

    They may be near poses that are excluded, and under other loads: they were made before.
    """
    violation = float(np.max(case.setting.workspace.violation_within_rounding(case.kept.q)))
    return _at_most("kept", violation, TINY, "a kept pose violates a constraint")


def _at_most(name: str, found: float, limit: float, reason: str) -> Claim:
    """The claim that a number that should be zero or less is no more than rounding."""
    holds = bool(found <= limit)  # not if it is no number
    positive = found if math.isnan(found) else max(found, 0.0)
    return Claim(name, holds, 0.0, positive, "" if holds else reason)


def _amounts(case: Case) -> Claim:
    """Weights sum to one, or repetitions are whole numbers."""
    is_plan = case.kind == "plan"
    total = float(case.made.amount.sum())
    holds = case.amounts_are_sound
    expected = "whole repetitions from 1 to 1e9" if is_plan else "weights of sum one, none negative"
    reason = "" if holds else f"expected {expected}"
    name = "repeats" if is_plan else "weights"
    return Claim(name, holds, total if is_plan else 1.0, total, reason)


def _costs(case: Case) -> list[Claim]:
    """The visits and their load changes cost no more than the budget; none without one."""
    day = case.day
    if day is None:
        return []
    total = day.total(case.made.wrench, case.made.amount)
    pays = total <= day.budget * (1 + ROUNDING_OF_FUNDS)
    sized = day.visits is None or case.made.amount.sum() == day.visits
    reason = "" if pays else "the budget does not pay for the visits"
    if pays and not sized:
        reason = f"expected {day.visits} visits"
    return [Claim("costs", bool(pays and sized), day.budget, total, reason)]


def _numbers(case: Case) -> list[Claim]:
    """The stated numbers, those that are missing, and those that nobody knows."""
    recomputed: dict[str, float] = {}
    sources: dict[str, Callable[[], float]] = {
        "value": lambda: case.value,
        "bound": lambda: case.bound(searched=False),
        "bound_searched": lambda: case.bound(searched=True),
        "bound_proved": lambda: case.bound_proved,
        "gap": lambda: _gap(case, recomputed, BOUNDS),
        "efficiency": lambda: 1.0 - _gap(case, recomputed, BOUNDS[::-1]),
    }
    mandatory = _mandatory(case)
    found = []
    for name in ORDER:
        if name not in case.stated and name not in mandatory:
            continue
        claim = _compared(case, name, sources[name])
        recomputed[name] = math.nan if claim.recomputed is None else claim.recomputed
        found.append(_unbeaten(claim, lambda: _gap(case, recomputed, BOUNDS[::-1])))
    # The name is from the file, and is not printed.
    found += [
        Claim("unknown", False, None, None, "a claim that cannot be checked")
        for name in case.stated
        if name not in ORDER
    ]
    return found


def _mandatory(case: Case) -> tuple[str, ...]:
    """The claims that must be stated: one that is left out could hide a bad number.

    The poses of a plan need not be candidates. Its efficiency is that beside all poses.
    """
    if case.kind == "relaxation":
        return ("value", "bound", "gap")
    if "bound_proved" in case.stated:
        return ("value", "bound_proved", "efficiency")
    if "bound" in case.stated and not {"bound_searched", "efficiency"} & set(case.stated):
        return ("value", "bound")
    return ("value", "bound_searched", "efficiency")


def _gap(case: Case, recomputed: dict[str, float], order: tuple[str, ...]) -> float:
    """``1 - bound/cost`` of the recomputed numbers, for the first of the bounds that is stated."""
    bound = next(recomputed[name] for name in order if name in recomputed)
    best = values.cost(case.name, recomputed["value"])
    return 1.0 - values.cost(case.name, bound) / best


def _compared(case: Case, name: str, source: Callable[[], float]) -> Claim:
    """Compare a stated number with a recomputed one; a proof that proves nothing does not hold."""
    candidates = case.candidates if name in BOUNDS[:2] else None
    number = _number(case.stated.get(name))
    try:
        found = source()
    except (ValueError, ArithmeticError) as error:
        reason = f"cannot be recomputed: {' '.join(str(error).split())}"
        return Claim(name, False, number, None, reason, candidates)
    # A gap near zero has no digits of its own, so that only its size can be compared.
    absolute = ABSOLUTE if name in ("gap", "efficiency") else 0.0
    by_boxes = name == "bound_proved" or (name == "efficiency" and "bound_proved" in case.stated)
    relative = AGREE_ON_BOXES if by_boxes else AGREE
    agrees = math.isclose(number, found, rel_tol=relative, abs_tol=absolute)
    holds = math.isfinite(number) and math.isfinite(found) and agrees
    reason = "" if holds else _why(case, name, number, found)
    return Claim(name, holds, number, found, reason, candidates)


def _number(stated: Any) -> float:
    """A stated number; no number if the certificate has anything else in its place."""
    try:
        is_number = isinstance(stated, int | float) and not isinstance(stated, bool)
        return float(stated) if is_number else math.nan
    except OverflowError:  # an integer of more than 308 digits
        return math.nan


def _why(case: Case, name: str, stated: float, found: float) -> str:
    """Why a stated number does not hold."""
    if name not in case.stated:
        return f"not stated, and the certificate of a {case.kind} must state it"
    if not math.isfinite(stated):
        return "the stated value is no finite number"
    if not math.isfinite(found):
        return "nothing is proved here" if name in BOUNDS else "it rests on claims that fail"
    return "the recomputed number differs"


def _unbeaten(claim: Claim, gap: Callable[[], float]) -> Claim:
    """Reject a bound, and what follows from it, that the design itself beats: it says nothing."""
    is_beaten = claim.holds and claim.claim != "value" and gap() < -ABSOLUTE
    if not is_beaten:
        return claim
    return Claim(claim.claim, False, claim.stated, claim.recomputed, "the design beats the bound")


def _search(case: Case) -> Claim:
    """No pose that a search of this module's own finds has a much larger sensitivity."""
    try:
        excess = case.excess
    except (ValueError, ArithmeticError) as error:
        return Claim("search", False, 0.0, None, f"cannot be repeated: {error}")
    return _at_most("search", excess, EXCESS, "a pose of a larger sensitivity was found")
