"""Plans that were not optimised, as a report names them."""

import pandas as pd

from edtk.report.shown import other_plans
from edtk.study.study_run import Case


def table_of(*cases):
    """A table of a comparison, as far as groups need it."""
    keys = ("plan", "kind", "optimised_for", "experiments")
    rows = [(case.name, case.kind, case.optimised, case.size) for case in cases]
    return pd.DataFrame(rows, columns=keys)


def test_published_plans_of_one_size_are_groups_of_their_own():
    """Each has its file's name; a size with one published plan needs none."""
    cases = [
        Case("optimised", "D", 3),
        Case("published", "", 3, label="pub.csv"),
        Case("published", "", 3, label="sub/pub.csv"),
        Case("published", "", 4),
        Case("random", "", 3),
    ]
    found = {name: list(plans["plan"]) for name, plans in other_plans(table_of(*cases)).items()}
    assert found == {
        "published (pub.csv)": ["published_m3_pub.csv"],
        "published (sub/pub.csv)": ["published_m3_sub/pub.csv"],
        "published": ["published_m4"],
        "random": ["random_m3"],
    }


def test_a_comparison_without_published_plans():
    """There is no column for what the study does not name."""
    found = other_plans(table_of(Case("random", "", 3)))
    assert list(found) == ["random"]
