"""Does the toolkit find optima that are known in closed form? An arm of three joints says so.

    python studies/spherical_arm.py

writes spherical_arm.md beside this file: for criteria of all three compliances and of some of them,
the closed form of docs/explanation/spherical_arm.md, the relaxation over candidates, the search
over all poses with its bound, and exact plans. It ends with code 1 if one of them is off by more
than 1e-6.
"""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np

from edtk import Study, load_study
from edtk.report.tables import markdown_table
from edtk.study.plan_study import plan_study, relax_study
from edtk.system.files import write_text

HERE = Path(__file__).parent
TOLERANCE = 3e-7  # of the search over all poses
ACCURACY = 1e-6  # to which the closed forms have to come out
BUDGET = 60.0  # seconds for an exact plan

# Criteria, and the joints of interest; none for all.
QUESTIONS = (
    ("D", ()),
    ("A", ()),
    ("D", ("q1", "q3")),
    ("A", ("q1", "q3")),
    ("A", ("q1",)),
    ("A", ("q2",)),
)


def unit(study: Study) -> float:
    """``T = (rho^2 F / sigma)^2``: the most that one experiment can tell of a single compliance."""
    radius = study.specification.tool.position_mm[0] / 1e3
    assert study.specification.load is not None
    force = study.specification.load.F_max_N
    assert force is not None
    return float((radius**2 * force / study.sigma[0]) ** 2)


def closed_form(name: str, joints: tuple[str, ...], T: float) -> float:
    """The optimal value for one experiment's worth of weight."""
    pair = 27 / 8
    values = {
        ("D", ()): T * 16 ** (-1 / 3),
        ("A", ()): (1 + np.sqrt(pair)) ** 2 / T,
        ("D", ("q1", "q3")): T * np.sqrt(27 / 64),
        ("A", ("q1", "q3")): pair / T,
        ("A", ("q1",)): 1 / T,
        ("A", ("q2",)): 1 / T,
    }
    return float(values[name, joints])


def about(study: Study, joints: tuple[str, ...]) -> Study:
    """The study about some joints, or about all."""
    return study.replace(interest={"joints": list(joints)} if joints else None)


def relaxation_row(study: Study, name: str, joints: tuple[str, ...]) -> tuple[list[str], bool]:
    """A line of the table, and whether value and bound are those of the closed form."""
    since = perf_counter()
    question = about(study, joints)
    expected = closed_form(name, joints, unit(study))
    found = relax_study(question, name, continuous=True, tolerance=TOLERANCE)
    off = found.value / expected - 1
    bound_off = found.best_bound.value / expected - 1
    turns = np.unique(np.round(np.abs(np.rad2deg(found.x[found.weights > 0.01, 1])), 1))
    cells = [
        question.criterion(name).label,
        f"{expected:.7g}",
        f"{off:+.1e}",
        f"{bound_off:+.1e}",
        str(len(found.x)),
        ", ".join(f"{turn:.1f}" for turn in turns),
        f"{perf_counter() - since:.0f}",
    ]
    return cells, max(abs(off), abs(bound_off)) <= ACCURACY


def plan_row(study: Study, size: int) -> tuple[list[str], bool]:
    """A line on the best exact plan for D, which reaches the bound in threes."""
    expected = size * closed_form("D", (), unit(study))
    found = plan_study(study, size, "D", budget=BUDGET)
    off = found.value / expected - 1
    cells = [str(size), f"{expected:.7g}", f"{off:+.1e}", f"{found.efficiency:.7f}"]
    return cells, abs(off) <= ACCURACY


def main() -> int:
    """Write the report; 1 if anything is off."""
    study = load_study(HERE / "spherical_arm.toml")
    relaxations = [relaxation_row(study, *question) for question in QUESTIONS]
    plans = [plan_row(study, size) for size in study.specification.sizes]
    holds = all(good for _, good in (*relaxations, *plans))
    header = ["criterion", "closed form", "value", "bound", "poses", "size of q2 [deg]", "seconds"]
    text = (
        "# Optima that are known: the spherical arm\n\n"
        "`python studies/spherical_arm.py` wrote this file; it ends with code 1 if something does "
        f"not hold. Everything is within {ACCURACY:g} of the closed form: "
        f"{'yes' if holds else 'NO'}.\n\n"
        "Weights over all poses, per experiment; value and bound relative to the closed form.\n\n"
        f"{markdown_table(header, [cells for cells, _ in relaxations])}\n"
        "Exact plans for D; value relative to the closed form.\n\n"
        f"{markdown_table(['m', 'closed form', 'value', 'efficiency'], [c for c, _ in plans])}"
    )
    write_text(HERE / "spherical_arm.md", text)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
