"""The comparison report: one Markdown file and its figure."""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

import criteria
from edtk.atomic import atomic_path, write_text
from edtk.design import RelaxedPlan
from edtk.study.markdown import markdown_table
from edtk.study.spec import Study

# Okabe-Ito, safe for colour-blind readers.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")


def write_report(study: Study, table: pd.DataFrame, relaxed: dict[str, RelaxedPlan], out: Path) -> None:
    """Write `report.md` and `comparison.png` into the folder `out`."""
    main = "rho0" if "rho0" in study.file.optimise else study.file.optimise[0]
    with atomic_path(out / "comparison.png") as temporary:
        figure = _figure(study, table, relaxed, main)
        FigureCanvasAgg(figure)
        figure.savefig(temporary, dpi=150, metadata={"Software": None})
    parts = [
        f"# {study.file.title}\n",
        _setting(study),
        "## Which plan is best in the test pose?\n" if main == "rho0" else f"## Criterion {main}\n",
        _verdict(study, table, relaxed, main),
        f"![{main} against the number of experiments](comparison.png)\n",
        _by_size(table, main),
        "## All plans under all criteria\n",
        "Each cell is the criterion's own value, in SI units (rho0 in 1e-3 mm). O1 to O5 are those of A/sigma.\n",
        _all_criteria(study, table),
        "## The relaxation\n",
        "Weights over poses instead of whole experiments, per experiment. The first bound is proved: no plan over "
        "the candidates, and the poses found on the way, is better. The second speaks of all feasible poses; it was "
        "searched by ascent from many starts, and is not proved. For O4, which is not convex, the proof is by the "
        "least corner of a polygon that holds all designs.\n",
        _relaxation_table(relaxed),
        f"Seed {study.file.seed}, study {study.digest}, edtk {table['edtk'].iloc[0]}.\n",
    ]
    write_text(out / "report.md", "\n".join(parts))


def _setting(study: Study) -> str:
    """One paragraph on what was asked."""
    file = study.file
    unknown = ", ".join(study.model.parameters)
    force = ", ".join(f"{f:g}" for f in file.load.F_N)
    return (
        f"Robot {study.robot.name}; unknown compliances {unknown}; load F = ({force}) N; "
        f"sigma = {file.measurement.sigma_mm:g} mm per coordinate; {file.candidates} candidate poses.\n"
    )


def _unit(name: str) -> tuple[float, str]:
    """Factor and unit in which a person reads a criterion."""
    return (1e6, "1e-3 mm") if name == "rho0" else (1.0, "SI")


def _verdict(study: Study, table: pd.DataFrame, relaxed: dict[str, RelaxedPlan], main: str) -> str:
    """What a reader should take away, in at most three sentences."""
    factor, unit = _unit(main)
    best = table[(table["optimised_for"] == main) & table[main].notna()].sort_values("experiments")
    if best.empty:
        return "No size allows a plan that identifies all parameters.\n"
    row = best.iloc[-1]
    experiments = f"{row['experiments']} experiment{'s' if row['experiments'] > 1 else ''}"
    text = (
        f"With {experiments} the plan optimised for {main} reaches {main} = "
        f"{factor * row[main]:.4g} ({unit}), an efficiency of {100 * row[f'efficiency_{main}']:.1f} % against the "
        f"bound over all feasible poses (searched, not proved)."
    )
    others = table[(table["experiments"] == row["experiments"]) & (table["plan"] != row["plan"])]
    better = criteria.get(main).sense == "min"
    for kind, words in (("published", "the published plan"), ("random", "the random plan")):
        rest = others[others["kind"] == kind]
        if len(rest):
            ratio = float(rest[main].iloc[0] / row[main])
            text += f" For {words} {main} is {ratio:.3f} times that value{'' if better else ' (larger is better)'}."
    return text + "\n"


