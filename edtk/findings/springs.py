"""Everything that looks wrong in measurements."""

from collections.abc import Iterator

import numpy as np

from edtk.findings.diagnostic import Diagnostic, Severity
from edtk.findings.finding import Finding, Kind
from edtk.findings.fitted_data import FittedData
from edtk.findings.input_errors import find_input_error
from edtk.findings.match_plan import pose_resolution
from edtk.findings.noise import (
    cause_diagnostics,
    noise_diagnostics,
    outlier_diagnostics,
)
from edtk.findings.prior import prior_diagnostics
from edtk.findings.units import unit_diagnostics
from edtk.fit.least_squares import Whitened
from edtk.measure.expected_error import ErrorBudget
from edtk.measure.pose_table import pose_columns, pose_factors
from edtk.robots.robot import shown_limits
from edtk.system.typing import Array

LITTLE = 0.5  # error with compensation over that without, from which a person is told
FAR_BELOW_ZERO = -3.0  # standard deviations that noise does not explain
WEAK = 0.5  # standard deviation over the compliance above which it might as well be zero
ALIKE = 0.99  # correlation above which two parameters are hardly told apart
MUCH_WIDER = 5.0  # growth of a standard deviation by which a parameter rests on a pose
UNKNOWN = 1e3  # growth of a standard deviation beyond which a parameter is as good as unknown
ROUNDING = 1e-12  # of eigenvalues that are one at most


def budget_diagnostics(budget: ErrorBudget | None) -> Iterator[Diagnostic]:
    """Warn of a compensation after which the error is expected to be larger than without any.

    One that leaves more than half of the error is worth a note, as the budget says what to improve.
    """
    if budget is None or budget.total <= LITTLE * budget.uncompensated:
        return
    data = {
        "total": budget.total,
        "uncompensated": budget.uncompensated,
        "largest": budget.largest,
    }
    if budget.total >= budget.uncompensated:
        yield Diagnostic(Severity.ALARM, Finding(Kind.DO_NOT_COMPENSATE, data=data))
    else:
        yield Diagnostic(Severity.NOTE, Finding(Kind.GAINS_LITTLE, data=data))


def input_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name an input error, or a reading of the columns that explains most of a misfit, not all."""
    finding = find_input_error(fitted)
    if finding is None and fitted.explanation is not None:
        finding = fitted.explanation.finding
    if finding is not None:
        yield Diagnostic(Severity.ALARM, finding)


def pose_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name the first pose beyond the limits, and the planned experiments without a measurement."""
    yield from _limits(fitted)
    if fitted.match is not None and len(fitted.match.missing):
        rows = tuple(fitted.match.missing.tolist())
        yield Diagnostic(Severity.WARNING, Finding(Kind.NOT_MEASURED, rows))


def _limits(fitted: FittedData) -> Iterator[Diagnostic]:
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
        finding = Finding(Kind.BEYOND_LIMITS, (i,), (pose_columns(robot)[j],), data=data)
        yield Diagnostic(Severity.WARNING, finding)


