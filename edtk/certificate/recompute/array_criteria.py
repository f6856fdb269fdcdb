"""Every criterion written down once more: its cost, and the least cost under a multiplier.

A criterion is a form of combinations K'k. With the singular values d of their deviations the forms
are, and with those of ``F K``, for ``Z = F'F``, the least of all costs with ``<Z, X> <= 1`` are:

    sum       sum d^2                      (sum s)^2
    volume    (prod d)^(2/r)               r (prod s)^(2/r)
    longest   max d^2                      sum s^2
    lengths   sum d                        (sum s^(2/3))^(3/2)
    phi       (mean d^2q)^(1/q)            r (mean s^(2e))^(1/e), e = q/(1 + q)
    worst     largest sum in a group       (sum s)^2 of columns times the roots of shares

The last one takes shares u of the groups: the largest is at least any mean. A criterion is a power
of a form. That rho0 is the root of a sum, and G the worst of single parameters, needs no form of
its own.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from edtk.certificate.recompute.arrays import (
    Candidates,
    Design,
    Frame,
    Proof,
    Side,
    balance_bound,
    independent,
    log_volume,
    same_multipliers,
)
from edtk.certificate.recompute.candidates import PER_CUBE, PER_SQUARE, require
from edtk.certificate.recompute.eigenpairs import eigenpairs
from edtk.certificate.recompute.plain_data import number, numbers, rows, text
from edtk.certificate.recompute.tasks import EPS
from edtk.certificate.recompute.values import Multipliers
from edtk.certificate.recompute.weight_limits import WeightLimits
from edtk.system.typing import Array, Indices

FORMS = {
    "A": ("sum", 1.0),
    "I": ("sum", 1.0),
    "c": ("sum", 1.0),
    "rho0": ("sum", 0.5),
    "D": ("volume", 1.0),
    "Ds": ("volume", 1.0),
    "O1": ("volume", 0.5),
    "E": ("longest", 1.0),
    "O3": ("longest", 0.5),
    "G": ("worst", 1.0),
    "rho_max": ("worst", 0.5),
    "prediction_G": ("worst", 1.0),
    "O5": ("lengths", 1.0),
    "phi": ("phi", 1.0),
}
# Their combinations may be fewer than the parameters, all of which a plan must tell nevertheless.
OF_ALL = ("rho0", "rho_max", "prediction_G")
BALANCES = ("O2", "O4")
BAYESIAN = ("bayes_A", "bayes_D")
SEVERAL = ("compound", "minimax")
NAMES = (*FORMS, *BALANCES, *BAYESIAN, *SEVERAL)
MAXIMISED = ("D", "E", "O1", "O3", "O4", "Ds", "bayes_D")
MOST_PARTS = 100
PER_LONG = 0.005  # of a row and a pair of parameters, in long numbers [us]
PER_ROTATION = 100.0  # of a pair of parameters, in all sweeps [us]
BLURRED = 1e-6  # relative rounding of a cost that tells nothing any more
NOTHING = 1e-10  # of a singular value beside the largest: a combination that others say already
FLOOR = 1e-12  # least eigenvalue, of the largest, of what splits a multiplier


def unknown(given: Any) -> str:
    """The name of a criterion that is not written down here; empty if all are."""
    parts = given.get("criteria", ()) if given["name"] in SEVERAL else ()
    rows(list(parts), MOST_PARTS, "criterion.criteria")
    found = [given["name"], *(part if isinstance(part, str) else part["name"] for part in parts)]
    return next((str(name) for name in found if name not in NAMES), "")


def as_cost(name: str, value: float) -> float:
    """The cost, where smaller is better, of a printed value; and the other way round."""
    if name not in MAXIMISED:
        return value
    return 1 / value if value else math.inf


@dataclass(frozen=True, eq=False)
class Part:
    """A power of a form of combinations.

    Attributes:
        form: Its form.
        power: The power.
        K: Combinations (p, s), one a column.
        q: The order of phi; else one.
        groups: The group (s,) of each column, of those of which the worst counts.
        needs_all: Whether a plan must tell all parameters, even those that no combination has.
        logs: Of a volume, the logarithm of what its combinations are beside K, times their number.
        lost: Bound on the rounding of that.
    """

    form: str
    power: float
    K: Array
    q: float
    groups: Array
    needs_all: bool = False
    logs: float = 0.0
    lost: float = 0.0

    @property
    def degree(self) -> float:
        """How the cost shrinks: ``cost(c M) = c^-degree cost(M)``."""
        return 0.5 if self.form == "lengths" else self.power

    @property
    def is_volume(self) -> bool:
        """Whether it is that of a volume."""
        return self.form == "volume"

    def scaled(self, units: Indices) -> "Part":
        """The same for parameters k' with ``k = 2^units k'``."""
        if not self.is_volume:
            return replace(self, K=np.ldexp(self.K, units[:, None]))
        K, logs, lost = independent(self.K, units)
        return replace(self, K=K, logs=logs, lost=lost)

    @classmethod
    def of(cls, given: Any, p: int) -> "Part":
        """Read a criterion of p parameters that is not made of others."""
        given = {"name": given} if isinstance(given, str) else given
        name = text(given["name"], tuple(FORMS), "criterion.name")
        form, power = FORMS[name]
        K, group = _combinations(name, given, p)
        q = number(given["q"], "criterion.q") if form == "phi" else 1.0
        if form == "phi" and not 0 <= q <= 50:
            raise ValueError("criterion.q: expected a number from 0 to 50")
        if form == "phi" and q == 0:
            form = "volume"
        groups = np.repeat(np.arange(K.shape[1] // group), group)
        return cls(form, power, K, q, groups, name in OF_ALL)

    def cost(self, design: Design) -> tuple[float, float]:
        """The cost, and one that it is not above, whatever rounding did; infinite if unknown."""
        side = design.frame.side(self.K)
        if not design.root.tells(side.J, side.digits):
            return math.inf, math.inf
        longer = 1 + design.blur
        if self.is_volume:
            logs, error = self._log_volume(side, design)
            found, most = np.exp((logs, logs + error)).tolist()
            return found**self.power, (most * longer) ** self.power
        L, lost = side.deviations(design.root.W)
        if self.form == "worst":
            own = float(np.bincount(self.groups, np.square(L).sum(axis=1)).max())
            return own**self.power, ((math.sqrt(own) + lost) ** 2 * longer) ** self.power
        d = np.asarray(np.linalg.svd(L, compute_uv=False), dtype=float)
        most = self._of_deviations(d + lost) ** self.power * longer**self.degree
        return self._of_deviations(d) ** self.power, most

    def _log_volume(self, side: Side, design: Design) -> tuple[float, float]:
        """The logarithm of the volume, and a bound on its rounding."""
        Q, logs, error = side.volume
        logs += self.logs
        error += self.lost + EPS * (abs(logs) + abs(self.logs))
        s = self.K.shape[1]
        W = design.root.W
        if W.shape[1] == s == len(W):
            more, lost = log_volume(W)
            return 2 * (logs + more) / s, 2 * (error + lost) / s
        d = np.linalg.svd(Q.T @ W, compute_uv=False)
        lost = 16 * len(W) * EPS * float(np.linalg.norm(W))
        if len(d) < s or d[-1] <= lost:
            return math.inf, math.inf
        more = float(np.log(d).sum())
        return 2 * (logs + more) / s, 2 * (error + float((lost / d).sum())) / s

    def _of_deviations(self, d: Array) -> float:
        """The form of singular values, see above."""
        if self.form == "sum":
            return float(np.square(d).sum())
        if self.form == "longest":
            return float(d[0] ** 2)
        if self.form == "lengths":
            return float(d.sum())
        # Of s combinations, those that have no singular value of their own count as well.
        mean = ((d / d[0]) ** (2 * self.q)).sum() / self.K.shape[1]
        return float(d[0] ** 2 * mean ** (1 / self.q))

    def least(self, F: Array, side: Side, shares: Array | None = None) -> float:
        """The least cost of any X with ``<F'F, X> <= 1``, lowered by rounding.

        Args:
            F: Root (k, p) of a multiplier, for the parameters of a frame.
            side: The combinations K for these parameters, see `Frame.side`.
            shares: Shares (groups,) of sum one at most, for the worst of several.
        """
        s = self.K.shape[1]
        if self.is_volume:
            found = s * float(np.exp(2 * self._log_least(side, F) / s))
        elif self.form == "worst":
            found = self._of_worst(side, F, shares)
        else:
            found = self._of_roots(side.roots(F))
        return float(found**self.power)

    def _log_least(self, side: Side, F: Array) -> float:
        """``log |det F J|``, lowered by its rounding."""
        Q, logs, error = side.volume
        scaled = F @ Q
        if len(F) < Q.shape[1] or not scaled.any(axis=0).all():
            return -math.inf
        length = np.ones(Q.shape[1])
        if Q.shape[0] == Q.shape[1]:
            length = np.linalg.norm(F, axis=0)
        scaled = scaled / length
        logs += float(np.log(length).sum()) + self.logs
        size = abs(logs) + abs(self.logs) + float(np.abs(np.log(length)).sum())
        error += self.lost + 2 * EPS * size
        lost = 16 * len(F) * EPS * np.linalg.norm(F / length if len(length) == len(Q) else F)
        s = np.linalg.svd(scaled, compute_uv=False) - lost
        return logs - error + float(np.log(s).sum()) if s[-1] > 0 else -math.inf

    def _of_roots(self, s: Array) -> float:
        """The least of a form by singular values (s,), see above."""
        if self.form == "sum":
            return float(s.sum() ** 2)
        if self.form == "longest":
            return float(np.square(s).sum())
        if self.form == "lengths":
            return float((s ** (2 / 3)).sum() ** 1.5)
        e = self.q / (1 + self.q)
        return float(len(s) * ((s ** (2 * e)).mean()) ** (1 / e))

    def _of_worst(self, side: Side, F: Array, shares: Array | None) -> float:
        """The least of the worst group by its shares."""
        groups = int(self.groups[-1]) + 1
        if shares is None or len(shares) != groups:
            raise ValueError(f"dual_weights: expected {groups} shares")
        return float(side.weighted(np.sqrt(shares)[self.groups]).roots(F).sum() ** 2)

    def slope(self, D: Array, side: Array) -> Array:
        """H (s, r) with ``H H'`` minus the gradient of ``log cost^(1/degree)``.

        With ``L = K'D = P diag(d) R'`` it is ``D R diag(d^q) / (sum d^2q)^(1/2)``, where q is that
        of phi: 1 of a sum, 0 of a volume, 1/2 of lengths. A volume has the same for all
        combinations of the same span, of which orthogonal ones hide none.

        Args:
            D: Root (s, r) of a covariance.
            side: Combinations (s, t) of what it is the covariance of.
        """
        if self.is_volume:
            side = np.linalg.qr(side)[0]
        _, d, R = np.linalg.svd(side.T @ D, full_matrices=False)
        kept = d > NOTHING * d[0]
        q = {"volume": 0.0, "lengths": 0.5}.get(self.form, self.q)
        powers = (d[kept] / d[0]) ** q
        return np.asarray(D @ R[kept].T * powers / np.linalg.norm(powers))


def _combinations(name: str, given: Any, p: int) -> tuple[Array, int]:
    """Combinations K (p, s) that a criterion is about, and how many columns are a group."""
    if name == "rho0":
        return numbers(given["target"], (None, p), "criterion.target").T, 1
    if name in ("rho_max", "prediction_G"):
        return _grouped(given["targets" if name == "rho_max" else "points"], p, name)
    if name == "I":
        return _of_predictions(given, p), 1
    if name == "c":
        return numbers(given["c"], (p,), "criterion.c")[:, None], 1
    K = given.get("interest")
    if K is None:
        return np.eye(p), 1
    if isinstance(K, list) and K and not isinstance(K[0], list):
        return numbers(K, (p,), "criterion.interest")[:, None], 1
    return numbers(K, (p, None), "criterion.interest"), 1


def _grouped(given: Any, p: int, name: str) -> tuple[Array, int]:
    """Rows of several tasks, or places, as columns; of tasks in two axes all rows are one task."""
    depth = 0
    inner = given
    while isinstance(inner, list) and inner:
        inner = inner[0]
        depth += 1
    if depth == 2:
        found = numbers(given, (None, p), "criterion.points")
        return found.T, 1 if name == "prediction_G" else len(found)
    tasks = numbers(given, (None, None, p), "criterion.points")
    return tasks.reshape(-1, p).T, tasks.shape[1]


def _of_predictions(given: Any, p: int) -> Array:
    """K (p, s) with ``K K'`` the weights of predictions: a root, the matrix, or places."""
    if given.get("root") is not None:
        return numbers(given["root"], (p, None), "criterion.root")
    if given.get("W") is not None:
        W = numbers(given["W"], (p, p), "criterion.W")
        d = np.sqrt(np.maximum(np.diag(W), 0.0))
        unit = np.where(d > 0, d, 1.0)
        r, V = eigenpairs(0.5 * (W + W.T) / unit[:, None] / unit)
        kept = r > 16 * p * EPS * r[-1]
        return np.asarray(d[:, None] * V[:, kept] * np.sqrt(r[kept]))
    K, group = _grouped(given["points"], p, "prediction_G")
    places = K.shape[1] // group
    w = np.ones(places)
    if given.get("weights") is not None:
        w = numbers(given["weights"], (places,), "criterion.weights")
    found = K * np.sqrt(np.repeat(w / w.sum(), group))
    return np.asarray(np.linalg.qr(found.T, mode="r")).T


