"""A stored relaxation is judged as if an enemy had written it."""

from dataclasses import replace

import numpy as np
import pytest
from no_dual import NoDual

import criteria
from edtk.design.bound import BoundKind
from edtk.design.problem import Problem
from edtk.design.relaxation.proof import InnerProof
from edtk.design.relaxation.relax import relax

RNG = np.random.default_rng(11)
PROBLEM = Problem(RNG.normal(size=(30, 1, 4)) + np.array([2.0, 1.0, 0.5, 0.0]))
STEEP = Problem(np.vander(np.linspace(2000, 2030, 31), 3, increasing=True)[:, None, :])
NAMES = ("A", "D", "E", "G", "O1", "O3", "O5", "phi", "I", "c")
INDEFINITE = ("O2", "O4")
PARAMETERS = {
    "phi": {"q": 2.0},
    "I": {"W": np.diag([1.0, 2, 3, 4])},
    "c": {"c": [1.0, -1, 2, 0]},
}
every = pytest.mark.parametrize("name", NAMES)


def solved(name):
    """A relaxation of the problem."""
    return relax(PROBLEM, criteria.create(name, **PARAMETERS.get(name, {})))


@every
def test_nothing_is_gained_by_multipliers_that_are_not_semidefinite(name):
    """Large, negative, swapped and indefinite multipliers prove nothing beyond the cost."""
    r = solved(name)
    Z = r.multipliers
    V = np.linalg.qr(RNG.normal(size=(4, 4)))[0]
    forged = [
        -Z,
        Z - 10 * np.trace(Z[0]) * np.eye(4),
        Z * np.array([1, -1, 1, 1])[:, None],
        (V * np.array([-1.0, -1, 1e3, 1e3]) @ V.T)[None],
        Z + np.diag([1e9, -1e9, 0, 0]) * np.abs(Z).max(),
    ]
    for each in forged:
        each = 0.5 * (each + np.swapaxes(each, 1, 2))
        cost, bound = replace(r, multipliers=each).certify(PROBLEM)
        assert cost == pytest.approx(r.cost, rel=1e-12)
        assert 0.0 <= bound <= cost * (1 + 1e-12)
    assert replace(r, multipliers=-Z).certify(PROBLEM)[1] == 0.0


@every
@pytest.mark.parametrize("tilt", [1e-9, 1e-10, 1e-12])
def test_nothing_is_gained_by_what_could_be_rounding(name, tilt):
    """An eigenvalue just below zero is lifted, and every sensitivity with it."""
    r = solved(name)
    cost, bound = r.certify(PROBLEM)
    rng = np.random.default_rng(3)
    for _ in range(20):
        v = rng.normal(size=4)
        size = np.sqrt(np.diag(r.multipliers[0]))
        Z = r.multipliers - tilt * np.outer(v * size, v * size)
        found = replace(r, multipliers=Z).certify(PROBLEM)[1]
        assert found <= cost * (1 + 1e-12)
        assert found <= bound * (1 + 1e-6)


@pytest.mark.parametrize("name", INDEFINITE)
@pytest.mark.parametrize("size", [1e3, 1e8, 1e15])
def test_nothing_is_gained_by_terms_that_cancel(name, size):
    """A multiple of the identity hides rounding in multipliers of O2 and O4; none of it counts."""
    r = solved(name)
    cost, _ = r.certify(PROBLEM)
    rng = np.random.default_rng(4)
    for _ in range(20):
        noise = rng.normal(size=(4, 4))
        Z = size * np.eye(4) + noise + noise.T
        _, bound = replace(r, multipliers=Z[None]).certify(PROBLEM)
        assert bound <= cost * (1 + 1e-12)


@every
@pytest.mark.parametrize("length", [1e-300, 1e-200, 1e-100, 1e100, 1e200, 1e290])
def test_the_length_of_a_multiplier_does_not_matter(name, length):
    """Multiples of a proof prove the same, and nothing overflows on the way."""
    r = solved(name)
    _, bound = r.certify(PROBLEM)
    _, found = replace(r, multipliers=length * r.multipliers).certify(PROBLEM)
    assert found == pytest.approx(bound, rel=1e-6)


@every
def test_claims_do_not_count(name):
    """Cost and bound that are claimed are not looked at."""
    r = solved(name)
    claim = replace(r, cost=0.1 * r.cost, proved_bound=replace(r.proved_bound, cost=9 * r.cost))
    cost, bound = claim.certify(PROBLEM)
    assert cost == pytest.approx(r.cost, rel=1e-10)
    assert bound == pytest.approx(r.proved_bound.cost, rel=1e-10)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda w: 2 * w, "sum 2; expected 1"),
        (lambda w: np.where(w == w.max(), np.nan, w), "finite"),
        (lambda w: w - 0.5 * (np.arange(30) == 0) + 0.5 * (np.arange(30) == 1), "not negative"),
        (lambda w: w[:-1], r"shape \(29,\); expected \(30,\)"),
        (lambda w: w[:, None], "shape"),
    ],
    ids=["double", "nan", "negative", "too few", "axes"],
)
def test_weights_that_are_none(change, words):
    """Weights of another sum or shape, negative or not finite ones are told in one line."""
    r = solved("D")
    with pytest.raises(ValueError, match=words):
        replace(r, weights=change(r.weights)).certify(PROBLEM)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda Z: Z[0], "shape"),
        (lambda Z: Z[:0], "at least one"),
        (lambda Z: Z[:, :3, :3], "shape"),
        (lambda Z: Z * np.inf, "finite"),
        (lambda Z: Z + np.triu(np.ones((4, 4)), 1), "symmetric"),
    ],
    ids=["axes", "none", "smaller", "inf", "skew"],
)
def test_multipliers_that_are_none(change, words):
    """Multipliers of another shape, skew or not finite ones are told in one line."""
    r = solved("D")
    with pytest.raises(ValueError, match=words), np.errstate(invalid="ignore"):
        replace(r, multipliers=change(r.multipliers)).certify(PROBLEM)


