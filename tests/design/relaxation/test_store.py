"""Certificates of relaxations are judged as an enemy would write them."""

import json
from collections.abc import Iterator
from copy import deepcopy

import numpy as np
import pytest

import criteria
import edtk
from edtk.design.relaxation.relaxation import Relaxation

CUBIC = edtk.Problem(np.vander(np.linspace(300, 310, 21), 4, increasing=True)[:, None, :])
BLOCKS = edtk.Problem(np.random.default_rng(5).normal(size=(12, 2, 3)))
MADE = {"cubic": (CUBIC, "A"), "blocks": (BLOCKS, "D"), "worst": (BLOCKS, "E")}
every = pytest.mark.parametrize("case", MADE)
WRONG = (None, True, "x", -1, 10**30, 1e300, float("nan"), float("inf"), [], {}, [[]], [1, [2]])


def certificate(case):
    """A problem, its relaxation, and the certificate as JSON brings it back."""
    problem, name = MADE[case]
    found = edtk.relax(problem, name)
    return problem, found, json.loads(json.dumps(found.to_dict()))


def places(data, path=()) -> Iterator[tuple]:
    """All places of nested tables and lists."""
    keys = data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    for key in keys:
        yield (*path, key)
        yield from places(data[key], (*path, key))


def changed(data, path, value):
    """A copy with another value at a place; without the place where the value is `...`."""
    copy = deepcopy(data)
    inside = copy
    for key in path[:-1]:
        inside = inside[key]
    if value is ...:
        del inside[path[-1]]
    else:
        inside[path[-1]] = value
    return copy


@every
def test_round_trip(case):
    """A certificate brings back weights, cost and bound."""
    problem, found, data = certificate(case)
    again = Relaxation.from_dict(data, problem)
    np.testing.assert_array_equal(again.weights, found.weights)
    assert again.cost == pytest.approx(found.cost, rel=1e-10)
    assert again.proved_bound.cost == pytest.approx(found.proved_bound.cost, rel=1e-9)


@every
def test_forged_certificates_prove_nothing_wrong(case):
    """Any place changed, or left out: one line, or a cost and a bound that are true."""
    problem, found, data = certificate(case)
    best = found.cost
    rng = np.random.default_rng(1)
    paths = list(places(data))
    rejected = []
    for path in (paths[i] for i in rng.permutation(len(paths))[:60]):
        for value in (..., WRONG[rng.integers(len(WRONG))], WRONG[rng.integers(len(WRONG))]):
            try:
                with np.errstate(all="ignore"):
                    again = Relaxation.from_dict(changed(data, path, value), problem)
            except ValueError as error:
                rejected.append(str(error))
                continue
            if again.criterion.name == found.criterion.name:
                assert again.proved_bound.cost <= best * (1 + 1e-9)
                assert again.cost >= found.proved_bound.cost * (1 - 1e-9)
    assert len(rejected) > 60
    assert not any("\n" in message for message in rejected)


def test_other_candidates_are_found_out():
    """A certificate is about the candidates whose hash it has."""
    _, _, data = certificate("blocks")
    other = edtk.Problem(BLOCKS.factors() * (1 + 1e-15 + np.eye(2)[0][:, None] * 1e-9))
    with pytest.raises(ValueError, match="about other candidates"):
        Relaxation.from_dict(data, other)


@pytest.mark.parametrize(
    "weights",
    [
        {"candidate": [0, 0], "weight": [0.5, 0.5]},
        {"candidate": [-1], "weight": [1.0]},
        {"candidate": [12], "weight": [1.0]},
        {"candidate": [0, 1], "weight": [1.0]},
        {"candidate": [True, False], "weight": [0.5, 0.5]},
        {"candidate": [0.0], "weight": [1.0]},
    ],
)
def test_weights_of_no_candidate(weights):
    """Candidates are numbers from zero, once each, with a weight each."""
    problem, _, data = certificate("blocks")
    with pytest.raises(ValueError, match="from 0 to 11, once each"):
        Relaxation.from_dict({**data, "weights": weights}, problem)


def test_sensitivities_keep_their_digits():
    """Of a cubic on [300, 310] the support has the largest sensitivity, to ten digits."""
    found = edtk.relax(CUBIC, criteria.create("A"))
    sensitivities = found.sensitivities(CUBIC)[0]
    top = sensitivities.max()
    np.testing.assert_allclose(sensitivities[found.support], top, rtol=1e-5)
    assert found.weights @ sensitivities == pytest.approx(top, rel=1e-8)
