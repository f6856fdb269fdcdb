"""Recompute every claim of a certificate of a relaxation over a problem of arrays."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import criteria
from edtk.certificate.recompute.array_criteria import (
    Found,
    as_cost,
    beside_precision,
    recompute,
    require_little_work,
    unknown,
)
from edtk.certificate.recompute.arrays import Candidates
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text
from edtk.certificate.recompute.region import Region
from edtk.certificate.recompute.values import MOST_MULTIPLIERS
from edtk.certificate.recompute.weight_limits import WeightLimits
from edtk.certificate.verify_certificate import ABSOLUTE, AGREE, Claim, Verification
from edtk.design.information import Rows
from edtk.design.problem import Problem
from edtk.system.typing import Array, Indices

KIND = "relaxation of a problem"
KEYS = ("kind", "criterion", "candidates", "weights", "value", "bound", "gap", "multipliers")
OF_LIMITS = ("limits", "experiments", "limit_multipliers")
OPTIONAL = ("dual_weights", "inner", "region", "bound_proved", *OF_LIMITS)
OVER_REGION = "bound_proved"
NUMBERS = "numbers of the criterion"
LIMITS = "limits"


@dataclass(frozen=True, repr=False)
class ProblemVerification(Verification):
    """All claims of a certificate of a relaxation over a problem's candidates, checked.

    Attributes:
        about: The criterion as a person reads it.
        told: What the certificate alone says of the question; the problem beside it does not.
    """

    about: str = ""
    told: tuple[str, ...] = ()

    @property
    def proved(self) -> str:
        """What is proved, and on what."""
        if not self.valid:
            return "nothing is proved"
        if any(claim.claim == OVER_REGION for claim in self.claims):
            return f"{self.question}; the bound is proved for all points of that region"
        within = ", within these limits" if LIMITS in self.told else ""
        drawn = f"its {self.candidates} candidates alone{within}"
        return f"{self.question}; the bound is proved on {drawn}"

    @property
    def question(self) -> str:
        """What was asked, and which part of it is the file's own word."""
        if not self.told:
            return "for this problem"
        *first, last = self.told
        listed = f"{', '.join(first)} and {last}" if first else last
        return f"for this problem, with {listed} by the file's own word"

    @property
    def subject(self) -> str:
        """What the certificate is about, for a person."""
        return f"{self.label}, weights on {self.poses} of {self.candidates} candidates"

    @property
    def whose(self) -> str:
        """Where the check begins: what is before it has no second implementation."""
        return "the check begins with the rows as this problem keeps them, in units of their sigma"

    @property
    def label(self) -> str:
        """The criterion as a person reads it."""
        return self.about

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: `valid`, what the certificate is about, and the claims."""
        return {
            "valid": self.valid,
            "criterion": self.criterion,
            "about": self.about,
            "kind": self.kind,
            "candidates": self.candidates,
            "proved": self.proved,
            "support": self.poses,
            "second_implementation": True,
            "claims": [claim.to_dict() for claim in self.claims],
        }


def verify_problem(content: Any, problem: Problem) -> ProblemVerification:
    """Check all claims of a certificate against the candidates that it is about.

    The certificate is an enemy's: whatever it says is computed anew from weights, multipliers and
    the candidates. These are taken as the problem keeps them: rows that are divided by sigma, or
    squares, with the prior. From there on the code is none that the search uses. The registry of
    criteria tells how the criterion is called in words, and no more.

    Args:
        content: What `Relaxation.to_dict` wrote, as JSON has it.
        problem: The candidates.

    Returns:
        Each claim with the stated and the recomputed number.

    Raises:
        ValueError: The content is no such certificate, or would take too long; one line says where.
    """
    with np.errstate(all="ignore"):
        read = _Stated.of(content, problem)
        plug_in = unknown(read.criterion)
        candidates = candidates_of(problem)
        require_little_work(read.criterion, candidates, len(read.multipliers))
        label = label_of(read.criterion)
        sound = _sound(read.places, read.shares)
        claims = [same_candidates(content["candidates"], problem, candidates.sha256), sound]
        if read.limits is not None:
            counts = read.experiments * read.weights
            broken = read.limits.broken(counts)
            total = float(counts.sum())
            claims.append(Claim("limits", not broken, read.experiments, total, broken))
        found = Found(math.nan, math.inf, math.nan, math.nan)
        if sound.holds and not plug_in:
            unit = 1.0 if read.limits is None else read.limits.unit
            weights = read.weights * (read.experiments / unit)
            parts = read.multipliers, read.inner, read.duals, read.limits
            found = recompute(read.criterion, candidates, weights, *parts)
            if "region" in content:
                claims.append(_over_region(content, candidates, weights))
        claims += _numbers(read.criterion["name"], read.numbers, found, problem.n, plug_in)
    return ProblemVerification(
        criterion=read.criterion["name"],
        kind="relaxation",
        robot="",
        poses=len(read.places),
        kept=0,
        candidates=problem.n,
        claims=tuple(claims),
        about=label,
        told=(
            *(["a region"] if "region" in content else []),
            *([LIMITS] if read.limits is not None else []),
            *numbers_of(read.criterion),
        ),
    )


@dataclass(frozen=True, eq=False)
class _Stated:
    """What a certificate says, as far as it can be read.

    Attributes:
        criterion: The criterion as a table with a name.
        places: Candidates (k,) of the design.
        shares: Their weights (k,).
        weights: Those of all candidates (n,).
        multipliers: Multipliers (r, p, p).
        inner: The same with more digits, if there are any.
        duals: The shares that go with each multiplier.
        numbers: Value, bound and gap; NaN where none is stated.
        limits: Limits of the weights; None without any.
        experiments: Number of experiments that these are about.
    """

    criterion: dict[str, Any]
    places: Indices
    shares: Array
    weights: Array
    multipliers: Array
    inner: tuple[Array, Array] | None
    duals: list[Array | None]
    numbers: dict[str, float]
    limits: WeightLimits | None
    experiments: float

    @classmethod
    def of(cls, content: Any, problem: Problem) -> "_Stated":
        """Read a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        table(content, KEYS, "certificate", OPTIONAL)
        text(content["kind"], (KIND,), "kind")
        places, shares = _weights(content["weights"], problem.n)
        multipliers = _multipliers(content["multipliers"], problem.p)
        inner = _inner(content.get("inner"), multipliers.shape)
        duals = _shares(content.get("dual_weights"), len(multipliers))
        stated = {name: number(content[name], name) for name in ("value", "gap")}
        says_nothing = content["bound"] is None
        stated["bound"] = math.nan if says_nothing else number(content["bound"], "bound")
        require_table(content["criterion"])
        limits, experiments = _limits(content, problem, len(multipliers))
        return cls(
            criterion=content["criterion"],
            places=places,
            shares=shares,
            weights=np.bincount(places, shares, problem.n).astype(float),
            multipliers=multipliers,
            inner=inner,
            duals=duals,
            numbers=stated,
            limits=limits,
            experiments=experiments,
        )


