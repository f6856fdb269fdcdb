"""One pass over candidates that do not fit in memory."""

import numpy as np
import pytest
from designs import KR270

from criteria import create
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.search_continuum import most_sensitive, sweep_candidates
from edtk.system.workers import Workers


@pytest.mark.parametrize("name", ["D", "O2"])
@pytest.mark.parametrize("keep", [10, 500])
def test_the_same_as_all_at_once(name, keep, monkeypatch):
    """Chunk by chunk the largest sensitivities and the best candidates are those of all."""
    monkeypatch.setattr("edtk.design.candidate_source.SAMPLES_AT_ONCE", 512)
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


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_stretches_are_the_same_candidates(sampling, monkeypatch):
    """What workers bring back of their stretches is, bit by bit, what one pass keeps of all."""
    monkeypatch.setattr("edtk.design.candidate_source.SAMPLES_AT_ONCE", 256)
    monkeypatch.setattr("edtk.design.relaxation.search_continuum.STRETCH", 3)
    monkeypatch.setattr(Workers, "_run_in_parallel", in_turn)
    criterion = create("D")
    source = CandidateSource(KR270, 3, sampling, workers=1)
    Z = np.stack([-criterion.gradient(normalised(source.take(500).problem, criterion).mean)])
    one = sweep_candidates(source, 3001, criterion, Z, 20)
    two = sweep_candidates(source, 3001, criterion, Z, 20, Workers(2))
    np.testing.assert_array_equal(one[1].x, two[1].x)
    np.testing.assert_array_equal(one[0].values, two[0].values)
    np.testing.assert_array_equal(one[0].x, two[0].x)


def in_turn(workers, pieces):
    """Answers in another order than that of the pieces."""
    return reversed([(i, piece()) for i, piece in enumerate(pieces)])
