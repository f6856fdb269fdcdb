"""Plans at random: within the limits, and with the chances that were asked for."""

import numpy as np
import pytest

from edtk.design.exact.counts.counts_search import Record, draw_places, kicked
from edtk.design.exact.counts.limits import Limits

N = 12
NO_BASE = np.zeros((2, 2))
COSTS = np.linspace(1.0, 3.0, N)
MOST = np.array([0, 1, 2] * 4)
LIMITS = {
    "most": Limits(5, NO_BASE, most=MOST),
    "costs and size": Limits(5, NO_BASE, costs=COSTS, funds=8.0),
    "costs": Limits(9, NO_BASE, costs=COSTS, funds=9.5, sized=False),
    "costs and most": Limits(9, NO_BASE, most=MOST, costs=COSTS, funds=9.5, sized=False),
}


@pytest.mark.parametrize("limits", LIMITS.values(), ids=LIMITS)
def test_starts_and_kicks_obey_the_limits(limits: Limits) -> None:
    """Counts, costs and the number of places hold in each plan, and plans differ."""
    rng = np.random.default_rng(0)
    drawn = draw_places(rng, limits, [np.ones(N)] * 40)
    for places in (drawn, kicked(rng, limits, drawn, N, 3)):
        counts = limits.counts(places, N)
        assert places.shape == (40, limits.m)
        assert len(np.unique(counts, axis=0)) > 5
        if limits.most is not None:
            assert (counts <= limits.most).all()
        if limits.costs is not None:
            assert (counts @ limits.costs <= limits.funds + 1e-9).all()
        assert (counts.sum(axis=1) == limits.m).all() or not limits.sized


@pytest.mark.parametrize("limits", LIMITS.values(), ids=LIMITS)
def test_what_may_take_a_place_is_what_keeps_the_limits(limits: Limits) -> None:
    """Each candidate is tried at another place of each plan, and all limits are looked at anew."""
    rng = np.random.default_rng(1)
    drawn = draw_places(rng, limits, [np.ones(N)] * 8)
    where = rng.integers(limits.m, size=8)
    allowed = limits.allowed(drawn, where, N)
    assert allowed is not None
    for i, place in enumerate(where):
        for candidate in range(N if limits.sized else N + 1):
            trial = drawn[i : i + 1].copy()
            trial[0, place] = candidate
            counts = limits.counts(trial, N)[0]
            fits = limits.most is None or bool((counts <= limits.most).all())
            if limits.costs is not None:
                fits &= bool(counts @ limits.costs <= limits.funds + 1e-9)
            assert allowed[i, candidate] == fits


def test_candidates_are_drawn_with_their_chances() -> None:
    """Of 4000 plans of one place each candidate has its share, within four standard deviations."""
    chances = np.arange(1.0, N + 1)
    limits = Limits(1, NO_BASE, costs=np.ones(N), funds=1.0)
    drawn = draw_places(np.random.default_rng(2), limits, [chances] * 4000)
    share = chances / chances.sum()
    counted = np.bincount(drawn[:, 0], minlength=N)
    spread = np.sqrt(4000 * share * (1 - share))
    assert (np.abs(counted - 4000 * share) < 4 * spread).all()


def test_optima_are_counted_by_their_costs() -> None:
    """Costs that rounding alone sets apart are of one optimum; kicks of the best do not count."""
    record = Record()
    places = np.zeros((3, 1), dtype=int)
    record.enter((np.array([1.0, 1.0 + 1e-12, 2.0]), places), True)
    record.enter((np.array([3.0, np.inf, 4.0]), places), False)
    assert (record.optima, len(record.drawn), record.starts) == (2, 3, 6)
