"""A problem of arrays: its information, its sensitivities, and what it rejects."""

import doctest
from importlib import import_module

import numpy as np
import pytest

from edtk.design import information as packed_information
from edtk.design.problem import Problem, RankDeficientError

EPS = np.finfo(float).eps
X = np.linspace(-1, 1, 41)


@pytest.fixture
def blocks():
    return np.random.default_rng(0).normal(size=(7, 3, 4))


def test_noise_of_candidates_is_that_of_their_rows(blocks):
    """One number for each candidate, or for each of its rows; (n,) is of rows where both are n."""
    of_each = np.arange(1.0, 8.0)
    expected = blocks / of_each[:, None, None]
    for sigma in (of_each, of_each[:, None], np.tile(of_each[:, None], 3)):
        np.testing.assert_allclose(Problem(blocks, sigma).factors(), expected, rtol=1e-15)
    square = blocks[:3]
    by_row = np.array([1.0, 2.0, 5.0])
    np.testing.assert_allclose(Problem(square, by_row).factors(), square / by_row[:, None])
    own = Problem(square, by_row[:, None]).factors()
    np.testing.assert_allclose(own, square / by_row[:, None, None])


@pytest.mark.parametrize("sigma", [0.3, [0.1, 0.2, 0.7]], ids=["one", "per row"])
def test_information_is_the_sum_of_outer_products(blocks, sigma):
    """M = sum w_i A_i' A_i / sigma^2, row by row."""
    w = np.arange(7.0)
    s = np.broadcast_to(sigma, 3)
    rows = [(w[i], r, s[j]) for i, A in enumerate(blocks) for j, r in enumerate(A)]
    expected = sum(weight * np.outer(r, r) / sd**2 for weight, r, sd in rows)
    np.testing.assert_allclose(Problem(blocks, sigma).information(w), expected, rtol=1e-12)


def test_information_of_few_and_of_many_candidates_agree(blocks):
    """The information of few and of many weights is the sum of their blocks, to rounding."""
    problem = Problem(blocks)
    rng = np.random.default_rng(1)
    for k in range(8):
        w = np.zeros(7)
        w[rng.permutation(7)[:k]] = rng.uniform(0.1, 1, size=k)
        expected = np.tensordot(w, problem.blocks(), axes=1)
        size = np.tensordot(w, np.abs(problem.blocks()), axes=1)
        assert (np.abs(problem.information(w) - expected) <= 8 * EPS * size).all()


def test_blocks_are_information_of_one_each(blocks):
    """The information of a unit weight is the candidate's block, however blocks are chosen."""
    problem = Problem(blocks, 2.0)
    assert (problem.n, problem.p) == (7, 4)
    assert problem.packed.shape == (10, 7)
    for i, w in enumerate(np.eye(7)):
        np.testing.assert_array_equal(problem.information(w), problem.blocks()[i])
        np.testing.assert_array_equal(problem.blocks(i), problem.blocks()[i])
    np.testing.assert_array_equal(problem.blocks([5, 2, 5]), problem.blocks()[[5, 2, 5]])


@pytest.mark.parametrize(
    "units", [np.ones(4), 10.0 ** np.array([-7, -2, 1, 4])], ids=["good units", "bad units"]
)
@pytest.mark.parametrize("rows", [1, 3, 6])
def test_factors_are_roots_of_the_information(rows, units):
    """U' U is the candidate's information, with no more rows than its rank, however chosen.

    An eigenvalue that is left out is below 1e-13 of the largest, and rounding is a few eps of it,
    both at the scale sqrt(m_ii m_jj) of the mean.
    """
    problem = Problem(np.random.default_rng(0).normal(size=(7, rows, 4)) * units)
    U = problem.factors()
    assert U.shape == (7, min(rows, 4), 4)
    scale = np.sqrt(np.diag(problem.mean))
    error = np.abs(np.swapaxes(U, 1, 2) @ U - problem.blocks()) / np.outer(scale, scale)
    size = np.abs(problem.blocks() / np.outer(scale, scale)).sum(axis=(1, 2)).max()
    assert error.max() <= 64 * EPS * size + (1e-13 * size if rows < 4 else 0.0)
    np.testing.assert_array_equal(problem.factors(2), U[2])
    np.testing.assert_array_equal(problem.factors([5, 2, 5]), U[[5, 2, 5]])


