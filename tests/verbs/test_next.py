"""The experiments to make after those at hand."""

import numpy as np
import pandas as pd
import pytest

import edtk
from edtk.system.errors import ArgumentError

pytestmark = pytest.mark.slow

X = np.linspace(-1.0, 1.0, 41)
PARABOLA = edtk.Problem(np.vander(X, 3)[:, None, :])
KEPT = [0, 0, 7, 20]


def best_pair(cost):
    """All pairs of candidates, by their cost."""
    M = PARABOLA.information(np.bincount(KEPT, minlength=41))
    A = PARABOLA.blocks()
    pairs = [(cost(M + A[i] + A[j]), i, j) for i in range(41) for j in range(i, 41)]
    return min(pairs)


@pytest.mark.parametrize(
    ("criterion", "cost"),
    [("D", lambda M: -np.linalg.det(M)), ("A", lambda M: np.trace(np.linalg.inv(M)))],
)
def test_the_next_two_are_the_best_of_all_pairs(criterion, cost):
    """Brute force over all pairs finds none that is better."""
    found = edtk.next(PARABOLA, KEPT, 2, criterion=criterion)
    best, _, _ = best_pair(cost)
    i, j = found.new
    M = PARABOLA.information(np.bincount([*KEPT, i, j], minlength=41))
    assert cost(M) == pytest.approx(best, rel=1e-9)
    assert found.size == 6


def test_experiments_at_hand_may_be_a_problem():
    """In a region the next point is that of the largest variance, for D."""
    made = edtk.Problem(np.vander([-1.0, -1.0, 0.2], 3)[:, None, :])
    region = edtk.Region(lambda x: np.vander(x[:, 0], 3), -1, 1)
    found = edtk.next(region, made)
    np.testing.assert_allclose(found.experiments, [[1.0]], atol=1e-6)
    for points in ([-1.0, -1.0, 0.2], [[-1.0], [-1.0], [0.2]], pd.DataFrame({"x": [-1, -1, 0.2]})):
        assert edtk.next(region, points).cost == pytest.approx(found.cost, rel=1e-9)
    with pytest.raises(ArgumentError, match=r"keep: expected points \(n, 1\), or a Problem"):
        edtk.next(region, [[1.0, 2.0]])


def test_experiments_at_hand_may_be_rows_of_a_data_frame():
    """They have the columns of the candidates, and need be none of them."""
    made = pd.DataFrame({"dose": [0.13, 0.77, 0.77], "batch": ["b", "a", "a"]})
    runs = pd.DataFrame({"dose": np.tile(np.linspace(0, 1, 11), 2), "batch": ["a", "b"] * 11})
    model = edtk.Problem.from_frame(runs, "dose * batch", sigma=0.5)
    one = edtk.Problem(model.regressors(made)[:, None] / 0.5)
    found = edtk.next(model, made, 3)
    assert found.cost == pytest.approx(edtk.next(model, one, 3).cost, rel=1e-9)
    curve = edtk.Problem.of_model("a * exp(-b * dose)", {"a": 1, "b": 1}, runs[["dose"]])
    assert edtk.next(curve, made, 1).size == 4
    with pytest.raises(ArgumentError, match="keep: no column 'dose' in the data frame"):
        edtk.next(model, made[["batch"]])
    with pytest.raises(ArgumentError, match="keep: a data frame needs one model of a data frame"):
        edtk.next(PARABOLA, made)


@pytest.mark.parametrize(("keep", "share"), [([0, 0, 7, 20], 0.95), ([3, 4, 5, 6], 0.9)])
def test_as_few_as_reach_an_efficiency(keep, share):
    """All together are so efficient as asked; the best plan of one less is not."""
    found = edtk.next(PARABOLA, keep, efficiency=share)
    best = (4 / 27) ** (1 / 3)

    def efficiency(counts):
        return np.linalg.det(PARABOLA.information(counts) / counts.sum()) ** (1 / 3) / best

    assert efficiency(found.counts) >= share * (1 - 1e-6)
    fewer = edtk.next(PARABOLA, keep, len(found.new) - 1)
    assert efficiency(fewer.counts) < share
    assert edtk.next(PARABOLA, found.experiments, efficiency=share) is None


