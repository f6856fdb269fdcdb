"""Descents where instruments are read in some poses only."""

import numpy as np
import pytest

from criteria import create
from edtk import Study
from edtk.design.candidate_source import CandidateSource
from edtk.design.interior_point.held import holding, with_fewer
from edtk.design.interior_point.objective import Neighbourhood
from edtk.design.relaxation.search_continuum import ascend
from edtk.design.relaxation.settle import WeightedSpace, _PricedCost
from edtk.system.typing import Array

STUDY = Study(
    robot="kuka_kr270",
    tool={"position_mm": [611.5, 0, -460]},
    load={"F_N": [0, 0, -2500]},
    measurement={},
    joints={"unknown": ["q2", "q3", "q4"], "fixed_deg": {"q1": 0}},
    noise={"tracker_position_mm": [4500, 2500, 1200], "along": [10, 0.4], "across": [15, 6]},
    marker=[
        {"name": "a", "position_mm": [0, 100, 0], "normal": [0, 1, 0], "acceptance_deg": 60},
        {"name": "b", "position_mm": [50, 0, 100], "normal": [1, 0, 0], "acceptance_deg": 80},
    ],
)
SIGHT = STUDY.sight
X = CandidateSource(STUDY.space, 0, workers=1).take(40).x
Z = np.eye(3)


def worth(x: Array) -> Array:
    """Sensitivities of experiments to a unit multiplier."""
    return np.asarray(np.square(STUDY.space.at(x).regressor).sum(axis=(-1, -2)))


@pytest.mark.slow
def test_a_descent_reads_what_its_start_reads() -> None:
    """Ends are no worse than starts, read all that these do, and often stand where a marker would
    be lost: beyond that bound the way would lead uphill, and down at the switch.
    """
    assert SIGHT is not None
    scale = worth(X).max()
    ends = ascend(STUDY.space, X, np.tile(Z / scale, (len(X), 1, 1)), steps=40)
    assert (worth(ends) >= worth(X) * (1 - 1e-9)).all()
    before, after = SIGHT.seen(X[:, :6]), SIGHT.seen(ends[:, :6])
    assert (after >= before).all()
    reading = before.any(axis=1)
    assert (worth(ends) > 1.2 * worth(X))[reading].mean() > 0.9
    every = STUDY.space.at(ends, np.moveaxis(before, -1, 0)).slack
    assert (every >= 0).all()
    assert (every.min(axis=1)[reading] < 1e-4).any()


def test_the_set_that_counts_is_a_variable() -> None:
    """Experiments that hold what they read tell what they do, and all of their sums decode."""
    assert SIGHT is not None
    space, held = holding(STUDY.space, X)
    np.testing.assert_array_equal(held[:, :-1], X)
    np.testing.assert_array_equal(held[:, -1], SIGHT.seen(X[:, :6]) @ [1, 2])
    np.testing.assert_array_equal(space.at(held).regressor, STUDY.space.at(X).regressor)
    fewer = with_fewer(STUDY.space, X)
    assert fewer is not None
    less, begun, of = fewer
    both = SIGHT.seen(X[:, :6]).all(axis=1)
    np.testing.assert_array_equal(np.unique(of), np.flatnonzero(both))
    assert set(begun[:, -1]) == {1, 2}
    own = np.square(less.at(begun).regressor).sum(axis=(-1, -2))
    parts = np.bincount(of, own, len(X))[both]
    np.testing.assert_allclose(parts, worth(X)[both])


def test_slopes_of_the_slack_are_those_of_what_is_held() -> None:
    """Conditions of markers that are not held do not count, and the others have their slopes."""
    space, held = holding(STUDY.space, X)
    found = space.at(held).slack_gradient
    for j in space.movable:
        step = 1e-6 * np.eye(held.shape[1])[j]
        up, down = (space.at(held + s * step).slack for s in (1, -1))
        np.testing.assert_allclose(found[..., j], (up - down) / 2e-6, atol=1e-6)


def test_weights_beside_what_is_read_cost_the_same_with_and_without_derivatives() -> None:
    """The variable that says what is read stands behind the weights, and is no weight."""
    chosen = X[:5]
    weighted = WeightedSpace(STUDY.space, len(chosen))
    design = np.concatenate([chosen, np.full((5, 1), 0.2)], axis=1)
    space, held = holding(weighted, design[None])
    objective = _PricedCost(create("D"), np.full((1, 5), 0.2), unit=3.0)
    first = np.array([0])
    value = objective.value(space.at(held), first)
    np.testing.assert_allclose(objective.local(Neighbourhood(space, held), first).value, value)
    np.testing.assert_allclose(objective.value(weighted.at(design[None]), first), value)
