"""Candidates as statisticians name them: factorials, composite designs, mixtures, samples of boxes.

Each function gives a data frame with a column a factor and a row a candidate, for
`edtk.Problem.from_frame` and `edtk.Problem.of_model`. Factors are their number (they are called A,
B, C, ..., without I), their names, or a mapping of names to a low and a high value, in natural
units. Without values the units are coded: low is -1 and high is 1.

    >>> import edtk
    >>> runs = edtk.candidates.fractional_factorial(4, "D=ABC")
    >>> runs.head(3)
         A    B    C    D
    0 -1.0 -1.0 -1.0 -1.0
    1  1.0 -1.0 -1.0  1.0
    2 -1.0  1.0 -1.0  1.0
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb, isqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.linear_constraints import Linear, linear_constraints
from edtk.design.polytope import DIGITS, Polytope
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, whole_number
from edtk.system.typing import Array, Mask

if TYPE_CHECKING:
    import pandas as pd

Factors = int | Sequence[str] | Mapping[str, Any]

LETTERS = "ABCDEFGHJKLMNOPQRSTUVWXYZ"  # I is the identity of defining relations
MOST_ROWS = 10_000_000


# ---------------------------------------------------------------- factorials


def full_factorial(factors: Mapping[str, Any] | Sequence[int]) -> "pd.DataFrame":
    """All combinations of the levels of factors; the first factor changes fastest.

    Args:
        factors: Levels by name: a list of values of any kind, or a number of levels, which then are
            evenly spaced from -1 to 1. Or a list of numbers of levels.

    Example:
        >>> import edtk
        >>> len(edtk.candidates.full_factorial({"oven": ["left", "right"], "time": [10, 20, 30]}))
        6
    """
    import pandas as pd

    given: Any = factors
    if not isinstance(given, Mapping | Sequence):
        message = "expected levels by name, or a list of numbers of levels"
        raise ArgumentError(message, argument="factors")
    if not isinstance(given, Mapping):
        given = dict(zip(_letters(len(given)), given, strict=True))
    if not given:
        raise ArgumentError("expected a factor or more", argument="factors")
    levels = {name: _levels(name, one) for name, one in given.items()}
    number = 1
    for one in levels.values():
        number *= len(one)
    _require_few(number)
    # The last factor of a product changes fastest.
    index = np.indices([len(one) for one in reversed(levels.values())]).reshape(len(levels), -1)
    columns = zip(levels.items(), reversed(index), strict=True)
    return pd.DataFrame({name: pd.Series(one).take(own).array for (name, one), own in columns})


def _levels(name: str, given: object) -> Sequence[Any]:
    """The levels of a factor.

    Raises:
        ArgumentError: There are none, or one is there twice.
    """
    if isinstance(given, int):
        number = whole_number(given, f"factors[{name!r}]", 1)
        return [0.0] if number == 1 else np.linspace(-1.0, 1.0, number).tolist()
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise ArgumentError("expected a list of levels, or their number", argument=_of(name))
    levels = list(given)
    if not levels:
        raise ArgumentError("expected a level or more", argument=_of(name))
    twice = [level for i, level in enumerate(levels) if level in levels[:i]]
    if twice:
        raise ArgumentError(f"level {twice[0]!r} is there twice", argument=_of(name))
    return levels


@checked
def fractional_factorial(factors: Factors, generators: str | Sequence[str]) -> "pd.DataFrame":
    """A two-level factorial of some factors, of which generators make the others.

    Args:
        factors: The factors. In generators each has its letter: its name where all names are single
            letters, else A for the first, B for the second and so on, without I.
        generators: Such as "E=ABCD", or several; "D=-AB" takes the other half.

    Returns:
        ``2^(k - g)`` rows for k factors and g generators, those without a generator in standard
        order: the first changes fastest.

    Example:
        >>> import edtk
        >>> edtk.candidates.fractional_factorial(5, ["D=AB", "E=AC"]).shape
        (8, 5)
    """
    box = _Box.of(factors)
    words = _generated(box.letters, generators)
    free = [letter for letter in box.letters if letter not in words]
    _require_few(2 ** len(free))
    signs = dict(zip(free, _corners(len(free)).T, strict=True))
    for letter, (sign, others) in words.items():
        signs[letter] = sign * np.prod([signs[other] for other in others], axis=0)
    return box.frame(np.stack([signs[letter] for letter in box.letters], axis=1))


def defining_relation(factors: Factors, generators: str | Sequence[str]) -> tuple[str, ...]:
    """The words that are the identity in a fractional factorial, the shortest first.

    The length of the first is the design's resolution. See `fractional_factorial` for arguments.

    Example:
        >>> import edtk
        >>> edtk.candidates.defining_relation(5, ["D=AB", "E=AC"])
        ('ABD', 'ACE', 'BCDE')
    """
    letters = _Box.of(factors).letters
    words = [
        (sign, frozenset((letter, *others)))
        for letter, (sign, others) in _generated(letters, generators).items()
    ]
    found = []
    for size in range(1, len(words) + 1):
        for some in combinations(words, size):
            sign = 1
            joined: frozenset[str] = frozenset()
            for own, letters_of_word in some:
                sign *= own
                joined ^= letters_of_word
            ordered = sorted(joined, key=letters.index)
            found.append(("-" if sign < 0 else "") + "".join(ordered))
    return tuple(sorted(found, key=lambda word: (len(word.lstrip("-")), word)))


def _generated(
    letters: Sequence[str], generators: str | Sequence[str]
) -> dict[str, tuple[int, str]]:
    """Sign and letters that make each generated factor.

    Raises:
        ArgumentError: A generator is none, or names a letter that is no free factor.
    """
    given = [generators] if isinstance(generators, str) else list(generators)
    parts = [str(one).replace(" ", "").partition("=") for one in given]
    made = [left for left, _, _ in parts]
    found = {}
    for one, (left, equals, right) in zip(given, parts, strict=True):
        sign = -1 if right.startswith("-") else 1
        word = right.lstrip("+-")
        known = set(word) <= set(letters) - set(made) and len(set(word)) == len(word)
        if not equals or left not in letters or made.count(left) > 1 or not word or not known:
            expected = "a factor, =, and others that have no generator, such as 'D=ABC'"
            message = f"expected {expected}, of the letters {''.join(letters)}"
            raise ArgumentError(message, argument="generators", given=repr(one))
        found[left] = (sign, word)
    return found


def _corners(k: int) -> Array:
    """The corners (2^k, k) of a cube in standard order."""
    return np.asarray(2.0 * (np.arange(2**k)[:, None] >> np.arange(k) & 1) - 1.0)


def plackett_burman(factors: Factors) -> "pd.DataFrame":
    """A two-level screening design whose main effects are orthogonal, in few runs.

    The number of runs is the least multiple of four above the number of factors for which one of
    the constructions is known: of Paley with quadratic residues modulo a prime, which gives the
    cyclic designs of Plackett and Burman (Biometrika 33, 1946) of 12, 20 and 24 runs, and of
    Sylvester by doubling. Of up to a hundred runs 52, 92 and 100 are not among them.

    Example:
        >>> import edtk
        >>> edtk.candidates.plackett_burman(11).shape
        (12, 11)
    """
    box = _Box.of(factors)
    runs = 4 * (len(box.names) // 4 + 1)
    found = _hadamard(runs)
    while found is None:
        runs += 4
        _require_few(runs * runs)
        found = _hadamard(runs)
    return box.frame(found[:, 1 : len(box.names) + 1])


def _hadamard(n: int) -> Array | None:
    """An orthogonal matrix (n, n) of signs, its first column of ones; None if none is built."""
    if n <= 2:
        return np.array([[1.0, 1.0], [1.0, -1.0]])[:n, :n]
    if n % 4:
        return None
    if _is_prime(n - 1):
        # Cyclic shifts of the first row, and a last one of minus signs.
        first = _residues(n - 1)
        first[0] = 1.0
        q = n - 1
        shifted = first[(np.arange(q)[None, :] - np.arange(q)[:, None]) % q]
        return np.column_stack([np.ones(n), np.vstack([shifted, -np.ones(q)])])
    half = _hadamard(n // 2)
    if half is not None:
        return np.block([[half, half], [half, -half]])
    q = n // 2 - 1
    return _of_paley(q) if q % 4 == 1 and _is_prime(q) else None


def _of_paley(q: int) -> Array:
    """Paley's second construction (2q + 2, 2q + 2) for a prime q of the form 4k + 1."""
    residues = _residues(q)
    C = np.zeros((q + 1, q + 1))
    C[0, 1:] = C[1:, 0] = 1.0
    C[1:, 1:] = residues[(np.arange(q)[:, None] - np.arange(q)[None, :]) % q]
    found = np.kron(C, np.array([[1.0, 1.0], [1.0, -1.0]]))
    found += np.kron(np.eye(q + 1), np.array([[1.0, -1.0], [-1.0, -1.0]]))
    return np.asarray(found * found[:, :1])


