"""What multipliers prove: lower bounds that hold, and that are tight where they should be."""

import numpy as np
import pytest
from matrices import (
    balance,
    candidates,
    make,
    optimum,
    positive,
    semidefinite,
    sensitivities,
    slip,
    symmetric,
    units,
)

import criteria
from criteria.linalg.inverse import whitener

pytestmark = pytest.mark.slow

BUILTINS = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0", "rho_max")
POLARS = ("A", "D", "E", "G", "O1", "O3", "O5", "rho0", "rho_max")
GAP = 1e-6

every = pytest.mark.parametrize("name", [*BUILTINS, "balance"])
of_degree = pytest.mark.parametrize("name", POLARS)
sizes = pytest.mark.parametrize("p", [1, 2, 3, 6])


def choose(name, M):
    """A criterion; "balance" is a member of O4's family, set by the design M."""
    return balance(M, 0.4) if name == "balance" else make(name, len(M))


def unit_trace(c, blocks):
    """Candidates as a criterion normalises them: of unit trace where its degree is zero."""
    return blocks / np.trace(blocks, axis1=1, axis2=2)[:, None, None] if c.degree == 0 else blocks


def proofs(c, M):
    """Multipliers that prove the cost of M with ``t = <Z, M>``: minus gradients.

    For O4 they are those of E and of O2. A member of O4's family has its own gradient.
    """
    if isinstance(c, type(make("O4", 1))):
        return np.stack([-make(name, len(M)).gradient(M) for name in ("E", "O2")])
    return -c.gradient(M)[None]


def best_design(c, blocks):
    """Optimal information and its multiplier; for O4 those of a member of its family."""
    member = choose("balance", blocks.mean(axis=0)) if c.name == "O4" else c
    return optimum(member, blocks)


def multipliers(rng, c, blocks, optimal):
    """Random multipliers of many kinds: of full and low rank, of designs, near an optimal one.

    For a monotone criterion they are positive semidefinite, for the others indefinite.
    """
    p = blocks.shape[-1]
    length = np.linalg.norm(optimal, 2)
    Z = [optimal, length * positive(rng, p, 1e3), optimal + 0.3 * length * symmetric(rng, p)]
    Z += [optimal + size * length * symmetric(rng, p) for size in (1e-8, 1e-4, 1e-2)]
    Z += [B @ B.T for B in (rng.normal(size=(p, 1)), rng.normal(size=(p, p - 1 or 1)))]
    for w in rng.dirichlet(np.full(len(blocks), 0.3), size=3):
        Z += list(proofs(c, np.tensordot(w + 0.01, blocks, axes=1)))
    Z = 0.5 * (np.stack(Z) + np.swapaxes(Z, 1, 2))
    return np.stack([semidefinite(z, blocks.mean(axis=0)) for z in Z]) if c.monotone else Z


def designs(rng, blocks, best):
    """Information of many designs: of few, of all and of single candidates, and near the best."""
    n = len(blocks)
    weights = np.concatenate(
        [rng.dirichlet(np.full(n, a), size=300) for a in (0.05, 0.3, 3.0)] + [np.eye(n)]
    )
    far = np.tensordot(weights, blocks, axes=1)
    near = [(1 - step) * best + step * far for step in (1e-6, 1e-3, 0.1)]
    return np.concatenate([best[None], far, *near])


@pytest.mark.parametrize("seed", range(2))
@every
def test_bound_is_below_every_design(name, seed):
    """No design over the candidates costs less than the bound, whatever the multipliers are.

    That holds for them one by one and all together. The designs include the optimal one and its
    vicinity, so that a bound that is too high by 1e-6 is seen; and the optimal multiplier shows
    that bounds come that close.
    """
    rng = np.random.default_rng(seed)
    blocks = candidates(rng, 12, 4)
    c = choose(name, blocks.mean(axis=0))
    blocks = unit_trace(c, blocks)
    best, optimal = best_design(c, blocks)
    Z = multipliers(rng, c, blocks, optimal)
    t = sensitivities(Z, blocks)
    X = designs(rng, blocks, best)
    costs = c.cost(X)
    M = blocks.mean(axis=0)
    least = X[costs.argmin()]
    bounds = np.array([c.lower_bound(z[None], top[None], M) for z, top in zip(Z, t, strict=True)])
    together = c.lower_bound(Z, t, M)
    assert (bounds >= 0).all()
    assert max(together, *bounds) <= costs.min() * (1 + slip(least))
    assert together >= bounds.max() * (1 - 1e-9)
    if name != "O4":  # a single multiplier proves nothing of O4
        assert c.lower_bound(Z[:1], t[:1], best) >= (1 - GAP) * c.cost(best)


