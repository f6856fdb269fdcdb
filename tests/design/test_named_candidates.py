"""Candidates as statisticians name them, against published tables and against first principles."""

from itertools import combinations

import numpy as np
import pandas as pd
import pytest

import edtk
from edtk.candidates import (
    box_behnken,
    central_composite,
    coded,
    defining_relation,
    extreme_vertices,
    fractional_factorial,
    full_factorial,
    latin_hypercube,
    n_choose_k,
    natural,
    plackett_burman,
    simplex_centroid,
    simplex_lattice,
    sobol,
)

FLARE = {"Mg": (0.40, 0.60), "Na": (0.10, 0.50), "Sr": (0.10, 0.50), "binder": (0.03, 0.08)}
# McLean and Anderson, Technometrics 8 (1966): the fifteen mixtures of their table, in percent.
FLARE_TABLE = [
    (40, 10, 47, 3), (40, 10, 42, 8), (60, 10, 27, 3), (60, 10, 22, 8),
    (40, 47, 10, 3), (40, 42, 10, 8), (60, 27, 10, 3), (60, 22, 10, 8),
    (50, 10, 34.5, 5.5), (50, 34.5, 10, 5.5), (40, 27.25, 27.25, 5.5),
    (60, 17.25, 17.25, 5.5), (50, 23.5, 23.5, 3), (50, 21, 21, 8), (50, 22.25, 22.25, 5.5),
]  # fmt: skip


def points(frame: pd.DataFrame) -> set[tuple[float, ...]]:
    """The rows without their order."""
    return {tuple(row) for row in np.round(frame.to_numpy(dtype=float), 9) + 0.0}


def test_flares_are_those_of_mclean_and_anderson() -> None:
    """Eight vertices, six centroids of planes and that of the whole, as they were printed."""
    table = {tuple(np.round(np.array(row) / 100, 9)) for row in FLARE_TABLE}
    corners = points(extreme_vertices(FLARE))
    assert len(corners) == 8
    assert corners <= table
    edges = points(extreme_vertices(FLARE, centroids=1)) - corners
    assert len(edges) == 12
    assert points(extreme_vertices(FLARE, centroids=3)) - edges == table


@pytest.mark.parametrize("seed", range(6))
def test_vertices_are_all_that_meet_in_a_point(seed: int) -> None:
    """They are the feasible ones of all points where constraints meet, found one by one."""
    rng = np.random.default_rng(seed)
    q = 3 + seed % 3
    low = rng.uniform(0, 0.15, q)
    high = low + rng.uniform(0.2, 0.7, q)
    sums = rng.uniform(-1, 1, (2, q))
    inside = low + (1 - low.sum()) * np.full(q, 1 / q)
    triples = [(row, float(row @ inside) - 0.1, float(row @ inside) + 0.2) for row in sums]
    if (inside > high).any():
        high = np.maximum(high, inside + 0.01)
    G = np.vstack([np.eye(q), -np.eye(q), sums, -sums])
    limits = [t[2] for t in triples] + [-t[1] for t in triples]
    h = np.concatenate([high, -low, limits])
    expected = set()
    for some in combinations(range(len(G)), q - 1):
        A = np.vstack([np.ones(q), G[list(some)]])
        if abs(np.linalg.det(A)) > 1e-9:
            x = np.linalg.solve(A, np.append(1.0, h[list(some)]))
            if (G @ x <= h + 1e-9).all():
                expected.add(tuple(np.round(x, 7) + 0.0))
    names = [f"x{i}" for i in range(q)]
    box = dict(zip(names, zip(low, high, strict=True), strict=True))
    found = extreme_vertices(box, triples).to_numpy()
    assert {tuple(np.round(x, 7) + 0.0) for x in found} == expected
    assert len(found) == len(expected)
    assert np.abs(found.sum(axis=1) - 1).max() < 1e-14


def test_a_polytope_without_room_is_what_is_left_of_it() -> None:
    """An equation leaves a segment, two leave a point; bounds alone leave the corners of a box."""
    box = {"a": (0.0, 1.0), "b": (0.0, 0.4), "c": (0.1, 0.8)}
    segment = extreme_vertices(box, [({"a": 1}, 0.2, 0.2)], centroids=1)
    assert segment.to_numpy().tolist() == [[0.2, 0.4, 0.4], [0.2, 0.0, 0.8], [0.2, 0.2, 0.6]]
    point = extreme_vertices(box, [({"a": 1}, 0.2, 0.2), ({"b": 1, "c": -1}, 0, 0)], centroids=2)
    assert point.to_numpy().tolist() == [[0.2, 0.4, 0.4]]
    cube = extreme_vertices({"a": (1, 2), "b": (0, 3), "c": (5, 6)}, total=None, centroids=3)
    assert len(cube) == 27
    assert points(cube) == points(
        full_factorial({"a": [1, 1.5, 2], "b": [0, 1.5, 3], "c": [5, 5.5, 6]})
    )


