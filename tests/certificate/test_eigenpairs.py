"""The check's own eigenvalues: found where LAPACK's divide and conquer fails."""

import numpy as np
import pytest

from edtk.certificate.recompute.eigenpairs import eigenpairs


@pytest.fixture
def failing(monkeypatch):
    """Divide and conquer that never converges."""

    def eigh(M):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr(np.linalg, "eigh", eigh)


def test_a_stack_has_the_eigenpairs_of_its_matrices(failing):
    """``V diag(r) V'`` is each matrix, of any sign and of less than full rank, and V orthogonal."""
    A = np.random.default_rng(1).normal(size=(3, 30, 30))
    stack = np.stack([A[0] @ A[0].T, A[1] + A[1].T, A[2, :, :9] @ A[2, :, :9].T])
    r, V = eigenpairs(stack)
    again = (V * r[:, None]) @ np.swapaxes(V, 1, 2)
    np.testing.assert_allclose(again, stack, rtol=0, atol=1e-13 * np.linalg.norm(stack))
    np.testing.assert_allclose(np.swapaxes(V, 1, 2) @ V, np.tile(np.eye(30), (3, 1, 1)), atol=1e-13)
    np.testing.assert_allclose(r, np.linalg.eigvalsh(stack), atol=1e-12 * np.abs(stack).max())
    assert (np.diff(r) >= 0).all()


def test_what_is_not_finite_has_none(failing):
    """Its first error is what one sees."""
    with pytest.raises(np.linalg.LinAlgError, match="did not converge"):
        eigenpairs(np.full((2, 30, 30), np.nan))