def _residues(q: int) -> Array:
    """Legendre's symbols (q,) of 0, .., q - 1 modulo a prime."""
    found = -np.ones(q)
    found[np.arange(1, q) ** 2 % q] = 1.0
    found[0] = 0.0
    return found


def _is_prime(q: int) -> bool:
    return q > 1 and all(q % d for d in range(2, isqrt(q) + 1))


# ---------------------------------------------------------------- response surfaces


@checked
def central_composite(
    factors: Factors,
    alpha: float | str = "rotatable",
    center: int = 1,
    generators: str | Sequence[str] = (),
) -> "pd.DataFrame":
    """Corners of a cube, two points on each axis, and the center.

    Args:
        factors: The factors; low and high are those of the corners.
        alpha: Distance of the axial points from the center, in parts of that of low and high.
            "rotatable" is the fourth root of the number of corners, "face" is 1, "spherical" is the
            root of the number of factors, and "orthogonal" makes squares uncorrelated:
            ``(F ((F + 2k + c)^(1/2) - F^(1/2))^2 / 4)^(1/4)`` (Myers and Montgomery).
        center: Number of runs c at the center.
        generators: Generators of a fraction of the corners, see `fractional_factorial`.

    Example:
        >>> import edtk
        >>> edtk.candidates.central_composite({"T": (300, 350), "P": (1, 3)}, "face").tail(3)
               T    P
        6  325.0  1.0
        7  325.0  3.0
        8  325.0  2.0
    """
    box = _Box.of(factors)
    k = len(box.names)
    center = whole_number(center, "center", 0)
    names = box.letters if generators else k
    corners = fractional_factorial(names, generators).to_numpy()
    F = float(len(corners))
    known = {
        "rotatable": F**0.25,
        "face": 1.0,
        "spherical": k**0.5,
        "orthogonal": (F * (np.sqrt(F + 2 * k + center) - np.sqrt(F)) ** 2 / 4) ** 0.25,
    }
    far = known.get(alpha) if isinstance(alpha, str) else float(alpha)
    if far is None or not (np.isfinite(far) and far > 0):
        message = f"expected a number above 0, or one of {', '.join(known)}"
        raise ArgumentError(message, argument="alpha", given=repr(alpha))
    axial = np.kron(np.eye(k), [[-far], [far]])
    return box.frame(np.vstack([corners, axial, np.zeros((center, k))]))


