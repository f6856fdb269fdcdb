"""One plan of a study's comparison."""

from dataclasses import dataclass

from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.plan import Plan


@dataclass(frozen=True, eq=False)
class Case:
    """One plan of the comparison, or the question for it.

    Attributes:
        kind: "optimised", "distinct", "published" or "random".
        optimised: Name of the criterion that it is optimised for, or "".
        size: Number of experiments m.
        distinct: Number of distinct poses, at most; None for any.
        plan: The plan; None before it is found, or if there is no such plan.
        found: How it was found, with its bound; None for plans that were not searched for.
        reason: Why there is no such plan, or "".
        label: What tells it from other plans of its kind and size: the file of a published plan.
    """

    kind: str
    optimised: str
    size: int
    distinct: int | None = None
    plan: Plan | None = None
    found: ExactPlan | None = None
    reason: str = ""
    label: str = ""

    @property
    def name(self) -> str:
        """Name in tables, and of the plan's file."""
        distinct = f"k{self.distinct}" if self.distinct else ""
        parts = (self.kind, self.optimised, f"m{self.size}", distinct, self.label)
        return "_".join(filter(None, parts))
