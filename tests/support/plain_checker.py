"""A checker of certificates of problems, by numpy alone: it shares no code with the package.

Every criterion is written down once more: its cost, and the least cost of all designs X with
``<Z, X> <= 1`` (its polar). What a certificate says is recomputed from candidates, weights and
multipliers; it is not believed in anything.
"""

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np

EPS = np.finfo(float).eps
AGREE = 1e-7  # relative difference of two ways of computing a number
NEGATIVE = 1e-10  # of an eigenvalue at unit diagonal
KIND = "relaxation of a problem"
MAXIMISED = ("D", "E", "O1", "O3", "O4", "Ds", "bayes_D")
# What reading a certificate may raise whose entries are not of the kinds that they should be.
WRONG = (LookupError, TypeError, ValueError, ArithmeticError, AttributeError)
HALF = ("O1", "O3", "O4", "O5", "rho0", "rho_max")


class RejectedError(Exception):
    """The certificate does not hold."""


def check(certificate: Any, A: np.ndarray, prior: np.ndarray | None = None) -> None:
    """Check a certificate against candidates.

    Args:
        certificate: As JSON has it.
        A: The rows ``A_i / sigma`` (n, r, p) of the candidates.
        prior: Prior information (p, p).

    Raises:
        RejectedError: A claim does not hold; says which.
    """
    try:
        with np.errstate(all="ignore"):
            _check(certificate, A, prior)
    except WRONG as error:
        raise RejectedError(f"malformed: {error}") from error


def _check(certificate: Any, A: np.ndarray, prior: np.ndarray | None) -> None:
    n, _, p = A.shape
    _require(certificate.get("kind") == KIND, "kind")
    _candidates(certificate["candidates"], A, prior)
    blocks = np.swapaxes(A, 1, 2) @ A
    blocks = blocks if prior is None else blocks + prior
    M = np.tensordot(_weights(certificate["weights"], n), blocks, axes=1)
    Z = _numbers(certificate["multipliers"], (-1, p, p), "multipliers")
    _require(len(Z) > 0 and not (Z - np.swapaxes(Z, 1, 2)).any(), "multipliers")
    spec = certificate["criterion"]
    cost = _cost(spec, M)
    bound = _bound(spec, Z, certificate.get("dual_weights"), blocks, M)
    _require(np.isfinite(cost) and np.isfinite(bound) and bound > 0, "no bound")
    _require(bound <= cost * (1 + AGREE), "the design beats the bound")
    stated = {key: _number(certificate[key], key) for key in ("value", "bound", "gap")}
    costs = {key: _as_cost(spec["name"], stated[key]) for key in ("value", "bound")}
    _require(abs(costs["value"] / cost - 1) <= AGREE, "value")
    # Less than what is proved here is true as well, but is no certificate of the package's.
    _require(costs["bound"] <= bound * (1 + AGREE), "bound")
    _require(abs(stated["gap"] - (1 - costs["bound"] / costs["value"])) <= AGREE, "gap")


def _require(holds: bool, what: str) -> None:
    if not holds:
        raise RejectedError(what)


def _number(value: Any, what: str) -> float:
    _require(isinstance(value, int | float) and not isinstance(value, bool), what)
    _require(bool(np.isfinite(value)), what)
    return float(value)


def _numbers(value: Any, shape: tuple[int, ...], what: str) -> np.ndarray:
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise RejectedError(what) from error
    same = found.ndim == len(shape) and all(
        wanted in (-1, length) for wanted, length in zip(shape, found.shape, strict=True)
    )
    _require(same and bool(np.isfinite(found).all()), what)
    return found


def _candidates(given: Any, A: np.ndarray, prior: np.ndarray | None) -> None:
    """The hash is that of these candidates."""
    digest = hashlib.sha256(f"rows {A.shape[0]} {A.shape[1]} {A.shape[2]}\n".encode())
    digest.update(np.ascontiguousarray(A, "<f8").tobytes())
    if prior is not None:
        digest.update(np.ascontiguousarray(prior, "<f8").tobytes())
    _require(given["sha256"] == digest.hexdigest(), "candidates")
    _require(given["number"] == len(A), "candidates")
    _require(len(given["parameters"]) == A.shape[2], "candidates")


