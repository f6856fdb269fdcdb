"""Which fault explains the residuals best, if any does."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.findings.causes.evidence import USUAL_SHARE
from edtk.findings.causes.family import NOISE, OUTLIER, POSE, PRIOR, Cause, Tried
from edtk.findings.causes.faults import FAULTS
from edtk.findings.causes.scene import same_in
from edtk.findings.causes.try_faults import (
    COMMON,
    LEVEL,
    PlainFit,
    likely_faults,
    rank_faults,
    try_faults,
)
from edtk.findings.causes.wrong_pose import wrong_pose
from edtk.fit.distributions import chi_square_tail
from edtk.fit.least_squares import SingularPlanError, Whitened
from edtk.fit.measurements import Measurements
from edtk.fit.prior import PriorRows
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.task import Tasks
from edtk.system.typing import Array, Indices

MOST_OFF = 6  # one of so many rows may be an outlier, and one in any case
MOST_LOOKS = 20  # outliers that anybody would look at one by one
NINE_TENTHS = 1.2816  # a standard normal variable is below it with 90 %
MOST_TIMES = 100  # times that anybody would measure
MOST_CAUSES = 2  # causes that are named
NEAR_SCORE = 6.0  # score within which a second cause is as likely as the best, to a person
CLEARLY_OFF = 6.0  # size of an outlier, in sigma, that larger noise does not make
WITHIN_REACH = 20.0  # score that a pose gains at most where a joint value explains it
UNEXPLAINED = 1e-6  # probability of what the best fault leaves, below which it is none of the list
MOSTLY = 0.5  # of the misfit: what explains less is not the fault, whatever else errs
LIKELIER_ROWS = 1e-6  # score by which rows have to be set aside for more than rounding
MOST_SEARCHED = 1000  # measurements in which causes are looked for


@dataclass(frozen=True)
class FoundCauses:
    """Faults that explain the residuals, and outliers beside which they do.

    Attributes:
        named: The best cause, and a second one that is about as likely; none if noise explains all.
        outliers: Rows that are off by themselves, counted from 0: the others were looked at without
            them.
        unexplained: Whether the best fault leaves what noise and usual errors of a model do not
            make; it is not named.
        possible: That fault, where it explains most of the misfit: a part of what is wrong, as
            like as not.
        typed: Joints that may have been mistyped in some of the outliers.
    """

    named: tuple[Cause, ...] = ()
    outliers: tuple[int, ...] = ()
    unexplained: bool = False
    possible: Cause | None = None
    typed: tuple[Cause, ...] = ()

    def in_rows(self, rows: Indices) -> "FoundCauses":
        """The same of measurements of which these were some: their row i is `rows[i]` there."""

        def there(one: Cause) -> Cause:
            return replace(one, rows=_numbers(one.rows, rows))

        return replace(
            self,
            named=tuple(map(there, self.named)),
            outliers=_numbers(self.outliers, rows),
            possible=self.possible and there(self.possible),
            typed=tuple(map(there, self.typed)),
        )


def most_outliers(rows: int) -> int:
    """How many of so many rows may be off by themselves; of more, none is the odd one."""
    return min(max(1, rows // MOST_OFF), MOST_LOOKS)


def _numbers(found: tuple[int, ...], rows: Indices) -> tuple[int, ...]:
    """Numbers among all rows of some that were found among a part of them."""
    return tuple(int(rows[i]) for i in found)


def times_to_tell(first: Tried, second: Tried, plain: PlainFit) -> int | None:
    """Repetitions after which the first fault, if it is the true one, is told from the second.

    Of what the first fault makes, ``D_1 c``, the second leaves a part of squared length d^2 in
    units of the noise, once compliances and its own size are fitted. Between two predictions that
    are d apart the likelier one is right with the probability Phi(d/2) (Fisher's linear
    discriminant); each repetition of all experiments adds as much to d^2.

    Args:
        first: The fault that is taken for the true one.
        second: The other one.
        plain: The measurements without any fault.

    Returns:
        How often each experiment is measured until that is 90 %, at least once; None for the same
        fault or one of single rows, and where `MOST_CAUSES` times do not.
    """
    size = first.size
    if first is second or size is None or second.family is None:
        return None
    made = _shown(first, plain) @ size
    other = _shown(second, plain)
    imitated, *_ = np.linalg.lstsq(other, made, rcond=None)
    apart = float(((made - other @ imitated) ** 2).sum())
    if apart * MOST_TIMES < (2 * NINE_TENTHS) ** 2:
        return None
    return math.ceil((2 * NINE_TENTHS) ** 2 / apart)


def _shown(one: Tried, plain: PlainFit) -> Array:
    """What residuals (n, dims) show of a unit of each of a fault's parameters."""
    assert one.family is not None
    columns = np.moveaxis(one.family.derivative_at_zero(plain.k), -1, 0)
    return np.stack([plain.whitened.residual(column).ravel() for column in columns], axis=-1)


