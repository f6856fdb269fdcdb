"""Runs of a study that are made up, for reports on them."""

from pathlib import Path

import numpy as np
import pandas as pd

from edtk.study.study import load_study
from edtk.study.study_run import StudyRun

PATH = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"
OPTIMISED = '["rho0", "A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5"]'
COMPARED = '["A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0"]'


def study_of(folder, optimise, sizes):
    """The example, comparing E and rho0 in plans of some sizes."""
    text = PATH.read_text().replace(OPTIMISED, optimise).replace(COMPARED, '["E", "rho0"]')
    path = folder / "study.toml"
    path.write_text(text.replace("sizes = [2, 3, 4, 6, 12]", f"sizes = {sizes}"))
    return load_study(path)


def two_sizes(folder, relaxed, optimise, E=(np.nan, 5e14), rho0=(np.nan, 7e-6)):
    """A run that optimises one criterion, with one and three experiments, beside random plans.

    Args:
        folder: Where the study and the run are.
        relaxed: Relaxations by criterion.
        optimise: The criterion.
        E: Its values for both sizes.
        rho0: Its values for both sizes [m].
    """
    kinds = ["optimised", "random"] * 2
    sizes = [1, 1, 3, 3]
    worse_E = np.repeat(E, 2) * [1, 1, 1, 0.5]
    table = pd.DataFrame(
        {
            "kind": kinds,
            "optimised_for": [optimise, ""] * 2,
            "experiments": sizes,
            "distinct_at_most": sizes,
            "poses": sizes,
            "plan": [f"{kind}_m{m}" for kind, m in zip(kinds, sizes, strict=True)],
            "E": worse_E,
            "rho0": np.repeat(rho0, 2) * [1, 1, 1, 2.0],
            "reason": ["too few" if np.isnan(value) else "" for value in worse_E],
            "efficiency_E": 0.8,
            "efficiency_rho0": 0.9,
            "error_test_pose": 6e-6,
            "error_mean": 8e-6,
            "error_largest": 9e-6,
            "edtk": "1.2",
        }
    )
    study = study_of(folder, f'["{optimise}"]', [1, 3])
    return StudyRun(study, table, relaxed, (), folder)


def other_criteria(folder, relaxed):
    """A run of three and four experiments for rho0 and E, with fewer distinct poses for rho0."""
    rows = [
        ("optimised", "rho0", 3, 3, 6.0e-6),
        ("optimised", "rho0", 4, 4, 5.0e-6),
        ("optimised", "E", 3, 3, 9.0e-6),
        ("optimised", "E", 4, 4, 10.0e-6),
        ("distinct", "rho0", 3, 2, 6.03e-6),
        ("distinct", "rho0", 4, 2, 5.5e-6),
        ("distinct", "rho0", 4, 3, 5.6e-6),
        ("published", "", 4, 4, 6.0e-6),
    ]
    columns = ["kind", "optimised_for", "experiments", "distinct_at_most", "rho0"]
    table = pd.DataFrame(rows, columns=columns)
    table = table.assign(
        plan=[f"plan_{i}" for i in range(len(rows))],
        E=5e14,
        reason="",
        error_test_pose=table["rho0"],
        error_mean=8e-6,
        error_largest=9e-6,
        edtk="1.2",
        poses=table["distinct_at_most"],
        efficiency_E=0.5,
        efficiency_rho0=4.8e-6 / table["rho0"],
    )
    study = study_of(folder, '["rho0", "E"]', [3, 4])
    return StudyRun(study, table, relaxed, (), folder)