@dataclass(frozen=True, eq=False)
class Several:
    """A mean, or the largest, of the losses ``(cost_j / best_j)^(1/degree_j)`` of several parts.

    Attributes:
        parts: The parts.
        best: Their best costs (k,).
        weights: Weights (k,) of sum one of a geometric mean; None for the largest.
    """

    parts: list[Part]
    best: Array
    weights: Array | None
    degree = 1.0
    is_volume = False

    def scaled(self, units: Indices) -> "Several":
        """The same for parameters k' with ``k = 2^units k'``."""
        return replace(self, parts=[part.scaled(units) for part in self.parts])

    @classmethod
    def of(cls, given: Any, p: int) -> "Several":
        """Read a criterion of p parameters; with sizes each part is about a model of its own."""
        specifications = rows(given["criteria"], MOST_PARTS, "criterion.criteria")
        k = len(specifications)
        sizes = given.get("sizes")
        lengths = [p] * k if sizes is None else rows(sizes, k, "criterion.sizes")
        if sizes is not None and (len(lengths) != k or sum(lengths) != p or min(lengths) < 1):
            raise ValueError(f"criterion.sizes: expected {k} numbers of sum {p}")
        parts = []
        start = 0
        for one, length in zip(specifications, lengths, strict=True):
            part = Part.of(one, length)
            K = np.zeros((p, part.K.shape[1]))
            K[start : start + length] = part.K
            parts.append(replace(part, K=K))
            start += 0 if sizes is None else length
        names = [one if isinstance(one, str) else one["name"] for one in specifications]
        best = np.ones(k)
        if given.get("best") is not None:
            values = numbers(given["best"], (k,), "criterion.best")
            best = np.array([as_cost(*pair) for pair in zip(names, values.tolist(), strict=True)])
        weights = None
        if given["name"] == "compound":
            weights = np.ones(k)
            if given.get("weights") is not None:
                weights = numbers(given["weights"], (k,), "criterion.weights")
            weights = weights / weights.sum()
        if not (best > 0).all() or (weights is not None and not (weights > 0).all()):
            raise ValueError("criterion: expected positive best values and weights")
        return cls(parts, best, weights)

    def cost(self, design: Design) -> tuple[float, float]:
        """The cost, and one that it is not above, whatever rounding did."""
        found = np.array([part.cost(design) for part in self.parts])
        return self._joined(self._losses(found[:, 0])), self._joined(self._losses(found[:, 1]))

    def _joined(self, losses: Array) -> float:
        if self.weights is None:
            return float(losses.max())
        return float(np.exp(self.weights @ np.log(losses)))

    def _losses(self, costs: Array) -> Array:
        degrees = np.array([part.degree for part in self.parts])
        return np.asarray((costs / self.best) ** (1 / degrees))

    def bound(self, F: Array, design: Design, shares: Array | None) -> float:
        """The least cost of any X with ``<F'F, X> <= 1``, lowered by rounding.

        Of parts ``Z_j = F_j'F_j`` that add up to ``F'F`` at most, each bounds its own loss by q_j:
        the largest is at least their sum, the mean ``prod (q_j / a_j)^(a_j)``.

        Args:
            F: Root (p, p) of a multiplier, for the parameters of the design.
            design: The design near which the bound is tight.
            shares: Shares (k,) of the parts in the multiplier; a mean has its weights.
        """
        u = self.weights if shares is None else shares
        if u is None or len(u) != len(self.parts):
            raise ValueError(f"dual_weights: expected {len(self.parts)} shares")
        parts = zip(self.parts, self._split(F, design, u), strict=True)
        q = self._losses(
            np.array([part.least(C @ F, design.frame.side(part.K)) for part, C in parts])
        )
        if self.weights is None:
            return float(q.sum())
        return float(np.prod((q / self.weights) ** self.weights))

    def _split(self, F: Array, design: Design, u: Array) -> list[Array]:
        """C_j (k, p) with ``sum C_j'C_j <= I``, for ``F_j = C_j F``, by shares u (k,).

        With the slopes ``H_j H_j'`` of the parts for all their combinations Q'k', ``F Q = P R``
        and ``w_j = u_j^(1/2) R^-T H_j``, they are ``w_j' S P'`` with ``S = (sum w_j w_j')^(-1/2)``:
        where ``R'R = sum u_j H_j H_j'``, which optimality asks for, S is the identity. What is left
        of the identity is shared out.
        """
        sides = [design.frame.side(part.K).J for part in self.parts]
        units = [J / np.linalg.norm(J, axis=0) for J in sides]
        U, s, _ = np.linalg.svd(np.hstack(units), full_matrices=False)
        Q = U[:, s > NOTHING * s[0]]
        P, b, Y = np.linalg.svd(F @ Q, full_matrices=False)
        kept = b > 16 * len(F) * EPS * b[0]
        back = Y[kept] / b[kept, None]
        D = Q.T @ design.root.W
        pairs = zip(self.parts, sides, strict=True)
        slopes = [back @ part.slope(D, Q.T @ J) for part, J in pairs]
        w = [math.sqrt(each) * slope for each, slope in zip(u, slopes, strict=True)]
        values, V = eigenpairs(np.sum([each @ each.T for each in w], axis=0))
        S = (V * np.maximum(values, FLOOR * values[-1]) ** -0.5) @ V.T
        roots = [each.T @ S for each in w]
        whole = np.sum([root.T @ root for root in roots], axis=0)
        rounding = 64 * len(F) * EPS
        most = max(1.0, float(np.linalg.eigvalsh(whole)[-1])) * (1 + rounding)
        r, V = eigenpairs(np.eye(len(S)) - whole / most)
        left = np.sqrt(np.maximum(r - rounding, 0.0))[:, None] * V.T
        return [
            np.vstack([root / math.sqrt(most), math.sqrt(each) * left]) @ P[:, kept].T
            for each, root in zip(u / u.sum(), roots, strict=True)
        ]


