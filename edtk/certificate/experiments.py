"""The experiments of a certificate."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.plain_data import numbers, rows, table
from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array, Mask

MOST = 20_000  # experiments that a certificate may list


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
        found = rows(value, MOST, where)
        for i, row in enumerate(found):
            table(row, ("q", "wrench", amount), f"{where}[{i}]")
        return cls(
            numbers([row["q"] for row in found], (None, n), f"{where}.q"),
            numbers([row["wrench"] for row in found], (None, 6), f"{where}.wrench"),
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
            visits = setting.noise.visits(setting.chain, self.q, self.amount)
        rows = self.rows(setting, visits) * np.sqrt(self.amount)[:, None, None]
        return rows.reshape(-1, setting.p)