def test_mixtures_of_some_components_obey_bounds_where_these_are_present() -> None:
    """NChooseK: of each set of at most two components the vertices, absent ones being zero."""
    box = {"a": (0.3, 0.8), "b": (0.3, 0.8), "c": (0.3, 1.0)}
    found = points(extreme_vertices(box, present=(1, 2)))
    pairs = {
        (0.3, 0.7, 0),
        (0.7, 0.3, 0),
        (0.7, 0, 0.3),
        (0.3, 0, 0.7),
        (0, 0.7, 0.3),
        (0, 0.3, 0.7),
    }
    assert found == pairs | {(0, 0, 1)}


@pytest.mark.parametrize(
    ("q", "m", "number"), [(1, 3, 1), (3, 2, 6), (3, 3, 10), (4, 3, 20), (5, 2, 15)]
)
def test_lattices_are_scheffes(q: int, m: int, number: int) -> None:
    """All mixtures in multiples of one m-th, each once."""
    found = simplex_lattice(q, m).to_numpy()
    assert len(points(pd.DataFrame(found))) == len(found) == number
    assert np.allclose(found.sum(axis=1), 1)
    assert np.allclose(found * m, np.round(found * m))


def test_centroids_are_equal_parts_of_each_set() -> None:
    """Three components: three pure ones, three halves, and the thirds."""
    found = simplex_centroid(["a", "b", "c"], total=6).to_numpy()
    assert found.tolist()[:3] == [[6, 0, 0], [0, 6, 0], [0, 0, 6]]
    assert found.tolist()[3:] == [[3, 3, 0], [3, 0, 3], [0, 3, 3], [2, 2, 2]]


@pytest.mark.parametrize(
    ("k", "generators", "resolution", "words"),
    [
        (3, "C=AB", 3, 1),
        (5, "E=ABCD", 5, 1),
        (7, ["E=ABC", "F=BCD", "G=ACD"], 4, 7),
        (7, ["D=AB", "E=AC", "F=BC", "G=ABC"], 3, 15),
        (8, ["E=BCD", "F=ACD", "G=ABC", "H=ABD"], 4, 15),
    ],
)
def test_fractions_of_the_nist_handbook(
    k: int, generators: str | list[str], resolution: int, words: int
) -> None:
    """Fractions of its table 5.3.3.4.7 have their resolution, and orthogonal main effects."""
    found = fractional_factorial(k, generators).to_numpy()
    relation = defining_relation(k, generators)
    assert (len(relation), len(relation[0])) == (words, resolution)
    assert np.array_equal(found.T @ found, len(found) * np.eye(k))
    letters = dict(zip("ABCDEFGHJ", found.T, strict=False))
    for word in relation:
        sign = -1 if word[0] == "-" else 1
        assert (sign * np.prod([letters[one] for one in word.lstrip("-")], axis=0) == 1).all()


def test_the_other_half_has_the_other_sign() -> None:
    """A minus in a generator takes the other half; names of one letter are the letters."""
    found = fractional_factorial({"T": (20, 40), "P": (1, 2), "R": (0, 1)}, "R=-TP")
    assert found.to_numpy().tolist() == [[20, 1, 0], [40, 1, 1], [20, 2, 1], [40, 2, 0]]
    assert defining_relation(["T", "P", "R"], "R=-TP") == ("-TPR",)


@pytest.mark.parametrize("k", [3, 7, 11, 15, 19, 23, 27, 35, 43])
def test_plackett_and_burman_designs_are_orthogonal(k: int) -> None:
    """One run more than factors, all main effects orthogonal to each other and to the mean."""
    found = plackett_burman(k).to_numpy()
    assert len(found) == k + 1
    assert np.array_equal(found.T @ found, (k + 1) * np.eye(k))
    assert not found.sum(axis=0).any()


def test_plackett_and_burmans_rows_are_those_of_their_paper() -> None:
    """The rows from which 12, 20 and 24 runs are made by cyclic shifts."""
    rows = {11: "++-+++---+-", 19: "++--++++-+-+----++-", 23: "+++++-+-++--++--+-+----"}
    for k, signs in rows.items():
        first = plackett_burman(k).to_numpy()[0]
        assert "".join("+" if x > 0 else "-" for x in first) == signs