NO_FAULTS = (COMMON, OUTLIER, PRIOR)  # of the day; they keep others from being blamed
SINGLE = (OUTLIER, POSE)  # faults of single rows, which may be set aside one after another


@dataclass(frozen=True, eq=False)
class Look:
    """What may explain some of the measurements, where the other rows are set aside.

    Attributes:
        plain: These measurements without any fault.
        rows: Their rows, counted from 0.
        ranked: Faults with their scores, the likeliest first.
        aside: The outliers that were set aside, with rows of all measurements, each with the
            chi-square that it took.
        cost: What these add to the score.
    """

    plain: PlainFit
    rows: Indices
    ranked: tuple[tuple[float, Tried], ...]
    aside: tuple[tuple[Tried, float], ...] = ()
    cost: float = 0.0

    @property
    def best(self) -> Tried | None:
        """The likeliest fault; None where none is likely, or rather one reading is off by itself.

        Outliers are for the next look.
        """
        near = [one for score, one in self.ranked if score <= self.ranked[0][0] + NEAR_SCORE]
        return next((one for one in near if one.cause.cause != OUTLIER), None)

    @property
    def score(self) -> float:
        """The less, the likelier are the best fault and the outliers together."""
        best = self.best
        found = [score for score, one in self.ranked if one is best]
        return self.cost + (found[0] if found else self.plain.chi2)

    @property
    def left(self) -> float:
        """Probability that noise makes what the best fault leaves, beside the outliers."""
        best = self.best
        if best is None:
            return self.plain.probability(self.plain.chi2, self.plain.dof)
        if best.cause.cause in (NOISE, COMMON):
            return 1.0
        dof = self.plain.alone_dof if best.cause.cause == PRIOR else self.plain.dof - best.dims
        return self.plain.probability(best.deviance, dof)

    @property
    def off(self) -> Tried | None:
        """The likeliest fault of single rows that is off by far; None where a likelier one fits."""
        best = self.best
        for _, one in self.ranked:
            if one is best and best.cause.cause != NOISE and self.left > LEVEL:
                return None
            if one.cause.cause in SINGLE and self.drop(one) > CLEARLY_OFF**2:
                return one
        return None

    def drop(self, one: Tried) -> float:
        """By how much a fault reduces the sum of squares."""
        return self.plain.chi2 - one.deviance

    @property
    def is_clear(self) -> bool:
        """Whether outliers are off by more than the others scatter, if that is more than stated.

        A reading that is little off may as well be one of noise that is larger than stated.
        """
        best = self.best
        dims = 0 if best is None else best.dims
        left = self.plain.chi2
        if best is not None and best.cause.cause not in (NOISE, COMMON):
            left = best.deviance
        dof = max(self.plain.dof - dims, 1)
        scatter = 1.0 if _fits(left, dof) else max(1.0, left / dof)
        return all(drop > CLEARLY_OFF**2 * scatter for _, drop in self.aside)


