"""The measurements of a plan, and of experiments of which one more may be made."""

from typing import Any

import numpy as np

from edtk.calibration.planned_measurements import planned_measurements
from edtk.design.plan import Plan
from edtk.design.sample_feasible import sample_feasible
from edtk.inference.measurements import Measurements
from edtk.study.study import Study

CANDIDATES = 300  # poses among which one more experiment is looked for


def with_candidates(study: Study, plan: Plan) -> tuple[int, Measurements]:
    """Measurements without their values: the plan's, and behind them those of feasible experiments.

    Args:
        study: The study.
        plan: All experiments.

    Returns:
        The number of the plan's rows, and all rows.
    """
    first = planned_measurements(study, plan)
    x = sample_feasible(study.space, CANDIDATES, study.specification.seed)
    more = planned_measurements(study, study.space.plan(x, np.ones(len(x), dtype=int)))
    return len(first), _joined(first, more)


def _joined(first: Measurements, second: Measurements) -> Measurements:
    """The rows of both."""

    def both(name: str) -> Any:
        """One column of both; None where there is none."""
        columns = (getattr(first, name), getattr(second, name))
        return None if columns[0] is None else np.concatenate(columns)

    noise = None
    if first.covariance is not None and second.covariance is not None:
        noise = first.covariance.and_then(second.covariance)
    names = ("q", "wrench", "deflection", "sigma", "marker", "sensor", "turn")
    columns = {name: both(name) for name in names}
    return Measurements(**columns, covariance=noise, absolute=first.absolute)