def test_factors_of_candidates_that_tell_different_amounts():
    """Factors have as many rows as the largest rank, also beside candidates of no information."""
    blocks = np.zeros((4, 2, 3))
    blocks[0] = [[1, 2, 0], [3, -1, 0]]
    blocks[1, 0] = [1e-3, 0, 0]
    blocks[2, 1] = [5, 1e3, 0]
    problem = Problem(blocks)
    U = problem.factors()
    assert U.shape == (4, 2, 3)
    size = np.abs(problem.blocks()).max(axis=(1, 2), keepdims=True) + np.abs(problem.mean)
    assert (np.abs(np.swapaxes(U, 1, 2) @ U - problem.blocks()) <= 2e-13 * size).all()


def test_mean_is_the_information_of_uniform_weights(blocks):
    """The mean is the information of equal weights, to the rounding of a sum of seven terms."""
    problem = Problem(blocks)
    size = np.abs(problem.blocks()).mean(axis=0)
    assert (np.abs(problem.mean - problem.information(np.full(7, 1 / 7))) <= 16 * EPS * size).all()


def test_sensitivities_are_traces(blocks):
    """A sensitivity is trace(Z M_i), for one multiplier, for several, and for none."""
    problem = Problem(blocks)
    Z = np.random.default_rng(2).normal(size=(5, 4, 4))
    Z = Z + np.swapaxes(Z, -1, -2)
    expected = np.einsum("rij,nji->rn", Z, problem.blocks())
    size = np.einsum("rij,nji->rn", np.abs(Z), np.abs(problem.blocks()))
    assert (np.abs(problem.sensitivities(Z) - expected) <= 32 * EPS * size).all()
    assert problem.sensitivities(Z[0]).shape == (7,)
    assert problem.sensitivities(Z[:0]).shape == (0, 7)


def test_of_information_is_the_same_problem_without_a_copy(blocks):
    """A problem of packed information has the same blocks and names, and shares the memory."""
    problem = Problem(blocks, 0.5, ("a", "b", "c", "d"))
    packed = problem.packed
    same = Problem.of_information(packed, problem.parameters)
    assert np.shares_memory(same.packed, packed)
    assert (same.n, same.p, same.parameters) == (7, 4, ("a", "b", "c", "d"))
    np.testing.assert_array_equal(same.blocks(), problem.blocks())


def test_with_unit_trace(blocks):
    """Every candidate is scaled to trace one; one without information is left as it is."""
    blocks[3] = 0
    blocks *= 10.0 ** np.arange(-9, 12, 3)[:, None, None]
    problem = Problem(blocks, parameters=("a", "b", "c", "d"))
    unit = problem.with_unit_trace()
    traces = np.trace(problem.blocks(), axis1=1, axis2=2)
    expected = problem.blocks() / np.where(traces > 0, traces, 1.0)[:, None, None]
    np.testing.assert_allclose(unit.blocks(), expected, rtol=16 * EPS, atol=0)
    np.testing.assert_allclose(
        np.trace(unit.blocks(), axis1=1, axis2=2), traces > 0, rtol=16 * EPS, atol=0
    )
    assert unit.parameters == problem.parameters


@pytest.fixture
def prior():
    """Prior information of full rank for the four parameters of the blocks."""
    B = np.random.default_rng(3).normal(size=(6, 4))
    return B.T @ B


def test_prior_counts_with_the_sum_of_the_weights(blocks, prior):
    """M = sum(w) M0 + sum w_i M_i, of few weights and of all, and of equal ones in the mean."""
    alone = Problem(blocks)
    beside = Problem(blocks, prior=prior)
    for w in (np.arange(7.0), np.eye(7)[2], np.full(7, 1 / 7)):
        expected = alone.information(w) + w.sum() * prior
        np.testing.assert_allclose(beside.information(w), expected, rtol=1e-13)
    np.testing.assert_allclose(beside.mean, alone.mean + prior, rtol=1e-13)


def test_prior_counts_in_every_sensitivity(blocks, prior):
    """Each sensitivity is <Z, M0 + M_i>, so that weights of sum one have sum w_i s_i = <Z, M>."""
    problem = Problem(blocks, prior=prior)
    Z = np.random.default_rng(2).normal(size=(2, 4, 4))
    Z = Z + np.swapaxes(Z, -1, -2)
    w = np.random.default_rng(4).dirichlet(np.ones(7))
    expected = np.einsum("rij,ij->r", Z, problem.information(w))
    np.testing.assert_allclose(problem.sensitivities(Z) @ w, expected, rtol=1e-11)
    assert problem.sensitivities(Z[:0]).shape == (0, 7)


