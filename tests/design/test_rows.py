"""Candidates kept as rows: the same numbers as their information gives, in less memory."""

import numpy as np
import pytest

from edtk.design.information import Rows
from edtk.design.problem import Problem

EPS = np.finfo(float).eps
SHAPES = pytest.mark.parametrize("shape", [(9, 1, 5), (9, 3, 5), (9, 5, 5), (9, 8, 5)], ids=str)


def both(shape, prior=None):
    """The same random candidates, kept as rows and kept as packed information."""
    rows = Problem(np.random.default_rng(1).normal(size=shape), prior=prior)
    return rows, Problem.of_information(rows.packed, prior=prior)


def close(found, expected):
    """Check that arrays agree to a hundred roundings of the largest entry."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=100 * EPS * np.abs(expected).max())


@SHAPES
def test_every_method_agrees_with_packed_information(shape):
    """Information, means, plans, sensitivities and unit traces are those of packed triangles."""
    rng = np.random.default_rng(2)
    B = rng.normal(size=(6, 5))
    for prior in (None, B.T @ B):
        rows, packed = both(shape, prior)
        w = rng.dirichlet(np.ones(9))
        places = rng.integers(9, size=(4, 3))
        times = rng.integers(1, 4, size=(4, 3)).astype(float)
        close(rows.information(w), packed.information(w))
        close(rows.mean, packed.mean)
        close(rows.plan_information(places, times), packed.plan_information(places, times))
        close(rows.with_unit_trace().blocks(), packed.with_unit_trace().blocks())
        for chosen in ([2, 0], slice(3, 8), w > 0.1, np.array([[1, 2], [3, 3]])):
            close(rows.blocks(chosen), packed.blocks(chosen))
            U = rows.factors(chosen)
            close(np.swapaxes(U, -1, -2) @ U, packed.blocks(chosen))


@SHAPES
def test_sensitivities_to_any_symmetric_multiplier(shape):
    """Semidefinite, indefinite, singular and zero multipliers give <Z, M_i> alike."""
    rows, packed = both(shape)
    V = np.linalg.qr(np.random.default_rng(3).normal(size=(5, 5)))[0]
    spectra = [[1, 2, 3, 4, 5], [1, -2, 3, -4, 0], [0, 0, 0, 0, 7], [0, 0, 0, 0, 0]]
    Z = np.array([V * np.array(values, dtype=float) @ V.T for values in spectra])
    Z = 0.5 * (Z + np.swapaxes(Z, 1, 2))
    found = rows.sensitivities(Z)
    assert found.shape == (4, 9)
    close(found, packed.sensitivities(Z))
    close(rows.sensitivities(Z.reshape(2, 2, 5, 5)), found.reshape(2, 2, 9))
    assert rows.sensitivities(Z[:0]).shape == (0, 9)
    B = np.random.default_rng(4).normal(size=(5, 2))
    close(rows.sensitivities_to_root(B), rows.sensitivities(B @ B.T))
    close(packed.sensitivities_to_root(B), rows.sensitivities(B @ B.T))


def test_sensitivities_in_bad_units_and_in_many_chunks():
    """Units of twenty decades cost no digit, and long lists are cut at any candidate."""
    rng = np.random.default_rng(4)
    A = rng.normal(size=(30_001, 2, 3))
    units = np.array([1e-10, 1.0, 1e10])
    F = rng.normal(size=(3, 3))
    expected = np.square(A @ F.T).sum(axis=(1, 2))
    root = (F / units).T
    kept = Rows(A * units)
    np.testing.assert_allclose(kept.sensitivities_to_root(root), expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(kept.sensitivities(root @ root.T), expected, rtol=1e-12, atol=1e-13)


def test_triangles_in_chunks(monkeypatch):
    """Packed information is the same, however many candidates are turned into it at once."""
    kept = Rows(np.random.default_rng(7).normal(size=(23, 2, 4)))
    whole = kept.packed()
    monkeypatch.setattr("edtk.design.information.ROWS_AT_ONCE", 5 * 16)
    np.testing.assert_array_equal(kept.packed(), whole)


def test_rank_one_rows_need_the_memory_of_rows_alone():
    """A row of thirty parameters is thirty numbers, and nothing computed from it stays."""
    A = np.random.default_rng(5).normal(size=(50, 1, 30))
    problem = Problem(A)
    problem.sensitivities(problem.mean)
    kept = [v for v in vars(problem.kept).values() if isinstance(v, np.ndarray)]
    assert sum(v.size for v in kept) == 50 * 30


def test_sums_of_candidates_with_different_numbers_of_rows():
    """Candidates of one row and of three, or of packed information, stand side by side."""
    rng = np.random.default_rng(6)
    one = Problem(rng.normal(size=(2, 1, 4)))
    three = Problem(rng.normal(size=(3, 3, 4)))
    expected = np.concatenate([one.blocks(), three.blocks()])
    close((one + three).blocks(), expected)
    close((one + Problem.of_information(three.packed)).blocks(), expected)


def test_the_callers_array_may_change():
    """A problem keeps its own copy of the rows."""
    A = np.ones((3, 1, 2))
    problem = Problem(A)
    A[:] = 7
    np.testing.assert_array_equal(problem.mean, np.ones((2, 2)))
