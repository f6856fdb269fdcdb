"""How the calls of the front door take a criterion, with its parameters if it needs some."""

from collections.abc import Mapping
from typing import Any

import criteria
from edtk.study.study import Study

CriterionLike = criteria.Criterion | str | Mapping[str, Any]


def for_criterion(study: Study, criterion: CriterionLike | None) -> tuple[Study, str | None]:
    """The study that asks for a criterion, and the criterion's name in it.

    A name stands for the criterion with what the study says of it. A table with parameters, or a
    criterion that needs some, becomes the study's own key `criterion`.

    Args:
        study: The study.
        criterion: What is asked for; None for the criterion that the study is about.

    Raises:
        UserError: The study cannot have such a criterion.
        CriterionError: There is no such criterion, or its parameters are wrong.
    """
    if criterion is None or isinstance(criterion, str):
        return study, criterion
    if isinstance(criterion, criteria.Criterion):
        if not criterion.needs_parameters:
            return study, criterion.name
        criterion = criterion.to_dict()
    if study.specification.parameters is not None:
        name = str(criterion.get("name"))  # which parameters it has only the design knows
    else:
        name = criteria.as_criterion(criterion, study.specification.joints.unknown).name
    return study.replace(criterion=dict(criterion)), name
