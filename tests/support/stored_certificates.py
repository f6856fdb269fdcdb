"""Certificates of random problems under all criteria: how they were made, and how they are read.

    python -m tests.support.stored_certificates tests/data/certificates.jsonl

writes them anew, a line each with its candidates; it takes a minute.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

import criteria
import edtk

STORED = Path(__file__).parents[1] / "data" / "certificates.jsonl"
NUMBER = 300
P = 3
PLAIN = criteria.available()


def rounded(x: np.ndarray) -> np.ndarray:
    """Numbers with three digits, which take little room in a file."""
    return np.round(x, 3)


def semidefinite(rng: np.random.Generator, p: int = P) -> list[list[float]]:
    """A random weight matrix."""
    B = rng.integers(-3, 4, size=(p, p))
    return (B @ B.T + np.eye(p)).tolist()


def random_specification(rng: np.random.Generator, i: int, p: int = P) -> dict[str, Any]:
    """The criterion of the i-th problem of p parameters, as a dictionary; all of them in turn."""
    target = rounded(rng.normal(size=(2, p))).tolist()
    vector = rounded(rng.normal(size=p)).tolist()
    some = rounded(rng.normal(size=(p, 2))).tolist()
    kinds: list[dict[str, Any]] = [{"name": name} for name in PLAIN if "rho" not in name]
    kinds += [{"name": "rho0", "target": target}]
    kinds += [{"name": "rho_max", "targets": rounded(rng.normal(size=(3, 2, p))).tolist()}]
    kinds += [{"name": name, "interest": some} for name in ("A", "D", "E", "G", "O5", "Ds")]
    kinds += [{"name": "c", "c": vector}, {"name": "I", "W": semidefinite(rng, p)}]
    kinds += [{"name": "phi", "q": q} for q in (0.0, 0.4, 1.0, 3.0)]
    kinds += [{"name": "phi", "q": 2.0, "interest": some}]
    kinds += [{"name": "prediction_G", "points": rounded(rng.normal(size=(6, p))).tolist()}]
    kinds += [{"name": name, "precision": semidefinite(rng, p)} for name in ("bayes_D", "bayes_A")]
    parts = ["D", {"name": "I", "W": semidefinite(rng, p)}, {"name": "phi", "q": 3.0}]
    kinds += [{"name": "compound", "criteria": parts, "best": [1.0, 2.0, 0.5]}]
    kinds += [{"name": "compound", "criteria": ["D", {"name": "c", "c": vector}]}]
    kinds += [{"name": "minimax", "criteria": [*parts, "O5"], "best": [1.0, 2.0, 0.5, 3.0]}]
    return kinds[i % len(kinds)]


def specification(rng: np.random.Generator, i: int) -> dict[str, Any]:
    """The criterion of the i-th stored problem: those above, and some of several models."""
    vector = rounded(np.random.default_rng(i).normal(size=P)).tolist()
    models: list[dict[str, Any]] = [
        {"name": "minimax", "criteria": ["D", "A"], "sizes": [1, 2]},
        {"name": "compound", "criteria": ["A", {"name": "c", "c": vector}], "sizes": [2, P]},
    ]
    turn = i % 32
    return random_specification(rng, turn) if turn < 30 else models[turn - 30]


def problem(i: int) -> tuple[edtk.Problem, np.ndarray, dict[str, Any]]:
    """The i-th random problem, its rows (n, r, p), and the criterion."""
    rng = np.random.default_rng(i)
    spec = specification(rng, i)
    n = int(rng.integers(6, 13))
    A = rounded(rng.normal(size=(n, int(rng.integers(1, 3)), P)))
    if "sizes" in spec:
        first, second = spec["sizes"]
        models = [rounded(rng.normal(size=(n, 1, size))) for size in (first, second)]
        A = np.zeros((n, 2, first + second))
        A[:, :1, :first] = models[0]
        A[:, 1:, first:] = models[1]
    return edtk.Problem(A), A, spec


def certificate(i: int) -> tuple[dict[str, Any], np.ndarray]:
    """The certificate of the i-th problem, as JSON has it, and the candidates' rows."""
    candidates, A, spec = problem(i)
    found = edtk.relax(candidates, criteria.from_dict(spec))
    return json.loads(json.dumps(found.to_dict())), A


def stored() -> list[tuple[dict[str, Any], np.ndarray]]:
    """All stored certificates with their candidates."""
    lines = STORED.read_text(encoding="utf-8").splitlines()
    pairs = map(json.loads, lines)
    return [(each["certificate"], np.array(each["rows"], dtype=float)) for each in pairs]


def main(path: str) -> None:
    """Write all certificates."""
    lines = []
    for i in range(NUMBER):
        found, A = certificate(i)
        lines.append(json.dumps({"certificate": found, "rows": A.tolist()}))
        print(i, found["criterion"]["name"], f"{found['gap']:.1e}")
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
