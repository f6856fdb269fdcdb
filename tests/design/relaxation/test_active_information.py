"""Information of the active candidates: the same from whole matrices and from rows."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from criteria.linalg.typing import triangle
from edtk.design.problem import Problem, several_models
from edtk.design.relaxation import master_equations as active_information
from edtk.design.relaxation.master_equations import ActiveInformation
from edtk.design.relaxation.proof import experiment_blocks


@pytest.mark.parametrize("small", [0, 12], ids=["rows", "blocks"])
@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("with_prior", [False, True])
def test_formulas(monkeypatch, small, rows, with_prior):
    """Information, sensitivities and triangles are those of the matrices, the prior included."""
    monkeypatch.setattr(active_information, "SMALL_ORDER", small)
    monkeypatch.setattr(active_information, "CHUNK", 40)
    rng = np.random.default_rng(rows)
    p = 4
    prior = np.diag([1.0, 2.0, 0.0, 3.0]) if with_prior else None
    problem = Problem(rng.normal(size=(30, rows, p)), prior=prior)
    active = np.array([3, 17, 5, 29, 8])
    found = ActiveInformation.of(problem, active)
    blocks = experiment_blocks(problem, active)
    weights = rng.uniform(size=5)
    Z = rng.normal(size=(p, p))
    Z = Z + Z.T
    T = rng.normal(size=(p, p))
    scale = rng.uniform(size=10)
    np.testing.assert_allclose(
        found.information(weights), np.tensordot(weights, blocks, axes=1), rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(found.sensitivities(Z), np.einsum("kij,ij->k", blocks, Z))
    turned = (T.T @ blocks @ T)[:, *triangle(p)].T
    np.testing.assert_allclose(
        found.triangles(T, scale), scale[:, None] * turned, rtol=1e-11, atol=1e-11
    )


def test_columns_of_different_models_tell_nothing_together():
    """Triangles that are told are the others' too, in their order; columns may be of one model."""
    rng = np.random.default_rng(0)
    models = [Problem(rng.normal(size=(9, 1, p))) for p in (2, 3)]
    found = ActiveInformation.of(several_models(models), np.arange(9))
    T = block_diag(rng.normal(size=(2, 2)), rng.normal(size=(3, 3)))[:, rng.permutation(5)]
    scale = rng.uniform(size=15)
    whole = found.triangles(T, scale)
    told = found.told_triangles(T, scale)
    assert len(told) == 3 + 6
    np.testing.assert_array_equal(told, whole[whole.any(axis=1)])
    dense = rng.normal(size=(5, 5))
    np.testing.assert_array_equal(found.told_triangles(dense, scale), found.triangles(dense, scale))