def _limits(
    content: dict[str, Any], problem: Problem, multipliers: int
) -> tuple[WeightLimits | None, float]:
    """The limits that a certificate states, and the number of experiments; None without any."""
    stated = [key for key in OF_LIMITS if key in content]
    if not stated:
        return None, 1.0
    if len(stated) < len(OF_LIMITS) or "region" in content:
        raise ValueError(f"limits: expected {', '.join(OF_LIMITS)} together, and no region")
    limits = WeightLimits.from_dict(
        content["limits"], content["limit_multipliers"], problem.n, multipliers
    )
    experiments = number(content["experiments"], "experiments")
    if limits.size is None and (problem.prior is not None or "precision" in content["criterion"]):
        raise ValueError("limits.size: expected beside a prior, which counts per experiment")
    if not experiments > 0:
        raise ValueError("experiments: expected above 0")
    return limits, experiments


def numbers_of(given: dict[str, Any]) -> list[str]:
    """That a criterion has numbers, which its name does not tell; nothing where it has none."""
    return [NUMBERS] if len(given) > 1 else []


def _over_region(content: dict[str, Any], candidates: Candidates, weights: Array) -> Claim:
    """The claim that no design over a whole region is better.

    With ``<Z, M(x)> <= limit`` for all points, instead of the largest t of the candidates, the
    bound that Z proves for these becomes ``(t/limit)^degree`` times as large.
    """
    stated = number(content.get(OVER_REGION), OVER_REGION)
    region = Region.from_dict(content["region"], candidates.rows.shape[1], candidates.p)
    criterion, candidates = beside_precision(content["criterion"], candidates)
    prior = candidates.prior.astype(float)
    strangers = region.strangers(content["region"]["points"], candidates)
    left = region.open_leaves(prior)
    if strangers or left:
        found = f"{strangers} candidates are no points of it, {left} boxes are open"
        return Claim(OVER_REGION, False, stated, None, found)
    Z = region.Z[None]
    given = content["region"].get("dual_weights")
    shares = _shares(None if given is None else [given], 1, "region.dual_weights")
    by_candidates = recompute(criterion, candidates, weights, Z, None, shares)
    AZ = candidates.rows @ region.Z
    largest = float((AZ * candidates.rows).sum(axis=(1, 2)).max() + (region.Z * prior).sum())
    proved = by_candidates.bound * (largest / region.limit) ** by_candidates.degree
    holds = 0 < as_cost(criterion["name"], stated) <= proved * (1 + AGREE)
    reason = "" if holds else "the recomputed number differs"
    return Claim(OVER_REGION, holds, stated, as_cost(criterion["name"], proved), reason)


