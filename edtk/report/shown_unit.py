"""The unit in which a person reads a criterion."""

import criteria


def shown_unit(name: str) -> tuple[float, str]:
    """Factor and unit for a criterion's values; "SI" where the criterion names none."""
    factor, unit = criteria.get(name).shown
    if unit == "mm":
        return 1e3 * factor, "um"
    return (factor, unit) if unit else (factor, "SI")
