"""Values of criteria as a table."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import criteria

if TYPE_CHECKING:
    import pandas as pd


def criteria_frame(values: Mapping[str, float]) -> "pd.DataFrame":
    """A table with a criterion a row, by name: value, sense, title and formula."""
    import pandas as pd

    classes = [criteria.get(name) for name in values]
    return pd.DataFrame(
        {
            "value": list(values.values()),
            "sense": [criterion.sense for criterion in classes],
            "title": [criterion.title for criterion in classes],
            "formula": [criterion.formula for criterion in classes],
        },
        index=pd.Index(list(values), name="criterion"),
    )
