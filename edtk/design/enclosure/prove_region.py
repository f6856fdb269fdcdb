"""The relaxation over a region with a bound that is proved for all of its points."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from criteria import Criterion
from criteria.linalg.inverse import EPS
from edtk.design.bound import BLURRED, Bound, BoundKind
from edtk.design.enclosure.cover import Covering, CoveringInterrupted
from edtk.design.enclosure.region_functions import RegionIntervals, RegionPolynomials, Spans
from edtk.design.region import Region
from edtk.design.relaxation.proof import is_normalised, trace_matrix
from edtk.design.relaxation.relax_poses import ActiveSet
from edtk.design.relaxation.relax_region import RegionProof, RegionSearch, relax_region
from edtk.design.relaxation.relaxed_region import JudgedRegion, RelaxedRegion
from edtk.design.relaxation.search_continuum import LargestSensitivities
from edtk.design.relaxation.search_region import POINTS, polish
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array

# Parts of the gap: what relaxation and ascents may leave, and what the covering may, of the rest
# that they have left and of the whole at least.
OF_SEARCH = 0.6
OF_REST = 0.9
LEAST_REST = 0.1
TRIED_TOLERANCES = 12  # tolerances that are tried
HIGHER = 1e-12  # part by which a place is larger than what ascents have found, beyond rounding
FEW_VARIABLES = 60  # variables of a design up to which all are moved together in a second
LOSS_OF_GAP = 0.1  # part of the gap that a design of fewer points may cost


@dataclass(frozen=True, eq=False)
class RegionCovering:
    """Why no design over a region costs less.

    Attributes:
        multipliers: Multipliers (r, p, p), in the judged parameters; to those of the search in one
            ratio, which makes sensitivities of order one.
        upper: No point of the region has a larger sensitivity to each (r,).
        lower: The largest sensitivity that is known to each of the search (r,).
        coverings: What proves these; for a criterion of degree zero of a sensitivity to which a
            constant was added.
        cost: The bound on the cost that follows.
        is_stopped: Whether Ctrl-C or the time has ended the last covering early.
    """

    multipliers: Array
    upper: Array
    lower: Array
    coverings: tuple[Covering | Spans, ...]
    cost: float
    is_stopped: bool

    @property
    def boxes(self) -> int:
        """Number of boxes that were looked at."""
        return sum(covering.boxes for covering in self.coverings)

    @property
    def seconds(self) -> float:
        """Time that the coverings took [s]."""
        return sum(covering.seconds for covering in self.coverings)


@dataclass(frozen=True, eq=False, kw_only=True)
class ProvedRegion(RelaxedRegion):
    """A relaxed design over a region, with a bound that is proved for all points of it.

    Attributes:
        continuum_bound: No design over the region has a lower cost.
        covering: What proves it.
    """

    continuum_bound: Bound
    covering: RegionCovering

    @property
    def told_bound(self) -> Bound:
        """The proved one over the whole region."""
        return self.continuum_bound

    @property
    def bounds(self) -> dict[str, Bound]:
        """The others, and that over the whole region."""
        return super().bounds | {"continuum": self.continuum_bound}

    @property
    def bound_proved(self) -> float:
        """The proved bound over the region as the criterion's formula prints it."""
        return self.continuum_bound.value


