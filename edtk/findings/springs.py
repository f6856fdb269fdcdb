"""Everything that looks wrong in measurements, and what is certainly wrong first."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from edtk.findings.finding import (
    EXPLAIN,
    Data,
    Finding,
    Severity,
    Wording,
    row_names,
    worst_first,
)
from edtk.findings.fitted_data import FittedData
from edtk.findings.match_plan import CHANCE, not_measured, other_pose, pose_resolution
from edtk.findings.noise import (
    cause_findings,
    left_out_findings,
    no_cause_findings,
    noise_findings,
    outlier_findings,
)
from edtk.findings.prior import prior_findings
from edtk.findings.units import place_findings, unit_findings
from edtk.measure.expected_error import ErrorBudget
from edtk.measure.pose_table import pose_columns, pose_factors
from edtk.robots.robot import Robot, shown_limits
from edtk.system.typing import Array

STANDS_STILL = 1e-6  # [rad or m] a joint that moves less stands still
MOST_NAMED = 2  # open directions that are named in full
MOST_LETTERS = 120  # of their names together


@dataclass(frozen=True)
class Doubts:
    """From where on springs are doubted."""

    little: float = 0.5  # error with compensation over that without, from which a person is told
    far_below_zero: float = -3.0  # standard deviations that noise does not explain
    weak: float = 0.5  # standard deviation over the compliance above which it might as well be zero
    hardly_apart: float = 0.99  # correlation above which two parameters are hardly told apart
    much_wider: float = 5.0  # growth of a standard deviation by which a parameter rests on a pose
    # Growth of a standard deviation beyond which a parameter is as good as unknown.
    unknown: float = 1e3


DOUBTS = Doubts()


def budget_findings(budget: ErrorBudget | None) -> Iterator[Finding]:
    """Warn of a compensation after which the error is expected to be larger than without any.

    One that leaves more than half of the error is worth a note, as the budget says what to improve.
    """
    if budget is None or budget.total <= DOUBTS.little * budget.uncompensated:
        return
    data = {
        "total": budget.total,
        "uncompensated": budget.uncompensated,
        "largest": budget.largest,
    }
    if budget.total >= budget.uncompensated:
        yield Finding.of(Severity.ALARM, WORDING, "do_not_compensate", **data)
    else:
        yield Finding.of(Severity.NOTE, WORDING, "gains_little", **data)


def input_findings(fitted: FittedData) -> Iterator[Finding]:
    """Name an input error, or a reading of the columns that explains most of a misfit, not all."""
    finding = find_input_error(fitted)
    if finding is None and fitted.explanation is not None:
        finding = fitted.explanation.finding
    if finding is not None:
        yield finding


def pose_findings(fitted: FittedData) -> Iterator[Finding]:
    """Name the first pose beyond the limits, and the planned experiments without a measurement."""
    yield from _limits(fitted)
    if fitted.match is not None:
        yield from not_measured(fitted.match)


def _left_out(fitted: FittedData, others: list[Finding]) -> Iterator[Finding]:
    """Poses that the others predict worse than bands say, where no finding explains it."""
    left_out = fitted.left_out
    kinds = {one.kind for one in others}
    if left_out is None or "noise_above_sigma" in kinds:
        return
    named = not kinds.isdisjoint(EXPLAIN)
    inside = left_out.share_inside
    yield from left_out_findings(inside, left_out.independent, named, fitted.fit.robust)


def _limits(fitted: FittedData) -> Iterator[Finding]:
    """The first pose beyond a joint's limits."""
    robot = fitted.study.robot
    factors = pose_factors(robot)
    slack = pose_resolution(fitted.study) * factors
    lower, upper = robot.hard_limits
    q = fitted.data.q
    beyond = np.argwhere((q < lower - slack) | (q > upper + slack))
    if len(beyond):
        i, j = beyond[0].tolist()
        shown = shown_limits(robot)[j]
        low, high = shown.range((lower[j], upper[j]))
        numbers = {"value": shown.of(q[i, j]), "low": low, "high": high}
        data = {name: float(value / factors[j]) for name, value in numbers.items()}
        yield Finding.of(
            Severity.WARNING,
            WORDING,
            "beyond_limits",
            rows=(i,),
            columns=(pose_columns(robot)[j],),
            **data,
        )


