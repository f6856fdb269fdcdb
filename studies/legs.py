"""Ten thousand legs of a robot in its cell: how long a proof takes, and whether one is ever wrong.

Each leg that is called free is driven again in steps of a millimetre: no point of a body moves
farther between two samples. Run it with ``python studies/legs.py STUDY [LEGS]``.
"""

import sys
from collections import Counter
from dataclasses import replace
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


def touching_samples(cell: Cell, a: Array, b: Array) -> int:
    """Number of the samples of one leg in which something touches."""
    # The fastest end of a capsule, by its chords; a fifth more than they are long.
    ends = cell.frames(np.linspace(a, b, CHORDS + 1))
    moved = np.diff(np.stack(cell.solids.placed(ends)), axis=-1)
    fastest = 1.2 * CHORDS * float(np.linalg.norm(moved, axis=1).max())
    t = np.linspace(0.0, 1.0, int(np.ceil(fastest / STEP)) + 1)
    return int((~cell.free(a + t[:, None] * (b - a))).sum())


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
    allowed = replace(cell, margin=cell.margin - TOLERANCE)
    free = np.flatnonzero(legs.free)
    wrong = sum(touching_samples(allowed, a[i], b[i]) > 0 for i in free)
    print(f"called free though a sample touches: {wrong} of {len(free)}")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 10_000)
