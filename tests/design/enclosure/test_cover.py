"""Upper bounds by halving boxes, held against values."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from edtk.design.enclosure import boxes as module
from edtk.design.enclosure import stage as stage_module
from edtk.design.enclosure.boxes import (
    TENSORS_AT_ONCE,
    Boxes,
    Grid,
    Reason,
    at_once,
    coefficients,
    limits_on,
)
from edtk.design.enclosure.cover import Covering, CoveringInterrupted, cover
from edtk.design.enclosure.objective import Enclosed, Objective
from edtk.design.enclosure.polynomial import Axis, Polynomial
from edtk.system.time_limit import time_limit
from edtk.system.typing import Array

AXES = (Axis("angle", -2.5, 3.0), Axis("length", 1.0, 4.0), Axis("angle", -0.3, 1.2))


@pytest.fixture
def rng() -> np.random.Generator:
    """The same numbers each time."""
    return np.random.default_rng(7)


def enclosed(*objectives: Polynomial | Objective, slacks: tuple[Polynomial, ...] = ()) -> Enclosed:
    """A question in polynomials, where the places are the experiments."""
    all_of_them = [f if isinstance(f, Objective) else Objective(f) for f in objectives]
    axes = all_of_them[0].numerator.axes
    none = np.zeros((len(objectives), len(axes)))
    return Enclosed(axes, tuple(all_of_them), slacks, none, np.eye(len(axes)))


def drawn(rng: np.random.Generator, degrees: tuple[int, ...] = (2, 3, 1)) -> Polynomial:
    """A polynomial with random coefficients."""
    sizes = [axis.size(n) for axis, n in zip(AXES, degrees, strict=True)]
    return Polynomial(AXES, rng.normal(size=sizes))


def places(rng: np.random.Generator, n: int = 20_000, axes: tuple[Axis, ...] = AXES) -> Array:
    """Random places of the box."""
    low = np.array([axis.low for axis in axes])
    high = np.array([axis.high for axis in axes])
    return low + (high - low) * rng.random((n, len(axes)))


def largest(question: Enclosed, x: Array) -> float:
    """The largest objective of places that are feasible."""
    feasible = np.all([np.ones(len(x)), *(slack(x) >= 0 for slack in question.slacks)], axis=0)
    return float(np.max([f(x[feasible]).max() for f in question.objectives]))


def cuts(leaves: Boxes, grid: Grid) -> bool:
    """Whether boxes are disjoint and fill the domain: volumes add up, and no box has another."""
    volume = np.ldexp(1.0, -leaves.depth.sum(axis=1)).sum()
    known = {(*d, *p) for d, p in zip(leaves.depth.tolist(), leaves.place.tolist(), strict=True)}
    return bool(np.isclose(volume, grid.parts.prod(), rtol=1e-12)) and len(known) == len(leaves)


@pytest.mark.parametrize("seed", range(4))
def test_no_place_is_above_the_bound_and_one_is_near(seed: int) -> None:
    """The bound holds at twenty thousand places, and exceeds its own place by the tolerance."""
    rng = np.random.default_rng(seed)
    slack = drawn(rng, (1, 1, 1))
    question = enclosed(drawn(rng), slacks=(slack, slack * slack - 0.1))
    found = cover(question, 1e-3)
    assert largest(question, places(rng)) <= found.upper <= found.lower * 1.001 * (1 + 1e-9)
    at = found.place[None]
    assert question.objectives[0](at)[0] == pytest.approx(found.lower, rel=1e-13)
    assert all(c(at)[0] >= -1e-10 for c in question.slacks)
    assert cuts(found.leaves[0].boxes, found.grid)


@pytest.mark.parametrize("part", [0.0, 0.4, 0.7])
def test_errors_below_the_tolerance_leave_it_reached(rng: np.random.Generator, part: float) -> None:
    """What polynomials may be off is part of the bound; boxes take no more than the rest."""
    tolerance = 1e-7
    exact = drawn(rng)
    unit = cover(enclosed(exact), 1e-2).lower
    found = cover(enclosed(replace(exact, error=part * tolerance * unit)), tolerance)
    assert part * tolerance < found.upper / found.lower - 1 <= tolerance * (1 + 1e-6)


def test_the_leaves_hold_for_the_reasons_that_they_name(rng: np.random.Generator) -> None:
    """In each leaf drawn places are below its bound, infeasible, or below with its penalties."""
    slack = drawn(rng, (1, 1, 1))
    question = enclosed(drawn(rng), slacks=(slack,))
    found = cover(question, 1e-2)
    leaves = found.leaves[0]
    assert {Reason.BELOW, Reason.PENALISED} <= set(leaves.reason.tolist())
    middles, halves = found.grid.middles(leaves.boxes), found.grid.halves(leaves.boxes)
    for _ in range(5):
        x = middles + halves * rng.uniform(-1, 1, middles.shape)
        f, c = question.objectives[0](x), slack(x)
        infeasible = leaves.reason == Reason.INFEASIBLE
        assert (c[infeasible] < 0).all()
        assert (f + leaves.penalties[:, 0] * c <= leaves.bound)[~infeasible].all()


@pytest.mark.slow
def test_a_maximum_on_two_constraints_takes_few_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Factors of both together level a box around it, which one after the other do not."""
    axes = (*(Axis("length", 0.0, 1.2),) * 2, Axis("length", -1.0, 1.0))
    x, y, z = (Polynomial.variable(axes, j) for j in range(3))
    slacks = (1.3 - x - 0.5 * y - 0.2 * x * x - 0.2 * z * z, 1.3 - 0.5 * x - y - 0.3 * y * y)
    question = enclosed(x + y + 0.7 * x * y + 0.5 * z * x - z * z, slacks=slacks)
    together = cover(question, 1e-6)
    assert ((together.leaves[0].penalties > 0).sum(axis=1) == 2).any()
    assert largest(question, places(np.random.default_rng(1), axes=axes)) <= together.upper
    monkeypatch.setattr(stage_module.Penalised, "join", lambda self, cut: None)
    assert together.boxes < cover(question, 1e-6).boxes / 2