def test_other_candidates():
    """Of other candidates the bound is that of their sensitivities, and holds for their designs."""
    r = solved("A")
    others = Problem(3 * PROBLEM.factors())
    cost, bound = r.certify(others)
    assert cost == pytest.approx(r.cost / 9, rel=1e-10)
    assert bound == pytest.approx(r.proved_bound.cost / 9, rel=1e-10)
    more = PROBLEM + Problem(10 * PROBLEM.factors())
    with pytest.raises(ValueError, match=r"expected \(60,\)"):
        r.certify(more)


def test_inner_proof_that_says_something_else_is_ignored():
    """Multipliers with more digits count only where they are those that are stated."""
    r = relax(STEEP, criteria.create("A"))
    assert r.inner is not None
    cost, bound = r.certify(STEEP)
    assert bound == pytest.approx(r.proved_bound.cost, rel=1e-10)
    for forged in (
        InnerProof(r.inner.T, 1e3 * r.inner.Z),
        InnerProof(2 * r.inner.T, r.inner.Z),
        InnerProof(np.zeros((3, 3)), r.inner.Z),
        InnerProof(r.inner.T[:2], r.inner.Z),
        InnerProof(r.inner.T * np.nan, r.inner.Z),
    ):
        assert replace(r, inner=forged).certify(STEEP)[1] <= cost * (1 + 1e-9)
    indefinite = InnerProof(r.inner.T, r.inner.Z - 2 * np.trace(r.inner.Z[0]) * np.eye(3))
    forged = replace(r, inner=indefinite, multipliers=indefinite.outward())
    assert forged.certify(STEEP)[1] == 0.0
    assert replace(r, inner=None).certify(STEEP)[1] <= cost * (1 + 1e-9)


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "O2", "O4", "O5"])
def test_parameters_of_the_enemys_choice_hide_no_rounding(name):
    """A change of parameters that spans many decades changes neither cost nor what is proved."""
    r = solved(name)
    rng = np.random.default_rng(8)
    for decades in (3, 8, 12, 20):
        for _ in range(6):
            U, V = (np.linalg.qr(rng.normal(size=(4, 4)))[0] for _ in range(2))
            T = (U * 10.0 ** rng.uniform(-decades, decades, size=4)) @ V
            B = rng.normal(size=(4, 2))
            inner = InnerProof(T, (B @ B.T)[None])
            forged = replace(r, multipliers=inner.outward(), inner=inner)
            cost, bound = forged.certify(PROBLEM)
            assert cost == pytest.approx(r.cost, rel=1e-10)
            assert bound <= cost * (1 + 1e-9)


def test_design_that_leaves_a_direction_open():
    """Forged weights on a single candidate have infinite cost, and the bound still holds."""
    for name in ("A", "G", "D"):
        r = solved(name)
        cost, bound = replace(r, weights=np.eye(30)[0]).certify(PROBLEM)
        assert cost == np.inf
        assert 0 <= bound <= r.cost * (1 + 1e-12)


def test_a_plug_in_of_an_ill_conditioned_model():
    """An expression alone is enough for years, in the parameters that whiten them."""
    found = relax(STEEP, NoDual())
    best = relax(STEEP, criteria.create("A"))
    assert found.rests_on_solver
    assert found.cost == pytest.approx(best.cost, rel=1e-6)
    assert found.proved_bound.cost == pytest.approx(best.cost, rel=1e-5)
    assert found.proved_bound.cost <= best.cost * (1 + 1e-9)


class Smooth(NoDual):
    """The same with the truth about its smoothness."""

    smooth = True


def test_a_bound_by_a_solvers_word_says_so():
    """The result of a criterion without a dual form says whose word its bound is."""
    found = relax(PROBLEM, NoDual())
    assert found.rests_on_solver
    assert "gap by a solver's word" in found.headline()
    assert found.proved_bound.kind is BoundKind.SOLVED
    assert not solved("A").rests_on_solver
    assert "proved gap" in solved("A").headline()


def test_a_gradient_needs_no_solvers_word():
    """Minus the gradient of a smooth criterion proves its bound without a dual form."""
    smooth = Smooth()
    M = PROBLEM.information(solved("A").weights)
    assert not smooth.rests_on_solver(-smooth.gradient(M)[None], M)
    assert smooth.rests_on_solver(np.eye(4)[None], M)