def sign_findings(fitted: FittedData) -> Iterator[Finding]:
    """Name compliances that come out negative by far, then those that cannot be told from zero."""
    fit = fitted.fit
    if fit.negative.all():
        yield Finding.of(Severity.ALARM, WORDING, "all_negative")
        return
    estimates = list(
        zip(fitted.study.model.parameters, fit.unbounded.tolist(), fit.std.tolist(), strict=True)
    )
    for name, k, std in estimates:
        if k < min(DOUBTS.far_below_zero * std, 0):
            yield _of(Severity.ALARM, "far_below_zero", name, k, std)
    for name, k, std in estimates:
        if DOUBTS.far_below_zero * std <= k < std / DOUBTS.weak:
            yield _of(Severity.WARNING, "near_zero", name, k, std)


def _of(severity: Severity, kind: str, name: str, k: float, std: float) -> Finding:
    """A finding about one parameter."""
    return Finding.of(severity, WORDING, kind, parameters=(name,), k=k, std=std)


def structure_findings(fitted: FittedData, rho0_bias: float | None = None) -> Iterator[Finding]:
    """Name equal rows, parameters that are alike or rest on one pose, and a costly linear model.

    Args:
        fitted: The measurements and their fit.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
    """
    yield from _equal_rows(fitted)
    yield from _alike(fitted)
    yield from _alone(fitted)
    yield from _linear_model(fitted, rho0_bias)


def _equal_rows(fitted: FittedData) -> Iterator[Finding]:
    """Equal rows that chance may have made; those that it did not are an input error."""
    found = fitted.equal_rows
    if found is not None:
        yield Finding.of(
            Severity.NOTE,
            WORDING,
            "equal_rows",
            rows=(found.later, found.earlier),
            others=found.others,
            chance=found.chance,
        )


def _alike(fitted: FittedData) -> Iterator[Finding]:
    """The two parameters that are hardest to tell apart."""
    fit = fitted.fit
    off = np.abs(fit.correlation - np.eye(len(fit.k)))
    if off.max() > DOUBTS.hardly_apart:
        i, j = np.unravel_index(int(off.argmax()), off.shape)
        names = fitted.study.model.parameters
        yield Finding.of(
            Severity.WARNING,
            WORDING,
            "alike_parameters",
            parameters=(names[j], names[i]),
            correlation=float(fit.correlation[i, j]),
        )


def _alone(fitted: FittedData) -> Iterator[Finding]:
    """Parameters that would be unknown, or hardly known, without one of the poses.

    Few poses leave no other choice, and are what a plan of few poses asks for: it is a note.
    Parameters that rest on the same poses are named together.
    """
    if fitted.left_out is None:
        return
    growth = fitted.left_out.growth()
    resting: dict[tuple[int, ...], list[int]] = {}
    for i, of_parameter in enumerate(growth.T):
        poses = tuple(np.flatnonzero(of_parameter >= DOUBTS.much_wider**2).tolist())
        if poses:
            resting.setdefault(poses, []).append(i)
    names = fitted.study.model.parameters
    for poses, members in resting.items():
        rows = np.flatnonzero(np.isin(fitted.data.pose, poses))
        times = float(np.sqrt(growth[np.ix_(poses, members)].min()))
        data = {"poses": len(poses), "times": times, "unknown": times > DOUBTS.unknown}
        named = tuple(names[i] for i in members)
        yield Finding.of(
            Severity.NOTE, WORDING, "one_pose", rows=tuple(rows.tolist()), parameters=named, **data
        )


def _linear_model(fitted: FittedData, rho0_bias: float | None) -> Iterator[Finding]:
    """A linear model that costs more than the noise."""
    target = fitted.study.target
    if target is None or rho0_bias is None:
        return
    if rho0_bias > fitted.noise_fit.accuracy(target)[0]:
        tasks = fitted.study.tasks
        place = {"place": tasks.place} if len(tasks) > 1 else {}
        yield Finding.of(Severity.WARNING, WORDING, "linear_model", rho0_bias=rho0_bias, **place)