def _weights(given: Any, n: int) -> np.ndarray:
    """Weights (n,), each candidate's once, of sum one."""
    places = given["candidate"]
    _require(all(type(i) is int and 0 <= i < n for i in places), "weights")
    _require(len(set(places)) == len(places) > 0, "weights")
    shares = _numbers(given["weight"], (len(places),), "weights")
    _require(bool((shares >= 0).all()) and abs(shares.sum() - 1) < 1e-8, "weights")
    w = np.zeros(n)
    w[places] = shares
    return w


# ---------------------------------------------------------------------------- matrices


def _scale(M: np.ndarray) -> np.ndarray:
    d = np.sqrt(np.abs(np.diag(M)))
    return np.where(d > 0, d, 1.0)


def _inverse(M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A generalised inverse, and the directions (p, q) that M leaves open."""
    d = _scale(M)
    r, V = np.linalg.eigh(M / np.outer(d, d))
    kept = r > 64 * len(M) * EPS
    U = V[:, kept] / d[:, None]
    return (U / r[kept]) @ U.T, V[:, ~kept] / d[:, None]


def _power_trace(Z: np.ndarray, power: float) -> float:
    z = np.linalg.eigvalsh(Z)
    z = np.where(z > 16 * len(z) * EPS * z[-1], z, 0.0)
    return float((z[z > 0] ** power).sum())


def _power_trace_of_root(F: np.ndarray, power: float) -> float:
    s = np.linalg.svd(F, compute_uv=False)
    return float((s[s > 16 * len(F) * EPS * s[0]] ** (2 * power)).sum())


def _det_root(Z: np.ndarray) -> float:
    sign, log = np.linalg.slogdet(Z)
    return float(np.exp(log / len(Z))) if sign > 0 else 0.0


def _root(Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R (r, p) with R'R = Z, and its inverse (p, r) on the rows of R."""
    d = _scale(Z)
    r, V = np.linalg.eigh(Z / np.outer(d, d))
    kept = r > 16 * len(Z) * EPS * r[-1]
    return np.sqrt(r[kept])[:, None] * V[:, kept].T * d, V[:, kept] / d[:, None] / np.sqrt(r[kept])


# ---------------------------------------------------------------------------- criteria


@dataclass(frozen=True)
class Part:
    """A criterion phi of C_K: its name, its combinations K (p, s) or None, and its parameters."""

    name: str
    K: np.ndarray | None
    given: dict[str, Any]

    @property
    def degree(self) -> float:
        """How the cost shrinks: ``cost(c M) = c^-degree cost(M)``."""
        return {"O2": 0.0}.get(self.name, 0.5 if self.name in HALF else 1.0)

    def about(self, M: np.ndarray) -> np.ndarray | None:
        """C_K (s, s); None where M leaves K'k open."""
        if self.K is None:
            return None if _inverse(M)[1].size else M
        cov, hidden = _inverse(M)
        along = np.abs(hidden.T @ self.K)
        if along.size and along.max() > 1e-7 * np.linalg.norm(self.K):
            return None
        return np.linalg.inv(self.K.T @ cov @ self.K)

    def cost(self, M: np.ndarray) -> float:
        """The cost; infinite where it is not known."""
        N = self.about(M)
        return np.inf if N is None else self._cost(N)

    def _cost(self, N: np.ndarray) -> float:
        """Costs as Table 1 and the literature print them, or their reciprocals."""
        cov = np.linalg.inv(N)
        v = np.linalg.eigvalsh(cov)
        given = self.given
        if self.name == "phi":
            q = given["q"]
            return 1 / _det_root(N) if q == 0 else float(np.mean(v**q) ** (1 / q))
        if self.name in ("rho0", "rho_max", "prediction_G"):
            errors = np.einsum("tri,ij,trj->t", self._targets(), cov, self._targets())
            return float(errors.max() if self.name == "prediction_G" else np.sqrt(errors.max()))
        return float(
            {
                "A": lambda: v.sum(),
                "D": lambda: 1 / _det_root(N),
                "E": lambda: v[-1],
                "G": lambda: np.diag(cov).max(),
                "O1": lambda: _det_root(N) ** -0.5,
                "O2": lambda: np.sqrt(v[-1] / v[0]),
                "O3": lambda: np.sqrt(v[-1]),
                "O4": lambda: v[-1] / np.sqrt(v[0]),
                "O5": lambda: np.sqrt(v).sum(),
            }[self.name]()
        )

    def polar(self, Z: np.ndarray, dual: np.ndarray | None = None) -> float:
        """The least cost of all X with ``<Z, X> <= 1``."""
        Y = Z if self.K is None else self.K.T @ Z @ self.K
        s = len(Y)
        if self.name == "phi":
            q = self.given["q"]
            e = q / (1 + q)
            return s * _det_root(Y) if q == 0 else s * (_power_trace(Y, e) / s) ** (1 / e)
        if self.name == "G":
            _require(dual is not None and len(dual) == s, "dual weights")
            return _power_trace(np.sqrt(np.outer(dual, dual)) * Y, 0.5) ** 2
        if self.name in ("rho0", "rho_max", "prediction_G"):
            targets = self._targets()
            shares = np.ones(1) if self.name == "rho0" else dual
            _require(shares is not None and len(shares) == len(targets), "dual weights")
            rows = np.sqrt(shares)[:, None, None] * targets
            rows = rows.reshape(-1, s)
            found = _power_trace_of_root(_root(Y)[0] @ rows.T, 0.5)
            return found**2 if self.name == "prediction_G" else found
        return float(
            {
                "A": lambda: _power_trace(Y, 0.5) ** 2,
                "D": lambda: s * _det_root(Y),
                "E": lambda: np.trace(Y),
                "O1": lambda: np.sqrt(s * _det_root(Y)),
                "O3": lambda: np.sqrt(np.trace(Y)),
                "O5": lambda: _power_trace(Y, 1 / 3) ** 1.5,
            }[self.name]()
        )

    def slope(self, M: np.ndarray) -> np.ndarray:
        """Minus the gradient (p, p) of ``log cost^(1/degree)`` of a smooth criterion."""
        cov, _ = _inverse(M)
        side = cov if self.K is None else cov @ self.K
        V = cov if self.K is None else self.K.T @ side
        v, U = np.linalg.eigh(V)
        if self.name in ("D", "O1") or (self.name == "phi" and self.given["q"] == 0):
            S = np.linalg.inv(V) / len(V)
        elif self.name == "rho0":
            L = self._targets()[0].T @ self._targets()[0]
            S = L / np.sum(L * V)
        else:
            q = {"A": 1.0, "O5": 0.5}.get(self.name) or self.given["q"]
            S = (U * (v ** (q - 1) / np.sum(v**q))) @ U.T
        return side @ S @ side.T

    def _targets(self) -> np.ndarray:
        """Targets (tasks, rows, p)."""
        key = {"rho0": "target", "rho_max": "targets", "prediction_G": "points"}[self.name]
        found = np.array(self.given[key], dtype=float)
        if found.ndim == 2:
            found = found[:, None, :] if self.name == "prediction_G" else found[None]
        return found


def _part(spec: Any, p: int) -> Part:
    """A criterion that is not made of others."""
    name = spec["name"]
    given = {key: value for key, value in spec.items() if key not in ("name", "interest")}
    if name == "I" and "root" in given:
        return Part("A", _numbers(given["root"], (p, -1), "root"), {})
    if name == "I":
        W = _numbers(given["W"], (p, p), "W")
        w, V = np.linalg.eigh(0.5 * (W + W.T))
        _require(w[0] > -1e-9 * w[-1], "W")
        kept = w > 1e-13 * w[-1]
        return Part("A", V[:, kept] * np.sqrt(w[kept]), {})
    if name == "c":
        return Part("A", _numbers(given["c"], (p,), "c")[:, None], {})
    K = None if "interest" not in spec else np.array(spec["interest"], dtype=float).reshape(p, -1)
    return Part("D" if name == "Ds" else name, K, given)


@dataclass(frozen=True)
class Several:
    """A compound or minimax criterion: its parts, their best costs and weights."""

    parts: list[Part]
    best: np.ndarray
    weights: np.ndarray | None

    @classmethod
    def of(cls, spec: Any, p: int) -> "Several":
        """Read it from its name and parameters."""
        sizes = spec.get("sizes")
        specs = spec["criteria"]
        ends = np.cumsum(sizes) if sizes else [p] * len(specs)
        _require(ends[-1] == p, "sizes")
        parts = []
        for each, end, size in zip(specs, ends, sizes or [p] * len(specs), strict=True):
            part = _part(each, size)
            block = np.eye(p)[:, end - size : end]
            if sizes:
                part = Part(part.name, block if part.K is None else block @ part.K, part.given)
            parts.append(part)
        values = _numbers(spec["best"], (len(parts),), "best")
        _require(bool((values > 0).all()), "best")
        best = [_as_cost(each["name"], value) for each, value in zip(specs, values, strict=True)]
        weights = None
        if spec["name"] == "compound":
            weights = _numbers(spec["weights"], (len(parts),), "weights of criteria")
            _require(bool((weights > 0).all()), "weights of criteria")
            weights = weights / weights.sum()
        return cls(parts, np.array(best), weights)

    def cost(self, M: np.ndarray) -> float:
        """The largest loss, or their mean."""
        losses = self._losses(np.array([part.cost(M) for part in self.parts]))
        if self.weights is None:
            return float(losses.max())
        return float(np.exp(self.weights @ np.log(losses)))

    def polar(self, Z: np.ndarray, M: np.ndarray, dual: np.ndarray | None) -> float:
        """Of parts of Z that add up to Z, by shares that may be any."""
        if all(part.K is not None for part in self.parts):
            # What is of interest is a function of all combinations Q'k together.
            K = np.hstack([part.K for part in self.parts])
            U, s, _ = np.linalg.svd(K, full_matrices=False)
            Q = U[:, s > 1e-10 * s[0]]
            reduced = [Part(part.name, Q.T @ part.K, part.given) for part in self.parts]
            N = np.linalg.inv(Q.T @ _inverse(M)[0] @ Q)
            return Several(reduced, self.best, self.weights)._polar(Q.T @ Z @ Q, N, dual)
        return self._polar(Z, M, dual)

    def _polar(self, Z: np.ndarray, M: np.ndarray, dual: np.ndarray | None) -> float:
        shares = self.weights if dual is None else dual
        _require(shares is not None and len(shares) == len(self.parts), "dual weights")
        R, back = _root(Z)
        W = [u * back.T @ part.slope(M) @ back for u, part in zip(shares, self.parts, strict=True)]
        values, V = np.linalg.eigh(np.sum(W, axis=0))
        S = (V * np.maximum(values, 1e-12 * values[-1]) ** -0.5) @ V.T
        found = []
        total = np.zeros_like(Z)
        for part, w in zip(self.parts, W, strict=True):
            z, U = np.linalg.eigh(w)
            F = np.sqrt(np.maximum(z, 0.0))[:, None] * U.T @ S @ R
            total += F.T @ F
            found.append(part.polar(F.T @ F))
        d = _scale(Z)
        left = np.linalg.eigvalsh((Z * (1 + 1e-9) - total) / np.outer(d, d))
        _require(left[0] > -1e-9, "parts of a multiplier")
        q = self._losses(np.array(found))
        if self.weights is None:
            return float(q.sum())
        return float(np.prod((q / self.weights) ** self.weights))

    def _losses(self, costs: np.ndarray) -> np.ndarray:
        degrees = np.array([part.degree for part in self.parts])
        return (costs / self.best) ** (1 / degrees)


# ---------------------------------------------------------------------------- costs and bounds


def _as_cost(name: str, value: float) -> float:
    return 1 / value if name in MAXIMISED else value


def _cost(spec: Any, M: np.ndarray) -> float:
    name = spec["name"]
    if name in ("compound", "minimax"):
        return Several.of(spec, len(M)).cost(M)
    if name.startswith("bayes_"):
        return _part({"name": name.removeprefix("bayes_")}, len(M)).cost(M + _precision(spec, M))
    return _part(spec, len(M)).cost(M)


def _precision(spec: Any, M: np.ndarray) -> np.ndarray:
    R = _numbers(spec["precision"], M.shape, "precision")
    _require(bool(np.linalg.eigvalsh(0.5 * (R + R.T))[0] > -1e-10), "precision")
    return 0.5 * (R + R.T)


def _bound(spec: Any, Z: np.ndarray, duals: Any, blocks: np.ndarray, M: np.ndarray) -> float:
    """The bound that multipliers prove; the best of them where they do not combine."""
    name = spec["name"]
    p = len(M)
    if name in ("O2", "O4"):
        return _indefinite(name, Z, blocks)
    lifted = np.stack([_lifted(z) for z in Z])
    t = np.einsum("rij,nij->rn", lifted, blocks).max(axis=1) * (1 + 64 * p * EPS)
    if name.startswith("bayes_"):
        part = _part({"name": name.removeprefix("bayes_")}, p)
        t = t + np.einsum("rij,ij->r", lifted, _precision(spec, M))
        return max(part.polar(z) / top for z, top in zip(lifted, t, strict=True))
    weights = [None] * len(Z) if duals is None else [_shares(u) for u in duals]
    _require(len(weights) == len(Z), "dual weights")
    if name in ("compound", "minimax"):
        several = Several.of(spec, p)
        found = [several.polar(z, M, u) for z, u in zip(lifted, weights, strict=True)]
        return max(q / top for q, top in zip(found, t, strict=True))
    part = _part(spec, p)
    found = [part.polar(z, u) for z, u in zip(lifted, weights, strict=True)]
    return max(q * top**-part.degree for q, top in zip(found, t, strict=True))


def _shares(given: Any) -> np.ndarray:
    u = _numbers(given, (-1,), "dual weights")
    _require(bool((u >= 0).all()) and u.sum() <= 1 + 1e-9, "dual weights")
    return u


def _lifted(Z: np.ndarray) -> np.ndarray:
    d = _scale(Z)
    least = np.linalg.eigvalsh(Z / np.outer(d, d))[0]
    _require(bool(least > -NEGATIVE * len(Z)), "a multiplier is not semidefinite")
    return Z + (max(-least, 0.0) + 16 * len(Z) * EPS) * np.diag(np.abs(np.diag(Z)))


def _indefinite(name: str, Z: np.ndarray, blocks: np.ndarray) -> float:
    """Bounds of O2, from ``Y = Z - t I`` at unit trace, and of O4, from a polygon."""
    if name == "O2":
        unit = blocks / np.trace(blocks, axis1=1, axis2=2)[:, None, None]
        t = np.einsum("rij,nij->rn", Z, unit).max(axis=1)
        best = 1.0
        for z, top in zip(Z, t, strict=True):
            y = np.linalg.eigvalsh(z - top * np.eye(len(z)))
            if (y < 0).any():
                best = max(best, y[y > 0].sum() / -y[y < 0].sum())
        return float(np.sqrt(best))
    t = np.einsum("rij,nij->rn", Z, blocks).max(axis=1)
    z = np.linalg.eigvalsh(Z)
    above = np.maximum(z, 0).sum(axis=1)
    # An eigenvalue of size 1e-12 may be rounding, and counts as negative only if it is not.
    size = np.abs(z).max(axis=1, keepdims=True)
    below = np.where(z < -1e-12 * size, -z, 0.0).sum(axis=1)
    # The least s kappa where t s + b kappa >= a for all lines, s >= 0 and kappa >= 1: at the least
    # s of each kappa it is concave between corners, so that it is least at one of them.
    kappas = [1.0]
    lines = [(a / x, b / x) for a, b, x in zip(above, below, t, strict=True) if x > 0]
    for i, (a, b) in enumerate(lines):
        kappas += [a / b] if b > 0 else []
        kappas += [(a - c) / (b - e) for c, e in lines[:i] if b != e]
    best = np.inf
    for kappa in kappas:
        if kappa >= 1:
            best = min(best, kappa * max([0.0, *(a - b * kappa for a, b in lines)]))
    return float(np.sqrt(best))