# Which factors are varied together, of six and of seven (Box and Behnken, Technometrics 2, 1960).
TRIPLES = {
    6: [(0, 1, 3), (1, 2, 4), (2, 3, 5), (0, 3, 4), (1, 4, 5), (0, 2, 5)],
    7: [(3, 4, 5), (0, 5, 6), (1, 4, 6), (0, 1, 3), (2, 3, 6), (0, 2, 4), (1, 2, 5)],
}


def box_behnken(factors: Factors, center: int = 1) -> "pd.DataFrame":
    """Two factors at a time at low and high, the others between (Box and Behnken 1960).

    Of six or seven factors it is three at a time, as in the table of their paper.

    Args:
        factors: Three to seven factors.
        center: Number of runs at the center.

    Example:
        >>> import edtk
        >>> [len(edtk.candidates.box_behnken(k, center=0)) for k in (3, 4, 5, 6, 7)]
        [12, 24, 40, 48, 56]
    """
    box = _Box.of(factors)
    k = len(box.names)
    if not 3 <= k <= 7:
        raise ArgumentError("expected three to seven factors", argument="factors", given=k)
    center = whole_number(center, "center", 0)
    groups = TRIPLES.get(k, combinations(range(k), 2))
    blocks = []
    for group in groups:
        block = np.zeros((2 ** len(group), k))
        block[:, list(group)] = _corners(len(group))
        blocks.append(block)
    return box.frame(np.vstack([*blocks, np.zeros((center, k))]))


# ---------------------------------------------------------------- mixtures


