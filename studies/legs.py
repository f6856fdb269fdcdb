"""Ten thousand legs of a robot in its cell: how long a proof takes, and whether one is ever wrong.

Each leg that is called free is driven again in steps of a millimetre: no point of a body moves
farther between two samples. Run it with ``python studies/legs.py STUDY [LEGS]``.
"""

import sys
from collections import Counter
from time import process_time

import numpy as np

import edtk
from edtk.cell.cell import Cell
from edtk.cell.legs import TOLERANCE, prove_legs
from edtk.system.typing import Array

STEP = 1e-3  # [m]
CHORDS = 200  # by which the way of a body is measured
ALONE = 100  # legs that are proved one by one


def legs_of(cell: Cell, count: int) -> tuple[Array, Array]:
    """Legs between random free poses; half of them lead a quarter of the way."""
    rng = np.random.default_rng(2026)
    lower, upper = cell.robot.limits
    drawn = rng.uniform(lower, upper, (20 * count, cell.robot.n))
    free = drawn[cell.free(drawn)][: 2 * count]
    a, b = free[:count], free[count:]
    b[::2] = a[::2] + (b - a)[::2] / 4
    return a, b


def least_at_samples(cell: Cell, a: Array, b: Array) -> float:
    """Least clearance of the samples of one leg [m]."""
    # The fastest end of a capsule, by its chords; a fifth more than they are long.
    ends = cell.frames(np.linspace(a, b, CHORDS + 1))
    moved = np.diff(np.stack(cell.solids.placed(ends)), axis=-1)
    fastest = 1.2 * CHORDS * float(np.linalg.norm(moved, axis=1).max())
    number = int(np.ceil(fastest / STEP)) + 1
    least = np.inf
    for part in np.array_split(np.linspace(0.0, 1.0, number), number // 4096 + 1):
        least = min(least, float(cell.clearance(a + part[:, None] * (b - a)).least.min()))
    return least


def main(path: str, count: int) -> None:
    """Print the numbers of the page."""
    cell = edtk.load_study(path).cell
    assert cell is not None
    a, b = legs_of(cell, count)
    begun = process_time()
    legs = prove_legs(cell, a, b)
    together = (process_time() - begun) / count
    begun = process_time()
    for i in range(ALONE):
        prove_legs(cell, a[i : i + 1], b[i : i + 1])
    alone = (process_time() - begun) / ALONE
    print(path, dict(Counter(legs.verdict.tolist())), flush=True)
    print(f"{1e3 * together:.2f} ms a leg together, {1e3 * alone:.2f} ms one by one", flush=True)
    free = np.flatnonzero(legs.free)
    least = np.array([least_at_samples(cell, a[i], b[i]) for i in free])
    excess = legs.clearance[free] - least
    allowed = np.maximum(1e-3, 0.1 * legs.clearance[free])
    print(f"free legs with a sample that touches: {(least < -TOLERANCE).sum()} of {len(free)}")
    print(f"samples below what is promised: {(excess > allowed).sum()}")
    print(f"largest clearance told less that of samples: {1e3 * excess.max():.2f} mm")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 10_000)
