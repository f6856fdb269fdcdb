"""The comparison report: one Markdown file and its figures."""

from pathlib import Path

import numpy as np
import pandas as pd

import criteria
from edtk.design.exact.batch import BATCH_SIZE
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.report.figures import by_size, heat_map, save, unit_of
from edtk.report.markdown_table import markdown_table
from edtk.study.study import Study
from edtk.system.atomic_file import write_text

WORTH = 0.01  # relative loss that fewer distinct poses are worth


def write_report(
    study: Study, table: pd.DataFrame, relaxed: dict[str, RelaxedPlan], out: Path
) -> None:
    """Write `report.md` and its figures into the folder `out`; figures of sizes that are gone are removed."""
    main = study.main_criterion
    save(by_size(study, table, relaxed), out / "comparison.png")
    sections = [_by_size(table, main), _distinct(table, main)]
    pictures = {"comparison.png"}
    for size in sorted(study.specification.sizes):
        text, picture = _efficiencies(study, table, size, out)
        sections.append(text)
        pictures.add(picture)
    for path in out.glob("efficiency_m*.png"):
        if path.name not in pictures:
            path.unlink()
    heading = (
        "Which plan is best in the test pose?"
        if main == "rho0"
        else f"Which plan is best for {main}?"
    )
    parts = [
        f"# {study.specification.title}\n",
        _setting(study),
        f"## {heading}\n",
        _verdict(study, table, main),
        f"![{main} against the number of experiments](comparison.png)\n",
        sections[0],
        f"## What plans for other criteria cost in {main}\n",
        _cost_of_others(study, table, main),
        "## Fewer distinct poses\n",
        sections[1],
        "## All plans under all criteria\n",
        "Efficiency against the bound over all feasible poses (searched, not proved): the bound divided by the plan's "
        "cost. Rows are plans, columns criteria.\n",
        *sections[2:],
        "Each cell is the criterion's own value, in SI units (rho0 in 1e-3 mm). O1 to O5 are those of A/sigma.\n",
        _values(study, table),
        "## The relaxation\n",
        "Weights over poses instead of whole experiments, per experiment. The first bound is proved: no plan over "
        "the candidates, and the poses found on the way, is better. The second speaks of all feasible poses; it was "
        "searched by ascent from many starts, and is not proved. For O4, which is not convex, the proof is by the "
        "least corner of a polygon that holds all designs.\n",
        _relaxation_table(relaxed),
        f"Seed {study.specification.seed}, study {study.digest}, edtk {table['edtk'].iloc[0]}.\n",
    ]
    write_text(out / "report.md", "\n".join(part for part in parts if part))