@checked
def simplex_lattice(
    components: int | Sequence[str], degree: int, total: float = 1.0
) -> "pd.DataFrame":
    """All mixtures of q components in multiples of one m-th: Scheffe's {q, m} lattice (1958).

    Args:
        components: Their number or names.
        degree: m.
        total: What the components sum to.

    Example:
        >>> import edtk
        >>> len(edtk.candidates.simplex_lattice(["water", "acid", "salt"], degree=3))
        10
    """
    names = _Box.of(components).names
    m = whole_number(degree, "degree", 1)
    q = len(names)
    number = comb(q + m - 1, m)
    _require_few(number)
    # Bars between stars: m stars and q - 1 bars in a row.
    places = list(combinations(range(q + m - 1), q - 1))
    bars = np.array(places, dtype=int).reshape(number, q - 1)
    ends = np.pad(bars, ((0, 0), (1, 1)), constant_values=(-1, q + m - 1))
    counts = np.diff(ends, axis=1) - 1
    return _frame(counts[::-1] * (_total(total) / m), names)


@checked
def simplex_centroid(components: int | Sequence[str], total: float = 1.0) -> "pd.DataFrame":
    """Equal parts of each set of components: Scheffe's centroid design (1963) of 2^q - 1 mixtures.

    Args:
        components: Their number or names.
        total: What the components sum to.
    """
    names = _Box.of(components).names
    q = len(names)
    _require_few(2**q - 1)
    sets = [some for size in range(1, q + 1) for some in combinations(range(q), size)]
    parts = np.zeros((len(sets), q))
    for row, some in zip(parts, sets, strict=True):
        row[list(some)] = _total(total) / len(some)
    return _frame(parts, names)


@checked
def extreme_vertices(
    components: Mapping[str, tuple[float, float]],
    constraints: Sequence[Linear] = (),
    *,
    total: float | None = 1.0,
    centroids: int = 0,
    present: Sequence[int] | None = None,
) -> "pd.DataFrame":
    """The vertices of the mixtures within bounds and linear constraints (McLean, Anderson 1966).

    Args:
        components: Least and largest amount by name.
        constraints: Triples of coefficients, a least and a largest sum (None for no limit);
            coefficients are as many numbers as components, or a mapping of some names.
        total: What the components sum to; None where they are factors of their own.
        centroids: Up to which dimension the centroids of faces, the means of their vertices, follow
            the vertices: 1 for edges, 2 for planes too, and so on; that of the whole comes last.
        present: The least and the largest number of components that a mixture has (NChooseK). The
            bounds are those of components that are present; others are zero.

    Raises:
        ArgumentError: No mixture is within the constraints; the message names some that contradict
            each other.

    Example:
        McLean and Anderson's flares of magnesium, nitrates of sodium and strontium, and a binder:

        >>> import edtk
        >>> flare = {"Mg": (0.4, 0.6), "Na": (0.1, 0.5), "Sr": (0.1, 0.5), "binder": (0.03, 0.08)}
        >>> len(edtk.candidates.extreme_vertices(flare))
        8
        >>> len(edtk.candidates.extreme_vertices(flare, centroids=3))  # 12 edges, 6 planes, 1
        27
    """
    box = _Box.of(components)
    q = len(box.names)
    whole_number(centroids, "centroids", 0)
    rows = linear_constraints(constraints, box.coefficients, q)
    if total is not None:
        rows = rows.and_also(np.ones((1, q)), _total(total), _total(total), "total")
    limits = np.stack([box.low, box.high])
    found = []
    for absent in _absences(q, present):
        low, high = np.where(absent, 0.0, limits)
        clash = rows.conflict(low, high)
        if clash and not absent.any():
            message = f"no mixture within the bounds obeys {' and '.join(clash)}"
            raise ArgumentError(message, argument="constraints")
        if not clash:
            found.append(Polytope.of(rows, low, high).corners_and_centroids(centroids))
    if not found:
        message = "no mixture of so many components is within the constraints"
        raise ArgumentError(message, argument="present", given=present)
    size = max(float(np.abs(limits).max()), 1e-300)
    points = np.concatenate(found)
    # A mixture of few components may be a vertex of several sets.
    _, first = np.unique(np.round(points / size, DIGITS), axis=0, return_index=True)
    return _frame(points[np.sort(first)], box.names)


