"""Values of all criteria that a study can evaluate."""

from collections.abc import Callable
from contextlib import suppress

import criteria
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.system.typing import Array

OBSERVABILITY = ("O1", "O2", "O3", "O4", "O5")  # indices that others also print without sigma

CriterionOf = Callable[[str], criteria.Criterion]


def criterion_values(
    study: Study, M: Array, criterion: CriterionOf, has_target: bool
) -> tuple[dict[str, float], dict[str, str]]:
    """Values of all criteria that apply, and why those of other plug-ins have none.

    Args:
        study: The study, which names criteria and gives their parameters.
        M: Information (p, p) of a plan.
        criterion: The study's criterion of a name; raises `UserError` where it has none.
        has_target: Whether there is a task, without which criteria of tasks do not apply.

    Raises:
        UserError: A criterion that the study names fails.
    """
    loaded = criteria.load_all()
    values = {}
    skipped = dict(loaded.problems)
    # Criteria that need parameters have them only where the study gives them.
    own = {name: criteria.get(name) for name in study.names if name not in loaded.problems}
    for name, known in (loaded.classes | own).items():
        if known.needs_target and not has_target:
            continue
        try:
            values[name] = float(criterion(name).value(M))
        except (criteria.CriterionError, UserError) as error:
            message = error.message if isinstance(error, UserError) else str(error)
            if name in study.names:
                raise UserError(message, where=study.where) from error
            skipped[name] = message
    return values, skipped


def observability(M: Array, criterion: CriterionOf) -> dict[str, float]:
    """O1 to O5 of ``A' A`` (p, p), without division by sigma."""
    found = {}
    for name in OBSERVABILITY:
        with suppress(UserError):  # an index that has no meaning for a part of the parameters
            found[name] = float(criterion(name).value(M))
    return found
