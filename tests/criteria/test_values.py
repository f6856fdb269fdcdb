"""Every built-in criterion against its definition by the singular values of the regressor."""

import numpy as np
import pytest

import criteria

TARGET = np.array([[1.0, 2.0, -1.0, 0.5], [0.0, 1.0, 3.0, -2.0], [2.0, 0.0, 0.0, 1.0]])


def definition(name, A, target):
    """Table 1, from the singular value decomposition A = U S V' alone."""
    _, s, Vt = np.linalg.svd(A)
    p = len(s)
    variances = ((Vt[:p].T / s) ** 2).sum(axis=1)
    return {
        "A": (s**-2.0).sum(),
        "D": np.prod(s) ** (2 / p),
        "E": s[-1] ** 2,
        "G": variances.max(),
        "O1": np.prod(s) ** (1 / p),
        "O2": s[0] / s[-1],
        "O3": s[-1],
        "O4": s[-1] ** 2 / s[0],
        "O5": (1 / s).sum(),
        "rho0": np.linalg.norm(target @ Vt[:p].T / s),
        "rho_max": np.linalg.norm(target @ Vt[:p].T / s),  # of a single task
    }[name]


BUILTINS = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0", "rho_max")


@pytest.mark.parametrize("name", BUILTINS)
def test_value_is_the_definition_by_singular_values(name):
    """The value of M = A'A is what Table 1 defines by the singular values of A.

    The condition of M is below 1e4.
    """
    rng = np.random.default_rng(0)
    for m in (4, 9, 36):
        A = rng.normal(size=(m, 4)) @ np.diag([1.0, 2.0, 3.0, 0.5])
        assert np.linalg.cond(A) < 1e2
        value = criteria.create(name, target=TARGET).value(A.T @ A)
        np.testing.assert_allclose(value, definition(name, A, TARGET), rtol=1e-9)


@pytest.mark.parametrize("name", BUILTINS)
def test_a_single_parameter(name):
    """With one parameter and s = 3 every criterion is a plain power of s, and O2 is one."""
    expected = {
        "A": 1 / 9,
        "D": 9,
        "E": 9,
        "G": 1 / 9,
        "O1": 3,
        "O2": 1,
        "O3": 3,
        "O4": 3,
        "O5": 1 / 3,
        "rho0": 5 / 3,
        "rho_max": 5 / 3,
    }
    value = criteria.create(name, target=[[3.0], [4.0]]).value([[9.0]])
    np.testing.assert_allclose(value, expected[name], rtol=1e-14)


def test_d_is_the_root_of_the_determinant():
    """D is det(M)**(1/p), so that doubling the measurements doubles it."""
    assert criteria.create("D").value(np.diag([4.0, 9.0])) == pytest.approx(6.0, rel=1e-14)
    M = np.diag([1.0, 2.0, 4.0])
    assert criteria.create("D").value(2 * M) == pytest.approx(2 * 8 ** (1 / 3), rel=1e-14)


def test_d_survives_a_determinant_that_underflows():
    """The p-th root is taken of the logarithm, so that tiny or huge determinants do no harm."""
    for scale in (1e-100, 1e100):
        assert criteria.create("D").value(scale * np.eye(6)) == pytest.approx(scale, rel=1e-12)


def test_reading_of_table_1():
    """O3 is maximised although it is printed "min"; O2 and O5 are minimised; G reads diag(cov)."""
    senses = {name: criteria.get(name).sense for name in BUILTINS}
    assert [n for n in BUILTINS if senses[n] == "min"] == ["A", "G", "O2", "O5", "rho0", "rho_max"]
    assert criteria.create("G").value(np.diag([4.0, 10.0])) == pytest.approx(0.25)
