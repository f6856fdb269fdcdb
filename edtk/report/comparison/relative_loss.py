"""By how much plans are worse than the best one."""

from typing import Any

import criteria


def relative_loss(name: str, best: float, values: Any) -> Any:
    """Loss of values (a number or a series) of a criterion, as a share of the best plan's cost."""
    return values / best - 1 if criteria.get(name).sense == "min" else best / values - 1
