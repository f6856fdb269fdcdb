"""`edtk.plan` of a study of geometry: its arguments, checked, and its files."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from edtk.calibration.geometry_design.plan_geometry import plan_geometry as plan_of_study
from edtk.study.run_options import Progress, RunOptions
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.verbs.for_criterion import CriterionLike, for_criterion
from edtk.verbs.inputs import PlanLike, as_plan, errors_in
from edtk.verbs.table_and_certificate import TableAndCertificate

if TYPE_CHECKING:
    from edtk.calibration.geometry_design.geometry_plan import GeometryPlan


def plan_geometry(
    study: Study,
    size: int | None,
    criterion: CriterionLike | None,
    seed: int | None,
    keep: PlanLike | None,
    progress: Progress,
    *,
    cost_budget: float | None,
    distinct: int | None,
    exclude: Path | str | None,
    budget: float | None,
    workers: int | None,
    dask: str | None,
    out: Path | str | None,
    certificate: Path | str | None,
    detect: Mapping[str, str] | None,
) -> "GeometryPlan":
    """Search for the best visits of a study with [parameters].

    The arguments are those of `edtk.plan`; the search is done in this process, on any machine.

    Raises:
        ArgumentError: An argument is for plans of compliances alone.
        UserError: One line that says what cannot be done, and where.
    """
    unknown = {"distinct": distinct, "dask": dask, "certificate": certificate, "detect": detect}
    for argument, given in unknown.items():
        if given is not None:
            message = "is for plans of compliances alone; this study has [parameters]"
            raise ArgumentError(message, argument=argument)
    question = study if exclude is None else study.excluding(exclude)
    kept = None if keep is None else as_plan(question, keep)
    files = TableAndCertificate(out, None)
    files.require(*question.reads, keep if isinstance(keep, str | Path) else None)
    asked, name = for_criterion(question, criterion)
    with errors_in(question.where):
        found = plan_of_study(
            asked,
            size,
            name,
            kept=kept,
            cost_budget=cost_budget,
            seconds=budget,
            options=RunOptions(seed=seed, progress=progress),
        )
    files.write(lambda: found.whole.to_frame(question.robot), lambda: "")
    return found