Whole = Part | Several


def bound(about: Whole, proof: Proof, design: Design, shares: list[Array | None]) -> float:
    """The best of the bounds that multipliers prove, lowered by rounding.

    Args:
        about: The criterion.
        proof: The multipliers with the largest sensitivities.
        design: The design near which bounds are tight, in the frame of the proof.
        shares: Shares for each multiplier, see `Part.least` and `Several.bound`.
    """
    best = 0.0
    for F, t, u in zip(proof.factors, proof.t, shares, strict=True):
        if not t > 0:
            continue  # it would exclude every design: nobody's proof
        if isinstance(about, Several):
            least = about.bound(F, design, u)
        else:
            least = about.least(F, proof.frame.side(about.K), u)
        best = max(best, least * float(t) ** -about.degree)
    return best


@dataclass(frozen=True)
class Found:
    """What a certificate's weights and multipliers say.

    Attributes:
        cost: The cost of the weights; nan where there is none, or rounding leaves no digits of it.
        error: Bound on its relative rounding.
        bound: The bound, lowered by its rounding; nan where nothing is proved.
        degree: How both shrink: ``cost(c M) = c^-degree cost(M)``.
    """

    cost: float
    error: float
    bound: float
    degree: float


def beside_precision(given: Any, candidates: Candidates) -> tuple[Any, Candidates]:
    """A criterion without its precision (p, p), which its candidates then have as a prior.

    Raises:
        ValueError: The precision is none.
    """
    if given["name"] not in BAYESIAN:
        return given, candidates
    precision = numbers(given["precision"], (candidates.p,) * 2, "criterion.precision")
    known = candidates.with_prior(0.5 * (precision + precision.T))
    return {"name": given["name"].removeprefix("bayes_")}, known


