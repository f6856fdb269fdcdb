"""How many digits are left where the parameters of a model are nearly dependent?

    python studies/ill_conditioned.py

writes ill_conditioned.md beside this file: designs of models far from the origin and of nearly
equal columns, from their rows and from their information alone. The error is that of the cost of
the weights found, beside exact rational arithmetic on the same floating-point rows; accuracy is
what the relaxation tells.
"""

import sys
from fractions import Fraction
from math import exp, log
from pathlib import Path

import numpy as np

import criteria
import edtk
from edtk.design.relaxation.relax import relax
from edtk.report.tables import markdown_table
from edtk.system.files import write_text

HERE = Path(__file__).parent
CANDIDATES = 101
GAP = 1e-6


def powers(low: float, high: float, degree: int) -> np.ndarray:
    """Rows of a polynomial on an interval."""
    return np.vander(np.linspace(low, high, CANDIDATES), degree + 1, increasing=True)


def nearly_equal(noise: float) -> np.ndarray:
    """Rows of which two columns differ by noise."""
    A = np.random.default_rng(0).normal(size=(CANDIDATES, 4))
    A[:, 3] = A[:, 2] + noise * A[:, 3]
    return A


MODELS = {
    "quadratic of the years 2000 to 2030": powers(2000, 2030, 2),
    "cubic on [300, 310]": powers(300, 310, 3),
    "degree 10 on [0, 1]": powers(0, 1, 10),
    "degree 14 on [-1, 1]": powers(-1, 1, 14),
    "degree 4 of the years 2000 to 2030": powers(2000, 2030, 4),
    "degree 6 on [10, 11]": powers(10, 11, 6),
    "columns that differ by 1e-5": nearly_equal(1e-5),
    "columns that differ by 1e-9": nearly_equal(1e-9),
}


def exact_costs(A: np.ndarray, weights: np.ndarray) -> dict[str, float]:
    """Costs of A and D of weights (n,) of rows (n, p), by rational arithmetic on these numbers."""
    p = A.shape[1]
    rows = [[Fraction(float(x)) for x in A[i]] for i in np.flatnonzero(weights)]
    w = [Fraction(float(x)) for x in weights[weights > 0]]
    M = [
        [sum(v * r[a] * r[b] for v, r in zip(w, rows, strict=True)) for b in range(p)]
        + [Fraction(int(a == b)) for b in range(p)]
        for a in range(p)
    ]
    log_det = 0.0
    for k in range(p):
        pivot = M[k][k]
        log_det += logarithm(pivot)
        M[k] = [x / pivot for x in M[k]]
        for a in range(p):
            if a != k:
                factor = M[a][k]
                M[a] = [x - factor * y for x, y in zip(M[a], M[k], strict=True)]
    return {"A": float(sum(M[a][p + a] for a in range(p))), "D": exp(-log_det / p)}


def logarithm(x: Fraction) -> float:
    """Natural logarithm of a positive fraction, however long its numbers are."""

    def of(number: int) -> float:
        shift = max(number.bit_length() - 200, 0)
        return log(number >> shift) + shift * log(2.0)

    return of(x.numerator) - of(x.denominator)


def cells(problem: edtk.Problem, A: np.ndarray, name: str) -> list[str]:
    """Proved gap, error and accuracy of a problem whose rows are A."""
    try:
        found = relax(problem, criteria.create(name), GAP)
    except ValueError:
        return ["-", "-", "-"]
    error = abs(found.cost / exact_costs(A, found.weights)[name] - 1)
    return [f"{max(found.gap, 0.0):.0e}", f"{error:.0e}", f"{found.accuracy:.0e}"]


def main() -> int:
    """Write the report; 1 if an error exceeds the accuracy, or a gap that and the one asked for."""
    table = []
    for model, A in MODELS.items():
        rows = edtk.Problem(A[:, None, :])
        squares = edtk.Problem.of_information(rows.packed)
        for name in ("D", "A"):
            own = [*cells(rows, A, name), *cells(squares, A, name)]
            table.append([model, f"{rows.conditioning.number:.0e}", name, *own])
    told = [row[i : i + 3] for row in table for i in (3, 6) if row[i] != "-"]
    holds = all(float(e) <= float(a) and float(g) <= GAP + float(a) for g, e, a in told)
    header = ["model", "condition", "criterion", "gap", "error", "accuracy"]
    header += [f"{word} of squares" for word in header[3:]]
    text = (
        "# Nearly dependent parameters\n\n"
        "`python studies/ill_conditioned.py` wrote this file: relaxations from rows, and from "
        "information alone (squares), which is refused where it has no digits left. Every error "
        "is below the accuracy that is told. A bound is lowered by what rounding may have added: "
        "every gap is below 1e-6 and that accuracy together: "
        f"{'yes' if holds else 'no'}.\n\n{markdown_table(header, table)}\n"
    )
    write_text(HERE / "ill_conditioned.md", text)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
