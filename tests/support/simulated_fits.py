"""Fits to simulated measurements of the published plans, each made once for all tests."""

from functools import cache
from pathlib import Path

import numpy as np

from edtk.fit.identify import identify
from edtk.fit.measurements import simulate
from edtk.study.study import load_study

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
PLANS = STUDY.published_plans()
NAMES = STUDY.model.parameters
K0 = STUDY.compliances
SIGMA = STUDY.sigma[0]
MOST_RUNS = 2000


@cache
def regressor(plan="table_4_12"):
    """Regressors (m, 3, 5) of a published plan."""
    return STUDY.model.regressor(PLANS[plan].q, PLANS[plan].wrench)


def fits(plan, runs, known=True, robust=False):
    """Fits to the first so many simulated runs of a plan."""
    return [_fit(plan, run, known, robust) for run in range(runs)]


@cache
def _measured(plan):
    return simulate(regressor(plan), K0, SIGMA, np.random.default_rng(1), MOST_RUNS)


@cache
def _fit(plan, run, known, robust):
    measured = _measured(plan)[run]
    sigma = np.full(measured.shape, SIGMA)
    return identify(regressor(plan), measured, sigma, NAMES, robust=robust, known=known)
