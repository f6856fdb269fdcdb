"""Poses beyond the joints' limits, and planned ones that were not measured."""

from collections.abc import Iterator

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.calibration.pose_resolution import pose_resolution
from edtk.model.shown_limit import shown_limits
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import pose_factors


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
