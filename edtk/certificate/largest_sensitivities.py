"""The largest sensitivities of a certificate's candidates, and of poses beyond them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.certificate.experiments import Experiments
from edtk.certificate.proof import Proof
from edtk.certificate.recompute.candidates import candidates
from edtk.certificate.recompute.climb import ROUNDS, climb
from edtk.certificate.recompute.effort import of_bounds, of_experiment, of_sample
from edtk.certificate.recompute.multipliers import Multipliers
from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array

STARTS = 32  # experiments of the largest sensitivities from which the search climbs, per multiplier
# Poses that the search draws itself: a certificate may name few candidates, or only bad ones.
OWN_DRAWS = 4096
OWN_SEED = 20_250_101


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
        heights = self._at(starts)
        found = np.array(self.searched)
        for j in range(len(found)):
            order = np.argsort(-heights[j])[:STARTS]
            reached = climb(self.setting, starts[order], self._height(j))
            found[j] = max(found[j], float(self._height(j)(reached).max()), self._of_own[j])
        return found

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
        return self._sensitivities(self.multipliers, x)

    def _height(self, j: int) -> Callable[[Array], Array]:
        """The sensitivity under one multiplier, as a function of experiments."""
        one = Multipliers(self.multipliers.Z[j : j + 1], self.multipliers.indefinite)

        def height(x: Array) -> Array:
            return np.asarray(self._sensitivities(one, x)[0])

        return height

    def _sensitivities(self, multipliers: Multipliers, x: Array) -> Array:
        """Sensitivities (r, k) of experiments x (k, v) under some multipliers."""
        n = len(self.setting.fixed)
        found = [np.empty((len(multipliers.Z), 0))]
        for first in range(0, len(x), self.setting.block):
            some = x[first : first + self.setting.block]
            rows = self.setting.whitened_rows(some[:, :n], self.setting.load.wrench(some[:, n:]))
            found.append(multipliers.sensitivities(rows, self.prior, self.per_trace))
        return np.concatenate(found, axis=1)