@checked
def n_choose_k(
    frame: "pd.DataFrame", columns: str | Sequence[str], most: int, least: int = 0
) -> "pd.DataFrame":
    """The candidates of which at least and at most so many columns are not zero (NChooseK).

    Args:
        frame: The candidates.
        columns: Names of the columns that count; those of one letter may be one text.
        most: The largest number of them.
        least: The least number of them.

    Example:
        >>> import edtk
        >>> mixtures = edtk.candidates.simplex_lattice(["a", "b", "c", "d"], 4)
        >>> len(edtk.candidates.n_choose_k(mixtures, ["a", "b", "c", "d"], most=2))
        22
    """
    _require_columns(frame, columns, "columns")
    least = whole_number(least, "least", 0)
    most = whole_number(most, "most", least)
    number = (frame[list(columns)] != 0).sum(axis=1)
    fits = (number >= least) & (number <= most)
    if not fits.any():
        there = f"{number.min()} to {number.max()}" if len(number) else "none"
        message = f"no candidate has {least} to {most} of these columns that are not zero: {there}"
        raise ArgumentError(message, argument="most")
    return frame[fits].reset_index(drop=True)


def _absences(q: int, present: Sequence[int] | None) -> list[Mask]:
    """Which components (q,) are absent, in each of the sets that are asked for."""
    if present is None:
        return [np.zeros(q, dtype=bool)]
    try:
        least, most = present
    except (TypeError, ValueError) as error:
        message = "expected two numbers: the least and the largest of components that are present"
        raise ArgumentError(message, argument="present", given=present) from error
    least = whole_number(least, "present", 0)
    most = whole_number(most, "present", least)
    if most > q:
        raise ArgumentError(f"there are {q} components", argument="present", given=present)
    found = []
    for size in range(least, most + 1):
        for some in combinations(range(q), size):
            absent = np.ones(q, dtype=bool)
            absent[list(some)] = False
            found.append(absent)
    return found


# ---------------------------------------------------------------- samples of a box


def latin_hypercube(factors: Factors, n: int, seed: int = 0) -> "pd.DataFrame":
    """A sample of a box in which each n-th of the range of each factor has one point.

    It is that of `scipy.stats.qmc.LatinHypercube`, exchanged for a small centered discrepancy.

    Args:
        factors: The factors.
        n: Number of points.
        seed: Seed.
    """
    from scipy.stats import qmc

    box = _Box.of(factors)
    n = whole_number(n, "n", 1)
    improved = "random-cd" if n > 1 and len(box.names) > 1 else None
    sampler = qmc.LatinHypercube(
        len(box.names), optimization=improved, seed=whole_number(seed, "seed", 0)
    )
    return box.frame(2.0 * sampler.random(n) - 1.0)


def sobol(factors: Factors, n: int, seed: int = 0) -> "pd.DataFrame":
    """The first points of a scrambled Sobol sequence in a box; best in numbers of powers of two.

    Args:
        factors: The factors.
        n: Number of points.
        seed: Seed of the scrambling.
    """
    from scipy.stats import qmc

    box = _Box.of(factors)
    n = whole_number(n, "n", 1)
    _require_few(n)
    if len(box.names) > qmc.Sobol.MAXDIM:
        message = f"expected {qmc.Sobol.MAXDIM} or fewer"
        raise ArgumentError(message, argument="factors", given=len(box.names))
    sampler = qmc.Sobol(len(box.names), seed=whole_number(seed, "seed", 0))
    # Of another number than a power of two scipy warns; the first points of more are the same.
    return box.frame(2.0 * sampler.random_base2((n - 1).bit_length())[:n] - 1.0)


# ---------------------------------------------------------------- units


def natural(frame: "pd.DataFrame", factors: Mapping[str, tuple[float, float]]) -> "pd.DataFrame":
    """Columns of coded units in natural ones: -1 becomes the low value, and 1 the high one.

    Args:
        frame: The candidates.
        factors: Low and high value of each column to change.

    Example:
        >>> import edtk
        >>> runs = edtk.candidates.full_factorial({"T": 2})
        >>> edtk.candidates.natural(runs, {"T": (300, 350)})["T"].tolist()
        [300.0, 350.0]
    """
    box = _Box.of(factors)
    own = _columns(frame, box.names)
    return frame.assign(**dict(zip(box.names, box.natural(own).T, strict=True)))


def coded(frame: "pd.DataFrame", factors: Mapping[str, tuple[float, float]]) -> "pd.DataFrame":
    """Columns of natural units in coded ones: the low value becomes -1, and the high one 1."""
    box = _Box.of(factors)
    middle = 0.5 * (box.low + box.high)
    found = (_columns(frame, box.names) - middle) / (0.5 * (box.high - box.low))
    return frame.assign(**dict(zip(box.names, found.T, strict=True)))


def _columns(frame: "pd.DataFrame", names: Sequence[str]) -> Array:
    """Some columns (n, k) of a frame."""
    _require_columns(frame, names, "factors")
    return frame[list(names)].to_numpy(dtype=float)


