"""Halving any constant of the enclosure is noticed: each mutant breaks one of these laws.

Margins of rounding are held to what the theorem on the page "A bound over every pose" counts, as
no experiment sees half of a margin that is counted for the worst case.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import edtk.design.enclosure.basis as basis_module
import edtk.design.enclosure.boxes as boxes_module
import edtk.design.enclosure.objective as objective_module
import edtk.design.enclosure.polynomial as polynomial_module
import edtk.design.enclosure.stage as stage_module
import edtk.design.enclosure.tracked as tracked_module

U = 2.0**-53
SINGLE = 2.0**-24


def laws_of_the_basis(basis: ModuleType) -> None:
    """The basis has the sum one, all matrices reproduce polynomials, and margins are counted."""
    rng = np.random.default_rng(4)
    for kind, a in (("angle", 0.7), ("length", 0.7)):
        s = np.linspace(-a, a, 9)
        axis = polynomial_module.Axis(kind, -1.0, 1.0)  # type: ignore[arg-type]
        for n in (1, 3):
            N = axis.size(n) - 1
            values = basis.basis(kind, n, a, s)
            assert np.allclose(values.sum(axis=1), 1, atol=1e-13)
            c = rng.normal(size=N + 1)
            lower, upper = basis.halves(kind, n, a)
            at = (s - a) / 2
            assert np.allclose(
                basis.basis(kind, n, a / 2, at + a / 2) @ lower @ c, _at(basis, kind, n, a, at, c)
            )
            assert np.allclose(
                basis.basis(kind, n, a / 2, -at - a / 2) @ upper @ c, _at(basis, kind, n, a, -at, c)
            )
            raised = basis.elevation(kind, n, n + 2, a) @ c
            assert np.allclose(basis.basis(kind, n + 2, a, s) @ raised, values @ c)
            f = polynomial_module.Polynomial((axis,), rng.normal(size=N + 1))
            F = basis.from_functions(axis, n, np.array([0.2]), np.array([a]))[0]
            assert np.allclose(values @ F @ f.coefficients, f(0.2 + s[:, None]))
            assert basis.largest_entry(axis, n, a) >= (np.abs(F).max() if kind == "angle" else 1.0)
            # A sum of N + 1 products, powers of 2n factors, weights twice, and the turn.
            assert basis.rounding_of_entry(axis, n) >= (34 * n + N + 10) * U
            # Two weights of N sums of three products, then the sum of N + 1 products.
            assert basis.rounding_of_half(N + 1, SINGLE) >= (6 * N + 8) * U + (N + 3) * SINGLE
    assert np.pi / 2 >= basis.WIDEST > 1.0


def _at(basis: ModuleType, kind: str, n: int, a: float, s: object, c: object) -> object:
    """Values of coefficients c on an interval of half width a."""
    return basis.basis(kind, n, a, s) @ c


AXES = (polynomial_module.Axis("angle", -2.0, 3.0), polynomial_module.Axis("angle", 0.0, 1.0))


def laws_of_boxes(module: ModuleType) -> None:
    """Boxes overlap, and coefficients are within their margin."""
    f = drawn(np.random.default_rng(4))
    grid = module.Grid(AXES)
    assert (grid.widest * 2 * grid.parts >= np.array([5.0, 1.0]) * (1 + 2.0**-41 * 1.5)).all()
    boxes = grid.first()
    _, error = module.coefficients(f, grid.middles(boxes), grid.halves(boxes))
    sizes = [
        basis_module.largest_entry(axis, n, a)
        for axis, n, a in zip(AXES, (2, 1), grid.widest.tolist(), strict=True)
    ]
    counted = sum(basis_module.rounding_of_entry(a, n) for a, n in zip(AXES, (2, 1), strict=True))
    assert error >= 0.125 + 0.9 * np.prod(sizes) * counted * np.abs(f.coefficients).sum()
    assert module.rounding_of_halves(f, SINGLE) >= basis_module.rounding_of_half(5, SINGLE)
    slack = cutting(f)
    once = module.rounding_of_halves(slack) * np.abs(slack.coefficients).sum()
    assert module.rounding_of_slack(slack) >= 2 * 60 * once


def drawn(rng: np.random.Generator) -> polynomial_module.Polynomial:
    """A polynomial of random coefficients."""
    return polynomial_module.Polynomial(AXES, rng.normal(size=(5, 3)), error=0.125)


def cutting(f: polynomial_module.Polynomial) -> polynomial_module.Polynomial:
    """A slack that cuts off what is large."""
    return polynomial_module.Polynomial(AXES, -f.coefficients[:3])


def laws_of_a_stage(stage_of: ModuleType) -> None:
    """Open boxes keep their margins, and what closes a box is true of it."""
    rng = np.random.default_rng(4)
    assert stage_of.UNIT == SINGLE
    f = drawn(rng)
    slack = cutting(f)
    grid = boxes_module.Grid(AXES)
    boxes = grid.first()
    _, error = boxes_module.coefficients(f, grid.middles(boxes), grid.halves(boxes))
    none = np.zeros((1, 2))
    question = objective_module.Enclosed(
        AXES, (objective_module.Objective(f),), (slack,), none, np.eye(2)
    )
    objective = question.objectives[0]
    stage = stage_of.Stage(question, objective, grid, 0.0)
    chunk = stage.opened(boxes_module.Leaves.unknown(boxes, np.full(len(boxes), np.inf), 1))
    largest = np.abs(chunk.values).reshape(len(boxes), -1).max(axis=1).astype(float)
    assert (chunk.error >= error + SINGLE * largest * 0.999).all()
    assert (chunk.rounding >= basis_module.rounding_of_half(5, SINGLE) * largest * 0.999).all()
    half = stage.halved(chunk, 0)
    assert (half.error >= np.tile(chunk.error + chunk.rounding, 2)).all()
    x = grid.middles(boxes) + grid.halves(boxes) * rng.uniform(-1, 1, (len(boxes), 2))
    leaves, _, _ = stage.close(chunk, 0.5 * float(chunk.values.max()), 0.0)
    below = leaves.reason != boxes_module.Reason.INFEASIBLE
    top = f(x) + leaves.penalties[:, 0] * slack(x)
    assert (top[below] + 0.125 <= leaves.bound[below]).all()
    everywhere, _, _ = stage.close(chunk, np.inf, 0.0)
    assert (everywhere.bound >= chunk.values.max(axis=(1, 2)) + 0.125).all()
    # The margin of a factor: a slack that is rounded once, three terms that are rounded thrice.
    # One coefficient is far below the others, so that it alone sets the margin.
    c = 0.1 - chunk.values.astype(float)
    c[:, 0, 0] = -1e4
    chunk = replace(chunk, slacks=(c,))
    stage.enclosed = replace(question, slacks=(f,))
    penalised = stage_of.Penalised(stage, chunk, np.full(len(boxes), 1e30), 1e20)
    penalised.add(0, np.ones(len(boxes), dtype=bool))
    mu = penalised.penalties[:, 0]
    top = (chunk.values.astype(float) + mu[:, None, None] * c).max(axis=(1, 2))
    margin = penalised.top - top - chunk.error
    assert (mu > 0).any()
    assert (margin >= 10 * SINGLE * mu * 1e4)[mu > 0].all()


def laws_of_polynomials(polynomial: ModuleType) -> None:
    """Errors of sums, products and samples are those of the theorem, at least."""
    rng = np.random.default_rng(4)
    axes = (polynomial.Axis("angle", -1.0, 1.0), polynomial.Axis("length", 0.0, 2.0))
    f = polynomial.Polynomial(axes, rng.normal(size=(3, 3)), error=0.25)
    g = polynomial.Polynomial(axes, rng.normal(size=(5, 2)), error=0.5)
    size_f, size_g = (np.abs(one.coefficients).sum() for one in (f, g))
    none = polynomial.Polynomial(axes, f.coefficients)
    assert (none + none).error >= U * 2 * size_f
    assert (f + g).error >= 0.75
    assert (f * g).error >= 0.25 * size_g + 0.5 * size_f + 0.125
    assert (f * 3.0).error >= 0.75 + U * 3 * size_f
    assert (none * none).error >= U * 8 * np.square(none(np.zeros((1, 2)))[0])
    assert f.cut((0, 2)).error >= 0.25 + np.abs(f.coefficients[1:]).sum()
    assert f.size >= size_f + 0.25
    samples = none.samples((1, 2))
    assert samples.rounding >= sum(4.5 * n + 2 for n in (3, 3)) * U * size_f
    for kind, N in (("angle", 5), ("length", 5)):
        sampling = polynomial.Sampling.of(kind, 2 if kind == "angle" else 4)
        e = np.sign(rng.normal(size=N))
        axis = polynomial.Axis(kind, -1.0, 1.0)
        moved = polynomial.Polynomial((axis,), sampling.analysis @ e)
        x = np.linspace(-1, 1, 50)[:, None]
        assert np.abs(moved(x)).max() <= sampling.noise
        scale = np.sqrt(np.r_[1.0, np.full(N - 1, 2.0)] / N)[:, None] if kind == "angle" else 1.0
        B = np.linalg.norm(np.abs(sampling.analysis / scale), 2)
        largest = 1.0 if kind == "angle" else np.sqrt(N)
        assert sampling.rounding >= (N + 10) * U * largest * B * np.sqrt(N) * 0.999
        assert (
            sampling.noise
            >= largest * np.linalg.norm(sampling.analysis / scale, 2) * np.sqrt(N) * 0.999
        )


def laws_of_a_tracker(tracked: ModuleType) -> None:
    """What is above a sensitivity under a tracker is so, and meets it at ends of a box."""
    axes = (polynomial_module.Axis("angle", -1.0, 1.2),)
    s, N, Q = (
        polynomial_module.Polynomial(axes, np.array(c))
        for c in ([5.0, 2.0, 1.0], [3.0, 0.5, 0.2], [4.0, 1.0, -0.5])
    )
    growth = tracked.Growth(1e-10, 2.0, (1e-6, 2e-6), (8e-6, 5e-6), 2e-10)
    objective = tracked.TrackedObjective(N, growth=growth, squared=s, inline=Q, nearest=1.0)
    t = np.linspace(-1.0, 1.2, 201)[:, None]
    S, r, u = s(t), np.sqrt(s(t)), 2.0
    aside, inline = (
        (1e-10 + 2 * (a + b * r) ** 2) / 2e-10 for a, b in (growth.across, growth.along)
    )
    told = N(t) / aside + (1 / inline - 1 / aside) * Q(t) / S
    assert np.allclose(objective(t), told, rtol=1e-13)
    assert objective.plus(0.5)(t[:1]) == pytest.approx(told[:1] + 0.5, rel=1e-13)
    grid = boxes_module.Grid(axes)
    scale = objective.scale(grid)
    assert scale[0] <= aside.min() <= aside.max() <= scale[1]
    assert objective.most(grid) >= told.max()
    # A wide box knows less of the distance than the whole arm does.
    high = np.array([S.max()])
    wide, known = (objective.weights(u, np.array([[s], [0.0]]), high) for s in (0.0, 1.0))
    assert all((one == other).all() for one, other in zip(wide, known, strict=True))
    for least in (S.min(), S.min() / tracked.CLOSE_BY):
        low = np.array([[least], [Q(t).min()]])
        factors, constant, error = objective.weights(u, low, np.array([S.max()]))
        is_near = S.max() > tracked.CLOSE_BY * least
        aside_last, inline_first, k = (
            one(np.array(at))
            for one, at in (
                (growth.aside, S.max()),
                (growth.inline, least),
                (growth.excess, least),
            )
        )
        # No rounding makes a factor less than what it stands for.
        assert factors[0, 0] >= (aside_last / inline_first * (1 + 60 * U) if is_near else 1.0)
        assert factors[2, 0] >= (0.0 if is_near else k * (1 + 60 * U))
        parts = [objective.tested(u)(t), S, Q(t)]
        above = sum(f * part for f, part in zip(factors[:, 0], parts, strict=True)) + constant
        own = aside * (told - u)
        assert (above + error >= own).all()
        assert error[0] >= 60 * U * 2 * u * aside.max()
        if least == S.min():
            assert (above - own)[S.argmin()] == pytest.approx(0, abs=1e-12)
    # Where Q is its least value everywhere, both chords meet what they are of at both ends.
    flat = replace(objective, inline=polynomial_module.Polynomial.constant(axes, 4.0))
    low = np.array([[S.min()], [4.0]])
    factors, constant, _ = flat.weights(u, low, np.array([S.max()]))
    parts = [flat.tested(u)(t), S, np.full(len(t), 4.0)]
    above = sum(f * part for f, part in zip(factors[:, 0], parts, strict=True)) + constant
    own = aside * (flat(t) - u)
    assert (above - own)[[S.argmin(), S.argmax()]] == pytest.approx(0, abs=1e-12)


Laws = Callable[[ModuleType], None]
MODULES: dict[str, tuple[ModuleType, Laws]] = {
    "basis": (basis_module, laws_of_the_basis),
    "boxes": (boxes_module, laws_of_boxes),
    "stage": (stage_module, laws_of_a_stage),
    "polynomial": (polynomial_module, laws_of_polynomials),
    "tracked": (tracked_module, laws_of_a_tracker),
}
MUTANTS = [
    ("basis", "WIDEST = np.pi / 2", "WIDEST = np.pi / 4"),
    ("basis", "[1.0, 2.0 * np.cos(half), 1.0]", "[1.0, np.cos(half), 1.0]"),
    ("basis", "else [1.0, 1.0]", "else [1.0, 0.5]"),
    ("basis", "q = 2.0 * np.cos(half / 2)", "q = np.cos(half / 2)"),
    ("basis", 'if kind == "angle" else 2.0', 'if kind == "angle" else 1.0'),
    ("basis", "comb(N - k, j - k) * w[k]", "comb(N - k, j - k) * 0.5 * w[k]"),
    (
        "basis",
        "(8 * size + 8) * ROUNDOFF + (size + 2) * unit",
        "(4 * size + 4) * ROUNDOFF + (size + 2) * unit / 2",
    ),
    ("basis", "= w[k] * one", "= 0.5 * w[k] * one"),
    ("basis", "exp(1j * middle[:, None] * k)", "exp(0.5j * middle[:, None] * k)"),
    (
        "basis",
        "np.exp(-0.5j * half), np.exp(0.5j * half)",
        "np.exp(-0.25j * half), np.exp(0.25j * half)",
    ),
    (
        "basis",
        "(40 * degree + order(axis, degree) + 16)",
        "(20 * degree + order(axis, degree) / 2 + 8)",
    ),
    ("basis", "np.max(sizes)) * 2**0.5", "np.max(sizes)) * 2**0.5 / 2"),
    (
        "basis",
        'if axis.kind == "length":\n        return 1.0',
        'if axis.kind == "length":\n        return 0.5',
    ),
    ("boxes", "WIDER = 2.0**-40", "WIDER = 2.0**-41"),
    ("stage", "UNIT = float(np.finfo(SINGLE).eps) / 2", "UNIT = float(np.finfo(SINGLE).eps) / 4"),
    (
        "boxes",
        "size * units * (1 + units) + polynomial.error",
        "size * units / 2 + polynomial.error",
    ),
    ("boxes", "(1 + units) + polynomial.error", "(1 + units) + polynomial.error / 2"),
    ("stage", "error + UNIT * largest", "error + UNIT * largest / 2"),
    (
        "stage",
        "rounding_of_halves(self.tested, UNIT) * largest + LEAST,",
        "rounding_of_halves(self.tested, UNIT) * largest / 2 + LEAST,",
    ),
    (
        "stage",
        "np.tile(chunk.error + chunk.rounding, 2)",
        "np.tile(chunk.error + chunk.rounding / 2, 2)",
    ),
    ("stage", "+ chunk.error\n", "+ chunk.error / 2\n"),
    ("stage", "rounds = 12 +", "rounds = 6 +"),
    ("stage", "rounds / 8", "rounds / 16"),
    ("polynomial", "float(np.finfo(float).eps) / 2", "float(np.finfo(float).eps) / 4"),
    ("polynomial", "(2 * count + 12) * ROUNDOFF", "(count + 6) * ROUNDOFF"),
    ("polynomial", "noise = largest *", "noise = 0.5 * largest *"),
    ("polynomial", "(8 * size + 4) * ROUNDOFF", "(4 * size + 2) * ROUNDOFF"),
    ("polynomial", "self.error + g.error + 2 * rounded", "self.error / 2 + g.error / 2 + rounded"),
    (
        "polynomial",
        "abs(weight) * (f.size * g.error + g.size * f.error)",
        "abs(weight) * (f.size * g.error + g.size * f.error) / 2",
    ),
    ("polynomial", "self.error + _total(rest)", "self.error + _total(rest) / 2"),
    ("polynomial", "* slack + self.error", "* slack + self.error / 2"),
    ("tracked", "64 * ROUNDOFF", "32 * ROUNDOFF"),
    ("tracked", "self.readings * sizes", "0.5 * self.readings * sizes"),
    ("tracked", "self.readings / self.least", "0.5 * self.readings / self.least"),
    ("tracked", "[first, least * falling]", "[first, 0.5 * least * falling]"),
    ("tracked", "[first, least * falling]", "[0.5 * first, least * falling]"),
    ("tracked", "rise - slope)", "rise - 0.5 * slope)"),
    ("tracked", "- more[1] * s\n", "- 0.5 * more[1] * s\n"),
]


def mutated(name: str, old: str, new: str) -> ModuleType:
    """A module with one change in its source."""
    module = MODULES[name][0]
    assert module.__file__
    spec = util.spec_from_file_location(f"mutant_of_{name}", module.__file__)
    assert spec
    assert spec.loader
    found = util.module_from_spec(spec)
    source = Path(module.__file__).read_text(encoding="utf-8")
    assert old in source, f"no longer in {name}: {old}"
    sys.modules[spec.name] = found
    try:
        exec(compile(source.replace(old, new), module.__file__, "exec"), vars(found))
    finally:
        del sys.modules[spec.name]
    return found


@pytest.mark.parametrize("name", MODULES)
def test_the_enclosure_obeys_its_laws(name: str) -> None:
    """Basis, margins and boxes are as the theorems have them, in a copy without a change, too."""
    module, laws = MODULES[name]
    laws(module)
    laws(mutated(name, "", ""))


@pytest.mark.parametrize(("name", "old", "new"), MUTANTS)
def test_half_a_constant_breaks_a_law(name: str, old: str, new: str) -> None:
    """A mutant with half of one constant is found out."""
    with pytest.raises(AssertionError, match=r"^(?!no longer)"):
        MODULES[name][1](mutated(name, old, new))