def recompute(
    given: Any,
    candidates: Candidates,
    weights: Array,
    multipliers: Array,
    inner: tuple[Array, Array] | None,
    shares: list[Array | None],
    limits: WeightLimits | None = None,
) -> Found:
    """Compute cost and bound anew.

    Args:
        given: The criterion, as JSON has it.
        candidates: The candidates.
        weights: Weights (n,), not negative, of sum one.
        multipliers: Symmetric multipliers (r, p, p).
        inner: T (p, p) and Z' (r, p, p), the multipliers ``T Z' T'`` with more digits, if any.
        shares: Shares for each multiplier, see `Part.least` and `Several.bound`.
        limits: Limits on counts; None without any.

    Raises:
        ValueError: A parameter of the criterion is not what it should be.
    """
    given, candidates = beside_precision(given, candidates)
    name = given["name"]
    if name in BALANCES:
        power = candidates.power
        candidates = candidates.scaled(power)
        frame = Frame.of_candidates(candidates)
        degree = 0.0 if name == "O2" else 0.5
        cost, most = _balance(name, Design.of(candidates, frame, weights), candidates, weights)
        framed = _framed(candidates, multipliers, inner, along_axes=True)
        proved = _proved(lambda: balance_bound(name, candidates, *framed, limits))
        # Of degree zero a bound is about designs of unit trace, which limits do not know.
        if name == "O2" and limits is not None:
            proved = math.nan
    else:
        kind = Several if given["name"] in SEVERAL else Part
        about: Whole = kind.of(given, candidates.p)
        degree = about.degree
        # A volume is told by its logarithm, whatever the units.
        power = 0 if about.is_volume else candidates.power
        candidates = candidates.scaled(power)
        units = candidates.units
        candidates = candidates.scaled(units)
        about = about.scaled(units)
        multipliers = np.ldexp(multipliers, -units[:, None] - units)
        inner = None if inner is None else (np.ldexp(inner[0], -units[:, None]), inner[1])
        frame = Frame.of_candidates(candidates)
        cost, most = about.cost(Design.of(candidates, frame, weights))
        proved = _proved(
            lambda: _monotone_bound(
                about, candidates, weights, _framed(candidates, multipliers, inner), shares, limits
            )
        )
    error = most / cost - 1 if 0 < cost < math.inf else math.inf
    if not error <= BLURRED:
        cost = math.nan
    # The degree is a half or one, or none at all.
    exponent = int(2 * power * degree)
    unscaled = (float(np.ldexp(number, exponent)) for number in (cost, proved))
    return Found(next(unscaled), error, next(unscaled), degree)