def find_causes(
    model: ElastostaticModel,
    data: Measurements,
    measured: Array,
    typed: tuple[int, ...] = (),
    known: Mapping[int, float] | None = None,
    prior: PriorRows | None = None,
    assumed: tuple[AssumedJoint, ...] = (),
    tasks: Tasks | None = None,
    share: float = USUAL_SHARE,
) -> FoundCauses:
    """Refit the measurements with each fault that is known, and name those that explain them.

    A fault of any size c adds parameters to the model; the sum of squares falls by a chi-square
    with as many degrees of freedom where the data are good. Where so large a fall has a probability
    below 1 %, after looking at all faults, the one of the largest marginal likelihood is named. A
    noise that is larger than stated is one of the alternatives.

    Readings that are off by themselves are another one. They are set aside one after another, the
    likeliest first, and the others are looked at as if these had not been measured. Of all these
    looks the one of the largest marginal likelihood counts: two outliers hide each other from a
    look at one, and make a noise that is larger than stated.

    Where the best fault leaves what noise does not make, it is not the fault: none is named. One
    that is weighed beside an error of the model may leave a usual one, but not most of the misfit:
    an error that was fitted to what is left would excuse anything.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        measured: Deflections (m, rows) as the linear model about the fitted compliances sees them,
            less those that joints of known compliance make [m, rad].
        typed: Revolute joints whose values were written by hand, in which a pose may be wrong.
        known: Compliances of further joints, by their index [rad/(N m)].
        prior: What is known of the compliances besides, linearised about the fitted ones.
        assumed: The joints that are not identified, and how far each may be off.
        tasks: Where the robot shall be accurate.
        share: Share of what springs do that a model of them usually leaves out.
    """
    told = prior if prior is not None and len(prior) else None

    def plain_fit(rows: Indices) -> PlainFit | None:
        """Some rows without a fault; None where they do not tell all parameters."""
        try:
            plain = PlainFit.of(model, data[rows], measured[rows], known or {}, told)
        except SingularPlanError:
            return None
        return replace(plain, assumed=assumed, share=share) if plain.dof >= 1 else None

    looks = list(_looks(len(data), plain_fit, typed))
    if not looks:
        return FoundCauses()
    best = looks[0]
    for look in looks[1:]:
        if look.is_clear and look.score < best.score - LIKELIER_ROWS:
            best = look
    return _found(best, len(data), tasks)


def _looks(
    m: int, plain_fit: Callable[[Indices], PlainFit | None], typed: tuple[int, ...]
) -> Iterator[Look]:
    """Look at all rows, and at those that are left where outliers are set aside one by one."""
    rows = np.arange(m)
    aside: tuple[tuple[Tried, float], ...] = ()
    cost = 0.0
    while m - len(rows) <= most_outliers(m):
        plain = plain_fit(rows)
        if plain is None:
            return
        look = Look(plain, rows, _ranked(plain, typed), aside, cost)
        yield look
        off = look.off
        if off is None:
            return
        there = replace(off.cause, rows=_numbers(off.cause.rows, rows))
        aside = (*aside, (replace(off, cause=there), look.drop(off)))
        # Outliers may be found in any order.
        cost += plain.score(off) - off.deviance - 2 * math.log(len(aside))
        rows = np.delete(rows, off.cause.rows)


def _ranked(plain: PlainFit, typed: tuple[int, ...]) -> tuple[tuple[float, Tried], ...]:
    """The faults that may explain some measurements, the likeliest first."""
    likely = likely_faults(try_faults(plain))
    likely.sort(key=plain.score)
    return tuple(rank_faults(_with_joints(plain, likely, typed), plain.coordinates))


def _found(look: Look, m: int, tasks: Tasks | None) -> FoundCauses:
    """What the best look shows."""
    best = look.best
    if look.left < UNEXPLAINED and not _leaves_usual_error(look):
        likeliest = _named(look.ranked, look.plain, tasks)[:1]
        part = [one for one in likeliest if one.cause != NOISE and one.explained >= MOSTLY]
        possible = part[0] if part else None
        return FoundCauses(unexplained=True, possible=possible).in_rows(look.rows)
    outliers = tuple(np.setdiff1d(np.arange(m), look.rows).tolist())
    # The test of lack of fit tells of noise that repetitions share.
    silent = best is None or best.cause.cause == COMMON
    if best is not None and best.cause.cause == PRIOR:
        silent = _fits(best.deviance, look.plain.alone_dof)
    named = () if silent else _named(look.ranked, look.plain, tasks)
    typed = tuple(one.cause for one, _ in look.aside if one.cause.joint)
    return replace(FoundCauses(named).in_rows(look.rows), outliers=outliers, typed=typed)


