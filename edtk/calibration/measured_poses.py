"""The poses of a calibration, each once, with how far the fit is from what was read there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.design.plan import Plan
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

MOST = 2000  # poses of a file of results, which is read by people too
KEYS = ("q", "wrench", "repeats", "residual_mm")


@dataclass(frozen=True, eq=False)
class MeasuredPoses:
    """Poses in the order of the sheet.

    Attributes:
        plan: The poses, their loads, and how many rows of the sheet each has.
        residual: Root mean square of the distances of its readings from the fit (k,) [m]; NaN where
            nothing but rotations was read.
    """

    plan: Plan
    residual: Array

    @classmethod
    def of(cls, plan: Plan, pose: Indices, square: Array) -> "MeasuredPoses":
        """Those of a fit.

        Args:
            plan: The poses, each once.
            pose: Which of them each reading is of (r,).
            square: Squared distances of markers from the fit (r, k) [m^2]; NaN where none was seen.
        """
        seen = np.isfinite(square)
        count = np.bincount(pose, weights=seen.sum(axis=1), minlength=len(plan.q))
        size = np.where(seen, square, 0.0).sum(axis=1)
        total = np.bincount(pose, weights=size, minlength=len(plan.q))
        return cls(plan, np.sqrt(total / np.where(count > 0, count, np.nan)))

    def to_list(self) -> list[dict[str, Any]]:
        """A table for each of the first poses, SI but for the residual."""
        rows = zip(self.plan.q, self.plan.wrench, self.plan.repeats, self.residual, strict=True)
        return [
            {
                "q": q.tolist(),
                "wrench": wrench.tolist(),
                "repeats": int(repeats),
                "residual_mm": 1e3 * float(residual) if np.isfinite(residual) else None,
            }
            for q, wrench, repeats, residual in list(rows)[:MOST]
        ]

    @classmethod
    def from_list(cls, given: object, joints: int, where: object) -> "MeasuredPoses":
        """The poses of a file.

        Args:
            given: What `to_list` gave.
            joints: Number of joints of the robot.
            where: The file, for messages.

        Raises:
            UserError: It is none, or of another robot.
        """
        expected = f"expected a table for each pose with {', '.join(KEYS)}"
        if not isinstance(given, list) or not given:
            raise UserError(expected, where=str(where), key="poses")
        columns: dict[str, list[Any]] = {key: [] for key in KEYS}
        for i, row in enumerate(given):
            key = f"poses[{i + 1}]"
            if not isinstance(row, Mapping) or not set(KEYS) <= set(row):
                raise UserError(expected, where=str(where), key=key)
            if isinstance(row["q"], list) and len(row["q"]) != joints:
                message = f"has {len(row['q'])} joints; expected the {joints} of the study's robot"
                raise UserError(message, where=str(where), key=key)
            for name in KEYS:
                columns[name].append(np.nan if row[name] is None else row[name])
        try:
            q, wrench, residual = (
                np.array(columns[name], dtype=float) for name in ("q", "wrench", "residual_mm")
            )
            plan = Plan(q, wrench, np.array(columns["repeats"], dtype=int))
        except (TypeError, ValueError) as error:
            raise UserError(expected, where=str(where), key="poses") from error
        return cls(plan, residual / 1e3)