def require_little_work(given: Any, candidates: Candidates, multipliers: int) -> None:
    """Refuse a certificate that takes long, beside a look at its candidates, which are the user's.

    Raises:
        ValueError: It does.
    """
    measured = candidates.rows.shape[0] * candidates.rows.shape[1]
    p = candidates.p
    parts = len(given.get("criteria", ())) if given["name"] in SEVERAL else 1
    looks = (multipliers - 1) * measured * (PER_SQUARE * p + PER_LONG * p**2)
    columns = sum(map(_entries, given.values())) / p
    decompositions = (10.0 + columns / p) * PER_CUBE * p**3 * parts
    rotations = PER_ROTATION * p**2 if given["name"] in BALANCES else 0.0
    require(looks + multipliers * (decompositions + rotations), "the multipliers and the criterion")


def _entries(given: Any) -> int:
    """Number of numbers in lists in lists."""
    return sum(map(_entries, given)) if isinstance(given, list) else 1


def _proved(source: Callable[[], float]) -> float:
    """A bound above zero; nan where nothing is proved."""
    try:
        found = source()
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return math.nan  # a multiplier that is not semidefinite, or numbers that overflow
    return found if 0 < found < math.inf else math.nan


def _balance(
    name: str, design: Design, candidates: Candidates, weights: Array
) -> tuple[float, float]:
    """The cost of O2 or O4, and one that it is not above: extreme singular values of the rows."""
    side = design.frame.side(np.eye(candidates.p))
    if not design.root.tells(side.J, side.digits):
        return math.inf, math.inf
    L, lost = side.deviations(design.root.W)
    longest = float(np.linalg.norm(L, 2))
    chosen = weights > 0
    w = weights[chosen]
    if candidates.information is None:
        stacked = (np.sqrt(w)[:, None, None] * candidates.rows[chosen]).reshape(-1, candidates.p)
        largest = float(np.linalg.norm(np.vstack([stacked, candidates.prior_rows]), 2))
    else:
        M = np.tensordot(w, candidates.information[chosen], axes=1) + candidates.prior
        largest = math.sqrt(float(np.linalg.norm(M.astype(float), 2)))
    power = 1 if name == "O2" else 2
    blur = (1 + design.blur) ** (power / 2) * (1 + 16 * candidates.p * EPS)
    return largest * longest**power, largest * (longest + lost) ** power * blur