def _require_columns(frame: "pd.DataFrame", names: Iterable[str], argument: str) -> None:
    """Check that a data frame has such columns.

    Raises:
        ArgumentError: It is none, or has not.
    """
    if not hasattr(frame, "columns"):
        message = f"expected a data frame, not {type(frame).__name__}"
        raise ArgumentError(message, argument="frame")
    missing = [name for name in names if name not in frame.columns]
    if missing:
        message = f"no column {missing[0]!r}; the frame has {', '.join(map(str, frame.columns))}"
        raise ArgumentError(message, argument=argument)


@dataclass(frozen=True, eq=False)
class _Box:
    """Factors by their names, with low and high values (k,)."""

    names: tuple[str, ...]
    low: Array
    high: Array

    @classmethod
    def of(cls, given: object) -> "_Box":
        """The factors as a user gives them, see the head of this module.

        Raises:
            ArgumentError: They are none, a name is there twice, or low is not below high.
        """
        if isinstance(given, Mapping):
            names = tuple(map(str, given))
            pairs = [_pair(name, one) for name, one in given.items()]
            low, high = np.array(pairs, dtype=float).reshape(-1, 2).T
        else:
            names = _names(given)
            low = -np.ones(len(names))
            high = np.ones(len(names))
        if not names:
            raise ArgumentError("expected a factor or more", argument="factors")
        if len(set(names)) < len(names):
            message = f"{next(n for n in names if names.count(n) > 1)!r} is there twice"
            raise ArgumentError(message, argument="factors")
        return cls(names, low, high)

    @property
    def letters(self) -> tuple[str, ...]:
        """What generators call the factors."""
        single = all(len(name) == 1 for name in self.names)
        return self.names if single else _letters(len(self.names))

    def natural(self, coded: Array) -> Array:
        """Points (n, k) of coded units in natural ones."""
        return 0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * coded

    def frame(self, coded: Array) -> "pd.DataFrame":
        """Points (n, k) of coded units as a data frame."""
        return _frame(self.natural(coded), self.names)

    def coefficients(self, given: object) -> tuple[Array, str]:
        """Coefficients (k,) of the factors, as numbers or by name."""
        if not isinstance(given, Mapping):
            return np.asarray(given), ""
        unknown = [name for name in given if name not in self.names]
        if unknown:
            message = f"no component {unknown[0]!r}, there are {', '.join(self.names)}"
            raise ArgumentError(message, argument="constraints")
        return np.array([given.get(name, 0.0) for name in self.names]), ""


def _names(given: object) -> tuple[str, ...]:
    """Names of so many factors, or those given."""
    if isinstance(given, int | np.integer):
        return _letters(whole_number(given, "factors", 1))
    if isinstance(given, str) or not isinstance(given, Iterable):
        message = "expected a number of factors, their names, or a mapping to (low, high)"
        raise ArgumentError(message, argument="factors", given=repr(given))
    return tuple(map(str, given))


def _letters(k: int) -> tuple[str, ...]:
    """Letters for k factors; beyond 25 they are x1, x2, ..."""
    return tuple(LETTERS[:k]) if k <= len(LETTERS) else tuple(f"x{i + 1}" for i in range(k))


def _pair(name: str, given: object) -> tuple[float, float]:
    """Low and high value of a factor."""
    try:
        low, high = (float(one) for one in given)  # type: ignore[attr-defined]
    except (TypeError, ValueError) as error:
        message = "expected two numbers, low and high"
        raise ArgumentError(message, argument=_of(name), given=repr(given)) from error
    if not (np.isfinite([low, high]).all() and low < high):
        message = "expected finite numbers, low below high"
        raise ArgumentError(message, argument=_of(name), given=repr(given))
    return low, high


def _of(name: object) -> str:
    return f"factors[{name!r}]"


def _total(given: float) -> float:
    """What the components of a mixture sum to."""
    if not (np.isfinite(given) and given > 0):
        raise ArgumentError("expected above 0", argument="total", given=given)
    return float(given)


def _frame(points: Array, names: Sequence[str]) -> "pd.DataFrame":
    """Points (n, k) as a data frame."""
    import pandas as pd

    return pd.DataFrame(points, columns=list(names))


def _require_few(number: int) -> None:
    """Refuse more candidates than memory holds well."""
    if number > MOST_ROWS:
        message = f"{number:,} candidates are more than {MOST_ROWS:,}"
        raise ArgumentError(message, argument="factors")
