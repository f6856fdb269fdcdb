"""`edtk.plan` of a region: its arguments, checked."""

import criteria
from edtk.design.exact import plan_region as exact
from edtk.design.exact.region_plan import RegionPlan
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.study.run_options import Progress
from edtk.system.errors import ArgumentError
from edtk.system.whole_number import whole_number
from edtk.verbs.for_criterion import CriterionLike


def plan_region(
    region: Region,
    size: int,
    criterion: CriterionLike,
    seed: int,
    starts: int | None,
    keep: object,
    progress: Progress,
) -> RegionPlan:
    """Search for the best plan in a region; the arguments are those of `edtk.plan`.

    Raises:
        ArgumentError: An argument is impossible.
        UserError: So few experiments cannot identify the parameters.
    """
    if keep is not None and not isinstance(keep, Problem):
        raise ArgumentError("expected a Problem of the experiments at hand", argument="keep")
    criterion = criteria.as_criterion(criterion, region.parameters)
    number = None if starts is None else whole_number(starts, "starts", 1)
    return exact.plan_region(
        region,
        whole_number(size, "size", 1),
        criterion,
        whole_number(seed, "seed", 0),
        number,
        keep,
        progress,
    )
