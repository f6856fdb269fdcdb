"""`edtk plan`: the best plan of exactly m experiments."""

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
from edtk.system.errors import ArgumentError

HELP_OF_FAULTS = "How likely faults would be noticed, and told apart, like tool_z=5mm,drift=0.05mm."
PROVED_GAP = 1e-3  # between a bound over all poses and the best weights
MOST_EXPERIMENTS = 10**12  # as in a study: beyond them numbers of repetitions are not exact
# What is said of a search, of the proof of its bound, and of that of the best plan, if cut off.
SEARCH_ENDED = {
    "budget": "the budget ended the search; this is the best plan so far",
    "failed": "a solver found no answer on the way; this is the best plan so far",
    "interrupted": "interrupted; this is the best plan so far",
}
PROOF_ENDED = {
    "budget": "the budget ended the proof; the bound is the best that was proved by then",
    "interrupted": "interrupted; the plan is whole, and its bound the best that was proved by then",
}
BEST_ENDED = {"interrupted": "interrupted; this is the best proof so far"}


class _FaultOption(click.Option):
    """An option whose help names all faults, which are imported only then."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """The line of the help."""
        from edtk.findings.causes.faults import units_in_words

        self.help = f"{HELP_OF_FAULTS} Units: {units_in_words()}."
        return super().get_help_record(ctx)


@click.command("plan", short_help="Find the best plan of m experiments.")
@click.argument("study", type=FilePath)
@click.option(
    "--size",
    type=Number(MOST_EXPERIMENTS),
    help="Number of experiments m, kept ones counted; needed unless a budget of costs decides.",
)
@click.option(
    "--distinct",
    type=Number(MOST_EXPERIMENTS),
    help="Distinct new poses at most [default: p(p+1)/2 + 1 of p parameters].",
)
@criterion_option
@click.option(
    "--keep",
    type=FilePath,
    help="Plan, or filled-in sheet (CSV), of experiments made already.",
)
@click.option("--exclude", type=FilePath, help="Plan (CSV) of poses to stay away from.")
@budget_option("Seconds for bound and plan together; the best so far is given then.")
@click.option(
    "--cost-budget",
    type=Range(min=0, min_open=True),
    help="What a day may cost, by the study's [costs] [default: the study's budget].",
)
@workers_option
@dask_option
@seed_option
@click.option(
    "--detect",
    cls=_FaultOption,
    metavar="FAULT=SIZE,...",
    help=HELP_OF_FAULTS,
)
@click.option(
    "--for",
    "second",
    metavar="CRITERION",
    help="Give up a part of the criterion for this one; or for parameters, like k_q2.cubic,q3.rx.",
)
@click.option(
    "--give-up",
    type=Range(min=0, max=100, min_open=True, max_open=True),
    help="With --for: how much of the criterion at most, in percent [default: 5].",
)
@click.option(
    "--prove-bound",
    is_flag=True,
    help="Prove the bound for all feasible poses, to 0.1 % of the best weights.",
)
@click.option(
    "--prove",
    type=Range(min=0),
    metavar="SECONDS",
    help="Prove the best plan of m experiments on the candidates, in so many seconds.",
)
@click.option(
    "--candidates",
    type=Number(MOST_EXPERIMENTS),
    help="With --prove: number of candidate poses [default: the study's].",
)
@click.option(
    "--place-tracker",
    is_flag=True,
    help="Choose the tracker's place too, in the study's list or box, and mounts of reflectors.",
)
@click.option(
    "--placed-study",
    type=FilePath,
    help="With --place-tracker: write the study with that place (TOML).",
)
@json_option
@click.option("--out", type=FilePath, help="Write all experiments (CSV, - to print).")
@click.option(
    "--rest", type=FilePath, help="With --keep: write the new experiments alone (CSV, - to print)."
)
@certificate_option
def command(
    study: Path,
    size: int | None,
    distinct: int | None,
    criterion: str | None,
    keep: Path | None,
    exclude: Path | None,
    budget: float | None,
    cost_budget: float | None,
    workers: int | None,
    dask: str | None,
    seed: int | None,
    detect: str | None,
    second: str | None,
    give_up: float | None,
    prove_bound: bool,
    prove: float | None,
    candidates: int | None,
    place_tracker: bool,
    placed_study: Path | None,
    as_json: bool,
    out: Path | None,
    rest: Path | None,
    certificate: Path | None,
) -> None:
    """Find the best plan of exactly m experiments for STUDY (TOML).

    The plan comes with a bound: a number that no plan of m experiments can beat. Ctrl-C, or the end
    of the budget, leaves the best plan so far with the best bound so far. The first plan, seconds
    after the start, is waited for.
    """
    from edtk.verbs.inputs import load_study
    from edtk.verbs.plan import plan

    question = load_study(study)
    with progress_line("bound") as say:
        found = plan(
            question,
            size,
            criterion,
            seed,
            distinct=distinct,
            keep=keep,
            exclude=exclude,
            budget=time_until(budget),
            cost_budget=cost_budget,
            workers=workers,
            dask=dask,
            out=out,
            certificate=certificate,
            rest=rest,
            detect=_faults(detect) or None,
            second=second,
            give_up=give_up,
            prove_bound=PROVED_GAP if prove_bound else None,
            prove=prove,
            candidates=candidates,
            place_tracker=place_tracker,
            placed_study=placed_study,
            progress=lambda label, number: say(label),
        )
    show(found, as_json, out, certificate, rest)
    warn_about(study, found.warnings)
    best = found.on_candidates
    for ended, words in (
        (found.ended, SEARCH_ENDED),
        (found.proof_ended, PROOF_ENDED),
        (best.ended if best else "", BEST_ENDED),
    ):
        if ended in words:
            warn(words[ended])
        if ended == "interrupted":
            end_interrupted()


def _faults(given: str | None) -> dict[str, str]:
    """Sizes of faults by name, from FAULT=SIZE pairs."""
    if given is None:
        return {}
    faults: dict[str, str] = {}
    for pair in given.split(","):
        name, equals, size = (part.strip() for part in pair.partition("="))
        if not equals:
            message = "expected pairs like tool_z=5mm, separated by commas"
            raise ArgumentError(message, argument="detect", given=given)
        if name in faults:
            message = f"{name} is there twice; expected each fault once"
            raise ArgumentError(message, argument="detect", given=given)
        faults[name] = size
    return faults
