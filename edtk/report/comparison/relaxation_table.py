"""The relaxations of all criteria."""

from edtk.report.markdown_table import markdown_table
from edtk.report.run_unit import run_unit
from edtk.study.study_run import StudyRun


def relaxation_table(run: StudyRun) -> str:
    """Value and both bounds of every relaxation, for one experiment's worth of weight."""
    rows = []
    for relaxed in run.relaxations.values():
        factor, unit = run_unit(run, relaxed.criterion.name)
        sharing = relaxed.space.sharing
        plural = "" if sharing == 1 else "s"
        among = f", {sharing} experiment{plural}" if sharing else ""
        values = (relaxed.value, relaxed.proved_bound.value, relaxed.best_bound.value)
        gaps = (relaxed.gap, relaxed.best_bound.gap_to(relaxed.cost))
        rows.append(
            [
                relaxed.criterion.label + among,
                *(f"{factor * value:.6g}" for value in values),
                unit,
                *(f"{gap:.1e}" for gap in gaps),
                len(relaxed.x),
                relaxed.solver,
            ]
        )
    header = ["criterion", "value", "bound, proved", "bound, searched", "unit", "gap, proved"]
    return markdown_table([*header, "gap, searched", "poses", "solver"], rows)
