"""Boxes that cover all poses, and whether each is closed: computed without halving any tensor.

A sensitivity d and the slacks of the constraints are trigonometric polynomials of the joints. Here
they follow from values on a grid of angles; on each box they are written anew in a basis that is
nowhere negative and has the sum one, so that their largest coefficient is above them. The page
"A bound over every pose" of the documentation has the theorems, by number, and their proofs.
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import comb, prod
from typing import Any

import numpy as np

from edtk.certificate.recompute.candidates import require
from edtk.certificate.recompute.forms import SAME_END, TURN, Domain, Form, Link, Motion, U
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, whole
from edtk.certificate.recompute.pose_polynomials import COUPLED, OF_LINKS, Polynomials
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.recompute.values import Multipliers
from edtk.system.typing import Array, Indices, Mask

Letters = np.ndarray[tuple[int, ...], np.dtype[np.str_]]
MOST_BOXES = 4_000_000  # boxes of a covering
MOST_INTERVALS = 64  # of the interval of a joint
WIDEST = 3.0  # first boxes, below half a turn [rad]
DEEPEST = 52  # halvings along one joint, as the prover
MOST_MOTIONS = 12
MOST_LINKS = len(OF_LINKS)
OF_ENTRY = 200.0  # roundings of an entry of a matrix of `basis_on`, from above
AT_ONCE = 1 << 20  # coefficients
PER_LEAF = 120.0  # time to check a box of five joints [us]
PER_POLYNOMIAL = 1e6
# By how much a stated limit is lifted before boxes are held to it, besides the rounding that is
# counted here; the bound falls by as much. Two ways of rounding need room between them.
LIFTED = 1e-9

BOUNDED = "."
COMBINED = "+"
# Height, radius, tilt up and down, coupled joints, and joints whose angles are no variables.
SLACKS = "hrud" + COUPLED + OF_LINKS


@dataclass(frozen=True, eq=False)
class Covering:
    """A binary tree of halvings, from first boxes that cover the domain to leaves.

    The leaves are read from the tree, and so cover what the first boxes do: no leaf can be missing.

    Attributes:
        limit: The stated bound on the sensitivity.
        joints: The joints that count (v,), by their place in the domain.
        links: Sums that are variables in place of angles of these, one after another.
        motions: Motions that take the first boxes to the whole domain.
        low: Lower ends (v,) of the first boxes together.
        high: Upper ends (v,).
        parts: Number of first boxes along each joint (v,).
        depth: How often each leaf was halved along each joint (L, v).
        place: Its number (L, v) among all boxes of that depth.
        reasons: A letter for each leaf (L,).
        factors: Factors mu of the slacks (c,) for each leaf (L, c), zero but for combined ones.
        slacks: Their letters, in the order of `factors`.
    """

    limit: float
    joints: list[int]
    links: list[Link]
    motions: list[Motion]
    low: Array
    high: Array
    parts: Indices
    depth: Indices
    place: Indices
    reasons: Letters
    factors: Array
    slacks: str

    @classmethod
    def from_dict(cls, content: Any, domain: Domain, where: str) -> "Covering":
        """Read a covering.

        The tree is a text: a digit halves the present box along that joint, of which the lower half
        comes next; any other letter closes it. Joints count from zero, in the setting's order.

        Raises:
            ValueError: The tree is no tree, or does not cover the domain.
        """
        keys = ("limit", "joints", "low", "high", "motions", "parts", "slacks", "tree", "factors")
        table(content, keys, where, ("links",))
        joints = _joints(content["joints"], len(domain.joints), f"{where}.joints")
        v = len(joints)
        slides = domain.slides[joints]
        ends = np.stack([numbers(content[key], (v,), f"{where}.{key}") for key in ("low", "high")])
        listed = rows(content.get("links", []), MOST_LINKS, f"{where}.links")
        links = [Link.from_dict(one, slides, f"{where}.links[{i}]") for i, one in enumerate(listed)]
        _require_limits(ends, links, domain.limits[:, joints], slides, where)
        motions, low, high = _moved(content["motions"], ends, slides, where)
        parts = _parts(content["parts"], high - low, slides, f"{where}.parts")
        slacks = content["slacks"]
        if not isinstance(slacks, str) or set(slacks) - set(SLACKS):
            raise ValueError(f"{where}.slacks: expected letters of {SLACKS}")
        depth, place, reasons = leaves_of(content["tree"], parts, where)
        factors = _factors(content["factors"], reasons, len(slacks), f"{where}.factors")
        limit = number(content["limit"], f"{where}.limit")
        return cls(
            limit, joints, links, motions, low, high, parts, depth, place, reasons, factors, slacks
        )

    @cached_property
    def _intervals(self) -> tuple[list[Array], list[Indices]]:
        """Middles and half widths (K, 2) of all intervals of each joint, and which a leaf has.

        Intervals are wider than their share by more than any rounding of their ends.
        """
        ends = []
        which = []
        for j in range(len(self.parts)):
            pairs = np.stack([self.depth[:, j], self.place[:, j]], axis=1)
            different, index = np.unique(pairs, axis=0, return_inverse=True)
            depth, place = different.T
            width = (self.high[j] - self.low[j]) / self.parts[j] / np.exp2(depth)
            middle = self.low[j] + width * (place + 0.5)
            beyond = 2 * SAME_END + 16 * U * (abs(self.low[j]) + abs(self.high[j]) + 1)
            ends.append(np.stack([middle, width / 2 + beyond], axis=1))
            which.append(index.ravel())
        return ends, which

    def open_leaves(self, about: Polynomials, limit: float) -> int:
        """The number of leaves that are not closed: none proves the limit.

        Args:
            about: Sensitivity and slacks.
            limit: The bound to which leaves are held.

        Raises:
            ValueError: A slack is named that the setting does not have.
        """
        missing = set(self.slacks) - set(about.slacks)
        if missing or set(self.reasons) - {BOUNDED, COMBINED} - set(about.slacks):
            raise ValueError("a leaf rests on a constraint that the setting does not have")
        bounded = np.flatnonzero(self.reasons == BOUNDED)
        count = self._open(about, limit, bounded, [], np.empty((len(bounded), 0)))
        for letter in set(self.reasons) - {BOUNDED, COMBINED}:
            some = np.flatnonzero(self.reasons == letter)
            slack = about.slacks[letter]
            top = self._largest(about.domain, [slack], some, np.ones((len(some), 1)))
            count += int((~(top < 0)).sum())
        combined = self.reasons == COMBINED
        used = self.factors > 0
        for pattern in np.unique(used[combined], axis=0):
            some = np.flatnonzero(combined & (used == pattern).all(axis=1))
            forms = [about.slacks[self.slacks[i]] for i in np.flatnonzero(pattern)]
            count += self._open(about, limit, some, forms, self.factors[some][:, pattern])
        return count

    def _open(
        self, about: Polynomials, limit: float, leaves: Indices, slacks: list[Form], mu: Array
    ) -> int:
        """How many leaves a sensitivity and factors mu (L, c) of slacks do not close."""
        if about.beam is None:
            mu = np.concatenate([np.ones((len(leaves), 1)), mu], axis=1)
            top = self._largest(about.domain, [about.tested(limit), *slacks], leaves, mu)
            # Factors of an enemy overflow: what is no number closes nothing.
            return int((~(top <= 0)).sum())
        beam = about.beam
        one = Form(np.ones((1,) * len(self.joints)), 0.0)
        forms = [about.sensitivity, beam.squared, beam.inline, one, *slacks]
        rest = limit - beam.prior - 4 * U * (abs(limit) + abs(beam.prior))
        for near in (False, True):
            # Closed by the sensitivity of either kind; the second one is for few.
            ends = [
                self._largest(about.domain, [f], leaves, np.full((len(leaves), 1), sign))
                for f, sign in ((beam.squared, -1.0), (beam.squared, 1.0), (beam.inline, -1.0))
            ]
            s = np.maximum([-ends[0], ends[1]], beam.growth.nearest)
            own = beam.growth.factors(rest, s, -ends[2], near)
            top = self._largest(about.domain, forms, leaves, np.concatenate([own, mu], axis=1))
            still = ~(top <= 0)
            leaves, mu = leaves[still], mu[still]
            if beam.growth.is_round:
                break
        return len(leaves)

    def _largest(self, domain: Domain, forms: list[Form], leaves: Indices, mu: Array) -> Array:
        """The largest coefficient (L,) on each leaf of ``sum_f mu_f f``, rounded up.

        Leaves with the same intervals along the first joints share the work for these. A sum of
        products is off by Theorem 4 (b), where sums of forms count like one product more.
        """
        shape = tuple(int(n) for n in np.max([one.values.shape for one in forms], axis=0))
        tensor = np.stack([one.padded(shape) for one in forms])
        ends, which = self._intervals
        matrices = [
            basis_on(n, bool(slides), one[:, 0], one[:, 1], self._unit(domain, j))
            for j, (n, slides, one) in enumerate(zip(shape, domain.slides, ends, strict=True))
        ]
        top = np.empty(len(leaves))
        place = np.stack([one[leaves] for one in which])
        last = len(shape) - 1

        def visit(tensor: Array, some: Indices, j: int) -> None:
            own = place[j, some]
            flat = tensor.reshape(len(forms), shape[j], -1)
            if j < last:
                for interval in np.unique(own):
                    moved = np.swapaxes(matrices[j][interval] @ flat, 1, 2)
                    visit(moved, some[own == interval], j + 1)
                return
            step = max(1, AT_ONCE // flat[0].size)
            for first in range(0, len(some), step):
                part = some[first : first + step]
                mixed = np.tensordot(mu[part], flat, 1)
                found = matrices[j][own[first : first + step]] @ mixed
                top[part] = found.reshape(len(part), -1).max(axis=1)

        visit(tensor, np.arange(len(leaves)), 0)
        tau = prod(float(np.abs(one).max()) for one in matrices)
        rounds = sum(n + OF_ENTRY for n in shape) + len(forms)
        each = np.array([one.error + 1.01 * rounds * U * tau * one.size for one in forms])
        return np.asarray(top + np.abs(mu) @ each)

    def _unit(self, domain: Domain, j: int) -> tuple[float, float]:
        """Middle and half width of the interval on which lengths count."""
        low, high = domain.limits[:, j]
        return (low + high) / 2, (high - low) / 2


def _joints(given: Any, count: int, where: str) -> list[int]:
    """The joints that count, of so many.

    Raises:
        ValueError: They are none, or not in order.
    """
    given = rows(given, count, where)
    joints = sorted({whole(j, 0, count - 1, where) for j in given})
    if not joints or joints != given:
        raise ValueError(f"{where}: expected some joints, in order")
    return joints


def _require_limits(
    ends: Array, links: list[Link], limits: Array, slides: Mask, where: str
) -> None:
    """Check that intervals (2, v) hold the limits (2, v) of their joints, or a whole turn."""
    for link in links:
        limits = link.range(limits)
    least, most = limits
    turns = ~slides & (ends[1] - ends[0] >= TURN - SAME_END)
    if not (turns | ((ends[0] <= least) & (ends[1] >= most))).all():
        raise ValueError(f"{where}: the boxes do not cover the limits of the joints")


def _moved(given: Any, ends: Array, slides: Mask, where: str) -> tuple[list[Motion], Array, Array]:
    """The motions, and the ends (v,) of what they leave of the intervals (2, v) to cover.

    Raises:
        ValueError: One is no motion, or leaves nothing.
    """
    box = list(zip(*ends.tolist(), strict=True))
    motions = []
    for i, one in enumerate(rows(given, MOST_MOTIONS, f"{where}.motions")):
        at = f"{where}.motions[{i}]"
        motions.append(Motion.from_dict(one, slides, at))
        box = motions[-1].left(box, at)
    low, high = np.array(box).T
    if not (low < high).all():
        raise ValueError(f"{where}: expected intervals")
    return motions, low, high


def _parts(given: Any, widths: Array, slides: Mask, where: str) -> Indices:
    """Numbers (v,) of first boxes along intervals of some widths (v,).

    Raises:
        ValueError: One is missing, or its boxes are too wide.
    """
    parts = np.array([whole(n, 1, MOST_INTERVALS, where) for n in rows(given, len(widths), where)])
    if len(parts) < len(widths) or (~slides & (widths / parts > WIDEST)).any():
        raise ValueError(f"{where}: expected parts of each joint, of {WIDEST:g} rad at most")
    return parts


def _factors(given: Any, reasons: Letters, slacks: int, where: str) -> Array:
    """Factors (L, c) of the slacks, zero but for combined leaves, whose factors are listed.

    Raises:
        ValueError: They are not those of the combined leaves.
    """
    listed = numbers(rows(given, MOST_BOXES, where), (None, slacks), where)
    combined = reasons == COMBINED
    if len(listed) != combined.sum() or not (listed >= 0).all():
        raise ValueError(f"{where}: expected factors from zero for each combined leaf")
    factors = np.zeros((len(reasons), slacks))
    factors[combined] = listed
    return factors


def leaves_of(text: Any, parts: Indices, where: str) -> tuple[Indices, Indices, Letters]:
    """Depths and places (L, v), and reasons (L,), of the leaves of a tree.

    Raises:
        ValueError: The text ends before each box is closed, or goes on after that.
    """
    if not isinstance(text, str) or len(text) > MOST_BOXES or not text.isascii():
        raise ValueError(f"{where}.tree: expected a text of at most {MOST_BOXES} letters")
    v = len(parts)
    first = np.indices(tuple(parts)).reshape(v, -1).T
    stack = [((0,) * v, tuple(place)) for place in first[::-1].tolist()]
    depths = []
    places = []
    reasons = []
    digits = {str(j): j for j in range(v)}
    for letter in text:
        if not stack:
            raise ValueError(f"{where}.tree: it goes on after its last leaf")
        depth, place = stack.pop()
        j = digits.get(letter)
        if j is None:
            depths.append(depth)
            places.append(place)
            reasons.append(letter)
            continue
        if depth[j] >= DEEPEST:
            raise ValueError(f"{where}.tree: more than {DEEPEST} halvings along one joint")
        finer = (*depth[:j], depth[j] + 1, *depth[j + 1 :])
        for side in (1, 0):
            stack.append((finer, (*place[:j], 2 * place[j] + side, *place[j + 1 :])))
    if stack:
        raise ValueError(f"{where}.tree: a leaf is missing")
    known = {BOUNDED, COMBINED, *SLACKS}
    if not set(reasons) <= known:
        raise ValueError(f"{where}.tree: expected digits of joints, and letters of {known}")
    return np.array(depths), np.array(places), np.array(reasons)


def basis_on(n: int, slides: bool, middle: Array, half: Array, unit: tuple[float, float]) -> Array:
    """Matrices (K, n, n) from coefficients on a joint to those of a basis on intervals.

    The basis is nowhere negative there, and has the sum one: Theorem 2. On an angle
    ``exp(i t/2) = u exp(-i a/2) + v exp(i a/2)`` for a half width a, and
    ``u^2 + 2 u v cos(a) + v^2 = 1``; on a length the basis is Bernstein's.
    """
    found = np.empty((len(middle), n, n))
    if slides:
        ends = np.stack([middle - half - unit[0], middle + half - unit[0]]) / unit[1]
        low, high = np.cumprod([np.ones_like(ends), *[ends] * (n - 1)], axis=0).swapaxes(0, 1)
        for power in range(n):
            # The blossom of x^power at ends: low as often as the index says, high for the rest.
            found[:, :, power] = (low[power::-1] * high[: power + 1]).T @ _shares(n - 1, power)
        return found
    degree = n // 2
    for a in np.unique(half):
        some = half == a
        weights = _power(np.array([1.0, 2 * np.cos(a), 1.0]), degree)
        turn = np.exp(0.5j * a * np.array([-1.0, 1.0]))
        found[some, :, 0] = 1.0
        for k in range(1, degree + 1):
            whole = np.convolve(_power(turn, degree + k), _power(turn.conj(), degree - k)) / weights
            turned = np.exp(1j * k * middle[some])[:, None] * whole
            found[some, :, 2 * k - 1] = turned.real
            found[some, :, 2 * k] = turned.imag
    return found


@cache
def _shares(degree: int, power: int) -> Array:
    """C(power, i) C(degree - power, k - i) / C(degree, k), over i from 0 to power and k (i, k).

    Of the terms of a power of x in Bernstein's basis, exact but for one rounding.
    """
    # Whole numbers of any length: of a high degree they are no doubles.
    rest = [comb(degree - power, k) for k in range(degree + 1)]
    whole = np.array([comb(degree, k) for k in range(degree + 1)], dtype=object)
    rows = [[0] * i + rest[: degree + 1 - i] for i in range(power + 1)]
    chosen = np.array([comb(power, i) for i in range(power + 1)], dtype=object)
    return np.asarray(chosen[:, None] * np.array(rows, dtype=object) / whole, dtype=float)


def _power(factor: Array, n: int) -> Array:
    """Coefficients of the n-th power of a polynomial."""
    found = np.ones(1, dtype=factor.dtype)
    for _ in range(n):
        found = np.convolve(found, factor)
    return found


def largest_sensitivities(
    content: Any,
    setting: Setting,
    multipliers: Multipliers,
    size: Array,
    prior: Array,
    per_trace: bool,
) -> Array:
    """Bounds (r,) on the sensitivities of all poses, to each of r multipliers.

    Args:
        content: A covering for each multiplier and load, as a certificate lists them.
        setting: Robot, load, noise and constraints.
        multipliers: The multipliers.
        size: Their lengths (r,) in parts of those for which limits and factors are stated.
        prior: Prior information M0 (p, p).
        per_trace: Whether sensitivities are per trace of ``M + M0``.

    Raises:
        ValueError: A covering is missing, or has a leaf that is not closed.
    """
    r = len(multipliers.Z)
    loads = _wrenches(setting, multipliers.indefinite)
    where = "proof.continuum.coverings"
    given = rows(content, r * len(loads), where)
    if len(given) < r * len(loads):
        raise ValueError(f"{where}: expected one for each multiplier and load")
    domain = Domain.of(setting)
    coverings = [Covering.from_dict(one, domain, f"{where}[{k}]") for k, one in enumerate(given)]
    leaves = sum(len(one.reasons) for one in coverings)
    require(leaves * PER_LEAF + len(coverings) * PER_POLYNOMIAL, f"{leaves} boxes of {where}")
    found = np.full(r, -np.inf)
    for k, covering in enumerate(coverings):
        j, load = divmod(k, len(loads))
        Z = Multipliers(multipliers.Z[j : j + 1], multipliers.indefinite)
        about = Polynomials.of(setting, Z, prior, loads[load], per_trace)
        seen = about.seen(covering.joints, covering.links, covering.motions)
        limit = covering.limit * size[j]
        limit += LIFTED * abs(limit) + seen.blur(limit)
        # Per trace no sensitivity is above the largest eigenvalue, whatever boxes say.
        z = np.linalg.eigvalsh(Z.Z[0])
        if per_trace and z[-1] + 8 * len(z) * U * np.abs(z).max() <= limit:
            found[j] = max(found[j], limit)
            continue
        scaled = replace(covering, factors=covering.factors * size[j])
        left = scaled.open_leaves(seen, limit)
        if left:
            raise ValueError(f"{where}[{k}]: {left} of {len(covering.reasons)} boxes are open")
        found[j] = max(found[j], limit)
    return found


def _wrenches(setting: Setting, indefinite: bool) -> Array:
    """Loads (l, 9) of which one is the worst in any pose.

    A sensitivity to a semidefinite multiplier is convex in the size of a force along one direction,
    so that its ends count; without weights there is nothing to measure without a force.

    Raises:
        ValueError: The force may point anywhere.
    """
    load = setting.load
    if load.listed is not None:
        return load.listed
    if load.direction is None or indefinite:
        raise ValueError("a covering of poses is not checked for forces in all directions")
    hangs = setting.physics is not None and setting.physics.weights
    return load.wrench(np.array([[0.0], [1.0]] if hangs else [[1.0]]))
