"""Candidates: poses stay with their information."""

import numpy as np
from designs import KR270

from edtk.design.candidate_source import CandidateSource


def test_some_of_them_and_others():
    """Indexing keeps poses with their information, and a sum has those of both, in order."""
    a, b = (CandidateSource(KR270, seed).take(5) for seed in (0, 1))
    chosen = np.array([3, 0])
    both = a[chosen] + b
    np.testing.assert_array_equal(both.x, np.concatenate([a.x[chosen], b.x]))
    expected = KR270.problem(both.x).blocks()
    np.testing.assert_allclose(
        both.problem.blocks(), expected, rtol=0, atol=1e-12 * np.abs(expected).max()
    )
    assert both.problem.parameters == KR270.model.parameters