def _leaves_usual_error(look: Look) -> bool:
    """Whether the best fault explains most, and leaves what usual errors of a model make."""
    best = look.best
    if best is None or not best.share or not _is_most(best, look.plain):
        return False
    return look.plain.probability_beside_error(best) >= UNEXPLAINED


def _named(
    ranked: Sequence[tuple[float, Tried]], plain: PlainFit, tasks: Tasks | None
) -> tuple[Cause, ...]:
    """The best cause, and a second one that is about as likely."""
    faults = [(score, one) for score, one in ranked if one.cause.cause not in NO_FAULTS]
    near = [one for score, one in faults if score <= faults[0][0] + NEAR_SCORE]
    best = [one for one in near if not one.share or _is_most(one, plain)][:MOST_CAUSES]
    return tuple(
        replace(
            one.cause,
            explained=_explained(one, plain),
            times=times_to_tell(best[0], one, plain),
            effect=effect_in_tasks(one, plain, tasks) if tasks else None,
        )
        for one in best
    )


def effect_in_tasks(one: Tried, plain: PlainFit, tasks: Tasks) -> float | None:
    """How far a robot with a fault is off in tasks, compensated by the model without it [m].

    With the fault of size c and the parameters k_c that go with it, the robot gives way in a task
    by ``A(c) k_c + b(c)``, and commands are for ``A k``. What is wrong with the measurements alone
    is not there in the task: then it gives way by ``A k_c``.

    Returns:
        The root mean square error; None for faults of single rows and of noise.
    """
    family, c = one.family, one.size
    if family is None or c is None:
        return None
    A, b = family.predict(c)
    names = tuple(map(str, range(A.shape[-1])))
    try:
        k = Whitened.of(A, plain.noise, names).solve(plain.measured - b)
    except SingularPlanError:
        return None
    fault = FAULTS[family.cause]
    squares = []
    for task in tasks:
        scene = plain.scene.in_task(task)
        off = scene.A @ (k - plain.k)
        if fault.in_tasks:
            A, b = same_in(scene, fault.models, family).predict(c)
            off = A @ k + b - scene.A @ plain.k
        squares.append(float((off**2).sum()))
    return float(np.sqrt(tasks.shares @ squares))


def _with_joints(plain: PlainFit, likely: list[Tried], typed: tuple[int, ...]) -> list[Tried]:
    """The same faults; wrong poses near the likeliest fault with the joint that explains them.

    A joint value has fewer parameters than a shift, so that such a pose comes further ahead.
    """
    found = list(likely)
    poses = [one for one in likely if one.cause.cause == POSE]
    near = [one for one in poses if plain.score(one) < plain.score(likely[0]) + WITHIN_REACH]
    for one in near[:MOST_CAUSES]:
        measured = plain.measured_rows(plain.measured)
        pose = wrong_pose(plain.model, plain.data, measured, one, typed, plain.by_prior)
        found[found.index(one)] = pose if len(one.cause.rows) > 1 else _single(pose, one, plain)
    return found


def _single(pose: Tried, off: Tried, plain: PlainFit) -> Tried:
    """A pose that was read once: with the joint that was mistyped, or a reading off by itself.

    Three coordinates lie near what one of six joints makes at some angle once in a few times. A
    reading that is off by itself has a likelihood ratio against it of ``exp(c/2)`` at most once in
    as many times (Markov's inequality); of c = `NEAR_SCORE` in twenty. Below it the joint is
    possible.
    """
    gain = plain.score(off) - plain.score(pose)
    if pose.cause.joint and gain > NEAR_SCORE:
        return pose
    possible = pose.cause if pose.cause.joint and gain > 0 else off.cause
    return replace(off, cause=replace(possible, cause=OUTLIER))


def _fits(deviance: float, dof: int) -> bool:
    """Whether the stated noise explains what is left."""
    return float(chi_square_tail(deviance, max(dof, 1))) > LEVEL


def _explained(one: Tried, plain: PlainFit) -> float:
    """Share of the misfit that a fault explains."""
    return min(1.0, max(0.0, plain.chi2 - one.deviance) / max(plain.chi2 - plain.dof, 1e-9))


def _is_most(one: Tried, plain: PlainFit) -> bool:
    """Whether a fault explains so much of the misfit that it is what is wrong."""
    return _explained(one, plain) >= MOSTLY
