"""Polished designs over a region."""

import numpy as np
import pytest

import criteria
from edtk.design.region import Region
from edtk.design.relaxation.relax_region import relax_region

GAP = 1e-7
AT = 0.5


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [("rho0", 1), ("c", 0), ("rho_max", 0)])
def test_rounding_is_no_improvement(name, seed):
    """The best design for the prediction at a place measures there: its variance is one.

    It is singular, and near it costs come out below one, which a descent finds. Covariances cancel
    there, and multipliers do not: the cost is known to fewer digits than the bound.
    """
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0] if seed else np.eye(3)
    region = Region(lambda x: x ** np.arange(3) @ turn, -1.0, 1.0)
    row = AT ** np.arange(3) @ turn
    given = {"rho0": {"target": row[None]}, "rho_max": {"target": row[None, None]}, "c": {"c": row}}
    found = relax_region(region, criteria.create(name, **given[name]))
    assert 0 <= found.gap <= 2 * GAP
    assert found.cost - 1 <= found.accuracy
    assert 1 - 1e-12 <= found.cost <= 1 + 2 * GAP
