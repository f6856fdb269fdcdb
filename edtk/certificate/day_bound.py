"""The bound on all plans that a day can pay for, from a proof for each set of loads."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.proof import Experiments, LargestSensitivities, Proof
from edtk.certificate.recompute.candidates import candidates
from edtk.certificate.recompute.day import MOST_LOADS, Day
from edtk.certificate.recompute.plain_data import rows, table, whole
from edtk.certificate.recompute.setting import TINY, Load, Setting
from edtk.certificate.recompute.values import Multipliers, lower_bound
from edtk.system.typing import Array

DRAWS = 1024  # poses that show whether some loads can tell all parameters
SEED = 20_260_319
NONE = 1e-12  # of the largest singular value of scaled columns, that is rounding of none


MOST_SETS = 2**MOST_LOADS - 1


@dataclass(frozen=True, eq=False)
class DayBound:
    """A bound for each set of loads that the budget pays for: the least of them counts.

    Which sets these are follows from the costs, and not from the proofs: a set without a proof must
    be one whose visits cannot tell all parameters, in whatever poses.

    Attributes:
        name: Name of the criterion.
        degree: Degree of homogeneity of its cost.
        setting: Robot, loads, noise and constraints.
        day: The costs.
        proofs: The proofs, by sets of loads.
        made: The new visits.
        known: Whitened rows (N, p) of all that is known besides.
        interest: Combinations (p, s) that the criterion is about; None for all parameters.
    """

    name: str
    degree: float
    setting: Setting
    day: Day
    proofs: dict[tuple[int, ...], Proof]
    made: Experiments
    known: Array
    interest: Array | None

    def cost(self, searched: bool) -> float:
        """The cost that no plan within the budget beats.

        Args:
            searched: Whether the poses that searches have found count too.

        Raises:
            ValueError: A set of loads has no proof that proves anything.
        """
        return min((self._cost(part, searched) for part in self._parts), default=float("nan"))

    def _cost(self, part: "_Part", searched: bool) -> float:
        """A bound on the cost of every plan of one set of loads, see `Case.bound`."""
        largest = part.largest
        t = largest.searched if searched else largest.proved
        targets = largest.setting.tasks.proving(self.name, largest.proof.task_weights, len(t))
        Z = largest.multipliers.Z
        least = lower_bound(self.name, Z, t, targets, part.M, self.interest)
        return least * part.total ** (-self.degree)

    @property
    def excess(self) -> float:
        """The largest of the sets' excesses, see `Case.excess`.

        Raises:
            ValueError: The multipliers prove nothing.
        """
        return max((part.largest.excess for part in self._parts), default=float("nan"))

    @cached_property
    def _parts(self) -> tuple["_Part", ...]:
        """The sets of loads that may tell all parameters, with their proofs."""
        wrenches = _listed(self.setting.load)
        found = []
        for loads, funds in self.day.sets(wrenches):
            setting = replace(self.setting, load=load_of(self.setting.load, loads))
            if loads in self.proofs:
                found.append(self._part(setting, wrenches[list(loads)], loads, funds))
            elif not self._is_blind(setting):
                listed = ", ".join(map(str, loads))
                raise ValueError(f"there is no proof for the loads {listed}")
        return tuple(found)

    def _part(
        self, setting: Setting, wrenches: Array, loads: tuple[int, ...], funds: float
    ) -> "_Part":
        """One set of loads."""
        if not self.degree:
            raise ValueError(f"{self.name} proves nothing about plans of other sizes")
        total, by_costs = self.day.amount(self.day.price(wrenches), funds)
        made = self.made.chosen(setting.load.excess(self.made.wrench) <= TINY)
        prior = np.asarray(self.known.T @ self.known / total)
        if by_costs:
            setting = replace(setting, price=self.day.price)
        proof = self.proofs[loads]
        largest = LargestSensitivities(
            setting=setting,
            proof=proof,
            multipliers=Multipliers.from_list(proof.multipliers, self.name, setting.p),
            prior=prior,
            per_trace=False,
            own=made,
            own_count=False,
            parts=len(self.proofs),
        )
        # Only G needs a matrix, to find good weights; bad ones would prove less, not more.
        own = self.made.stacked(setting)
        M = own.T @ own / total + prior
        return _Part(largest, M, total)

    def _is_blind(self, setting: Setting) -> bool:
        """Whether visits of any poses under some loads leave a parameter open."""
        few = candidates(setting, [SEED], "random", DRAWS, parts=MOST_SETS)
        drawn = np.concatenate([*few])
        n = len(setting.fixed)
        A = setting.whitened_rows(drawn[:, :n], setting.load.wrench(drawn[:, n:]))
        every = np.concatenate([A.reshape(-1, setting.p), self.known])
        sizes = np.linalg.norm(every, axis=0)
        if not np.isfinite(sizes).all():
            return False
        if not (sizes > 0).all():
            return self._matters(np.eye(setting.p)[:, sizes == 0])
        _, s, V = np.linalg.svd(every / sizes, full_matrices=False)
        return self._matters(V[s <= NONE * s[0]].T / sizes[:, None])

    def _matters(self, open_directions: Array) -> bool:
        """Whether directions (p, d) that are open make the criterion's cost infinite."""
        if not open_directions.shape[1]:
            return False
        return self.interest is None or bool(np.abs(self.interest.T @ open_directions).max() > NONE)


@dataclass(frozen=True, eq=False)
class _Part:
    """One set of loads.

    Attributes:
        largest: The largest sensitivities.
        M: An information matrix (p, p) for one unit of the amount.
        total: The amount: visits, or costs.
    """

    largest: LargestSensitivities
    M: Array
    total: float


def read_proofs(content: Any, setting: Setting) -> dict[tuple[int, ...], Proof]:
    """Read the proofs of a day: a list, each with the indices of its loads.

    Raises:
        ValueError: A part is missing, or is not what it should be.
    """
    last = len(_listed(setting.load)) - 1
    found = {}
    for i, entry in enumerate(rows(content, MOST_SETS, "proof")):
        where = f"proof[{i}]"
        entry = table(entry, ("loads",), where, entry)
        loads = tuple(
            whole(j, 0, last, f"{where}.loads")
            for j in rows(entry["loads"], last + 1, f"{where}.loads")
        )
        if not loads or list(loads) != sorted(set(loads)) or loads in found:
            raise ValueError(f"{where}.loads: expected other loads, in order, each once")
        rest = {key: value for key, value in entry.items() if key != "loads"}
        found[loads] = Proof.from_dict(rest, replace(setting, load=load_of(setting.load, loads)))
    if not found:
        raise ValueError("proof: expected one for each set of loads")
    return found


def load_of(load: Load, loads: tuple[int, ...]) -> Load:
    """Some of the listed loads."""
    some = _listed(load)[list(loads)]
    return Load(some, len(some) == 1, 0.0, None)


def _listed(load: Load) -> Array:
    """The loads (s, 6) that visits choose among.

    Of forces along a direction the largest counts alone: a displacement grows with its load.

    Raises:
        ValueError: They are not listed.
    """
    if load.direction is not None:
        return load.wrench(np.ones((1, 1)))
    if load.listed is None:
        raise ValueError("day: expected loads that are listed")
    return load.listed