@pytest.mark.parametrize("with_prior", [False, True])
@pytest.mark.parametrize("as_rows", [False, True])
def test_largest_sensitivities(prior, with_prior, as_rows, monkeypatch):
    """They are those of `sensitivities`, however many candidates are priced at a time."""
    monkeypatch.setattr(packed_information, "PACKED_AT_ONCE", 7)
    rows = np.random.default_rng(5).normal(size=(30, 2, 4))
    problem = Problem(rows, prior=prior if with_prior else None)
    if not as_rows:
        problem = Problem.of_information(problem.packed, prior=problem.prior)
    Z = np.random.default_rng(2).normal(size=(3, 4, 4))
    Z = Z + np.swapaxes(Z, -1, -2)
    expected = problem.sensitivities(Z).max(axis=1)
    np.testing.assert_allclose(problem.largest_sensitivities(Z), expected, rtol=1e-12)
    assert problem.largest_sensitivities(Z[:0]).shape == (0,)


def test_prior_is_no_part_of_a_candidate(blocks, prior):
    """Packed information, blocks and factors are those of the candidates alone, to the last bit."""
    alone = Problem(blocks)
    beside = Problem(blocks, prior=prior)
    np.testing.assert_array_equal(beside.packed, alone.packed)
    np.testing.assert_array_equal(beside.blocks(), alone.blocks())
    np.testing.assert_array_equal(beside.factors(), alone.factors())


def test_candidates_of_unit_trace_absorb_the_prior(blocks, prior):
    """Scaled candidates are (M0 + M_i)/trace(M0 + M_i), and nothing remains beside them."""
    unit = Problem(blocks, prior=prior).with_unit_trace()
    expected = Problem(blocks).blocks() + prior
    expected = expected / np.trace(expected, axis1=1, axis2=2)[:, None, None]
    assert unit.prior is None
    np.testing.assert_allclose(unit.blocks(), expected, rtol=1e-13)


def test_prior_may_identify_what_no_candidate_excites(blocks, prior):
    """Candidates that leave a direction open are enough beside prior information of full rank."""
    blocks[..., 1] = 0.0
    with pytest.raises(RankDeficientError):
        Problem(blocks).require_identifiable()
    Problem(blocks, prior=prior).require_identifiable()


@pytest.mark.parametrize("wrong", [np.full((4, 4), np.nan), -np.eye(4), np.triu(np.ones((4, 4)))])
def test_a_prior_is_information(blocks, wrong):
    """A prior that no measurements can have is rejected, in rows and in packed information."""
    packed = Problem(blocks).packed
    with pytest.raises(ValueError, match="the prior must be finite, symmetric and positive"):
        Problem(blocks, prior=wrong)
    with pytest.raises(ValueError, match="the prior must be finite, symmetric and positive"):
        Problem.of_information(packed, prior=wrong)


def test_shape_of_the_prior(blocks):
    """A prior for another number of parameters is rejected."""
    with pytest.raises(ValueError, match=r"the prior must be \(4, 4\), not \(3, 3\)"):
        Problem(blocks, prior=np.eye(3))


def test_some_candidates_and_others(blocks, prior):
    """Indexing chooses candidates, a sum puts them side by side, and both keep names and prior."""
    problem = Problem(blocks, parameters=("a", "b", "c", "d"), prior=prior)
    both = problem[np.array([4, 1])] + problem[np.array([6])]
    np.testing.assert_array_equal(both.packed, problem.packed[:, [4, 1, 6]])
    assert both.parameters == problem.parameters
    np.testing.assert_array_equal(both.prior, prior)


def test_parameters_have_names(blocks):
    """Parameters are k1 .. kp unless named; a wrong number of names is rejected."""
    assert Problem(blocks).parameters == ("k1", "k2", "k3", "k4")
    assert Problem(blocks, parameters=("a", "b", "c", "d")).parameters == ("a", "b", "c", "d")
    with pytest.raises(ValueError, match="3 names for 4 parameters"):
        Problem(blocks, parameters=("a", "b", "c"))


def test_non_finite_block_is_named(blocks):
    """The message names the first block with an entry that is not finite."""
    blocks[[3, 5], 1, 2] = np.inf, np.nan
    with pytest.raises(ValueError, match="block 3 "):
        Problem(blocks)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_non_finite_information_is_named(blocks, value):
    """So it is for packed information, wherever in the triangle the entry is."""
    for row in (0, 4, 9):
        packed = Problem(blocks).packed.copy()
        packed[row, 5:] = value
        with pytest.raises(ValueError, match="block 5 "):
            Problem.of_information(packed)