@pytest.mark.slow
def test_a_planted_narrow_peak_is_found(rng: np.random.Generator) -> None:
    """A peak a hundredth of the box wide, on top of waves, which random places miss."""
    axis = Axis("angle", -3.0, 3.0)
    at = 1.234567
    n = 40
    k = np.arange(1, n + 1)
    fejer = np.zeros(2 * n + 1)
    weight = 2 * (1 - k / (n + 1)) / (n + 1)
    fejer[0] = 1 / (n + 1)
    fejer[1::2], fejer[2::2] = weight * np.cos(k * at), weight * np.sin(k * at)
    peak = Polynomial((axis,), fejer)
    found = cover(enclosed(peak), 1e-6, known=np.array([[-2.0]]))
    assert peak(np.array([[at]]))[0] == pytest.approx(1.0)
    assert 1 - 1e-12 <= found.upper <= 1 + 1.1e-6
    assert found.place[0] == pytest.approx(at, abs=1e-3)


def test_several_objectives_and_a_denominator(rng: np.random.Generator) -> None:
    """The bound is on the largest of all, and of a quotient on the quotient."""
    D = 1.5 + 0.1 * drawn(rng, (1, 0, 1)) * drawn(rng, (1, 0, 1))
    D = D * D + 0.5
    question = enclosed(drawn(rng), Objective(drawn(rng) * 3.0, D))
    found = cover(question, 1e-3)
    best = largest(question, places(rng))
    assert best <= found.upper <= found.lower * 1.001 * (1 + 1e-9)
    assert found.upper < best * 1.05


def test_tolerances_below_single_precision_are_kept(rng: np.random.Generator) -> None:
    """A bound within 1e-9 of the maximum holds there, which polishing tells to 1e-13."""
    axes = (Axis("angle", -1.0, 1.5), Axis("length", -1.0, 1.0))
    cosine = partial(Polynomial.variable, axes)
    f = cosine(0, "cos") * 2.0 + cosine(0, "sin") + 3.0 - cosine(1) * cosine(1)
    top = 5**0.5 + 3.0
    known = np.array([[np.arctan(0.5), 0.0]])
    found = cover(enclosed(f), 1e-9, known=known)
    assert top * (1 - 1e-14) <= found.upper <= top * (1 + 1.1e-9)


