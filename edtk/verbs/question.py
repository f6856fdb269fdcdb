"""What a kind of question answers: a study of compliances or of geometry, a problem, or a region.

The verbs ask the question, and switch nowhere. What one kind does not answer is in one table.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from edtk.system.errors import ArgumentError

if TYPE_CHECKING:
    from edtk.design.errors import Errors
    from edtk.design.exact.counts.problem_plan import ProblemPlan
    from edtk.design.exact.exact_plan import ExactPlan
    from edtk.design.exact.plan_region import RegionPlan
    from edtk.design.relaxation.relaxation import Relaxation
    from edtk.design.relaxation.relaxed_plan import RelaxedPlan
    from edtk.design.relaxation.relaxed_region import RelaxedRegion
    from edtk.verbs.inputs import CriterionLike

FIXED = float("inf")  # variance of effects of blocks of which nothing is known
OF_PROBLEMS = (
    "starts",
    "least",
    "most",
    "costs",
    "constraints",
    "blocks",
    "block_variance",
    "errors",
)
OF_WEIGHTS = ("least", "most", "costs", "cost_budget", "constraints")  # limits, of plans too
OF_WORKERS = ("workers", "dask")
OF_STUDIES = (
    "distinct",
    "candidates",
    "exclude",
    "budget",
    *OF_WORKERS,
    "certificate",
    "rest",
    "detect",
    "second",
    "give_up",
    "place_tracker",
    "placed_study",
)
NOT_LINEAR = (
    "positions move with errors of geometry beyond the first order, and no linear model of them is "
    "fitted; leave this out"
)


def _none_of(options: Sequence[str], message: str) -> dict[str, str]:
    return dict.fromkeys(options, message)


# By kind and verb: the options that are not answered, and why.
REFUSED: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "problem": {
        "plan": _none_of(
            (*(name for name in OF_STUDIES if name != "certificate"), "prove_bound"),
            "not for plans of a problem of arrays",
        ),
        "relax": _none_of(
            ("candidates", "seed", "budget", *OF_WORKERS, "prove"),
            "not for the relaxation of a problem of arrays",
        ),
    },
    "region": {
        "plan": _none_of(
            (*OF_PROBLEMS[1:], "prove", "cost_budget", *OF_STUDIES), "not for plans of a region"
        ),
        "relax": _none_of(
            ("seed", "budget", *OF_WORKERS, *OF_WEIGHTS), "not for the relaxation of a region"
        ),
    },
    "compliances": {
        "plan": _none_of(OF_PROBLEMS, "not for plans of a study"),
        "relax": _none_of(OF_WEIGHTS, "not for the relaxation of a study"),
        "predict": {
            "tool_rows": "where a marker sits on the tool is no part of a displacement but in "
            "marker_x_mm marker_y_mm marker_z_mm; leave this out",
        },
    },
    "geometry": {
        "plan": _none_of(OF_PROBLEMS, "not for plans of a study"),
        "relax": _none_of(OF_WEIGHTS, "not for the relaxation of a study"),
        "template": {
            "markers": "the markers of a study of geometry are its [[marker]]; leave this out",
            "positions": "a sheet of a study of geometry has positions anyway; leave this out",
        },
        "identify": {"linear": NOT_LINEAR},
    },
}


def seconds_for(given: object, argument: str = "prove") -> float:
    """The time for a proof, or another argument [s]; infinite for None.

    Raises:
        ArgumentError: It is no number of seconds.
    """
    if given is None:
        return inf
    if isinstance(given, bool) or not isinstance(given, Real) or not float(given) >= 0:
        raise ArgumentError("expected seconds, zero or more", argument=argument, given=given)
    return float(given)


@dataclass(frozen=True, kw_only=True)
class PlanCall:
    """The arguments of `edtk.plan`, which describes them."""

    size: int | None
    criterion: "CriterionLike | None"
    seed: int | None
    keep: Any
    out: Path | str | None
    progress: Callable[[str, float], object]
    starts: int | None = None
    least: Any = None
    most: Any = None
    costs: Any = None
    cost_budget: Any = None
    constraints: Any = None
    blocks: Sequence[int] | None = None
    block_variance: float | None = None
    errors: "Errors | None" = None
    prove: float | None = None
    candidates: int | None = None
    distinct: int | None = None
    exclude: Path | str | None = None
    budget: float | None = None
    workers: int | None = None
    dask: str | None = None
    certificate: Path | str | None = None
    rest: Path | str | None = None
    detect: Mapping[str, str] | None = None
    second: "CriterionLike | None" = None
    give_up: float | None = None
    prove_bound: float | None = None
    place_tracker: bool = False
    placed_study: Path | str | None = None

    @property
    def seconds(self) -> float:
        """The time for bound and plan together [s]; infinite without a budget."""
        return seconds_for(self.budget, "budget")


@dataclass(frozen=True, kw_only=True)
class RelaxCall:
    """The arguments of `edtk.relax`, which describes them."""

    criterion: "CriterionLike | None"
    candidates: int | None
    continuous: bool
    size: int | None
    seed: int | None
    memory_mb: float
    workers: int | None
    dask: str | None
    out: Path | str | None
    certificate: Path | str | None
    progress: Callable[[str, float], object]
    budget: float | None = None
    prove: float | None = None
    least: Any = None
    most: Any = None
    costs: Any = None
    cost_budget: Any = None
    constraints: Any = None


class Question(ABC):
    """What is asked, and what answers it.

    Attributes:
        kind: The kind of question, as `REFUSED` names it.
    """

    kind: ClassVar[str]

    def require(self, verb: str, **options: object) -> None:
        """Check that no option is given that questions of this kind do not answer.

        Args:
            verb: The verb.
            options: Its options; None and False count as not given.

        Raises:
            ArgumentError: One is; it says why that is not answered.
        """
        refused = REFUSED[self.kind].get(verb, {})
        for name, value in options.items():
            if name in refused and value is not None and value is not False:
                raise ArgumentError(refused[name], argument=name)

    @abstractmethod
    def plan(self, call: PlanCall) -> "ExactPlan | ProblemPlan | RegionPlan":
        """The best plan, and its files; see `edtk.plan`."""

    @abstractmethod
    def relax(self, call: RelaxCall) -> "RelaxedPlan | Relaxation | RelaxedRegion":
        """The best weights, and their files; see `edtk.relax`."""
