"""The parameters that a study gives to a criterion."""

from collections.abc import Sequence
from typing import Any

import criteria
from edtk.study.criterion_table import CriterionTable


def given_parameters(
    name: str, table: CriterionTable | None, unknown: Sequence[str]
) -> dict[str, Any]:
    """The parameters of a criterion as `criteria.create` takes them; none where it needs none.

    Args:
        name: Name of the criterion.
        table: The study's key `criterion`.
        unknown: Names (p,) of the parameters that are unknown.

    Raises:
        CriterionError: The study gives none, and the criterion needs them, or they name others.
    """
    if table is not None and table.name == name:
        try:
            return table.build(unknown)
        except ValueError as error:
            raise criteria.CriterionError(f"criterion {name!r}: {error}") from error
    if criteria.get(name).needs_parameters:
        expected = ", ".join(criteria.parameters_of(name))
        raise criteria.CriterionError(
            f"criterion {name!r} needs parameters; give criterion = {{ name = {name!r}, ... }} "
            f"with {expected}"
        )
    return {}
