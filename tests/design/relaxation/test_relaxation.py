"""The result of a relaxation: it recomputes its own proof and shows itself."""

from dataclasses import replace

import numpy as np
import pytest
from relaxations import CASES, bound_slip, every, slip, solved

from edtk.design.problem import Problem

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("case", CASES)
@every
def test_certify(name, case):
    """Cost and bound follow from weights, multipliers and candidates, whatever is claimed."""
    problem = Problem(CASES[case])
    r = solved(name, case)
    M = problem.information(r.weights)
    bound = r.proved_bound.cost
    claim = replace(r, cost=0.1 * r.cost, proved_bound=replace(r.proved_bound, cost=10 * bound))
    for factor in (1, 2):  # of information of which no design knew
        found = claim.certify(Problem.of_information(factor * problem.packed))
        scale = factor**-r.criterion.degree
        assert found[0] == pytest.approx(r.cost * scale, rel=slip(M, name))
        assert found[1] == pytest.approx(bound * scale, rel=bound_slip(M, name))


@every
def test_printed_numbers(name):
    """Value and bound are printed in the form of the criterion's formula, the bound the better."""
    problem = Problem(CASES["off-centre"])
    r = solved(name, "off-centre")
    value = float(r.criterion.value(problem.information(r.weights)))
    assert r.value == pytest.approx(value, rel=slip(problem.information(r.weights)))
    better, worse = (r.bound, r.value) if r.criterion.sense == "min" else (r.value, r.bound)
    assert better <= worse * (1 + slip(problem.information(r.weights)))
    assert r.gap == 1 - r.proved_bound.cost / r.cost == r.proved_bound.gap


def test_headline():
    """One line has criterion, value, number of support points and gap."""
    r = solved("A", "cubic")
    assert repr(r) == f"<Relaxation: {r.headline()}>"
    assert r.headline().startswith(f"A = {r.value:.4g}, weights on {len(r.support)} of 41 ")
    assert len(r.support) == np.count_nonzero(r.weights)