def _framed(
    candidates: Candidates,
    multipliers: Array,
    inner: tuple[Array, Array] | None,
    along_axes: bool = False,
) -> tuple[Frame, Array]:
    """The parameters in which multipliers have all their digits, and what they are there.

    Raises:
        ValueError: The multipliers with more digits are others than those that are stated.
    """
    if inner is not None:
        if not same_multipliers(multipliers, *inner):
            raise ValueError("inner: not the multipliers that are stated")
        return Frame(inner[0]).at_order_one(candidates), inner[1]
    frame = Frame.of_axes(candidates) if along_axes else Frame.of_columns(candidates)
    # Any multiplier proves a bound, also one that rounding has changed on the way.
    own = np.linalg.inv(frame.T)
    Z = own @ multipliers @ own.T
    return frame, 0.5 * (Z + np.swapaxes(Z, 1, 2))


def _monotone_bound(
    about: Whole,
    candidates: Candidates,
    weights: Array,
    framed: tuple[Frame, Array],
    shares: list[Array | None],
    limits: WeightLimits | None,
) -> float:
    """The bound of a criterion that more information never makes worse."""
    frame, Z = framed
    proof = Proof.of(candidates, frame, Multipliers.of(Z, indefinite=False), limits)
    return bound(about, proof, Design.of(candidates, frame, weights), shares)
