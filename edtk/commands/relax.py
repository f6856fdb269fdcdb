"""`edtk relax`: the best weights, with a bound."""

from pathlib import Path

import click

from edtk.commands.shared import (
    FilePath,
    Number,
    Range,
    budget_option,
    certificate_option,
    criterion_option,
    dask_option,
    end_interrupted,
    json_option,
    progress_line,
    seed_option,
    show,
    time_until,
    warn,
    warn_about,
    workers_option,
)

MOST_EXPERIMENTS = 10**6  # as in a study
MOST_CANDIDATES = 10**9  # as in a study: no machine would end with more


@click.command("relax", short_help="Find the best weights, with a bound.")
@click.argument("study", type=FilePath)
@criterion_option
@click.option(
    "--candidates",
    type=Number(MOST_CANDIDATES),
    help="Candidate poses [default: the study's].",
)
@click.option(
    "--continuous", is_flag=True, help="Search all feasible poses, beyond the candidates."
)
@click.option(
    "--prove",
    metavar="EPS",
    type=Range(min=0, max=1, min_open=True, max_open=True),
    help="Prove a bound for all feasible poses, up to this relative gap, such as 0.01.",
)
@click.option(
    "--size",
    type=Number(MOST_EXPERIMENTS),
    help="Experiments that share a prior with in_design [default: the study's first size].",
)
@budget_option("Give the best weights after so many seconds, with the best bound so far.")
@seed_option
@click.option(
    "--memory",
    type=Range(min=0),
    default=1000,
    show_default=True,
    help="Limit on memory [MB].",
)
@workers_option
@dask_option
@json_option
@click.option("--out", type=FilePath, help="Write poses and weights (CSV, - to print).")
@certificate_option
def command(
    study: Path,
    criterion: str | None,
    candidates: int | None,
    continuous: bool,
    prove: float | None,
    size: int | None,
    budget: float | None,
    seed: int | None,
    memory: float,
    workers: int | None,
    dask: str | None,
    as_json: bool,
    out: Path | None,
    certificate: Path | None,
) -> None:
    """Find the best weights over candidate poses of STUDY (TOML), with a bound on every design.

    Ctrl-C, or the end of the budget, ends a long run with the best certified plan so far.
    """
    from edtk.design.relaxation.relax_poses import PlanInterrupted
    from edtk.verbs.inputs import load_study
    from edtk.verbs.relax import relax

    question = load_study(study)
    with progress_line("candidates") as say:

        def progress(stage: str, gap: float) -> None:
            say(stage if gap >= 1 else f"{stage}: gap {max(gap, 0.0):.1e}")

        try:
            found = relax(
                question,
                criterion,
                candidates,
                continuous=continuous,
                prove=prove,
                size=size,
                seed=seed,
                memory_mb=memory,
                workers=workers,
                dask=dask,
                out=out,
                certificate=certificate,
                progress=progress,
                budget=time_until(budget),
            )
            interrupted = False
        except PlanInterrupted as interrupt:
            found = interrupt.best
            interrupted = True
    show(found, as_json, out, certificate)
    warn_about(study, question.warnings)
    if found.ended == "budget":
        warn("the budget ended the search; these are the best weights and the best bound so far")
    if interrupted:
        warn("interrupted; this is the best certified plan so far")
        end_interrupted()