def test_few_at_hand_make_an_interval_narrow():
    """What is best for the slope is singular for the parabola, and yet fifteen more are found."""
    found = edtk.next(PARABOLA, [0], until={"k2": 1.0})
    cov = np.linalg.inv(PARABOLA.information(found.counts))
    assert 2 * 1.959963984540054 * np.sqrt(cov[1, 1]) <= 1 + 1e-9
    assert len(found.new) == 15  # of fourteen: 1.9602 * 2/sqrt(15) > 1


def test_as_few_as_make_intervals_narrow():
    """Both intervals are as narrow as asked, and with one experiment less no plan makes them so."""
    made = edtk.Problem(np.vander([-1.0, -1.0, 0.2], 3)[:, None, :])
    until = {"k1": 3.0, "k3": 2.0}
    found = edtk.next(PARABOLA, made, until=until)

    def widths(counts):
        M = PARABOLA.information(counts) + made.information(np.ones(3))
        return 2 * 1.959963984540054 * np.sqrt(np.diag(np.linalg.inv(M)))[[0, 2]]

    assert (widths(found.counts) <= [3.0 + 1e-9, 2.0 + 1e-9]).all()
    rows = np.diag(2 * 1.959963984540054 / np.array([3.0, 1.0, 2.0]))[[0, 2]]
    worst = edtk.criteria.create("prediction_G", points=rows)
    assert edtk.next(PARABOLA, made, len(found.new) - 1, criterion=worst).cost > 1
    region = edtk.Region(lambda x: np.vander(x[:, 0], 3), -1, 1)
    many = edtk.Problem(np.vander(np.tile([-1.0, 0.0, 1.0], 50), 3)[:, None, :])
    assert edtk.next(region, many, until={"k3": 2.0}) is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"efficiency": 1.5}, "efficiency 1.5: expected above 0, to 1"),
        ({"efficiency": 0.9, "until": {"k1": 1}}, "until: expected one of"),
        ({"until": {"z": 1}}, "until z: expected some of k1, k2, k3"),
        ({"until": {"k1": 0}}, "until 0: expected a width above 0 of k1"),
        ({"until": 3}, "until: expected widths by names"),
    ],
)
def test_goals_that_make_no_sense_are_refused(options, words):
    """One line names the argument."""
    with pytest.raises(ArgumentError, match=words):
        edtk.next(PARABOLA, KEPT, **options)


def test_nothing_at_hand_is_a_plain_plan():
    """The first three of a parabola are its ends and its middle."""
    assert edtk.next(PARABOLA, [], 3).new.tolist() == [0, 20, 40]


@pytest.mark.parametrize(
    ("problem", "keep", "k", "words"),
    [
        (PARABOLA, 3, 1, "keep: expected indices"),
        (PARABOLA, [99], 3, "keep: expected indices of candidates, from 0 to 40"),
        (PARABOLA, KEPT, 0, "k 0: expected a whole number, 1 or more"),
        ("study.toml", KEPT, 1, "problem: is about a Problem or a Region"),
    ],
)
def test_what_makes_no_sense_is_refused(problem, keep, k, words):
    """One line names the argument."""
    with pytest.raises(ArgumentError, match=words):
        edtk.next(problem, keep, k)


def test_the_fraction_of_design_space_has_the_variances():
    """The curve is that of the variances ``x' inv(M) x`` in order, and other kinds are refused."""
    plan = edtk.plan(PARABOLA, size=6)
    rows = np.vander(X, 3)
    variances = np.einsum(
        "ip,pq,iq->i", rows, np.linalg.inv(PARABOLA.information(plan.counts)), rows
    )
    line = plan.plot(kind="fds").lines[0]
    np.testing.assert_allclose(line.get_ydata(), np.sort(variances), rtol=1e-10)
    with pytest.raises(ArgumentError, match="kind pie: expected one of counts, fds"):
        plan.plot(kind="pie")