@sizes
@every
def test_bound_is_tight_at_the_design_that_a_gradient_belongs_to(name, p):
    """With Z minus a (sub)gradient at M and t = <Z, M>, the bound is the cost of M, at kinks too.

    O4 needs two multipliers: of its largest variance, and of its condition number.
    """
    rng = np.random.default_rng(p)
    for M in [*(positive(rng, p) for _ in range(10)), np.eye(p), 7 * np.eye(p)]:
        c = choose(name, M)
        Z = proofs(c, M)
        t = np.einsum("rij,ij->r", Z, M)
        assert c.lower_bound(Z, t, M) == pytest.approx(c.cost(M), rel=slip(M, M @ M))


@every
def test_bound_is_homogeneous(name):
    """If all candidates tell c times as much, bounds shrink as costs do, over forty decades of c.

    For degree zero candidates have unit trace, and only the multipliers are scaled.
    """
    for seed in range(3):
        rng = np.random.default_rng(seed)
        blocks = candidates(rng, 6, 3)
        M = blocks.mean(axis=0)
        c = choose(name, M)
        blocks = unit_trace(c, blocks)
        Z = rng.permutation(multipliers(rng, c, blocks, best_design(c, blocks)[1]))[:4]
        t = sensitivities(Z, blocks)
        before = c.lower_bound(Z, t, M)
        for factor in (1e-20, 1e-16, 1e-14, 1e-8, 1e8, 1e14, 1e20):
            if name == "balance":  # its b is set by the design, as s is
                after = choose(name, factor * M).lower_bound(Z, factor * t, factor * M)
            else:
                after = factor**c.degree * c.lower_bound(
                    factor ** (c.degree == 0) * Z, factor * t, factor * M
                )
            assert after == pytest.approx(before, rel=1e-9)


@every
def test_further_multipliers_never_lower_the_bound(name):
    """A further multiplier may raise the bound, but does not lower it.

    Corners are told apart to 1e-9, hence the tolerance.
    """
    for seed in range(2):
        rng = np.random.default_rng(seed)
        blocks = candidates(rng, 8, 3)
        c = choose(name, blocks.mean(axis=0))
        blocks = unit_trace(c, blocks)
        Z = multipliers(rng, c, blocks, best_design(c, blocks)[1])
        t = sensitivities(Z, blocks)
        M = blocks.mean(axis=0)
        bounds = np.array([c.lower_bound(Z[:k], t[:k], M) for k in range(1, len(Z) + 1)])
        assert (bounds[1:] >= bounds[:-1] * (1 - 1e-8)).all()


@of_degree
def test_bound_of_several_is_the_best_of_each(name):
    """Where multipliers do not combine, the bound is the best of them.

    A multiplier to which no candidate is sensitive proves nothing.
    """
    rng = np.random.default_rng(0)
    c = make(name, 3)
    M = positive(rng, 3)
    Z = np.stack([positive(rng, 3) for _ in range(4)])
    t = rng.uniform(1, 2, size=4)
    each = [c.polar(z, M) * top**-c.degree for z, top in zip(Z, t, strict=True)]
    assert c.lower_bound(Z, t, M) == pytest.approx(max(each), rel=1e-14)
    assert c.lower_bound(Z, np.array([0.0, -1.0, 0.0, -2.0]), M) == 0.0


@pytest.mark.parametrize("name", ["O2", "O4", "balance"])
def test_multipliers_that_prove_nothing(name):
    """A negative, a zero or an unbounded multiplier leaves the trivial bound.

    That is kappa >= 1 and s >= 0.
    """
    M = positive(np.random.default_rng(0), 3)
    c = choose(name, M)
    trivial = {"O2": 1.0, "O4": 0.0, "balance": getattr(c, "a", None)}[name]
    for Z, t in ((-M, 1.0), (np.zeros((3, 3)), 1.0), (M, np.inf) if name != "O2" else (M, 1e300)):
        assert c.lower_bound(Z[None], np.array([t]), M) == trivial


def test_bound_of_the_condition_number_knows_unit_traces():
    """With candidates of unit trace, c I added to a multiplier proves the same.

    It adds c to every sensitivity.
    """
    for seed in range(5):
        rng = np.random.default_rng(seed)
        c = make("O2", 4)
        blocks = unit_trace(c, candidates(rng, 12, 4))
        M, Z = optimum(c, blocks)
        for shift in (-3.0, -0.1, 0.7, 10.0):
            shifted = (Z + shift * np.linalg.norm(Z, 2) * np.eye(4))[None]
            assert c.lower_bound(shifted, sensitivities(shifted, blocks), M) == pytest.approx(
                c.cost(M), rel=GAP
            )


