"""What a certificate rests its bounds on: experiments, multipliers, the largest sensitivities."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.recompute.candidates import (
    ROUNDS,
    candidates,
    climb,
    of_bounds,
    of_experiment,
    of_sample,
    require,
)
from edtk.certificate.recompute.plain_data import numbers, rows, table, text, whole, wrenches_of
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.recompute.values import Multipliers
from edtk.system.typing import Array, Mask

# A certificate has some hundred lines; one of 20,000 experiments has 20 MB. A larger file is
# rejected before it fills the memory.
MOST_MB = 30.0
MOST_EXPERIMENTS = 20_000  # experiments that a certificate may list
MOST_SEEDS = 16  # numbers that a seed may consist of
LARGEST = 2**128  # number in a seed, and number of candidates: far more than anybody can draw
MOST_POINTS = 20_000
MOST_PROOFS = 63  # in a certificate
STARTS = 32  # experiments of the largest sensitivities from which the search climbs, per multiplier
# Poses that the search draws itself: a certificate may name few candidates, or only bad ones.
OWN_DRAWS = 4096
OWN_SEED = 20_250_101


@dataclass(frozen=True, eq=False)
class Experiments:
    """Experiments with their weights or repetitions.

    Attributes:
        q: Joint variables (k, n) [rad or m].
        wrench: Forces and torques (k, 6) [N, N m].
        amount: Weights or repetitions (k,).
    """

    q: Array
    wrench: Array
    amount: Array

    @classmethod
    def from_list(cls, value: Any, amount: str, n: int, where: str) -> "Experiments":
        """Read experiments of a robot with n joints.

        Args:
            value: The entry of the certificate.
            amount: Name of the key that holds the amounts, "weight" or "repeats".
            n: Number of joints.
            where: Name of the entry, for messages.

        Raises:
            ValueError: An entry is missing, or is no finite number.
        """
        found = rows(value, MOST_EXPERIMENTS, where)
        for i, row in enumerate(found):
            table(row, ("q", "wrench", amount), f"{where}[{i}]")
        return cls(
            numbers([row["q"] for row in found], (None, n), f"{where}.q"),
            wrenches_of([row["wrench"] for row in found], f"{where}.wrench"),
            numbers([row[amount] for row in found], (None,), f"{where}.{amount}"),
        )

    def __len__(self) -> int:
        return len(self.amount)

    def __add__(self, others: "Experiments") -> "Experiments":
        """These experiments, then others."""
        return Experiments(
            np.concatenate([self.q, others.q]),
            np.concatenate([self.wrench, others.wrench]),
            np.concatenate([self.amount, others.amount]),
        )

    def chosen(self, which: Mask) -> "Experiments":
        """Some of them."""
        return Experiments(self.q[which], self.wrench[which], self.amount[which])

    def rows(self, setting: Setting, visits: Array | None = None) -> Array:
        """Whitened rows (k, measured, p) of one measurement of each."""
        return setting.whitened_rows(self.q, self.wrench, visits)

    def stacked(self, setting: Setting, repeated: bool = False) -> Array:
        """Whitened rows (N, p), each times the root of its experiment's amount.

        Args:
            setting: What rows are whitened by.
            repeated: Whether the amounts are visits, which may share errors of the model.
        """
        visits = None
        if repeated and setting.noise is not None:
            visits = setting.noise.visits(setting.chain, self.q, self.wrench, self.amount)
        rows = self.rows(setting, visits) * np.sqrt(self.amount)[:, None, None]
        return rows.reshape(-1, setting.p)


@dataclass(frozen=True, eq=False)
class Proof:
    """Candidates, multipliers and poses of a certificate.

    Attributes:
        candidates: Number of candidates over which a bound is proved.
        seed: Seed of their sequence.
        sampling: "random" or "sobol".
        points: Experiments (k, v) that count as candidates too: those of the relaxation.
        searched: Experiments (k, v) of large sensitivity that a search has found.
        multipliers: The multipliers as they are written, which only a bound needs.
        task_weights: Weights of the tasks to each multiplier as they are written, which only the
            bound of rho_max needs; None without any.
        continuum: Multipliers and coverings of all poses, as they are written; None without any.
    """

    candidates: int
    seed: list[int]
    sampling: str
    points: Array
    searched: Array
    multipliers: Any
    task_weights: Any
    continuum: Any = None

    @classmethod
    def from_dict(cls, content: Any, setting: Setting) -> "Proof":
        """Read the part `proof` of a certificate; experiments that are not allowed do not count.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        keys = ("candidates", "seed", "sampling", "multipliers", "support", "searched")
        content = table(content, keys, "proof", ("task_weights", "continuum"))
        seed = rows(content["seed"], MOST_SEEDS, "proof.seed")
        if not seed:
            raise ValueError("proof.seed: expected at least one number")
        size = len(setting.fixed) + setting.load.size
        points = {}
        for key in ("support", "searched"):
            rows(content[key], MOST_POINTS, f"proof.{key}")
            x = numbers(content[key], (None, size), f"proof.{key}")
            require(len(x) * of_sample(setting) * MOST_PROOFS, f"the experiments of proof.{key}")
            # A pose that is not allowed could only lower the bound, to the harm of nobody but the
            # one who reads it. It is no candidate.
            points[key] = x[setting.feasible(x)]
        return cls(
            candidates=whole(content["candidates"], 1, LARGEST, "proof.candidates"),
            seed=[whole(part, 0, LARGEST, "proof.seed") for part in seed],
            sampling=text(content["sampling"], ("random", "sobol"), "proof.sampling"),
            points=points["support"],
            searched=points["searched"],
            multipliers=content["multipliers"],
            task_weights=content.get("task_weights"),
            continuum=content.get("continuum"),
        )


