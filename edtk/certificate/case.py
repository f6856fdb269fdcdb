"""A certificate read back: the experiments, the multipliers, and all that can be recomputed from them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.recompute import bounds, values
from edtk.certificate.recompute.experiments import candidates, climb, wrenches
from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array

STARTS = 32  # experiments of the largest sensitivities from which the search climbs, per multiplier


@dataclass(frozen=True, eq=False)
class Experiments:
    """Experiments of a certificate.

    Attributes:
        q: Joint variables (k, n) [rad or m].
        wrench: Forces and torques (k, 6) [N, N m].
        amount: Weights or repetitions (k,).
    """

    q: Array
    wrench: Array
    amount: Array

    @classmethod
    def from_dict(cls, rows: list[dict[str, Any]], key: str, n: int) -> "Experiments":
        """Read experiments; `key` names the entry that holds the amount.

        Raises:
            KeyError, TypeError, ValueError: An entry is missing, or is no finite number.
        """
        q = np.array([row["q"] for row in rows], dtype=float).reshape(len(rows), n)
        wrench = np.array([row["wrench"] for row in rows], dtype=float).reshape(len(rows), 6)
        amount = np.array([row[key] for row in rows], dtype=float)
        for part in (q, wrench, amount):
            if not np.isfinite(part).all():
                raise ValueError("an experiment has an entry that is not finite")
        return cls(q, wrench, amount)

    def stacked(self, setting: Setting) -> Array:
        """Whitened rows (N, p), each times the root of its experiment's amount."""
        rows = setting.whitened_rows(self.q, self.wrench)
        rows = rows * np.sqrt(self.amount)[:, None, None]
        return rows.reshape(-1, len(setting.unknown))