def test_composite_designs_are_rotatable_orthogonal_or_on_faces() -> None:
    """Axial distances are those of the NIST handbook's table, and squares are uncorrelated."""
    assert central_composite(5, generators="E=ABCD").max().max() == pytest.approx(2.0)
    assert central_composite(3).max().max() == pytest.approx(1.682, abs=5e-4)
    assert central_composite(2, "face").to_numpy().max() == 1
    found = central_composite(3, "orthogonal", center=4).to_numpy()
    squares = found**2 - (found**2).mean(axis=0)
    assert np.allclose(squares.T @ squares, np.diag(np.diag(squares.T @ squares)))


@pytest.mark.parametrize(
    ("k", "runs", "times"), [(3, 12, 8), (4, 24, 12), (6, 48, 24), (7, 56, 24)]
)
def test_box_and_behnken_designs_are_balanced(k: int, runs: int, times: int) -> None:
    """As many runs as in their paper, each factor as often away from the middle."""
    found = box_behnken(k, center=0).to_numpy()
    assert len(points(pd.DataFrame(found))) == len(found) == runs
    assert (np.abs(found).sum(axis=0) == times).all()
    assert np.array_equal(found.T @ found, times * np.eye(k))


def test_samples_fill_their_box() -> None:
    """Each part of a range has one point of a hypercube; both are the same for the same seed."""
    box = {"T": (300.0, 350.0), "P": (1.0, 3.0)}
    found = latin_hypercube(box, 10, seed=3)
    cells = np.floor(coded(found, box).to_numpy() * 5 + 5)
    assert all(sorted(column) == list(range(10)) for column in cells.T)
    assert found.equals(latin_hypercube(box, 10, seed=3))
    assert len(sobol(box, 24)) == 24
    assert (coded(sobol(box, 24), box).abs() <= 1).all(axis=None)


def test_units_go_there_and_back() -> None:
    """Natural units of coded ones are those that a design in natural units has."""
    box = {"T": (300.0, 350.0), "P": (1.0, 3.0)}
    there = natural(central_composite(["T", "P"]), box)
    assert np.allclose(there, central_composite(box))
    assert np.allclose(coded(there, box), central_composite(["T", "P"]))


def test_frames_are_what_problems_take() -> None:
    """Scheffe's quadratic model is told best by the lattice {3, 2}, a sixth of weight each."""
    mixtures = simplex_lattice(["a", "b", "c"], 6)
    model = edtk.Problem.from_frame(mixtures, "0 + a + b + c + a:b + a:c + b:c")
    found = edtk.relax(model, "D").to_frame()
    assert points(found[["a", "b", "c"]]) == points(simplex_lattice(3, 2))
    assert found["weight"].to_numpy() == pytest.approx(1 / 6, abs=1e-5)
    few = n_choose_k(mixtures, ["a", "b", "c"], most=2)
    assert len(few) == len(mixtures) - 10


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: fractional_factorial(4, "D=AX"), "generators 'D=AX': expected a factor"),
        (lambda: fractional_factorial(4, ["C=AB", "D=AC"]), "generators 'D=AC'"),
        (lambda: box_behnken(8), "three to seven"),
        (lambda: central_composite(2, "round"), "alpha 'round': expected a number above 0"),
        (lambda: full_factorial({"a": [1, 1]}), "level 1 is there twice"),
        (lambda: full_factorial({"a": []}), "expected a level or more"),
        (lambda: full_factorial({f"x{i}": 10 for i in range(9)}), "candidates are more than"),
        (lambda: extreme_vertices({"a": (0, 0.3), "b": (0, 0.3)}), "within the bounds obeys total"),
        (
            lambda: extreme_vertices({"a": (0, 1), "b": (0, 1)}, [({"a": 1, "z": 1}, 0, 1)]),
            "no component 'z'",
        ),
        (
            lambda: extreme_vertices(
                {"a": (0, 1), "b": (0, 1)}, [([1, 0], 0.7, 1), ([0, 1], 0.6, 1)]
            ),
            r"constraints\[0\] and constraints\[1\] and total",
        ),
        (lambda: extreme_vertices({"a": (0.5, 0.2), "b": (0, 1)}), "low below high"),
        (lambda: n_choose_k(pd.DataFrame({"a": [1]}), ["b"], 1), "no column 'b'; the frame has a"),
        (lambda: n_choose_k([1, 2], ["b"], 1), "frame: expected a data frame, not list"),
        (lambda: full_factorial(None), "factors: expected levels by name"),
        (lambda: n_choose_k(simplex_lattice(2, 2), ["A", "B"], 0), "most: no candidate .*: 1 to 2"),
        (lambda: simplex_lattice(["a", "a"], 2), "'a' is there twice"),
        (lambda: sobol("ab", 4), "expected a number of factors"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line(call: object, words: str) -> None:
    """What is wrong, and what was expected."""
    with pytest.raises(edtk.UserError, match=words) as caught:
        call()  # type: ignore[operator]
    assert "\n" not in str(caught.value)
