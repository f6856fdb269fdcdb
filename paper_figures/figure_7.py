"""Fig. 7: simulated accuracy of the compensation for six plans, with its numbers and caption."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from edtk.report.markdown_table import markdown_table
from edtk.study.study import Study
from edtk.system.atomic_file import write_text
from paper_figures.csv_file import write_csv
from paper_figures.draw_figure_7 import DOTS, save
from paper_figures.random_plans import random_plans
from paper_figures.simulated import Errors, simulate_errors

UNIT = 1e-6
TEXT = """# Fig. 7: accuracy of the compliance error compensation for different plans of twelve experiments

![Fig. 7](figure_7.png)

Error |A0 (k_hat - k0)| in the test pose when k_hat is estimated from simulated measurements, sigma = 0.03 mm
per coordinate, k0 from the study file (the error does not depend on it). (1) a random plan of twelve poses;
(2a) to (2e) the plans of Table 4 for 2, 3, 4, 6 and 12 experiments, carried out 6, 4, 3, 2 and 1 times. The
panels differ in A0 alone: (a) with its negative entries replaced by zero, with which Table 6 agrees with print
(why is not known); (b) A0 as Eq. (23) defines it. Both panels show the same simulated calibrations.

- Dots: the first {dots} simulations of each plan, side by side in the order drawn.
- Coloured lines (3), (4a) to (4e), with their values: means of all {runs} simulations.
- Dashed black lines: the expectations that the paper prints. Panel (b) repeats them for comparison.
- Diamonds: the exact mean of the error. Triangles: its exact root mean square, rho0 of Eq. (20).

{table}
All values in 1e-3 mm; "±" is one standard error of the Monte-Carlo mean.

The random plan (1) is ours. Print shows one random plan and does not give its poses, so the two values of line (3)
need not agree. Of {plans} random plans, feasible and uniform in the joint limits, ours is the median one by
its exact mean error with the true A0. Over all of them that mean error averages

- {clipped} with the clipped A0,
- {true} with the true A0.

For the plans of Table 4 the printed means differ from the exact ones of panel (a) by {misses}.
Print does not say how many simulations it averages; one standard error of a mean of {dots} is {noise:.0f} %.
"""


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


def readable(errors: Sequence[Errors], spread: Mapping[str, NDArray[np.float64]]) -> str:
    """The caption, honest about what is print's and what is ours, and the numbers."""
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
    header = [
        "plan",
        "A0",
        "Monte-Carlo mean",
        "exact mean",
        "Monte-Carlo RMS",
        "rho0, Eq. (20)",
        "printed mean",
    ]
    return TEXT.format(
        table=markdown_table(header, rows),
        dots=DOTS,
        runs=len(errors[0].distances),
        plans=len(spread["true"]),
        misses=_misses(errors),
        noise=_noise(errors),
        **{name: _summary(means) for name, means in spread.items()},
    )


def _summary(means: NDArray[np.float64]) -> str:
    """Mean, its standard error, and the middle 80 % of the plans."""
    low, high = np.quantile(means, (0.1, 0.9)) / UNIT
    error = means.std(ddof=1) / np.sqrt(len(means)) / UNIT
    return f"{means.mean() / UNIT:.2f} ± {error:.2f} (for eight plans in ten between {low:.2f} and {high:.2f})"


def _optimal(errors: Sequence[Errors]) -> list[Errors]:
    """The plans of Table 4 with the clipped A0."""
    return [e for e in errors if e.target == "clipped" and e.plan != "1"]


def _misses(errors: Sequence[Errors]) -> str:
    """How far printed expectations lie from the exact means."""
    misses = [100 * (e.printed / e.exact_mean - 1) for e in _optimal(errors)]
    return f"{min(misses):+.1f} to {max(misses):+.1f} %"


def _noise(errors: Sequence[Errors]) -> float:
    """Largest standard error [%] of a mean of as many simulations as there are dots."""
    return max(
        100 * float(np.sqrt((e.rho0 / e.exact_mean) ** 2 - 1) / np.sqrt(DOTS))
        for e in _optimal(errors)
    )


def write(study: Study, out: Path) -> tuple[Path, ...]:
    """Write figure_7.png, .svg, .csv and .md."""
    candidates = random_plans(study)
    errors = simulate_errors(study, candidates.median)
    csv, text = out / "figure_7.csv", out / "figure_7.md"
    write_csv(csv, tabulate(errors))
    write_text(text, readable(errors, candidates.means))
    return (*save(errors, out), csv, text)