@dataclass(frozen=True, eq=False)
class Case:
    """All parts of a certificate, with the numbers that follow from them.

    Attributes:
        name: Name of the criterion.
        kind: "relaxation" or "plan".
        setting: Robot, load, noise, constraints and test pose.
        made: The experiments with their weights or repetitions.
        kept: Experiments that were made before; there may be none.
        multipliers: Multipliers (r, p, p).
        proof: Candidates, seed, sampling, and design variables of support and searched poses.
        stated: The claimed numbers by name.
    """

    name: str
    kind: str
    setting: Setting
    made: Experiments
    kept: Experiments
    multipliers: Array
    proof: dict[str, Any]
    stated: dict[str, float]

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> "Case":
        """Read a certificate.

        Raises:
            KeyError, TypeError, ValueError: A part is missing, or is not what it should be.
        """
        setting = Setting.from_dict(content["setting"])
        n = len(setting.fixed)
        kind = content["kind"]
        if kind not in ("relaxation", "plan"):
            raise ValueError(f"kind: expected 'relaxation' or 'plan', got {kind!r}")
        key = "weight" if kind == "relaxation" else "repeats"
        made = Experiments.from_dict(content["experiments"], key, n)
        if not len(made.q):
            raise ValueError("experiments: expected at least one")
        return cls(
            name=str(content["criterion"]),
            kind=kind,
            setting=setting,
            made=made,
            kept=Experiments.from_dict(content["kept"], "repeats", n),
            multipliers=np.array(content["proof"]["multipliers"], dtype=float),
            proof=content["proof"],
            stated={name: float(number) for name, number in content["claims"].items()},
        )

    @property
    def degree(self) -> float:
        """Degree of homogeneity of the criterion's cost."""
        if self.name not in values.DEGREE:
            raise ValueError(f"criterion {self.name!r} cannot be recomputed: it is no built-in one")
        return values.DEGREE[self.name]

    @property
    def violation(self) -> float:
        """Largest violation of a constraint by a pose [m or rad]; zero if all are feasible."""
        return max(0.0, float(self.setting.violation(self.made.q).max()))

    @property
    def amounts_are_sound(self) -> bool:
        """Whether weights are shares of one, or repetitions whole numbers of at least one."""
        amount = self.made.amount
        if self.kind == "relaxation":
            return bool((amount >= 0).all() and abs(amount.sum() - 1) <= 1e-9)
        return bool((amount >= 1).all() and (amount == np.round(amount)).all())

    @cached_property
    def value(self) -> float:
        """The criterion as printed, of all experiments together."""
        rows = np.concatenate([self.made.stacked(self.setting), self.kept.stacked(self.setting)])
        return values.value(self.name, rows, self.setting.target)

    @cached_property
    def prior(self) -> Array:
        """Information (p, p) of the kept experiments, per new experiment."""
        rows = self.kept.stacked(self.setting)
        return np.asarray(rows.T @ rows / self.made.amount.sum())

    def sensitivities(self, x: Array) -> Array:
        """``<Z_j, M(x) + prior>`` (r, k) of experiments x (k, v); per trace for a criterion of degree 0."""
        n = len(self.setting.fixed)
        rows = self.setting.whitened_rows(x[:, :n], wrenches(self.setting.load, x[:, n:]))
        weighted = np.einsum("krp,jpq->jkrq", rows, self.multipliers)
        found = np.einsum("jkrq,krq->jk", weighted, rows)
        found += np.einsum("jpq,pq->j", self.multipliers, self.prior)[:, None]
        if self.degree == 0:
            found /= (rows**2).sum(axis=(1, 2)) + np.trace(self.prior)
        return np.asarray(found)

    @cached_property
    def _candidates(self) -> tuple[Array, Array]:
        """Largest sensitivities (r,) of all candidates, and the best of them (s, v)."""
        largest = np.full(len(self.multipliers), -np.inf)
        best: list[Array] = []
        number = int(self.proof["candidates"])
        drawn = candidates(self.setting, self.proof["seed"], self.proof["sampling"], number)
        for x in drawn:
            if not len(x):
                continue
            found = self.sensitivities(x)
            largest = np.maximum(largest, found.max(axis=1))
            order = np.argsort(-found, axis=1)[:, :STARTS]
            best.append(x[np.unique(order)])
        return largest, np.concatenate(best)

    def _points(self, key: str) -> Array:
        """Design variables (k, v) that the proof names; only feasible ones count."""
        size = self._candidates[1].shape[1]
        x = np.array(self.proof[key], dtype=float).reshape(-1, size)
        return x[self.setting.feasible(x[:, : len(self.setting.fixed)])]

    @cached_property
    def _largest_proved(self) -> Array:
        """Largest sensitivities (r,) over the candidates and the support of the weights."""
        support = self._points("support")
        largest, _ = self._candidates
        return np.maximum(largest, self.sensitivities(support).max(axis=1, initial=-np.inf))

    @cached_property
    def _largest_searched(self) -> Array:
        """Largest sensitivities (r,) over all that, and the poses that the search has found."""
        found = self.sensitivities(self._points("searched")).max(axis=1, initial=-np.inf)
        return np.maximum(self._largest_proved, found)

    def bound(self, searched: bool) -> float:
        """The printed value that no design, or no plan of so many experiments, can beat.

        Args:
            searched: Whether the poses that the search has found count too.

        Raises:
            ValueError: The multipliers prove nothing.
        """
        p = len(self.setting.unknown)
        bounds.require_multipliers(self.name, self.multipliers, p)
        largest = self._largest_searched if searched else self._largest_proved
        rows = self.made.stacked(self.setting)
        M = rows.T @ rows / self.made.amount.sum() + self.prior
        cost = bounds.lower_bound(self.name, self.multipliers, largest, self.setting.target, M)
        if self.kind == "plan":
            cost *= self.made.amount.sum() ** -self.degree
        return values.printed(self.name, cost)

    @cached_property
    def excess(self) -> float:
        """By how much a search of this module's own beats the largest sensitivities, relative to them.

        It climbs from the best candidates, the support and the searched poses.
        """
        starts = np.concatenate(
            [self._candidates[1], self._points("support"), self._points("searched")]
        )
        worst = 0.0
        for j, largest in enumerate(self._largest_searched):
            order = np.argsort(-self.sensitivities(starts)[j])[:STARTS]
            height: Callable[[Array], Array] = lambda x, j=j: self.sensitivities(x)[j]  # type: ignore[misc]  # noqa: E731
            top = self.sensitivities(climb(self.setting, starts[order], height))[j].max()
            worst = max(worst, float((top - largest) / abs(largest)))
        return worst