def prove_region(
    region: Region,
    criterion: Criterion,
    eps: float,
    candidates: int = POINTS,
    progress: Callable[[str, float], object] = lambda stage, gap: None,
) -> ProvedRegion:
    """Find the best weights over all points of a region, and prove that none are better.

    A search finds design and multipliers, as `relax_region` does. Then the largest sensitivity of
    all points is bounded by a covering with boxes: U in the place of the largest that was found
    makes the bound a proved one (`docs/explanation/every_pose.md`). Where a box has a point that no
    ascent has found, it joins the design's points, and the search goes on.

    Args:
        region: The region; rows and constraints run on polynomials or intervals, are polynomials
            of a stated degree, or have a stated enclosure.
        criterion: A criterion that can be relaxed, with a polar of its own.
        eps: Relative gap to prove. The gap of the result may be larger.
        candidates: Number of points of the grid, about.
        progress: Called with the stage and its relative gap.

    Raises:
        ArgumentError: Rows or constraints cannot be enclosed, or the bound is a solver's word.
        NotImplementedError: The criterion cannot be relaxed.
        RankDeficientError: The region cannot identify all parameters.
        UserError: No point is feasible, or the model fails.
    """
    enclosure_of(region)  # what cannot be enclosed is refused before the work
    proofs: list[_Prover] = []

    def closing(judged: JudgedRegion) -> Callable[[RegionSearch, ActiveSet], bool]:
        proofs.append(_Prover(judged, eps, progress))
        return proofs[-1].ends

    found = relax_region(region, criterion, candidates, OF_SEARCH * eps, progress, closing)
    (prover,) = proofs
    return prover.proved(found)


def enclosure_of(region: Region) -> RegionPolynomials | RegionIntervals:
    """What encloses the sensitivity over boxes of a region: polynomials where there are some.

    Raises:
        ArgumentError: Its functions run neither on polynomials nor on intervals.
    """
    if region.enclosure is not None:
        return RegionIntervals.of(region)
    try:
        return RegionPolynomials.of(region)
    except ArgumentError:
        return RegionIntervals.of(region)