def candidates_of(problem: Problem) -> Candidates:
    """The arrays that a problem keeps."""
    kept = problem.kept
    if isinstance(kept, Rows):
        found = Candidates.of(kept.A, None, problem.prior)
        divided = None if kept.sigma is None else (kept.given, kept.sigma)
        return replace(found, undivided=divided)
    return Candidates.of(None, kept.triangles, problem.prior)


def require_table(given: Any) -> None:
    """Refuse a criterion that is no table, or whose parts are none."""
    parts = given.get("criteria", []) if isinstance(given, dict) else []
    names = [given, *(parts if isinstance(parts, list) else [None])]
    for one in names:
        is_named = isinstance(one, dict) and isinstance(one.get("name"), str)
        if not is_named and not (isinstance(one, str) and one is not given):
            raise ValueError("criterion: expected a table with a name")


def label_of(given: Any) -> str:
    """How a person calls a criterion, which is all that the registry is asked for."""
    try:
        found = criteria.from_dict(given)
    except (criteria.CriterionError, ValueError, TypeError, OverflowError) as error:
        raise ValueError(f"criterion: {' '.join(str(error).split())}") from error
    if not isinstance(found, criteria.Relaxable):
        raise ValueError(f"criterion: {found.name!r} cannot be relaxed")
    return found.label


def _weights(given: Any, n: int) -> tuple[np.ndarray, Array]:
    """Candidates (k,) and their weights (k,)."""
    table(given, ("candidate", "weight"), "weights")
    places = rows(given["candidate"], n, "weights.candidate")
    for place in places:
        if isinstance(place, bool) or not isinstance(place, int) or not 0 <= place < n:
            raise ValueError(f"weights.candidate: expected whole numbers from 0 to {n - 1}")
    shares = numbers(given["weight"], (len(places),), "weights.weight")
    return np.array(places, dtype=int), shares


def _multipliers(given: Any, p: int) -> Array:
    """Multipliers (r, p, p), symmetric: of others the symmetric part would count, unseen."""
    found = numbers(rows(given, MOST_MULTIPLIERS, "multipliers"), (None, p, p), "multipliers")
    if not (found == np.swapaxes(found, 1, 2)).all():
        raise ValueError("multipliers: expected symmetric matrices")
    return found