def still_joints(robot: Robot, q: Array) -> tuple[str, ...]:
    """The joints that stand still in all poses (m, n); none where all do."""
    still = np.ptp(q, axis=0) <= STANDS_STILL
    names = [name for name, is_still in zip(robot.joint_names, still, strict=True) if is_still]
    return () if len(names) == robot.n else tuple(names)


def untold_finding(
    told: tuple[int, int], sentences: Sequence[str], still: tuple[str, ...], else_: str = ""
) -> Finding:
    """Parameters that a sheet leaves open.

    Args:
        told: How many parameters it tells, and of how many.
        sentences: What cannot be told from what.
        still: Joints that stand still in all poses.
        else_: What else would tell them, in words.
    """
    data = {"told": told[0], "count": told[1], "open": tuple(sentences)}
    return Finding.of(Severity.WARNING, WORDING, "open", still=still, else_=else_, **data)


def _open(data: Data) -> str:
    """What the poses tell, and the first directions that they leave open."""
    named = data["open"][:MOST_NAMED]
    if len("; ".join(named)) > MOST_LETTERS:
        named = named[:1]
    more = len(data["open"]) - len(named)
    rest = f"; and {more} more" if more else ""
    names = data["still"]
    stand = f"{', '.join(names)} stand{'s' * (len(names) == 1)} still in all poses"
    still = f", as {stand}" if names else ""
    return (
        f"{data['told']} of {data['count']} parameters can be told{still}: {'; '.join(named)}"
        f"{rest}. Poses that move these apart would tell{data['else_']}, and predictions elsewhere "
        "have wide bands"
    )


def spring_findings(
    fitted: FittedData, rho0_bias: float | None = None, budget: ErrorBudget | None = None
) -> tuple[Finding, ...]:
    """List everything that looks wrong in measurements, the worst first, see `worst_first`.

    Args:
        fitted: The measurements and their fit. The study's load and its assumed true compliances,
            if it has any, say how large things are.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
        budget: Errors to expect in the test pose; None without one.
    """
    found = list(unit_findings(fitted))
    misread = fitted.explanation is not None and fitted.explanation.refits
    # A wrong unit or a misread column spoils the fit: its other faults are consequences, and would
    # only distract.
    if not misread and all(one.severity < Severity.ALARM for one in found):
        found += sign_findings(fitted)
        found += noise_findings(fitted)
        found += cause_findings(fitted)
        found += outlier_findings(fitted)
        found += no_cause_findings(fitted)
        if fitted.prior is not None and not fitted.untold:
            found += prior_findings(fitted.fit, fitted.prior)
        found += structure_findings(fitted, rho0_bias)
        found += _left_out(fitted, found)
        found += budget_findings(budget)
    found += place_findings(fitted)
    found += pose_findings(fitted)
    found = [*input_findings(fitted), *found]
    return worst_first(found)


def _all_negative(data: Data) -> str:
    """No positive compliance."""
    return (
        "every compliance comes out negative, and was set to zero: signs of the displacements, the "
        "load or the axes are wrong, or poses are"
    )


def _far_below_zero(data: Data) -> str:
    """A negative compliance that noise does not explain."""
    k = f"{data['k']:.2g} +- {data['std']:.2g}"
    why = "far below zero: model, tool, units or poses are wrong"
    return f"{data['parameters'][0]} comes out as {k}, {why}"


def _near_zero(data: Data) -> str:
    """A compliance that might as well be zero."""
    k = f"{data['k']:.2g} +- {data['std']:.2g}"
    bounded = ", and was set to zero" if data["k"] < 0 else ""
    return f"{data['parameters'][0]} can hardly be told from zero ({k}){bounded}"


def _equal_rows_words(data: Data) -> str:
    """Rows that chance may have made the same."""
    chance = f"{data['chance']:.2g}"
    return f"{twins(data)}: as readings so coarse may be by chance ({chance}), or was it copied?"


def _alike_parameters(data: Data) -> str:
    """Two parameters that measurements hardly tell apart."""
    pair = " and ".join(data["parameters"])
    return f"{pair} are hardly told apart (correlation {data['correlation']:+.3f})"


