"""Every fault that may explain residuals, each fitted to them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.findings.causes.evidence import (
    USUAL_SHARE,
    ErringRows,
    Evidence,
    Pieces,
    Weighed,
    likely_size,
    noise_rarity,
    rarity,
    reading_rarity,
    weigh_each,
)
from edtk.findings.causes.family import (
    NOISE,
    OUTLIER,
    POSE,
    PRIOR,
    Cause,
    Family,
    FamilyFit,
    Tried,
    fit_families,
)
from edtk.findings.causes.faults import families, slipped_at
from edtk.findings.causes.scene import Displacements
from edtk.findings.causes.wrong_pose import SEEN, by_shifts, shifted
from edtk.fit.correlated_noise import RowNoise, whiten, whiten_columns
from edtk.fit.distributions import chi_square_tail, fisher_tail
from edtk.fit.estimate_noise import ErrorStrata, Stratum, visit_residuals, yardstick
from edtk.fit.least_squares import SingularPlanError, Whitened
from edtk.fit.measurements import Measurements, translations
from edtk.fit.outliers import LackOfFit, lack_of_fit
from edtk.fit.prior import PriorRows
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.instruments.pose_marker import COORDINATES
from edtk.system.typing import Array, Indices

NO_SIZE = 1e-12  # size of nothing [m, rad]
LEVEL = 0.01  # p of faults that are named
COMMON = "common_noise"
OTHERS = 1.25
UNASKED = 10.0  # a noise that is smaller than stated harms nobody: it has to be so much clearer
LOUDEST = 4.0  # noise over the stated one, beyond which rather something unknown is wrong
# Noise that repetitions share, over their own or the stated one: beyond it is a fault of the model.
NO_NOISE = 6.0
BESIDE_ERROR = 8.0  # fall of the sum of squares, below which no error of the model hides a fault
BESIDE_SLIP = 2  # poses before a joint slipped, and after: one that is off is a wrong pose
MOST_SLIPS = 200  # poses at which a slip is tried, before those between them
AS_MUCH = 0.5  # scatter of repetitions over that of all residuals, from which it confirms this one


@dataclass(frozen=True, eq=False)
class PlainFit:
    """The compliances alone, fitted to measurements, and to what is known of them besides.

    Attributes:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        known: Compliances of further joints, by their index [rad/(N m)].
        prior: What is known of the compliances besides; None for nothing.
        A: Regressors (m, rows, p) of the measurements.
        noise: The noise of the measurements, and of the rows of the prior below them.
        measured: Deflections (m, rows) [m, rad], and values of the prior below them.
        whitened: The factors of all regressors in units of the noise.
        k: Least-squares estimates (p,) [rad/(N m)].
        z: Residuals (m, rows) of the measurements in units of their noise.
        chi2: Sum of squares of all residuals.
        alone: The sum of squares without the prior; None where measurements alone do not tell all
            compliances.
        assumed: The joints whose compliances are taken from elsewhere, or as none.
        share: Share of what springs do that a model of them usually leaves out.
    """

    model: ElastostaticModel
    data: Measurements
    known: Mapping[int, float]
    prior: PriorRows | None
    A: Array
    noise: RowNoise
    measured: Array
    whitened: Whitened
    k: Array
    z: Array
    chi2: float
    alone: float | None
    assumed: tuple[AssumedJoint, ...] = ()
    share: float = USUAL_SHARE

    @classmethod
    def of(
        cls,
        model: ElastostaticModel,
        data: Measurements,
        measured: Array,
        known: Mapping[int, float],
        prior: PriorRows | None,
    ) -> "PlainFit":
        """Fit the compliances.

        Raises:
            SingularPlanError: They are not all told.
        """
        A = data.regressor(model)
        names = model.parameters
        if prior is None:
            whitened = Whitened.of(A, data.noise, names)
            k = whitened.solve(measured)
            z = whiten(measured - A @ k, data.noise)
            chi2 = float((z**2).sum())
            return cls(
                model, data, known, None, A, data.noise, measured, whitened, k, z, chi2, chi2
            )
        noise = prior.noise_below(data.noise, measured.shape[1])
        both = prior.measured_below(measured)
        whitened = Whitened.of(prior.below(A), noise, names)
        k = whitened.solve(both)
        z = whiten(both - prior.below(A) @ k, noise)
        try:
            rest = Whitened.of(A, data.noise, names).residual(measured)
            alone: float | None = float((rest**2).sum())
        except SingularPlanError:
            alone = None
        m = len(data)
        chi2 = float((z**2).sum())
        return cls(model, data, known, prior, A, noise, both, whitened, k, z[:m], chi2, alone)

    @cached_property
    def scene(self) -> Displacements:
        """What faults change."""
        told = self.prior is not None
        return Displacements(self.model, self.data, self.A, self.k, self.known, told, self.assumed)

    @cached_property
    def erring(self) -> ErringRows:
        """The readings, and what is known besides, where the model leaves something out."""
        more = self.measured.size - self.z.size
        return ErringRows.of(self.data, self.A * np.maximum(self.k, 0.0), self.data.noise, more)

    def evidence(self, A: Array, measured: Array) -> Evidence:
        """The model with regressors (m, rows, p) of readings (m, rows) beside such an error."""
        columns = whiten_columns(A, self.noise).reshape(measured.size, -1)
        return Evidence.of(self.erring, whiten(measured, self.noise).ravel(), columns)

    @cached_property
    def alone_beside_error(self) -> float:
        """The score of the model without a fault beside an error of its own."""
        A = self.A if self.prior is None else self.prior.below(self.A)
        return self.evidence(A, self.measured).alone.score

    @property
    def misfits(self) -> bool:
        """Whether noise hardly makes such residuals."""
        test = lack_of_fit(self.z, self.data.places, len(self.k))
        seen = test is not None and test.p < LEVEL
        return seen or self.probability(self.chi2, self.dof) < LEVEL

    @property
    def coordinates(self) -> int:
        """Number of measured coordinates, and of what is known besides."""
        return self.data.deflection.size + (0 if self.prior is None else len(self.prior))

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        return self.coordinates - len(self.k)

    @property
    def by_prior(self) -> float:
        """What the prior adds to the sum of squares."""
        return 0.0 if self.alone is None else self.chi2 - self.alone

    @property
    def alone_dof(self) -> int:
        """Degrees of freedom of the measurements alone."""
        return self.dof if self.alone is None else self.data.deflection.size - len(self.k)

    @cached_property
    def pure_error(self) -> tuple[float, int]:
        """Sum of squares of repetitions about their means, and its degrees of freedom."""
        z = self.z
        group = self.data.places
        count = np.bincount(group)
        mean = np.stack([np.bincount(group, column) / count for column in z.T], axis=1)
        return float(((z - mean[group]) ** 2).sum()), z.size - len(count) * z.shape[1]

    def probability(self, left: float, dof: int) -> float:
        """Probability that noise leaves so large a sum of squares.

        Where repetitions scatter by more than the stated noise, what is left beside their scatter
        is compared with that, by Fisher's law.
        """
        p = float(chi_square_tail(left, max(dof, 1)))
        pure, pure_dof = self.pure_error
        if pure_dof < 1 or pure <= pure_dof or dof <= pure_dof:
            return p
        F = (left - pure) / (dof - pure_dof) / (pure / pure_dof)
        return max(p, float(fisher_tail(max(F, 0.0), dof - pure_dof, pure_dof)))

    def probability_beside_error(self, one: "Tried") -> float:
        """Probability that noise and a usual error of the model leave as much as a fault does."""
        both = _as_pieces(self, one)
        if both is None:
            return self.probability(one.deviance, self.dof - one.dims)
        model, pieces = both
        return self.probability(model.left(pieces, self.share), self.dof - one.dims)

    def usual_shift(self, parts: int) -> Array:
        """Sizes (parts,) of shifts of single rows [m, rad]: lengths first, then rotations.

        A reading of another pose, or a mistyped one, is off by about the size of all readings.
        """
        measured = self.measured_rows(self.measured)
        lengths = self.data.lengths
        sizes = [measured[which] for which in (lengths, ~lengths)]
        length, turn = (
            max(float(np.sqrt(np.mean(x**2))), NO_SIZE) if x.size else NO_SIZE for x in sizes
        )
        return np.where(np.arange(parts) < COORDINATES, length, turn)

    def below(self, family: Family) -> Family:
        """The same fault, whose predictions have the rows of the prior below them."""
        prior = self.prior
        if prior is None:
            return family

        def predict(c: Array) -> tuple[Array, Array]:
            A, b = family.predict(c)
            return prior.below(A), prior.zeros_below(b)

        return replace(family, predict=predict)

    def score(self, one: Tried) -> float:
        """The less, the likelier is the fault."""
        return one.score(self.coordinates)

    def measured_rows(self, x: Array) -> Array:
        """The part of an array (m + ..., ...) that is of measurements."""
        return np.asarray(x[: len(self.data)])


# Shares of the level, as divisors, of noise that is tested whatever is looked at beside it, and of
# all other faults together: any cause is then named in at most 1.5 % of good data.
ALWAYS = {NOISE: 2.0, COMMON: 6.0}


def likely_faults(tried: Sequence[Tried]) -> list[Tried]:
    """The faults that may explain residuals which are no chance, after looking at all faults.

    Each cause has the same share of the level, which its joints, poses or readings share. Where one
    fault is no chance, every fault that would be none, had nothing else been tried, may be what it
    is: that is for `rank_faults` to say. Their p is the least level at which they are among these.
    A fault whose size may as well be zero explains nothing, however small a sum of squares some
    size leaves: a joint that hardly gives way does so if it depends a thousandfold on the sign of
    its torque, and usual sizes do not.
    """
    kinds = len({one.cause.cause for one in tried} - set(ALWAYS))
    tried = [one for one in tried if one.is_told]
    whole = min(
        (one.cause.p * ALWAYS.get(one.cause.cause, OTHERS * kinds * one.tries) for one in tried),
        default=1.0,
    )
    found = [replace(one, cause=replace(one.cause, p=max(one.cause.p, whole))) for one in tried]
    return [one for one in found if one.cause.p < LEVEL]


def rank_faults(found: Sequence[Tried], coordinates: int) -> list[tuple[float, Tried]]:
    """The faults with their scores, the likeliest first.

    A cause that is in one of several joints, or of several shapes, is as likely as these together,
    ``-2 log sum exp(-s/2)`` of their scores s: that is the score of the best of them.

    Args:
        found: The faults.
        coordinates: Number of measured coordinates.
    """
    ranked = sorted(((one.score(coordinates), one) for one in found), key=lambda pair: pair[0])
    by_cause: dict[str, list[float]] = {}
    for score, one in ranked:
        by_cause.setdefault(one.cause.cause, []).append(score)
    best: set[str] = set()
    whole = []
    for score, one in ranked:
        cause = one.cause.cause
        value = score
        if cause not in best:
            best.add(cause)
            share = sum(math.exp(-(other - score) / 2) for other in by_cause[cause])
            value = score - 2 * math.log(share)
        whole.append((value, one))
    return sorted(whole, key=lambda pair: pair[0])


def try_faults(plain: PlainFit) -> list[Tried]:
    """Fit every fault that is known.

    Args:
        plain: The measurements without any fault.
    """
    data = plain.data
    test = None
    if plain.alone is not None:
        test = lack_of_fit(plain.z, data.places, len(plain.k))
    strata = _strata(plain)
    shared = _common_noise(test) if strata is None else _shared(strata, data)
    return [
        *_smooth(plain),
        *_poses(plain),
        *_outliers(plain),
        *_noise(plain, 0.0 if test is None else test.pure_error),
        *(replace(one, deviance=one.deviance + plain.by_prior) for one in shared),
        *_prior(plain),
    ]


def _poses(plain: PlainFit) -> Iterator[Tried]:
    """A pose is another one than that written down.

    What a shift makes of the means of all poses has to leave a part of their misfit, or it would
    excuse anything: where all others together tell no more than the compliances, a wrong pose
    cannot be told from a wrong model.
    """
    moved = _moved(plain)
    parts = plain.data.deflection.shape[1] if moved is None else moved.shape[-1]
    usual = plain.usual_shift(parts)
    group = plain.data.pose
    tried = shifted(plain.whitened, plain.measured, plain.chi2, group, POSE, usual, moved)
    between = plain.dof - plain.pure_error[1]
    yield from (one for one in tried if one.dims < between)


def _moved(plain: PlainFit) -> Array | None:
    """What shifts and turns of the robot add to single coordinates; None where rows are whole.

    A pose of whole rows may be shifted, and turned, in each coordinate by itself.
    """
    data = plain.data
    if data.deflection.shape[1] > 1:
        return None
    moved = translations(plain.model, data)
    if data.turn is not None:
        _, axis = data.whole_rows(plain.model, plain.A)
        assert axis is not None
        turned = (axis[:, None] == np.arange(3)) & data.turn[:, None]
        moved = np.concatenate([moved, turned[:, None].astype(float)], axis=-1)
    if plain.prior is None:
        return moved
    return np.moveaxis(plain.prior.zeros_below(np.moveaxis(moved, -1, 0)), 0, -1)


def _smooth(plain: PlainFit) -> list[Tried]:
    """Faults of any size."""
    every = [plain.below(family) for family in (*families(plain.scene), *_slips(plain))]
    fits = fit_families(every, plain.whitened, plain.measured, plain.noise, plain.k)
    fitted = [(family, fit) for family, fit in zip(every, fits, strict=True) if fit is not None]
    found = _as_tried(fitted, plain.chi2)
    return beside_error(plain, found) if plain.misfits else found


def _slips(plain: PlainFit) -> Iterator[Family]:
    """Joints whose zeros change at a reading, each at the one where that explains most.

    Positions show it, counted from the rigid robot; displacements are read on one side of it.
    """
    m, n = len(plain.data), plain.model.robot.n
    begins = np.append(0, 1 + np.flatnonzero(np.diff(plain.data.pose)))
    ways = begins[BESIDE_SLIP : len(begins) - BESIDE_SLIP + 1]
    if not (plain.data.absolute and len(ways)):
        return
    step = 1 + len(ways) // MOST_SLIPS
    for j in range(n):
        at = step * int(_fall_by_slips(plain, j, ways[::step]).argmax())
        near = ways[max(at - step + 1, 0) : at + step]
        first = int(near[_fall_by_slips(plain, j, near).argmax()])
        family = slipped_at(plain.scene, j, np.arange(m) >= first)
        yield replace(family, tries=n * len(ways), rows=tuple(range(first, m)))


def _fall_by_slips(plain: PlainFit, j: int, first: Indices) -> Array:
    """By how much the sum of squares falls (w,) if a joint slipped before these rows (w,)."""
    m = len(plain.data)
    whole = plain.below(slipped_at(plain.scene, j, np.ones(m, dtype=bool)))
    units = whole.derivative_at_zero(plain.k)
    residual = plain.whitened.residual(plain.measured)
    later = [np.arange(row, m) for row in first]
    gram, along = by_shifts(plain.whitened, residual, later, units)
    left, seen = gram[:, 0, 0], (units**2).sum()
    return np.divide(along[:, 0] ** 2, left, out=np.zeros(len(left)), where=left > SEEN * seen)


def beside_error(plain: PlainFit, found: Sequence[Tried]) -> list[Tried]:
    """Faults beside what the model leaves out in each pose at random, where they are likely then.

    A robot that lacks one piece mostly lacks others, too: what the likeliest fault leaves is more
    than noise, and a model that errs in each pose by itself explains all that any fault does. So
    both are weighed with such an error, see `Evidence`; a fault is to be likelier than none.
    """
    likelier = list(found)
    at, models, pieces = [], [], []
    for i, one in enumerate(found):
        if plain.chi2 - one.deviance < BESIDE_ERROR:
            continue
        if plain.probability(one.deviance, plain.dof - one.dims) > LEVEL:
            continue  # it leaves nothing
        if (both := _as_pieces(plain, one)) is None:
            continue
        at.append(i)
        models.append(both[0])
        pieces.append(both[1])
    for i, weighed in zip(at, weigh_each(models, pieces), strict=True):
        if weighed.score + 2 * math.log(found[i].tries) <= plain.alone_beside_error:
            likelier[i] = _as_weighed(plain, found[i], weighed)
    return likelier


def _as_pieces(plain: PlainFit, found: Tried) -> tuple[Evidence, Pieces] | None:
    """The model about a fault of its size, and the fault as pieces; None for none of any size."""
    family, c = found.family, found.size
    if family is None or c is None:
        return None
    A, b = family.predict(c)
    columns = family.derivative(c, plain.k)
    measured = plain.measured - b + columns @ c
    whitened = whiten_columns(columns, plain.noise).reshape(measured.size, -1)
    usual = np.full(family.dims, family.usual / math.sqrt(family.dims))
    positive = np.full(family.dims, family.only_positive)
    return plain.evidence(A, measured), Pieces(whitened, usual, positive)


def _as_weighed(plain: PlainFit, found: Tried, weighed: Weighed) -> Tried:
    """A fault with the size and score that it has beside an error of the model."""
    family = found.family
    assert family is not None
    size = weighed.mean[len(plain.k) :]
    covariance = weighed.covariance[len(plain.k) :, len(plain.k) :]
    length = float(np.linalg.norm(size)) if family.dims > 1 else float(size[0])
    along = size / max(abs(length), 1e-300)
    cause = replace(
        found.cause,
        size=length * family.per_unit,
        std=math.sqrt(float(along @ covariance @ along)) * family.per_unit,
        p=weighed.p,
    )
    cost = weighed.score - found.deviance
    return replace(found, cause=cause, rarity=cost, size=size, share=weighed.share)


def _as_tried(fitted: Sequence[tuple[Family, FamilyFit]], chi2: float) -> list[Tried]:
    """Faults with their likely sizes, those of as many parameters at once.

    Args:
        fitted: The faults, each with its fit.
        chi2: Sum of squares of the fit without a fault.
    """
    found: dict[int, Tried] = {}
    for dims in {family.dims for family, _ in fitted}:
        at = [i for i, (family, _) in enumerate(fitted) if family.dims == dims]
        values = [
            (fit.c, fit.covariance, family.usual, family.only_positive)
            for family, fit in (fitted[i] for i in at)
        ]
        c, covariance, usual, positive = map(np.array, zip(*values, strict=True))
        costs = rarity(c, covariance, usual, positive).tolist()
        likely = likely_size(c, covariance, usual)
        for i, cost, size, of_size in zip(at, costs, *likely, strict=True):
            family, fit = fitted[i]
            cause = _sized_cause(family, size, of_size, chi2 - fit.chi2)
            found[i] = Tried(cause, fit.chi2, dims, family.tries, cost, family, size)
    return [found[i] for i in range(len(fitted))]


def _sized_cause(family: Family, c: Array, covariance: Array, drop: float) -> Cause:
    """A fault of a size c (dims,), which lowers the sum of squares so much."""
    size = float(np.linalg.norm(c)) if family.dims > 1 else float(c[0])
    along = c / max(float(np.linalg.norm(c)), 1e-300)
    std = math.sqrt(float(along @ covariance @ along))
    p = float(chi_square_tail(max(drop, 0.0), family.dims))
    if family.only_positive:
        p = p / 2 if size > 0 else 1.0
    return Cause(
        family.cause,
        size * family.per_unit,
        family.unit,
        std * family.per_unit,
        p,
        joint=family.joint,
        rows=family.rows,
        grows=family.grows,
    )


def _outliers(plain: PlainFit) -> Iterator[Tried]:
    """One reading is off, or one coordinate of it; where no pose is repeated it is that pose."""
    whitened = plain.whitened
    rows = np.arange(len(plain.data))
    if len(np.unique(plain.data.pose)) < len(rows):
        usual = plain.usual_shift(plain.data.deflection.shape[1])
        yield from shifted(whitened, plain.measured, plain.chi2, rows, OUTLIER, usual)
    residual = plain.measured_rows(whitened.residual(plain.measured))
    left = 1 - (plain.measured_rows(whitened.Q) ** 2).sum(axis=-1)
    drop = np.divide(residual**2, left, out=np.zeros_like(left), where=left > SEEN)
    row, column = np.unravel_index(int(drop.argmax()), drop.shape)
    most = float(drop[row, column])
    p = float(chi_square_tail(most, 1))
    cause = Cause(OUTLIER, math.sqrt(most), "sigma", None, p, rows=(int(row),))
    free = left[row, column]
    usual_size = plain.usual_shift(drop.shape[1])[column] * whitened.weight[row, column]
    off = residual[row, [column]] / free
    cost = reading_rarity(off, np.array([[1 / free]]), float(usual_size))
    yield Tried(cause, plain.chi2 - most, 1, drop.size, cost)


def _common_noise(found: LackOfFit | None) -> Iterator[Tried]:
    """All repetitions of a pose share a part of the noise; see `lack_of_fit`."""
    if found is None or not 0 < found.common <= NO_NOISE * max(1.0, found.pure_error):
        return
    means_dof, pure_dof = found.dof
    pure = found.pure_error**2
    deviance = pure_dof * (1 + math.log(pure)) + means_dof * (1 + math.log(pure * found.F))
    own = Stratum(pure * pure_dof, pure_dof)
    means = Stratum(pure * found.F * means_dof, means_dof)
    cost = noise_rarity(own, [(means, found.repetitions)])
    cause = Cause(COMMON, found.common, "times stated", None, found.p)
    yield Tried(cause, deviance, 2, 1, cost)


def _strata(plain: PlainFit) -> ErrorStrata | None:
    """Residuals split by what moves together, where that is not stated and can be seen."""
    data = plain.data
    if data.tracker is not None:
        return None
    joints = np.ones(plain.model.robot.n)
    seen = visit_residuals(plain.model, data, plain.A, plain.measured_rows(plain.measured), joints)
    if seen is None or len(seen.residual) < len(data):
        return None
    strata = ErrorStrata.of(seen)
    return strata if yardstick(strata) is not None and strata.poses.dof > 0 else None


def _shared(strata: ErrorStrata, data: Measurements) -> Iterator[Tried]:
    """Markers of a visit share a part of the noise, and visits of a pose do."""
    apart = yardstick(strata)
    if apart is None:
        return
    tests = [part for part in (strata.visits, strata.poses) if part.dof > 0]
    ratios = [part.mean_square / max(apart.mean_square, 1e-300) for part in tests]
    p = min(
        float(fisher_tail(F, part.dof, apart.dof)) for F, part in zip(ratios, tests, strict=True)
    )
    deviance = sum(part.dof * (1 + math.log(max(part.mean_square, 1e-300))) for part in strata.all)
    size = math.sqrt(max(ratios))
    cause = Cause(COMMON, size, "times stated", None, min(1.0, len(tests) * p))
    groups = (data.pose, data.visits, data.places)
    parts = (strata.poses, strata.visits, strata.shape)
    shared = [
        (part, len(data) / len(np.unique(group)))
        for part, group in zip(parts, groups, strict=True)
        if part.dof > 0
    ]
    own = strata.tracker if strata.tracker.dof > 0 else shared.pop()[0]
    cost = noise_rarity(own, shared)
    yield Tried(cause, deviance, len(strata.all), 1, cost)


def _noise(plain: PlainFit, pure_error: float) -> Iterator[Tried]:
    """The noise is not as stated; a loud one is only believed where repetitions scatter as much."""
    chi2 = plain.chi2 - plain.by_prior
    dof = plain.alone_dof
    if dof < 1:
        return
    scale = chi2 / dof
    if scale > LOUDEST**2 and pure_error < AS_MUCH * math.sqrt(scale):
        return
    p = float(chi_square_tail(chi2, dof))
    p = min(p, UNASKED * (1 - p))
    deviance = dof * (math.log(max(scale, 1e-300)) + 1) + plain.by_prior
    std = math.sqrt(scale / (2 * dof))
    cost = noise_rarity(Stratum(chi2, dof))
    yield Tried(Cause(NOISE, math.sqrt(scale), "times stated", std, p), deviance, 1, 1, cost)


def _prior(plain: PlainFit) -> Iterator[Tried]:
    """What was known of the compliances is wrong, whatever of it, and the measurements are not."""
    if plain.prior is None or plain.alone is None:
        return
    dims = len(plain.prior)
    p = float(chi_square_tail(plain.by_prior, dims))
    yield Tried(Cause(PRIOR, 1.0, "", None, p), plain.alone, dims, 1)
