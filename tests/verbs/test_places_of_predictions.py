"""Criteria about predictions that do not say where these are: at all places of the model."""

import numpy as np
import pytest

import criteria
import edtk

CUBIC = edtk.Region(lambda x: np.vander(x[:, 0], 4), [-1], [1])
CANDIDATES = np.linspace(0.1, 10, 40)
ENZYME = "V * x / (K + x)"


def test_the_largest_prediction_over_a_region_is_that_of_kiefer_and_wolfowitz():
    """The optimum of D has the variance p on all of the interval, at its four points most."""
    of_D = edtk.relax(CUBIC, criterion="D")
    for asked in (None, ["prediction_G"]):
        told = edtk.compare({"D": of_D}, criteria=asked).to_frame()
        assert told["prediction_G"].item() == pytest.approx(4, rel=1e-6)
        assert told["efficiency prediction_G"].item() == pytest.approx(1, rel=1e-6)


@pytest.mark.parametrize("outer", ["compound", "minimax"])
@pytest.mark.parametrize("model", [CUBIC, edtk.Problem(np.vander(CANDIDATES, 3)[:, None])])
def test_a_part_that_does_not_say_where_is_the_criterion_alone(outer, model):
    """A bare I within another criterion predicts where a bare I does."""
    asked = {"name": outer, "criteria": ["D", {"name": "I"}]}
    if isinstance(model, edtk.Region):
        points, weights = model.mean_over_points()
        own = criteria.create("I", points=points, weights=weights)
    else:
        own = criteria.create("I", points=model.factors())
    stated = criteria.create(outer, criteria=["D", own])
    assert edtk.relax(model, asked).value == edtk.relax(model, stated).value


@pytest.mark.parametrize("is_region", [False, True], ids=["candidates", "region"])
def test_predictions_over_ranges_are_those_of_each_theta(is_region):
    """No K of a grid has a lower efficiency under its own I than the worst that is told."""
    where = {"box": {"x": (0.1, 10)}} if is_region else {"candidates": CANDIDATES}
    kind = edtk.Region if is_region else edtk.Problem
    ranges = kind.of_model(ENZYME, {"V": 1.0, "K": (0.5, 3.0)}, robust="maximin", **where)
    design = edtk.relax(ranges, criterion="I")
    told = design.weights > 0
    x = design.points[:, 0] if is_region else CANDIDATES[told]
    seen = []
    for K in np.linspace(0.5, 3.0, 6):
        alone = kind.of_model(ENZYME, {"V": 1.0, "K": K}, **where)
        best = edtk.relax(alone, criterion="I")
        rows = np.stack([x / (K + x), -x / (K + x) ** 2], axis=-1)
        M = np.einsum("n,np,nq->pq", design.weights[told], rows, rows)
        seen.append(best.cost / float(best.criterion.cost(M)))
    assert min(seen) >= design.worst.value * (1 - 1e-6)
    assert min(seen) == pytest.approx(design.worst.value, rel=1e-2)
    assert design.worst.value <= 1 / design.bound * (1 + 1e-9)


def test_designs_of_a_region_are_compared_by_the_mean_that_they_were_made_for():
    """The best weights for I over a region are the best in a comparison under I."""
    best = edtk.relax(CUBIC, criterion="I")
    told = edtk.compare({"best": best}, criteria=["I"]).to_frame()
    assert told["efficiency I"].item() == pytest.approx(1.0, rel=1e-6)
    assert told["I"].item() == pytest.approx(best.value, rel=1e-9)