def _one_pose(data: Data) -> str:
    """Parameters that would be unknown, or hardly known, without a pose."""
    names = ", ".join(data["parameters"])
    many = len(data["parameters"]) > 1
    would = f"standard deviation{'s' * many} would be at least {data['times']:.2g} times as large"
    if data["unknown"]:
        would = f"value{'s' * many} would be unknown"
    into = "them" if many else "it"
    rows = row_names(data["rows"])
    if data["poses"] == 1:
        return (
            f"{names}: only one pose tells enough ({rows}); without that pose the {would}, and an "
            f"error in it goes into {into} and hardly shows in the residuals"
        )
    return (
        f"{names}: only {data['poses']} poses tell enough ({rows}), and each is needed; without "
        f"one of them the {would}, and an error in one goes into {into} and hardly shows in the "
        "residuals"
    )


def _linear_model_words(data: Data) -> str:
    """A linear model that costs more than noise."""
    error = f"{1e3 * data['rho0_bias']:.2g} mm"
    place = data.get("place", "in the test pose")
    return f"the linear model leaves {error} {place}, more than noise: use lighter loads"


def _do_not_compensate(data: Data) -> str:
    """A compensation that does harm."""
    total = f"{1e3 * data['total']:.2g} mm"
    without = f"{1e3 * data['uncompensated']:.2g} mm"
    return (
        f"do not compensate with this: the expected error is {total}, and {without} without any "
        "compensation"
    )


def _gains_little(data: Data) -> str:
    """A compensation that leaves most of the error."""
    total = f"{1e3 * data['total']:.2g} mm"
    without = f"{1e3 * data['uncompensated']:.2g} mm"
    return (
        f"compensation gains little: the expected error is {total}, and {without} without any "
        f"compensation; the largest part of it is {data['largest'].replace('_', ' ')}"
    )


def _beyond_limits(data: Data) -> str:
    """A pose beyond a joint's limits."""
    return (
        f"row {data['rows'][0] + 1}, column {data['columns'][0]}: {data['value']:g} is beyond the "
        f"joint's limits, {data['low']:g} to {data['high']:g}"
    )


def copied_rows(fitted: FittedData) -> Finding | None:
    """Find rows that are the same, if they are more than coarse readings explain."""
    found = fitted.equal_rows
    if found is None or found.chance > CHANCE:
        return None
    return Finding.of(
        Severity.ALARM,
        WORDING,
        "copied_rows",
        rows=(found.later, found.earlier),
        others=found.others,
    )


def _other_pose(fitted: FittedData) -> Finding | None:
    """The first measured pose that is not planned."""
    if fitted.plan is None or fitted.match is None:
        return None
    rows = [(row,) for row in range(len(fitted.data))]
    return other_pose(fitted.study, fitted.data, fitted.plan, fitted.match, rows)


def misread_columns(fitted: FittedData) -> Finding | None:
    """Find columns that fit if they are read otherwise, and do not as they are headed."""
    found = fitted.explanation
    return found.finding if found is not None and found.certain else None


def find_input_error(fitted: FittedData) -> Finding | None:
    """Find the first input error in measurements that can be read and fitted.

    Args:
        fitted: The measurements, their fit, and the plan that was to be carried out.

    Returns:
        The error, with its rows and columns; None if the measurements have none.
    """
    return _other_pose(fitted) or copied_rows(fitted) or misread_columns(fitted)


def twins(data: Data) -> str:
    """Rows that are the same."""
    later, earlier = data["rows"]
    others = data["others"]
    more = f", and {others} more rows have such a twin" if others else ""
    return f"row {later + 1} is row {earlier + 1} to the last digit, in all columns{more}"


def _copied_rows(data: Data) -> str:
    """Rows that were copied."""
    return f"{twins(data)}; expected measurements anew"


WORDING: Wording = {
    "copied_rows": _copied_rows,
    "open": _open,
    "all_negative": _all_negative,
    "far_below_zero": _far_below_zero,
    "near_zero": _near_zero,
    "equal_rows": _equal_rows_words,
    "alike_parameters": _alike_parameters,
    "one_pose": _one_pose,
    "linear_model": _linear_model_words,
    "do_not_compensate": _do_not_compensate,
    "gains_little": _gains_little,
    "beyond_limits": _beyond_limits,
}