def _setting(study: Study) -> str:
    """One paragraph on what was asked."""
    file = study.specification
    unknown = ", ".join(study.model.parameters)
    limits = (file.starts, file.descents(file.main_criterion))
    least, most = (BATCH_SIZE * -(-limit // BATCH_SIZE) for limit in limits)
    return (
        f"Robot {study.robot.name}; unknown compliances {unknown}; {file.load.describe()}; "
        f"sigma = {file.measurement.sigma_mm:g} mm per coordinate; {file.candidates} candidate poses; at most "
        f"{least} descents per plan, {most} for {file.main_criterion}.\n"
    )


def _of(table: pd.DataFrame, kind: str, name: str = "", size: int | None = None) -> pd.DataFrame:
    """The rows of one kind of plan."""
    chosen = (table["kind"] == kind) & (table["optimised_for"] == name)
    return table[chosen if size is None else chosen & (table["experiments"] == size)]


def _verdict(study: Study, table: pd.DataFrame, main: str) -> str:
    """What a reader should take away, in at most three sentences."""
    factor, unit = unit_of(main)
    best = _of(table, "optimised", main).dropna(subset=[main]).sort_values("experiments")
    if best.empty:
        return "No size allows a plan that identifies all parameters.\n"
    row = best.iloc[-1]
    experiments = f"{row['experiments']} experiment{'s' if row['experiments'] > 1 else ''}"
    text = (
        f"With {experiments} the plan optimised for {main} reaches {main} = "
        f"{factor * row[main]:.4g} ({unit}), an efficiency of {100 * row[f'efficiency_{main}']:.1f} % against the "
        f"bound over all feasible poses (searched, not proved)."
    )
    better = criteria.get(main).sense == "min"
    for kind, words in (("published", "the published plan"), ("random", "the random plan")):
        rest = _of(table, kind, size=row["experiments"])
        if len(rest):
            ratio = float(rest[main].iloc[0] / row[main])
            text += f" For {words} {main} is {ratio:.3f} times that value{'' if better else ' (larger is better)'}."
    return text + "\n"


def _by_size(table: pd.DataFrame, main: str) -> str:
    """The main criterion by size: our plan, its efficiency, the bound, and plans that were not optimised."""
    factor, unit = unit_of(main)
    ours = _of(table, "optimised", main).set_index("experiments").sort_index()
    power = 1.0 if criteria.get(main).sense == "min" else -1.0
    rows = []
    for m, row in ours.iterrows():
        cells = [_number(factor * row[main]), _percent(row[f"efficiency_{main}"])]
        cells.append(_number(factor * row[main] * row[f"efficiency_{main}"] ** power))
        for kind in ("published", "random"):
            other = _of(table, kind, size=int(str(m)))
            cells.append(_number(factor * other[main].iloc[0]) if len(other) else "-")
        rows.append([m, *cells])
    header = ["experiments", f"optimised for {main}", "efficiency", "bound", "published", "random"]
    return (
        f"{main} ({unit}), and the bound over all feasible poses:\n\n{markdown_table(header, rows)}"
    )


def _losses(main: str, best: float, values: pd.Series) -> pd.Series:
    """By how much plans are worse than the best, as a share of its cost."""
    return values / best - 1 if criteria.get(main).sense == "min" else best / values - 1


def _cost_of_others(study: Study, table: pd.DataFrame, main: str) -> str:
    """How much worse than the plan for the main criterion the plans for other criteria are, size by size."""
    sizes = sorted(study.specification.sizes)
    best = {m: _of(table, "optimised", main, m)[main].iloc[0] for m in sizes}
    groups = [
        ("optimised", n, f"optimised for {n}") for n in study.specification.optimise if n != main
    ]
    groups += [("published", "", "published"), ("random", "", "random")]
    rows, classical = [], []
    for kind, name, label in groups:
        part = {m: _of(table, kind, name, m) for m in sizes}
        if all(found.empty for found in part.values()):
            continue
        losses = [
            float(_losses(main, best[m], found[main]).iloc[0]) if len(found := part[m]) else np.nan
            for m in sizes
        ]
        rows.append(
            [label, *("-" if np.isnan(loss) else f"{100 * loss:+.1f} %" for loss in losses)]
        )
        classical += [
            (loss, name, m)
            for loss, m in zip(losses, sizes, strict=True)
            if name and not np.isnan(loss)
        ]
    if not rows:
        return "There are no other plans.\n"
    text = f"Cost in {main} of each plan, relative to the plan of the same size that was optimised for {main}.\n"
    if classical:
        (least, a, m), (most, b, n) = min(classical), max(classical)
        text = (
            f"{text[:-1]} A plan that is optimised for another criterion costs between {100 * least:.0f} % "
            f"({a}, {m} experiments) and {100 * most:.0f} % ({b}, {n} experiments).\n"
        )
    return f"{text}\n{markdown_table(['plan', *(f'm = {m}' for m in sizes)], rows)}"


def _distinct(table: pd.DataFrame, main: str) -> str:
    """The main criterion for m experiments in k distinct poses at most, and the k that suffices."""
    factor, unit = unit_of(main)
    some = table[(table["kind"] == "distinct") & table[main].notna()]
    if some.empty:
        return "No size allows fewer distinct poses.\n"
    places, rows, advice = sorted(some["distinct_at_most"].unique()), [], []
    for m in sorted(some["experiments"].unique()):
        free = _of(table, "optimised", main, m)
        own = (
            pd.concat([some[some["experiments"] == m], free])
            .set_index("distinct_at_most")[main]
            .sort_index()
        )
        own = (
            own.cummin() if criteria.get(main).sense == "min" else own.cummax()
        )  # fewer poses would do, too
        losses = _losses(main, own.iloc[-1], own)
        enough = int(losses.index[losses < WORTH][0])
        advice.append(f"{enough} for m = {m}")
        cells = [
            f"{_number(factor * own[k])} ({100 * losses[k]:+.2f} %)" if k in own else ""
            for k in places
        ]
        rows.append([m, *cells, _number(factor * own.iloc[-1]), enough])
    text = (
        f"{main} ({unit}) of m experiments in at most k distinct poses, each measured as often as is best, and the "
        f"loss against any number of poses. Enough for a loss below {100 * WORTH:.0f} %: {', '.join(advice)}.\n"
    )
    header = ["experiments", *(f"k = {k}" for k in places), "any", "recommended k"]
    return f"{text}\n{markdown_table(header, rows)}"


def _efficiencies(study: Study, table: pd.DataFrame, size: int, out: Path) -> tuple[str, str]:
    """Efficiencies of the plans of one size under all criteria: a table, and a heat map, which is written."""
    names = [n for n in study.specification.criteria if f"efficiency_{n}" in table]
    groups = [("optimised", n, f"optimised for {n}") for n in study.specification.optimise]
    rows, labels = [], []
    for kind, name, label in [*groups, ("published", "", "published"), ("random", "", "random")]:
        for _, row in _of(table, kind, name, size).iterrows():
            if not row["reason"]:
                labels.append(label)
                rows.append([float(row[f"efficiency_{n}"]) for n in names])
    heading = f"### {size} experiment{'s' if size > 1 else ''}\n"
    if not rows:
        reasons = _of(table, "optimised", study.main_criterion, size)["reason"]
        return f"{heading}\nNo plan: {reasons.iloc[0]}.\n", ""
    picture = f"efficiency_m{size}.png"
    save(heat_map(names, labels, 100 * np.array(rows), size), out / picture)
    cells = [[label, *map(_percent, row)] for label, row in zip(labels, rows, strict=True)]
    text = f"![Efficiencies of plans of {size} experiments]({picture})\n\n{markdown_table(['plan', *names], cells)}"
    return f"{heading}\n{text}", picture


def _values(study: Study, table: pd.DataFrame) -> str:
    """All plans (rows) under all criteria (columns)."""
    names = list(study.specification.criteria)
    rows = []
    for _, row in table.sort_values("experiments", kind="stable").iterrows():
        cells = [_number(unit_of(n)[0] * row[n]) for n in names]
        rows.append(
            [
                row["plan"],
                *(cells if not row["reason"] else [row["reason"], *[""] * (len(names) - 1)]),
            ]
        )
    return markdown_table(["plan", *(f"{n} ({criteria.get(n).sense})" for n in names)], rows)


def _relaxation_table(relaxed: dict[str, RelaxedPlan]) -> str:
    """Value and both bounds of every relaxation, for one experiment's worth of weight."""
    rows = []
    for name, r in relaxed.items():
        factor, unit = unit_of(name)
        numbers = (f"{factor * v:.6g}" for v in (r.value, r.bound, r.best_bound.value))
        gaps = (f"{gap:.1e}" for gap in (r.gap, r.best_bound.gap))
        rows.append([name, *numbers, unit, *gaps, len(r.x), r.solver])
    header = [
        "criterion",
        "value",
        "bound, proved",
        "bound, searched",
        "unit",
        "gap, proved",
        "gap, searched",
    ]
    return markdown_table([*header, "poses", "solver"], rows)


def _number(x: float) -> str:
    return "-" if np.isnan(x) else f"{x:.4g}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share >= 0.001 else f"{100 * share:.1g} %"
