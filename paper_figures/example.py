"""The paper's example, as the repository's study file states it."""

from pathlib import Path

from edtk import Plan, Study, load_study
from edtk.system.typing import Array

STUDY = Path(__file__).parent.parent / "studies" / "kr270_milling.toml"


def load_example() -> Study:
    """The study of the paper's Section 5."""
    return load_study(STUDY)


def plans_of_table_4(study: Study) -> dict[int, Plan]:
    """The published plans by their number of poses: 2, 3, 4, 6 and 12."""
    return {len(plan.q): plan for plan in study.published_plans().values()}


def target_of(study: Study) -> Array:
    """A0 (3, p) of the test pose, Eq. (23) [m/(rad/(N m))].

    Raises:
        ValueError: The study has no test pose.
    """
    if study.target is None:
        raise ValueError("the study has no test pose")
    return study.target
