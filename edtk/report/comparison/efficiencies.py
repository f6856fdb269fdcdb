"""Efficiencies of the plans of one size under all criteria."""

from dataclasses import dataclass

import numpy as np

from edtk.report.comparison.cell import percent
from edtk.report.markdown_table import markdown_table
from edtk.report.other_plans import other_plans
from edtk.report.plans_of import plans_of
from edtk.study.study_run import StudyRun
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Efficiencies:
    """Efficiencies of plans (k) under criteria (c), against the bounds over all poses.

    Attributes:
        size: Number of experiments of the plans.
        names: Criteria (c,).
        plans: Names of the plans (k,), in words.
        values: Efficiencies (k, c).
        reason: Why no plan exists, or "".
    """

    size: int
    names: list[str]
    plans: list[str]
    values: Array
    reason: str

    @classmethod
    def of(cls, run: StudyRun, size: int) -> "Efficiencies":
        """The efficiencies of a run's plans of one size."""
        specification = run.study.specification
        names = [name for name in specification.criteria if f"efficiency_{name}" in run.table]
        optimised = specification.optimise
        ours = {f"optimised for {n}": plans_of(run.table, "optimised", n) for n in optimised}
        plans = []
        values = []
        for label, group in (ours | other_plans(run.table)).items():
            for _, row in group[group["experiments"] == size].iterrows():
                if not row["reason"]:
                    plans.append(label)
                    values.append([float(row[f"efficiency_{name}"]) for name in names])
        reason = ""
        if not plans:
            main = plans_of(run.table, "optimised", run.study.main_criterion, size)
            reason = str(main["reason"].iloc[0])
        return cls(size, names, plans, np.array(values), reason)

    @property
    def picture(self) -> str:
        """Name of the file with the heat map."""
        return f"efficiency_m{self.size}.png"


def efficiencies(found: Efficiencies) -> str:
    """A heading, the heat map, and a table; or the reason why no plan exists."""
    heading = f"### {found.size} experiment{'s' if found.size > 1 else ''}\n"
    if not found.plans:
        return f"{heading}\nNo plan: {found.reason}.\n"
    cells = [
        [plan, *map(percent, row)] for plan, row in zip(found.plans, found.values, strict=True)
    ]
    image = f"![Efficiencies of plans of {found.size} experiments]({found.picture})"
    return f"{heading}\n{image}\n\n{markdown_table(['plan', *found.names], cells)}"