@dataclass(frozen=True, eq=False)
class LargestSensitivities:
    """Maxima over experiments i of ``<Z_j, M_i + M0>``, for each multiplier Z_j.

    Attributes:
        setting: Robot, load, noise and constraints.
        proof: Candidates, and poses of the relaxation and of the search.
        multipliers: The multipliers (r, p, p).
        prior: Prior information M0 (p, p).
        per_trace: Whether sensitivities are per trace of ``M_i + M0``.
        own: The experiments of the design.
        own_count: Whether these count as candidates.
        parts: Number of such questions in a certificate, which share the samples that are drawn.
    """

    setting: Setting
    proof: Proof
    multipliers: Multipliers
    prior: Array
    per_trace: bool
    own: Experiments
    own_count: bool
    parts: int = 1

    @cached_property
    def proved(self) -> Array:
        """Maxima (r,) over the candidates and the poses of the relaxation."""
        largest, _ = self._over_candidates
        points = self._at(self.proof.points).max(axis=1, initial=-np.inf)
        largest = np.maximum(largest, points)
        return np.maximum(largest, self._of_own) if self.own_count else largest

    @cached_property
    def searched(self) -> Array:
        """Maxima (r,) over these, and over the poses that a search has found."""
        found = self._at(self.proof.searched).max(axis=1, initial=-np.inf)
        return np.maximum(self.proved, found)

    @cached_property
    def climbed(self) -> Array:
        """Maxima (r,) over `searched` and what a search of this module's own finds.

        It climbs from the best candidates, from poses of its own, and from those of the proof. The
        poses of the design count too.
        """
        _, best = self._over_candidates
        own = candidates(self.setting, [OWN_SEED], "random", OWN_DRAWS, 1, self.parts)
        starts = np.concatenate([best, *own, self.proof.points, self.proof.searched])
        highest = starts[np.argsort(-self._at(starts), axis=1)[:, :STARTS]]
        reached = climb(self.setting, np.concatenate(highest), self._heights)
        ends = self._heights(reached).reshape(len(highest), -1).max(axis=1)
        return np.maximum.reduce([self.searched, ends, self._of_own])

    @property
    def excess(self) -> float:
        """By how much `climbed` beats `searched` at most, relative to it."""
        return float(np.max((self.climbed - self.searched) / np.abs(self.searched)))

    @cached_property
    def _over_candidates(self) -> tuple[Array, Array]:
        """Maxima (r,) over all candidates, and the best of the candidates (s, v).

        Raises:
            ValueError: They cannot be drawn.
        """
        found = self._drawn
        if isinstance(found, ValueError):
            raise found
        return found

    @cached_property
    def _drawn(self) -> tuple[Array, Array] | ValueError:
        """The same, or the error: several claims ask, and a failure takes as long as a success."""
        try:
            return self._draw()
        except ValueError as error:
            return error

    def _draw(self) -> tuple[Array, Array]:
        """Draw all candidates, chunk by chunk."""
        r = len(self.multipliers.Z)
        proof = self.proof
        largest = np.full(r, -np.inf)
        best = proof.points[:0]
        heights = np.empty((r, 0))
        drawn = candidates(
            self.setting, proof.seed, proof.sampling, proof.candidates, r, self.parts
        )
        for x in drawn:
            found = self._at(x)
            largest = np.maximum(largest, found.max(axis=1))
            pool = np.concatenate([best, x])
            heights = np.concatenate([heights, found], axis=1)
            # Only the best are kept: a million candidates are never in memory together.
            order = np.unique(np.argsort(-heights, axis=1)[:, :STARTS])
            best = pool[order]
            heights = heights[:, order]
        return largest, best

    @cached_property
    def _of_own(self) -> Array:
        """Maxima (r,) over the experiments of the design."""
        rows = self.own.rows(self.setting)
        return self.multipliers.sensitivities(rows, self.prior, self.per_trace).max(
            axis=1, initial=-np.inf
        )

    @staticmethod
    def effort(setting: Setting, proof: Proof, name: str) -> float:
        """Time for all but the candidates themselves [us]."""
        r = len(proof.multipliers) if isinstance(proof.multipliers, list) else 1
        points = 3 * (len(proof.points) + len(proof.searched))
        climbs = r * (ROUNDS * STARTS + OWN_DRAWS)
        each = of_experiment(setting, r) + of_sample(setting)
        return (points + climbs) * each + of_bounds(setting, r, name == "G")

    def _at(self, x: Array) -> Array:
        """Sensitivities (r, k) of experiments x (k, v)."""
        found = [np.empty((len(self.multipliers.Z), 0))]
        for first in range(0, len(x), self.setting.block):
            rows = self._rows(x[first : first + self.setting.block])
            found.append(self.multipliers.sensitivities(rows, self.prior, self.per_trace))
        return np.concatenate(found, axis=1)

    def _heights(self, x: Array) -> Array:
        """Sensitivities (k,) of experiments x (k, v), of which each multiplier has its part."""
        parts = np.split(self._rows(x), len(self._each))
        pairs = zip(self._each, parts, strict=True)
        found = [one.sensitivities(rows, self.prior, self.per_trace)[0] for one, rows in pairs]
        return np.concatenate(found)

    @cached_property
    def _each(self) -> list[Multipliers]:
        """The multipliers, one by one."""
        return [Multipliers(Z[None], self.multipliers.indefinite) for Z in self.multipliers.Z]

    def _rows(self, x: Array) -> Array:
        """Whitened rows (k, rows, p) of experiments x (k, v)."""
        n = len(self.setting.fixed)
        return self.setting.whitened_rows(x[:, :n], self.setting.load.wrench(x[:, n:]))
