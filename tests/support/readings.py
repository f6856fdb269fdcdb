"""Simulated readings of the published plan of twelve, by a robot at rest under its load."""

from pathlib import Path

import numpy as np

from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.measurements import Measurements
from edtk.measure.task import all_compliances
from edtk.study.study import load_study

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
PLAN = STUDY.published_plans()["table_4_12"]


def readings_of(q, wrench, seed=0, digits=None):
    """Readings in some poses under some loads, to so many digits of a millimetre."""
    k = all_compliances(STUDY.model, STUDY.compliances)
    moved = equilibrium_deflection(STUDY.model, q, wrench, k)
    moved = moved + STUDY.sigma * np.random.default_rng(seed).standard_normal(moved.shape)
    if digits is not None:
        moved = moved.round(digits + 3)
    sigma = np.tile(STUDY.sigma, (len(q), 1))
    return Measurements(q, wrench, moved, sigma, np.zeros((len(q), 3)))


def measured(seed=0, repeats=2, digits=4):
    """Readings of the plan, each pose so many times, to so many digits of a millimetre."""
    q = np.repeat(PLAN.q, repeats, axis=0)
    return readings_of(q, np.repeat(PLAN.wrench, repeats, axis=0), seed, digits)
