"""Fig. 7: simulated accuracy of the compensation for six plans, with its numbers and caption."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from edtk import Study
from edtk.report.tables import markdown_table
from edtk.system.files import write_text
from edtk.system.typing import Array
from paper_figures.csv_file import write_csv
from paper_figures.draw_figure_7 import DOTS, save
from paper_figures.fill_page import fill_page
from paper_figures.random_plans import random_plans
from paper_figures.simulated import Errors, simulate_errors

UNIT = 1e-6  # 1e-3 mm
HEADER = (
    "plan",
    "A0",
    "Monte-Carlo mean",
    "exact mean",
    "Monte-Carlo RMS",
    "rho0, Eq. (20)",
    "printed mean",
)


def by_target(errors: Iterable[Errors]) -> list[Errors]:
    """The clipped A0 first, as in the figure."""
    return sorted(errors, key=lambda e: e.target)


def tabulate(errors: Sequence[Errors]) -> pd.DataFrame:
    """A row per plan and A0, in 1e-3 mm."""
    rows = [
        {
            "A0": e.target,
            "plan": e.plan,
            "line": e.line,
            "mc_mean": e.mean / UNIT,
            "mc_mean_standard_error": e.mean_error / UNIT,
            "exact_mean": e.exact_mean / UNIT,
            "mc_rms": e.rms / UNIT,
            "mc_rms_standard_error": e.rms_error / UNIT,
            "rho0": e.rho0 / UNIT,
            "printed": e.printed / UNIT,
        }
        for e in by_target(errors)
    ]
    return pd.DataFrame(rows)


def readable(errors: Sequence[Errors], spread: Mapping[str, Array]) -> str:
    """The caption, which says what is print's and what is ours, and the numbers."""
    rows = [
        [
            f"({e.plan}), line ({e.line})",
            e.target,
            f"{e.mean / UNIT:.3f} ± {e.mean_error / UNIT:.3f}",
            *(f"{v / UNIT:.3f}" for v in (e.exact_mean, e.rms, e.rho0)),
            f"{e.printed / UNIT:.2f}",
        ]
        for e in by_target(errors)
    ]
    return fill_page(
        "figure_7",
        table=markdown_table(HEADER, rows),
        dots=DOTS,
        runs=len(errors[0].distances),
        plans=len(spread["true"]),
        misses=_misses(errors),
        noise=_noise(errors),
        **{name: _summary(means) for name, means in spread.items()},
    )


def _summary(means: Array) -> str:
    """Mean, its standard error, and the middle 80 % of the plans."""
    low, high = np.quantile(means, (0.1, 0.9)) / UNIT
    error = means.std(ddof=1) / np.sqrt(len(means)) / UNIT
    most = f"for eight plans in ten between {low:.2f} and {high:.2f}"
    return f"{means.mean() / UNIT:.2f} ± {error:.2f} ({most})"


def _optimal(errors: Sequence[Errors]) -> list[Errors]:
    """The plans of Table 4 with the clipped A0."""
    return [e for e in errors if e.target == "clipped" and e.plan != "1"]


def _misses(errors: Sequence[Errors]) -> str:
    """How far printed expectations lie from the exact means."""
    misses = [100 * (e.printed / e.exact_mean - 1) for e in _optimal(errors)]
    return f"{min(misses):+.1f} to {max(misses):+.1f} %"


def _noise(errors: Sequence[Errors]) -> float:
    """Largest standard error [%] of a mean of as many simulations as there are dots."""
    # The variance of a length is its mean square, rho0^2, less its squared mean.
    relative = [np.sqrt((e.rho0 / e.exact_mean) ** 2 - 1) for e in _optimal(errors)]
    return max(100 * float(std / np.sqrt(DOTS)) for std in relative)


def write(study: Study, out: Path) -> tuple[Path, ...]:
    """Write figure_7.png, .svg, .csv and .md."""
    candidates = random_plans(study)
    errors = simulate_errors(study, candidates.median)
    csv = out / "figure_7.csv"
    text = out / "figure_7.md"
    write_csv(csv, tabulate(errors))
    write_text(text, readable(errors, candidates.means))
    return (*save(errors, out), csv, text)
