"""The search over all poses for the largest sensitivities."""

import numpy as np
import pytest
from designs import KR270

from criteria import create
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import CandidateSource, sample_feasible
from edtk.design.information import distinct
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.search_continuum import (
    _most_sensitive,
    fresh_poses,
    search_continuum,
    sensitivity_and_slope,
)

pytestmark = pytest.mark.slow

ACCURACY = 1e-6


@pytest.fixture(scope="module", params=["D", "O2"])
def case(request):
    """A criterion, candidates, and the multipliers of their optimum; two for D."""
    criterion = create(request.param)
    known = CandidateSource(KR270, 0).take(200)
    Z = relax(known.problem, criterion).multipliers
    if criterion.degree > 0:
        Z = np.concatenate([Z, -criterion.gradient(known.problem.mean)[None]])
    return criterion, known, Z


@pytest.fixture(scope="module")
def answer(case):
    """What the search finds, with fewer fresh poses and starts than a plan takes."""
    criterion, known, Z = case
    return search_continuum(KR270, criterion, Z, known, ACCURACY, fresh_poses(KR270, (0, 1)), True)


@pytest.mark.parametrize("size", [1, 7, 100, 130])
def test_starts_are_the_most_sensitive_that_differ(case, size):
    """Looked at in parts, they are those of all at once."""
    _, known, Z = case
    many = CandidateSource(KR270, 1).take(1500)
    T = range_whitener(known.problem.mean)
    values = many.problem.sensitivities(Z)[0]
    order = np.argsort(-values, kind="stable")[: 100 * size]
    chosen = distinct(many.problem.blocks(order), T, 0.3, most=size)
    found = _most_sensitive(many, values, T, size, 0.3)
    np.testing.assert_array_equal(found, many.x[order[chosen]])


def sensitivities(criterion, Z, x):
    """Sensitivities (r, n) of experiments (n, v), by the other formula for them."""
    here = KR270.at(np.broadcast_to(x, (len(Z), *x.shape)))
    return sensitivity_and_slope(here, Z, criterion.degree == 0)[0]


def test_found_poses_are_feasible_and_have_their_information(case, answer):
    """Every pose that comes back is feasible, and its information is that of its regressor."""
    largest, found = answer
    assert largest.values.shape == (len(case[2]),)
    assert KR270.workspace.contains(found.x).all()
    np.testing.assert_array_equal(found.problem.packed, KR270.problem(found.x).packed)
    assert (found.x[:, 0] == KR270.fixed[0]).all()


def test_largest_sensitivities_are_those_of_found_poses(case, answer):
    """Each largest sensitivity is that of its pose, and no known pose has a larger one."""
    criterion, known, Z = case
    largest, found = answer
    here = sensitivities(criterion, Z, found.x)
    there = sensitivities(criterion, Z, known.x)
    at_stated = np.diagonal(sensitivities(criterion, Z, largest.x))
    slip = 1e-12 * np.abs(here).max(axis=1)  # two orders of the same sums
    assert (np.abs(at_stated - largest.values) <= slip).all()
    assert (here.max(axis=1) >= largest.values - slip).all()
    assert (there.max(axis=1) <= largest.values + slip).all()
    assert (largest.values > there.max(axis=1) * (1 + 1e-3)).all()


def test_no_random_pose_is_more_sensitive(case, answer):
    """Of twenty thousand other feasible poses none has a larger sensitivity than those found."""
    criterion, _, Z = case
    random = sensitivities(criterion, Z, sample_feasible(KR270, 20_000, 99))
    assert (random.max(axis=1) <= answer[0].values).all()


def test_seeded(case, answer):
    """The seed decides what is found."""
    criterion, known, Z = case
    again, other = (
        search_continuum(KR270, criterion, Z, known, ACCURACY, fresh_poses(KR270, (0, turn)), True)
        for turn in (1, 2)
    )
    first = answer
    np.testing.assert_array_equal(first[0].values, again[0].values)
    np.testing.assert_array_equal(first[1].x, again[1].x)
    assert first[1].x.shape != other[1].x.shape or (first[1].x != other[1].x).any()