@pytest.mark.parametrize("kappa", [1e2, 1e6, 1e12, 1e18, 1e22])
def test_bound_counts_a_negative_part_however_small(kappa):
    """A negative eigenvalue of size 1/kappa counts.

    The design of eigenvalues 1 and kappa gains as much by it: it has <Z, M> = t, so it obeys
    whatever Z proves, and its cost is 0.9 s + 0.1 kappa' = 1 in its units.
    """
    M = np.diag([1.0, kappa])
    Z = np.diag([1.0, -0.4 / kappa])
    c = balance(M, 0.1)
    assert c.cost(M) == pytest.approx(1, rel=slip(np.eye(2)))
    assert c.lower_bound(Z[None], np.array([0.6]), M) <= 1 + slip(np.eye(2))


@pytest.mark.parametrize("seed", range(3))
@every
def test_bound_is_a_bound_in_bad_units(name, seed):
    """With units from 1e-7 to 1e4 no design over the candidates costs less than a bound either.

    The multipliers are those of well scaled parameters, transformed, and gradients taken in the bad
    units.
    """
    rng = np.random.default_rng(seed)
    blocks = candidates(rng, 12, 4)
    t = units(rng, 4)
    T = np.diag(t)
    good = choose(name, blocks.mean(axis=0))
    normalised = unit_trace(good, blocks)
    optimal = best_design(good, normalised)[1]
    Z = multipliers(rng, good, normalised, optimal) / np.outer(t, t)
    weights = np.concatenate([rng.dirichlet(np.full(12, a), size=300) for a in (0.1, 1.0)])
    scaled = np.outer(t, t) * blocks
    c = choose(name, scaled.mean(axis=0)).in_units(T)
    scaled = unit_trace(c, scaled)
    X = np.tensordot(weights, scaled, axes=1)
    costs = c.cost(X)
    M = scaled.mean(axis=0)
    assert np.isfinite(costs.min())
    Z = np.concatenate([Z, *(proofs(c, X[i]) for i in np.argsort(costs)[:3])])
    top = sensitivities(Z, scaled)
    limit = costs.min() * (1 + slip(np.tensordot(weights[costs.argmin()], blocks, axes=1)))
    bounds = [c.lower_bound(z[None], x[None], M) for z, x in zip(Z, top, strict=True)]
    assert max(c.lower_bound(Z, top, M), *bounds) <= limit
    if c.monotone:
        assert max(bounds[-3:]) > 0.01 * limit


@pytest.mark.parametrize("name", [n for n in BUILTINS if criteria.get(n).unit_free])
def test_unit_free_ones_prove_the_same_in_any_units(name):
    """With k = t k' costs, polars and bounds of unit-free criteria change by one common factor.

    The units t are from 1e-7 to 1e4. For rho0, whose target is transformed too, the factor is one.
    """
    for seed in range(20):
        rng = np.random.default_rng(seed)
        M = positive(rng, 4)
        Z = positive(rng, 4)
        t = units(rng, 4)
        good = make(name, 4)
        tops = np.array([2.0, 3.0])
        bad = good.in_units(np.diag(t))
        TT = np.outer(t, t)
        factor = bad.cost(TT * M) / good.cost(M)
        accuracy = (
            2 * slip(M, Z) * 4
        )  # rho0 contracts all of A0 Z A0', whose condition may exceed Z's
        if name == "rho0":
            assert factor == pytest.approx(1, rel=slip(M))
        assert bad.polar(Z / TT, TT * M) == pytest.approx(factor * good.polar(Z, M), rel=accuracy)
        bounds = (
            bad.lower_bound(np.stack([Z, M]) / TT, tops, TT * M),
            good.lower_bound(np.stack([Z, M]), tops, M),
        )
        assert bounds[0] == pytest.approx(factor * bounds[1], rel=accuracy)


@pytest.mark.parametrize("name", POLARS)
def test_bound_of_a_gradient_is_tight_in_bad_units(name):
    """With units from 1e-7 to 1e4, too, minus the gradient at M proves the cost of M to 1e-6.

    A relaxation that stops at this gap must be able to prove it; and no bound exceeds the cost. In
    bad units the cost of O5 is a sum of roots of rounded eigenvalues, so it is taken from the
    singular values of a whitener instead.
    """
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t = units(rng, 4)
        good = positive(rng, 4)
        M = np.outer(t, t) * good
        c = make(name, 4).in_units(np.diag(t))
        Z = proofs(c, M)
        cost = np.linalg.svd(whitener(M), compute_uv=False).sum() if name == "O5" else c.cost(M)
        gap = 1 - c.lower_bound(Z, np.einsum("rij,ij->r", Z, M), M) / cost
        assert -slip(good) <= gap <= GAP
