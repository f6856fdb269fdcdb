"""The paper's example, as the repository's study file states it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from edtk.design.plan import Plan
from edtk.study.study import Study, load_study

Array = NDArray[np.float64]
STUDY = Path(__file__).parent.parent / "studies" / "kr270_milling.toml"


def load_example() -> Study:
    """The study of the paper's Section 5."""
    return load_study(STUDY)


def plans_of_table_4(study: Study) -> dict[int, Plan]:
    """The published plans by their number of poses: 2, 3, 4, 6 and 12."""
    return {len(plan.q): plan for plan in study.published_plans().values()}


def target_of(study: Study) -> Array:
    """A0 (3, p) of the test pose, Eq. (23) [m/(rad/(N m))]."""
    if study.target is None:
        raise ValueError("the study has no test pose")
    return study.target
