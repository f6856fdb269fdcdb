"""The largest sensitivity to each of several multipliers, and where it was found."""

import json

import numpy as np
import pytest
from designs import KR270

from criteria import create
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.search_continuum import LargestSensitivities


def test_of():
    """Each multiplier has its own largest one, with the experiment that has it."""
    sensitivities = np.array([[1.0, 3.0, 2.0], [5.0, -1.0, 0.0]])
    x = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])
    largest = LargestSensitivities.of(sensitivities, x)
    assert largest.values.tolist() == [3.0, 5.0]
    np.testing.assert_array_equal(largest.x, x[[1, 0]])


@pytest.mark.parametrize("name", ["A", "O2"])
def test_over(name):
    """Sensitivities are those of the normalised problem, as for bounds."""
    criterion = create(name)
    candidates = CandidateSource(KR270, 0, workers=1).take(50)
    Z = np.stack([np.eye(5), np.linalg.inv(candidates.problem.mean)])
    largest = LargestSensitivities.over(candidates, criterion, Z)
    expected = normalised(candidates.problem, criterion).sensitivities(Z)
    np.testing.assert_array_equal(largest.values, expected.max(axis=1))
    np.testing.assert_array_equal(largest.x, candidates.x[expected.argmax(axis=1)])


def test_or_larger():
    """Of two the larger one wins, multiplier by multiplier, with its experiment."""
    one = LargestSensitivities(np.array([1.0, 5.0]), np.array([[1.0], [2.0]]))
    other = LargestSensitivities(np.array([3.0, 4.0]), np.array([[3.0], [4.0]]))
    for a, b in ((one, other), (other, one)):
        assert a.or_larger(b).values.tolist() == [3.0, 5.0]
        assert a.or_larger(b).x.tolist() == [[3.0], [2.0]]


def test_dictionary():
    """JSON gives the same numbers again, to the last bit."""
    rng = np.random.default_rng(0)
    largest = LargestSensitivities(rng.normal(size=3), rng.normal(size=(3, 6)))
    again = LargestSensitivities.from_dict(json.loads(json.dumps(largest.to_dict())))
    np.testing.assert_array_equal(again.values, largest.values)
    np.testing.assert_array_equal(again.x, largest.x)