def sign_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name compliances that come out negative by far, then those that cannot be told from zero."""
    fit = fitted.fit
    if fit.negative.all():
        yield Diagnostic(Severity.ALARM, Finding(Kind.ALL_NEGATIVE))
        return
    estimates = list(
        zip(fitted.study.model.parameters, fit.unbounded.tolist(), fit.std.tolist(), strict=True)
    )
    for name, k, std in estimates:
        if k < min(FAR_BELOW_ZERO * std, 0):
            yield Diagnostic(Severity.ALARM, _of(Kind.FAR_BELOW_ZERO, name, k, std))
    for name, k, std in estimates:
        if FAR_BELOW_ZERO * std <= k < std / WEAK:
            yield Diagnostic(Severity.WARNING, _of(Kind.NEAR_ZERO, name, k, std))


def _of(kind: Kind, name: str, k: float, std: float) -> Finding:
    """A finding about one parameter."""
    return Finding(kind, parameters=(name,), data={"k": k, "std": std})


def structure_diagnostics(
    fitted: FittedData, rho0_bias: float | None = None
) -> Iterator[Diagnostic]:
    """Name equal rows, parameters that are alike or rest on one pose, and a costly linear model.

    Args:
        fitted: The measurements and their fit.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
    """
    yield from _equal_rows(fitted)
    yield from _alike(fitted)
    yield from _alone(fitted)
    yield from _linear_model(fitted, rho0_bias)


def _equal_rows(fitted: FittedData) -> Iterator[Diagnostic]:
    """Equal rows that chance may have made; those that it did not are an input error."""
    found = fitted.equal_rows
    if found is not None:
        data = {"others": found.others, "chance": found.chance}
        finding = Finding(Kind.EQUAL_ROWS, (found.later, found.earlier), data=data)
        yield Diagnostic(Severity.NOTE, finding)


def _alike(fitted: FittedData) -> Iterator[Diagnostic]:
    """The two parameters that are hardest to tell apart."""
    fit = fitted.fit
    off = np.abs(fit.correlation - np.eye(len(fit.k)))
    if off.max() > ALIKE:
        i, j = np.unravel_index(int(off.argmax()), off.shape)
        names = fitted.study.model.parameters
        data = {"correlation": float(fit.correlation[i, j])}
        finding = Finding(Kind.ALIKE_PARAMETERS, parameters=(names[j], names[i]), data=data)
        yield Diagnostic(Severity.WARNING, finding)


def _alone(fitted: FittedData) -> Iterator[Diagnostic]:
    """Parameters that would be unknown, or hardly known, without one of the poses.

    Few poses leave no other choice, and are what a plan of few poses asks for: it is a note. With
    ``G = Q'Q`` of a pose's rows the covariance is ``T T'``, and ``T (I - G)^-1 T'`` without the
    pose. Parameters that rest on the same poses are named together.
    """
    growth = _growth_without(fitted)
    resting: dict[tuple[int, ...], list[int]] = {}
    for i, of_parameter in enumerate(growth.T):
        poses = tuple(np.flatnonzero(of_parameter >= MUCH_WIDER**2).tolist())
        if poses:
            resting.setdefault(poses, []).append(i)
    names = fitted.study.model.parameters
    for poses, members in resting.items():
        rows = np.flatnonzero(np.isin(fitted.data.pose, poses))
        times = float(np.sqrt(growth[np.ix_(poses, members)].min()))
        data = {"poses": len(poses), "times": times, "unknown": times > UNKNOWN}
        named = tuple(names[i] for i in members)
        finding = Finding(Kind.ONE_POSE, tuple(rows.tolist()), parameters=named, data=data)
        yield Diagnostic(Severity.NOTE, finding)


def _growth_without(fitted: FittedData) -> Array:
    """Growth (poses, p) of each parameter's variance where one pose is left out; inf if unknown."""
    data = fitted.data
    parameters = fitted.study.model.parameters
    # The least eigenvalue of I - G is at least one minus the trace of G, the pose's leverage: of
    # most poses that shows that no variance grows by much.
    share = np.bincount(data.pose, fitted.fit.leverage.sum(axis=1))
    growth = np.ones((len(share), len(parameters)))
    suspects = np.flatnonzero(share > 1 - 1 / MUCH_WIDER**2)
    if fitted.untold or not len(suspects):
        return growth
    whitened = Whitened.of(fitted.A, fitted.noise, parameters)
    T = np.linalg.inv(whitened.R)
    for pose in suspects:
        Q = whitened.Q[data.pose == pose].reshape(-1, T.shape[1])
        left, V = np.linalg.eigh(np.eye(T.shape[1]) - Q.T @ Q)
        # An eigenvalue that is zero but for rounding stands for an infinite variance.
        growth[pose] = ((T @ V) ** 2 / np.maximum(left, ROUNDING)).sum(axis=1) / (T**2).sum(axis=1)
    return growth


def _linear_model(fitted: FittedData, rho0_bias: float | None) -> Iterator[Diagnostic]:
    """A linear model that costs more than the noise."""
    target = fitted.study.target
    if target is None or rho0_bias is None:
        return
    if rho0_bias > fitted.fit.accuracy(target)[0]:
        tasks = fitted.study.tasks
        place = {"place": tasks.place} if len(tasks) > 1 else {}
        finding = Finding(Kind.LINEAR_MODEL, data={"rho0_bias": rho0_bias, **place})
        yield Diagnostic(Severity.WARNING, finding)


EXPLAIN = (Kind.CAUSE, Kind.NO_CAUSE, Kind.OUTLIERS)


def diagnostics(
    fitted: FittedData, rho0_bias: float | None = None, budget: ErrorBudget | None = None
) -> tuple[Diagnostic, ...]:
    """List everything that looks wrong in measurements, the worst first.

    What explains residuals stands before the line that says how large they are.

    Args:
        fitted: The measurements and their fit. The study's load and its assumed true compliances,
            if it has any, say how large things are.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
        budget: Errors to expect in the test pose; None without one.
    """
    found = list(unit_diagnostics(fitted))
    misread = fitted.explanation is not None and fitted.explanation.refits
    # A wrong unit or a misread column spoils the fit: its other faults are consequences, and would
    # only distract.
    if not misread and all(diagnostic.severity < Severity.ALARM for diagnostic in found):
        found += sign_diagnostics(fitted)
        found += noise_diagnostics(fitted)
        found += cause_diagnostics(fitted)
        found += outlier_diagnostics(fitted)
        if fitted.prior is not None and not fitted.untold:
            found += prior_diagnostics(fitted.fit, fitted.prior)
        found += structure_diagnostics(fitted, rho0_bias)
        found += budget_diagnostics(budget)
    found += pose_diagnostics(fitted)
    found = [*input_diagnostics(fitted), *found]
    return tuple(sorted(found, key=lambda diagnostic: _order(diagnostic, found)))


def _order(diagnostic: Diagnostic, found: list[Diagnostic]) -> tuple[float, bool]:
    """The place of a finding: by its severity; what explains residuals stands before their size."""
    severity = diagnostic.severity
    if diagnostic.kind in EXPLAIN:
        sizes = [one.severity for one in found if one.kind is Kind.NOISE_ABOVE_SIGMA]
        severity = max([severity, *sizes])
    return -severity, diagnostic.kind not in EXPLAIN
