"""The bound that plans of a study are compared with."""

from collections.abc import Mapping

from edtk.design.bound import Bound
from edtk.design.relaxation.relaxed_plan import RelaxedPlan


def relaxation_key(name: str, size: int | None) -> str:
    """What the relaxation under a criterion is called in a run.

    Args:
        name: Name of the criterion.
        size: Number of experiments, where the relaxation depends on it: a prior counts the less,
            the more experiments share it.
    """
    return name if size is None else f"{name}_m{size}"


def bound_for(relaxations: Mapping[str, RelaxedPlan], name: str, size: int) -> Bound | None:
    """The best bound on plans of so many experiments; None where no relaxation gives one.

    Args:
        relaxations: Relaxations of a run by `relaxation_key`.
        name: Name of the criterion.
        size: Number of experiments.
    """
    for key in (relaxation_key(name, None), relaxation_key(name, size)):
        if key in relaxations:
            return relaxations[key].best_bound.scaled(size)
    return None