def test_where_time_is_up_a_bound_stays(rng: np.random.Generator) -> None:
    """With no time at all the bound is that of the first boxes; with more it is no worse."""
    question = enclosed(drawn(rng))
    with time_limit(0.0):
        found = cover(question, 1e-6)
    assert largest(question, places(rng)) <= found.upper < np.inf
    assert cover(question, 1e-2).upper <= found.upper


def test_an_interruption_keeps_the_bound_so_far(rng: np.random.Generator) -> None:
    """Ctrl-C at a level gives the leaves of that moment, which cover the domain."""
    question = enclosed(drawn(rng), drawn(rng))
    calls = []

    def interrupt(above: float, done: float) -> None:
        calls.append(above)
        if len(calls) == 6:
            raise KeyboardInterrupt

    with pytest.raises(CoveringInterrupted) as caught:
        cover(question, 1e-6, progress=interrupt)
    best = caught.value.best
    assert largest(question, places(rng)) <= best.upper < np.inf
    assert all(cuts(leaves.boxes, best.grid) for leaves in best.leaves)


def test_an_earlier_covering_of_another_objective_is_a_start(rng: np.random.Generator) -> None:
    """Its boxes are kept, its bounds are not."""
    f, slack = drawn(rng), drawn(rng, (1, 1, 1))
    first = cover(enclosed(f, slacks=(slack,)), 1e-2)
    other = enclosed(f * 1.1 + 0.3, slacks=(slack,))
    second: Covering = cover(other, 1e-2, known=first.place[None], earlier=first)
    alone = cover(other, 1e-2, known=first.place[None])
    assert largest(other, places(rng)) <= second.upper <= second.lower * 1.01 * (1 + 1e-9)
    assert second.boxes < alone.boxes


def test_a_place_is_needed(rng: np.random.Generator) -> None:
    """Without a feasible place there is nothing to compare with."""
    with pytest.raises(ValueError, match="no feasible place"):
        cover(enclosed(drawn(rng), slacks=(Polynomial.constant(AXES, -1.0),)), 0.1)


def test_errors_of_polynomials_widen_the_bound(rng: np.random.Generator) -> None:
    """An error of the objective is added; one of a slack keeps places that it may make feasible."""
    f, slack = drawn(rng), drawn(rng, (1, 1, 1))
    exact = cover(enclosed(f, slacks=(slack,)), 1e-2)
    wide = cover(enclosed(replace(f, error=0.5), slacks=(replace(slack, error=0.2),)), 1e-2)
    loose = enclosed(f + 0.5, slacks=(slack + 0.2,))
    assert wide.upper >= max(largest(loose, places(rng)), exact.lower + 0.5)


def test_tensors_that_fill_the_cache_are_treated_a_few_at_a_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of large tensors few boxes are held at once, and the bounds over all first boxes stay."""
    axes = [Axis("angle", -np.pi, np.pi), Axis("angle", 0.0, 6.0), Axis("length", -1.0, 1.0)]
    rng = np.random.default_rng(3)
    small = Polynomial(tuple(axes), rng.normal(size=(3, 3, 2)))
    large = small.raised([3, 2, 4])
    monkeypatch.setattr(module, "LARGE_TENSOR", 20)
    grid = Grid(tuple(axes))
    few = at_once(large)
    assert 1 < few < len(grid.first()) < TENSORS_AT_ONCE == at_once(small)
    assert limits_on(large, grid) == pytest.approx(whole_limits(large, grid), abs=1e-12)


def whole_limits(polynomial: Polynomial, grid: Grid) -> tuple[float, float]:
    """The same of all first boxes at once."""
    boxes = grid.first()
    found, error = coefficients(polynomial, grid.middles(boxes), grid.halves(boxes))
    return float(found.min()) - error, float(found.max()) + error
