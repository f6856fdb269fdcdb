"""The table of a study's comparison: all plans under all criteria."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.bound_for import bound_for
from edtk.study.case import Case
from edtk.study.designs import Designs
from edtk.version import __version__

if TYPE_CHECKING:
    import pandas as pd

ERRORS = ("error_test_pose", "error_mean", "error_largest")


def comparison_table(
    designs: Designs, cases: Iterable[Case], relaxations: Mapping[str, RelaxedPlan]
) -> "pd.DataFrame":
    """Compare plans under all criteria of a study.

    Args:
        designs: The designs of the study.
        cases: The plans; one that does not exist has a row with its reason and without values.
        relaxations: Relaxations by `relaxation_key`, whose bounds efficiencies refer to.

    Returns:
        One row a plan: what it is; the value of each criterion [SI units]; its efficiency under
        each criterion with a relaxation, which is the best bound divided by its cost; with a test
        pose, the errors to expect there and around it [m]; seed, digest of the study and version.
    """
    import pandas as pd

    return pd.DataFrame([_row(designs, case, relaxations) for case in cases])


def _row(designs: Designs, case: Case, relaxations: Mapping[str, RelaxedPlan]) -> dict[str, Any]:
    study = designs.study
    row: dict[str, Any] = {
        "plan": case.name,
        "kind": case.kind,
        "optimised_for": case.optimised,
        "experiments": case.size,
        "distinct_at_most": case.distinct or case.size,
        "poses": 0 if case.plan is None else len(case.plan.q),
        "reason": case.reason,
    }
    M = None if case.plan is None else designs.information(case.plan)
    for name in study.specification.criteria:
        row[name] = np.nan if M is None else float(designs.criterion(name).value(M))
    for name in dict.fromkeys(relaxed.criterion.name for relaxed in relaxations.values()):
        cost = np.inf if M is None else float(designs.criterion(name).cost(M))
        bound = bound_for(relaxations, name, case.size)
        row[f"efficiency_{name}"] = np.nan if bound is None else bound.efficiency(cost)
    if study.tasks:
        row |= _errors(designs, case)
    return row | {
        "seed": study.specification.seed,
        "study_sha256": study.digest,
        "edtk": __version__,
    }


def _errors(designs: Designs, case: Case) -> dict[str, float]:
    """The errors that a plan promises in the test pose and around it [m]; NaN where it has none."""
    found = None if case.plan is None else designs.expected(case.plan)
    if found is None:
        return dict.fromkeys(ERRORS, np.nan)
    return dict(zip(ERRORS, (found.test_pose, found.mean, found.largest), strict=True))