def _by_size(table: pd.DataFrame, main: str) -> str:
    """The main criterion by size (rows) and kind of plan (columns)."""
    factor, unit = _unit(main)
    label = table["kind"].where(table["optimised_for"] == "", "optimised for " + table["optimised_for"])
    wide = table.assign(label=label).pivot_table(
        index="experiments", columns="label", values=main, aggfunc="first", sort=False
    )
    header = ["experiments", *wide.columns]
    rows = [[m, *("-" if np.isnan(v) else f"{factor * v:.4g}" for v in row)] for m, row in wide.iterrows()]
    rows = [[m, *row] for m, *row in sorted(rows, key=lambda r: int(str(r[0])))]
    return f"{main} ({unit}):\n\n{markdown_table(header, rows)}"


def _all_criteria(study: Study, table: pd.DataFrame) -> str:
    """All plans (rows) under all criteria (columns)."""
    names = list(study.file.criteria)
    arrows = {n: "min" if criteria.get(n).sense == "min" else "max" for n in names}
    rows = []
    for _, row in table.sort_values("experiments", kind="stable").iterrows():
        cells = ["-" if np.isnan(row[n]) else f"{_unit(n)[0] * row[n]:.4g}" for n in names]
        rows.append([row["plan"], *(cells if not row["reason"] else [row["reason"], *[""] * (len(names) - 1)])])
    return markdown_table(["plan", *(f"{n} ({arrows[n]})" for n in names)], rows)


def _relaxation_table(relaxed: dict[str, RelaxedPlan]) -> str:
    """Value and both bounds of every relaxation, for one experiment's worth of weight."""
    rows = []
    for name, r in relaxed.items():
        factor, unit = _unit(name)
        numbers = (f"{factor * v:.6g}" for v in (r.value, r.printed(r.bound), r.printed(r.best_bound)))
        gaps = (f"{gap:.1e}" for gap in (r.gap, 1 - r.best_bound / r.cost))
        rows.append([name, *numbers, unit, *gaps, len(r.q), r.solver])
    header = ["criterion", "value", "bound, proved", "bound, searched", "unit", "gap, proved", "gap, searched"]
    return markdown_table([*header, "poses", "solver"], rows)


def _figure(study: Study, table: pd.DataFrame, relaxed: dict[str, RelaxedPlan], main: str) -> Figure:
    """The main criterion against the number of experiments, with the bound as a line."""
    factor, unit = _unit(main)
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    ax = figure.add_subplot()
    groups = [("optimised", name, f"optimised for {name}") for name in study.file.optimise]
    groups += [("published", "", "published"), ("random", "", "random")]
    markers = "osD^vPX*"
    for i, (kind, name, label) in enumerate(groups):
        part = table[(table["kind"] == kind) & (table["optimised_for"] == name)].sort_values("experiments")
        if len(part):
            ax.plot(
                part["experiments"],
                factor * part[main],
                label=label,
                linewidth=1.2,
                markersize=5,
                color=COLOURS[i % len(COLOURS)],
                marker=markers[i % len(markers)],
            )
    sizes = np.geomspace(min(study.file.sizes), max(study.file.sizes), 100)
    bound = relaxed[main].best_bound * sizes ** -criteria.get(main).degree
    bound = bound if criteria.get(main).sense == "min" else 1 / bound
    ax.plot(
        sizes, factor * bound, color="black", linestyle="--", linewidth=1.2, label="bound over all poses (searched)"
    )
    ax.set(xscale="log", yscale="log", xlabel="number of experiments m", ylabel=f"{main} [{unit}]")
    ax.xaxis.set_major_locator(FixedLocator(sorted(study.file.sizes)))
    ax.xaxis.set_minor_locator(NullLocator())
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(ScalarFormatter())
    ax.set_title(study.file.title, fontsize=11)
    ax.grid(visible=True, which="both", alpha=0.25)
    ax.legend(fontsize=8, frameon=False)
    return figure