class _Prover:
    """Covers a region for the multipliers of a search, and keeps the best bound.

    Args:
        judged: Region and criterion as they are searched.
        eps: Relative gap to prove.
        progress: Called with the stage and its relative gap.
    """

    def __init__(
        self, judged: JudgedRegion, eps: float, progress: Callable[[str, float], object]
    ) -> None:
        self.judged = judged
        self.eps = eps
        self.progress = progress
        self.enclosure = enclosure_of(judged.region)
        self.best: RegionCovering | None = None

    def ends(self, search: RegionSearch, active: ActiveSet) -> bool:
        """Cover the region for the best multipliers: whether that closes the gap, or nothing will.

        Raises:
            ArgumentError: The bound rests on a solver's word.
        """
        proof = search.proof
        assert proof is not None
        criterion = self.judged.criterion
        if criterion.rests_on_solver(proof.multipliers, proof.M):
            raise ArgumentError(
                f"the bound of {criterion.label} rests on a solver's word, which proves nothing; "
                "expected a criterion with a polar of its own",
                argument="prove",
            )
        rest = max(OF_REST * (self.eps - search.gap), LEAST_REST * self.eps)
        found = self._cover(proof, rest)
        if self.best is None or found.cost > self.best.cost:
            self.best = found
        gap = 1 - self.best.cost / search.cost
        self.progress("proof", gap)
        places = np.array([covering.place for covering in found.coverings])
        largest = proof.largest.values
        higher = found.lower > largest + HIGHER * np.abs(largest)
        if gap <= self.eps or found.is_stopped or not higher.any() or out_of_time():
            self._tidy(search, active)
            return True
        search.refuted(LargestSensitivities(found.lower, places), higher)
        return False

    def _cover(self, proof: RegionProof, gap: float) -> RegionCovering:
        """What the multipliers of a search prove, with coverings that leave a gap.

        Multipliers are scaled by a power of two, so that sensitivities are of order one: boxes are
        looked at in single precision, and a bound is the same for any scale of both.
        """
        criterion = self.judged.criterion
        Z = _semidefinite(proof.multipliers) if criterion.monotone else proof.multipliers
        raised, lift = _lifted(criterion, Z)
        largest = proof.largest.values + lift
        tolerance = self._tolerance(proof, largest, gap)
        unit = float(np.ldexp(1.0, -int(np.frexp(np.abs(largest).max())[1])))
        Z, raised, lift, largest = unit * Z, unit * raised, unit * lift, unit * largest
        coverings: list[Covering | Spans] = []
        is_stopped = False
        for z, own in zip(raised, largest.tolist(), strict=True):
            try:
                coverings.append(
                    self.enclosure.cover(z, criterion, tolerance, proof.largest.x, own)
                )
            except CoveringInterrupted as interrupt:
                coverings.append(interrupt.best)
                is_stopped = True
        upper = np.array([covering.upper for covering in coverings])
        # What is subtracted is rounded, and so was what was added before.
        upper = upper - lift + 8 * EPS * np.abs(lift)
        lower = (np.array([covering.lower for covering in coverings]) - lift) / unit
        bound = float(criterion.lower_bound(Z, upper, proof.M))
        cost = bound if np.isfinite(bound) else 0.0
        return RegionCovering(Z, upper, lower, tuple(coverings), cost, is_stopped)

    def _tolerance(self, proof: RegionProof, largest: Array, gap: float) -> float:
        """Relative excess of the largest sensitivities (r,) that leaves a gap of the bound."""
        criterion = self.judged.criterion
        tolerance = gap / (criterion.degree or 1.0)
        for _ in range(TRIED_TOLERANCES):
            values = proof.largest.values + tolerance * np.abs(largest)
            if criterion.lower_bound(proof.multipliers, values, proof.M) >= proof.cost * (1 - gap):
                break
            tolerance /= 4
        return tolerance

    def _tidy(self, search: RegionSearch, active: ActiveSet) -> None:
        """Take a design of fewer points, if it costs hardly more.

        Relaxations spread a weight over neighbours. Where they are few, they move together.
        """
        fewer = active.merged(LOSS_OF_GAP * self.eps, LOSS_OF_GAP * self.eps)
        x, weights, cost = fewer.support.x, fewer.weights, fewer.relaxation.cost
        if x.size + len(x) <= FEW_VARIABLES:
            x, weights, cost = polish(self.judged.region, self.judged.criterion, x, weights)
        if len(x) < len(search.points) and cost <= search.cost * (1 + LOSS_OF_GAP * self.eps):
            search.points, search.weights, search.cost = x, weights, cost

    def proved(self, found: RelaxedRegion) -> ProvedRegion:
        """The result of the search, with the proved bound."""
        assert self.best is not None
        x = np.concatenate([found.points, found.grid])
        weights = np.concatenate([found.weights, np.zeros(len(found.grid))])
        of_cost, of_bound = self.judged.errors(x, weights, self.best.multipliers)
        bound = Bound.of(
            self.judged.criterion,
            self.best.cost,
            found.cost,
            BoundKind.PROVED,
            of_bound,
            max(of_cost, BLURRED),
        )
        given = {field.name: getattr(found, field.name) for field in fields(found)}
        return ProvedRegion(**given, continuum_bound=bound, covering=self.best)


def _lifted(criterion: Criterion, Z: Array) -> tuple[Array, Array]:
    """Multipliers (r, p, p) with a constant (r,) added to each sensitivity.

    Sensitivities per trace, of criteria of degree zero, are nearly zero where they are largest:
    nothing can be relative to them. With the matrix P of the trace, ``<Z + s P, M>`` per trace is
    larger by s.
    """
    if not is_normalised(criterion):
        return Z, np.zeros(len(Z))
    P = trace_matrix(criterion, Z.shape[-1])
    lift = np.array([np.abs(np.linalg.eigvals(np.linalg.solve(P, z))).max() for z in Z])
    return Z + lift[:, None, None] * P, lift


def _semidefinite(Z: Array) -> Array:
    """Multipliers (r, p, p), raised by what rounding may have left of negative eigenvalues.

    At unit diagonal those of a product with a root are above ``-2 p^2 eps``.
    """
    p = Z.shape[-1]
    own = np.diagonal(Z, axis1=1, axis2=2)
    return np.asarray(Z + (2 * p * p * EPS * own)[:, :, None] * np.eye(p))
