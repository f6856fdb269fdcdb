"""The design space in which plans of a given size are searched."""

from edtk.design.design_space import DesignSpace
from edtk.design.plan import Plan
from edtk.study.study import Study


def planning_space(study: Study, new: int | None = None, kept: Plan | None = None) -> DesignSpace:
    """The study's design space, with all that is known beside the experiments to be designed.

    Args:
        study: The study.
        new: Number of experiments to be designed, which share what is known; only needed where
            something is.
        kept: Experiments that have been carried out already.

    Returns:
        The space, whose prior is that of the study, if it counts, and of the kept experiments.
    """
    known = study.prior_information
    if kept is not None:
        of_kept = study.space.information(kept)
        known = of_kept if known is None else known + of_kept
    if known is None:
        return study.space
    assert new is not None
    return study.space.with_kept(known, new)
