"""The largest of several smooth losses over a few candidates, by an interior point method."""

import numpy as np
import pytest
from relaxations import off_centre

import criteria
from edtk.design.problem import Problem, several_models
from edtk.design.relaxation.loss_weights import loss_weights
from edtk.design.relaxation.master_equations import ActiveInformation
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.restricted_master import SolverOptions

ACCURACY = 1e-8
PHI = [{"name": "phi", "q": q} for q in (0.5, 2, 3)]
# At a point far out the second criterion alone decides, and the first one has no share in Z.
FAR = {"name": "c", "c": [1.0, 3.0, 9.0, 27.0]}
PARTS = {
    "D, A": {"criteria": ["D", "A"], "best": [0.3, 30.0]},
    "phi": {"criteria": PHI},
    "D, c": {"criteria": ["D", FAR], "best": [0.3, 40.0]},
    "D": {"criteria": ["D"]},
}
every_case = pytest.mark.parametrize("case", PARTS)


def minimax(case):
    """The largest loss of some criteria."""
    return criteria.create("minimax", **PARTS[case])


def powers(x, p):
    """The candidates x of a polynomial with p coefficients."""
    return Problem(np.vander(x, p, increasing=True)[:, None, :])


@every_case
def test_proof(case):
    """The multiplier proves that no weights are better, to the accuracy asked for."""
    problem = powers(np.linspace(-1, 1, 41), 4)
    criterion = minimax(case)
    active = ActiveInformation.of(problem, np.arange(problem.n))
    weights, Z = loss_weights(criterion.largest_of(4), active, np.full(41, 1 / 41), ACCURACY)
    assert (weights > 0).all()
    assert weights.sum() == pytest.approx(1)
    M = problem.information(weights)
    bound = criterion.lower_bound(Z[None], problem.sensitivities(Z).max(keepdims=True), M)
    cost = float(criterion.cost(M))
    assert (1 - 10 * ACCURACY) * cost <= bound <= (1 + 1e-12) * cost


def test_models_of_one_parameter_are_a_linear_program():
    """The multiplier proves the weights of a game: two hundred columns against nine rows.

    Told are from 1e-4 to 1e4 at once, where a method that follows logarithms finds no way.
    """
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(9, 200, 1, 1)) * 10.0 ** rng.uniform(-2, 2, size=(9, 1, 1, 1))
    problem = several_models([Problem(each) for each in rows])
    best = rng.uniform(0.5, 2.0, 9)
    mixed = ["D", "A", {"name": "phi", "q": 2}] * 3
    criterion = criteria.create("minimax", criteria=mixed, best=best, sizes=[1] * 9)
    design = relax(problem, criterion)
    assert design.solver == "NEWTON"
    assert design.gap < 1e-9


def test_far_extrapolation():
    """Chebyshev's polynomial has the value 99 at 3; the variance there is its square."""
    problem = powers(np.linspace(-1, 1, 41), 4)
    found = relax(problem, criteria.create("minimax", criteria=["D", FAR], best=[1e-6, 1.0]))
    alone = relax(problem, criteria.create("minimax", criteria=[FAR, "D"], best=[1.0, 1e-6]))
    assert found.solver == "NEWTON"
    assert found.cost == pytest.approx(99.0**2, rel=1e-6)
    assert alone.cost == pytest.approx(99.0**2, rel=1e-6)
    assert max(found.gap, alone.gap) <= 1e-6


@pytest.mark.parametrize("case", ["D, A", "phi"])
@pytest.mark.slow
def test_same_as_cvxpy(case):
    """The relaxation by this method has the cost of the one by cvxpy's."""
    problem = Problem(off_centre(8, 60))
    own = relax(problem, minimax(case), options=SolverOptions(solvers=("NEWTON",)))
    other = relax(problem, minimax(case), options=SolverOptions(solvers=("CLARABEL",)))
    assert own.gap <= 1e-6
    assert own.cost == pytest.approx(other.cost, rel=1e-6)


@pytest.mark.slow
def test_a_small_share():
    """Where one share is far below the other, the bound of a light design is not lost."""
    z = np.linspace(-1, 1, 16)
    problem = powers(z, 3)
    parts = ["D", {"name": "c", "c": np.vander(z, 3, increasing=True)[8]}]
    found = relax(problem, criteria.create("minimax", criteria=parts, best=[15.0**-2, 1.0]))
    assert -1e-9 <= found.gap <= 1e-6
    assert found.weights[8] > 0.999


@pytest.mark.slow
def test_bad_units():
    """Twelve decades between the parameters' units leave a proved gap as small as ever."""
    units = 10.0 ** np.linspace(-6, 6, 4)
    problem = Problem(off_centre(8, 60) * units)
    criterion = minimax("phi")
    found = relax(problem, criterion)
    assert found.solver == "NEWTON"
    assert -1e-9 <= found.gap <= 1e-6
    for weights in np.random.default_rng(0).dirichlet(np.full(60, 0.2), size=20):
        assert criterion.cost(problem.information(weights)) >= found.proved_bound.cost
    same = criterion.in_units(np.diag(1 / units))
    assert not same.unit_free


@pytest.mark.parametrize("name", ["minimax", "compound"])
def test_several_models_of_calendar_years(name):
    """D of a line and of a parabola over thirty years is that of centred years, but for units."""
    years = np.linspace(2000, 2030, 31)
    z = (years - 2015) / 15
    # det M in powers of years is that in powers of z times 15^(p (p - 1)).
    best = [15.0, 15.0**2]
    given = several_models([powers(years, p) for p in (2, 3)])
    centred = several_models([powers(z, p) for p in (2, 3)])
    found = relax(given, criteria.create(name, criteria=["D", "D"], best=best, sizes=[2, 3]))
    good = relax(centred, criteria.create(name, criteria=["D", "D"], sizes=[2, 3]))
    for each in (found, good):
        assert each.solver == "NEWTON"
        assert -1e-9 <= each.gap <= 1e-6
    assert found.cost == pytest.approx(good.cost, rel=1e-8)


def test_which_have_the_form():
    """A smoothed maximum is another program, and a part needs a curvature in closed form."""
    assert minimax("D, A").smoothed(10.0).largest_of(4) is None
    assert criteria.create("G").largest_of(4) is None
    assert len(minimax("phi").largest_of(4).parts) == 3
