"""Certificates of many random problems, judged by a checker that shares no code with the package.

    python studies/certificates.py

Problems have 2 to 6 parameters, 8 to 60 candidates of one to three rows, and any criterion, those
with parameters included. Each certificate is checked as it is, and then with a bound that
is too good. It takes a minute, and writes `certificates.md` beside this file.
"""

import copy
import json
import sys
from collections import defaultdict
from pathlib import Path
from time import process_time

import numpy as np

import criteria
import edtk

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from plain_checker import RejectedError, check  # noqa: E402, from the tests
from stored_certificates import random_specification  # noqa: E402

NUMBER = 1000


def random_problem(i: int) -> tuple[np.ndarray, dict[str, object]]:
    """Rows (n, r, p) of the i-th problem, and its criterion."""
    rng = np.random.default_rng(10_000 + i)
    p = int(rng.integers(2, 7))
    shape = (int(rng.integers(8, 61)), int(rng.integers(1, min(p, 3) + 1)), p)
    A = np.round(rng.normal(size=shape) + rng.normal(size=p), 3)
    return A, random_specification(rng, i, p)


def better(content: dict[str, float], sense: str, by: float) -> None:
    """Change the bound so that the design looks closer to the best one than is proved."""
    worse = sense == "min"
    content["bound"] *= 1 + by if worse else 1 / (1 + by)
    value, bound = content["value"], content["bound"]
    content["gap"] = 1 - (bound / value if worse else value / bound)


def accepted(content: dict[str, object], A: np.ndarray) -> bool:
    """Whether the checker accepts a certificate."""
    try:
        check(content, A)
    except RejectedError:
        return False
    return True


def main() -> None:
    """Make, check and forge all certificates, and write the table."""
    counts: dict[str, list[float]] = defaultdict(lambda: [0, 0, 0, 0.0, 0])
    seconds = 0.0
    for i in range(NUMBER):
        A, spec = random_problem(i)
        criterion = criteria.from_dict(spec)
        content = json.loads(json.dumps(edtk.relax(edtk.Problem(A), criterion).to_dict()))
        row = counts[criterion.name]
        row[0] += 1
        start = process_time()
        row[1] += accepted(content, A)
        seconds += process_time() - start
        row[2] += edtk.verify(content, edtk.Problem(A)).valid
        row[3] = max(row[3], content["gap"])
        # A bound that is better by ten times what is left open.
        forged = copy.deepcopy(content)
        better(forged, criterion.sense, max(1e-6, 10 * abs(content["gap"])))
        row[4] += not accepted(forged, A)
    write(counts, seconds)


def write(counts: dict[str, list[float]], seconds: float) -> None:
    """The table, a row for each criterion."""
    lines = [
        "# Certificates of random problems",
        "",
        f"`python studies/certificates.py`: {NUMBER} problems of 2 to 6 parameters. The checker is",
        "`tests/support/plain_checker.py`, numpy alone. A forged certificate states a bound that",
        "is better by ten times its gap, and by 1e-6 at least.",
        "",
        "| criterion | problems | accepted | by `edtk.verify` | largest gap | forged, rejected |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    order = (*criteria.available(), *criteria.families())
    for name in sorted(counts, key=order.index):
        n, plain, own, gap, rejected = counts[name]
        lines.append(f"| {name} | {n} | {plain} | {own} | {gap:.1e} | {rejected} |")
    n, plain, own, _, rejected = np.array(list(counts.values())).sum(axis=0).astype(int)
    lines.append(f"| all | {n} | {plain} | {own} | | {rejected} |")
    lines += ["", f"The checker took {1e3 * seconds / NUMBER:.1f} ms a certificate."]
    Path(__file__).with_suffix(".md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