def _inner(given: Any, shape: tuple[int, ...]) -> tuple[Array, Array] | None:
    """The multipliers with more digits, T (p, p) and Z (r, p, p), if there are any."""
    if given is None:
        return None
    table(given, ("T", "Z"), "inner")
    Z = numbers(given["Z"], shape, "inner.Z")
    return numbers(given["T"], shape[1:], "inner.T"), 0.5 * (Z + np.swapaxes(Z, 1, 2))


def _shares(given: Any, multipliers: int, name: str = "dual_weights") -> list[Array | None]:
    """The shares that go with each multiplier; any prove a bound, so that they need no check."""
    if given is None:
        return [None] * multipliers
    rows(given, multipliers, name)
    if len(given) != multipliers:
        raise ValueError(f"{name}: expected shares for each of {multipliers} multipliers")
    found: list[Array | None] = []
    for each in given:
        u = numbers(each, (None,), name)
        if not (u >= 0).all() or not 0 < u.sum() < math.inf:
            raise ValueError(f"{name}: expected shares that are not negative")
        found.append(u / u.sum())
    return found


def _not_told(error: float) -> str:
    """Why nothing is said of a number that is recomputed to a relative error."""
    if not math.isfinite(error):
        return "it is not finite here"
    return f"rounding leaves it open: it is recomputed to {error:.0e} only"


def same_candidates(given: Any, problem: Problem, sha256: str) -> Claim:
    """The claim that the certificate is about these candidates."""
    table(given, ("number", "parameters", "sha256"), "candidates")
    own = {"number": problem.n, "parameters": list(problem.parameters), "sha256": sha256}
    other = [key for key in own if given[key] != own[key]]
    reason = f"the problem has another {', '.join(other)}" if other else ""
    return Claim("candidates", not other, None, None, reason)


def _sound(places: np.ndarray, shares: Array) -> Claim:
    """The claim that weights are shares of one, each candidate's given once."""
    total = float(shares.sum())
    is_share = bool((shares >= 0).all()) and abs(total - 1) <= ABSOLUTE
    holds = is_share and len(np.unique(places)) == len(places) > 0
    reason = "" if holds else "expected weights of sum one, none negative, each candidate once"
    return Claim("weights", holds, 1.0, total, reason)


def _numbers(
    name: str, stated: dict[str, float], found: Found, n: int, plug_in: str
) -> list[Claim]:
    """The claims about value, bound and gap.

    A bound holds if it is no better than what is proved here: a weaker one is true as well. It is
    proved but for the rounding of two ways, which never lifts it above the cost of the design. The
    gap is that of the bound that is stated, as far as it is proved.
    """
    value = as_cost(name, stated["value"])
    proved = found.bound * (1 + AGREE)
    bound = as_cost(name, stated["bound"])
    kept = min(bound, found.bound)
    gap = 1 - kept / found.cost
    unsure = AGREE + found.error
    is_beaten = bound > found.cost * (1 + found.error)
    holds = {
        "value": abs(value - found.cost) <= unsure * found.cost,
        "bound": 0 < bound <= proved and not is_beaten,
        "gap": abs(stated["gap"] - gap) <= ABSOLUTE + unsure and gap >= -ABSOLUTE - unsure,
    }
    own = {
        "value": as_cost(name, found.cost),
        "bound": as_cost(name, found.bound),
        "gap": gap,
    }
    claims = []
    for key, here in own.items():
        reason = ""
        if plug_in:
            reason = f"the criterion {plug_in} has no second implementation"
        elif key == "bound" and math.isnan(bound):
            reason = "no bound is stated"
        elif not math.isfinite(here):
            reason = "nothing is proved here" if key == "bound" else _not_told(found.error)
        elif is_beaten if key == "bound" else key == "gap" and here < -ABSOLUTE - unsure:
            reason = "the design beats the bound"
        elif not holds[key]:
            reason = "the recomputed number differs"
        candidates = n if key == "bound" else None
        told = None if math.isnan(stated[key]) else stated[key]
        claims.append(Claim(key, not reason, told, here, reason, candidates))
    return claims
