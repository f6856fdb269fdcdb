"""A power of a criterion has its base's relaxation: the same weights, costs and bounds turned."""

import numpy as np
import pytest
from arm import arm

from edtk.study.plan_study import relax_study
from edtk.study.run_study import relaxed_under

STUDY = arm()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "base"), [("O1", "D"), ("O3", "E")])
def test_base_proves_the_power(name, base):
    """Turned cost and bounds are those recomputed from weights and multipliers."""
    criterion = STUDY.criterion(name)
    assert criterion.plan_criterion.name == base
    relaxed = relax_study(STUDY, base, candidates=200, continuous=True, tolerance=1e-3)
    turned = relaxed_under(criterion, relaxed)
    assert turned.criterion is criterion
    assert turned.cost == pytest.approx(float(criterion.cost(turned.information)), rel=1e-12)
    cost, bound = turned.certify()
    assert turned.cost == pytest.approx(cost, rel=1e-12)
    assert turned.proved_bound.cost == pytest.approx(bound, rel=1e-9)
    assert turned.searched_bound.cost <= turned.proved_bound.cost <= turned.cost
    assert turned.searched_bound.kind is relaxed.searched_bound.kind
    for mine, theirs in ((turned.proved_bound, relaxed.proved_bound), (turned, relaxed)):
        np.testing.assert_allclose(mine.cost, np.sqrt(theirs.cost), rtol=1e-12)


def test_a_criterion_of_its_own_keeps_its_relaxation():
    """A criterion that is its own base is given back what was computed for it."""
    relaxed = relax_study(STUDY, "D", candidates=50)
    assert relaxed_under(STUDY.criterion("D"), relaxed) is relaxed