def test_block_whose_information_overflows_is_named(blocks):
    """A finite block whose square is not finite is rejected by name, without a warning."""
    blocks[4] *= 1e200
    with pytest.raises(ValueError, match="block 4 has an entry that is too large to be squared"):
        Problem(blocks)


@pytest.mark.parametrize("shape", [(3, 4), (0, 3, 4), (7, 3, 0), (7, 0, 4), (7,)])
def test_shape(shape):
    """Anything but a non-empty array of three axes is rejected."""
    with pytest.raises(ValueError, match="blocks must be"):
        Problem(np.ones(shape))


@pytest.mark.parametrize("shape", [(10,), (10, 0), (0, 7), (10, 7, 1)])
def test_shape_of_information(shape):
    """Packed information that is not a non-empty array of two axes is rejected."""
    with pytest.raises(ValueError, match="packed information must be"):
        Problem.of_information(np.ones(shape))


@pytest.mark.parametrize("length", [2, 4, 5, 11])
def test_information_that_is_no_triangle(length):
    """Packed information of a length that no upper triangle has is rejected."""
    with pytest.raises(ValueError, match=f"{length} entries"):
        Problem.of_information(np.ones((length, 7)))


@pytest.mark.parametrize("sigma", [0.0, -1.0, np.nan, np.inf, [1.0, 1.0, 0.0]])
def test_sigma(blocks, sigma):
    """Noise that is not finite and positive is rejected."""
    with pytest.raises(ValueError, match="sigma must be"):
        Problem(blocks, sigma)


@pytest.mark.parametrize("scale", [1e-7, 1.0, 1e4])
@pytest.mark.parametrize(
    ("columns", "named"),
    [
        ([X, 0 * X, X**2], "k2"),
        ([X, X, X**2], "k1 - k2"),
        ([X, 2 * X, X**2], "k1 - 0.5 k2"),
        ([X, -X, X**2], "k1 + k2"),
        ([0 * X, X, 0 * X], "k1 or k3"),
        ([1 + X, 1 + 0 * X, X], "k1 - k2 - k3"),
    ],
    ids=["unexcited", "equal", "proportional", "opposite", "two", "three"],
)
def test_rank_deficient_candidates_name_the_directions(columns, named, scale):
    """The message names the directions that no candidate excites, in any unit."""
    problem = Problem(scale * np.column_stack(columns)[:, None, :])
    with pytest.raises(
        RankDeficientError, match=f"no candidate excites {named.replace('+', '[+]')}$"
    ):
        problem.require_identifiable()


def test_directions_are_named_in_the_parameters_units():
    """The open direction (1, -1/2) of (x, 2 x) is named in the parameters' units and names."""
    T = np.array([1e-7, 1e4, 1.0])
    rows = np.column_stack([X, 2 * X, X**2]) * T
    with pytest.raises(RankDeficientError, match=r"excites a - 5e-12 b$"):
        Problem(rows[:, None, :], parameters=("a", "b", "c")).require_identifiable()


@pytest.mark.parametrize("spread", [0.0, 7.0, 20.0])
def test_units_make_no_candidates_deficient(blocks, spread):
    """Candidates of full rank pass in units of twice `spread` decades, and with duplicates."""
    units = 10.0 ** np.linspace(-spread, spread, 4)
    Problem(blocks * units).require_identifiable()
    Problem(np.repeat(blocks * units, 3, axis=0)).require_identifiable()


@pytest.mark.slow
def test_example():
    """The example in the docstring runs and prints what it says."""
    result = doctest.testmod(import_module("edtk.design.problem"))
    assert result.attempted > 0
    assert result.failed == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"blocks": np.ones((4, 2))}, r"not of shape \(4, 2\); X\[:, None, :\] has one row"),
        ({"blocks": np.ones((4, 1, 2), complex)}, "must be real numbers"),
        (
            {"blocks": np.ones((4, 1, 2)), "sigma": [1, 2]},
            "for each of 1 rows, or of 4 candidates, not",
        ),
        ({"blocks": np.ones((4, 1, 2)), "parameters": ("a", "a")}, "have the name 'a'"),
    ],
)
def test_arrays_that_newcomers_give(arguments, message):
    """What is wrong is said in words of the problem, and not of a library."""
    with pytest.raises(ValueError, match=message):
        Problem(**arguments)
