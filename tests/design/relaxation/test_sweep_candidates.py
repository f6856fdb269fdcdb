"""One pass over candidates that do not fit in memory."""

import numpy as np
import pytest
from designs import KR270

from criteria import create
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.search_continuum import most_sensitive, sweep_candidates


@pytest.mark.parametrize("name", ["D", "O2"])
@pytest.mark.parametrize("keep", [10, 500])
def test_the_same_as_all_at_once(name, keep, monkeypatch):
    """Chunk by chunk the largest sensitivities and the best candidates are those of all."""
    monkeypatch.setattr("edtk.design.candidate_source.CHUNK", 512)
    criterion = create(name)
    source = CandidateSource(KR270, 3, workers=1)
    whole = source.take(3000)
    M = normalised(whole.problem, criterion).mean
    Z = np.stack([-criterion.gradient(M), np.diag([1.0, -1, 1, 0, 0]) / np.diag(M)])
    largest, kept = sweep_candidates(source, 3000, criterion, Z, keep)
    sensitivities = normalised(whole.problem, criterion).sensitivities(Z)
    np.testing.assert_allclose(largest.values, sensitivities.max(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(largest.x, whole.x[sensitivities.argmax(axis=1)])
    best = np.unique(np.argsort(-sensitivities, axis=1)[:, :keep])
    order = np.lexsort(kept.x.T)
    expected = whole.x[best]
    np.testing.assert_array_equal(kept.x[order], expected[np.lexsort(expected.T)])
    np.testing.assert_array_equal(kept.problem.packed, KR270.problem(kept.x).packed)


def test_most_sensitive():
    """The best of each row are chosen once, and the least of each row's choice is told."""
    sensitivities = np.array([[5.0, 1.0, 4.0, 2.0], [0.0, 9.0, 8.0, 1.0]])
    chosen, least = most_sensitive(sensitivities, 2)
    assert chosen.tolist() == [0, 1, 2]
    assert least.tolist() == [4.0, 8.0]
    chosen, least = most_sensitive(sensitivities, 10)
    assert chosen.tolist() == [0, 1, 2, 3]
    assert least.tolist() == [1.0, 0.0]
