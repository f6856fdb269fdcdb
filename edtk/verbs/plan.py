"""`edtk.plan`: the best plan of exactly m experiments."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, overload

from numpy.typing import ArrayLike

from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.system.arguments import checked
from edtk.system.time_limit import Progress, no_progress
from edtk.verbs.inputs import CriterionLike, PlanLike, StudyLike
from edtk.verbs.of_kinds import question_of
from edtk.verbs.question import FIXED, PlanCall

if TYPE_CHECKING:
    from edtk.design.errors import Errors
    from edtk.design.exact.counts.problem_plan import ProblemPlan
    from edtk.design.exact.plan_region import RegionPlan
    from edtk.verbs.asked_limits import Constraint


@overload
def plan(
    study: StudyLike,
    size: int | None = None,
    criterion: CriterionLike | None = None,
    seed: int | None = None,
    *,
    distinct: int | None = None,
    keep: PlanLike | None = None,
    cost_budget: float | None = None,
    exclude: Path | str | None = None,
    budget: float | None = None,
    workers: int | None = None,
    dask: str | None = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    rest: Path | str | None = None,
    detect: Mapping[str, str] | None = None,
    second: CriterionLike | None = None,
    give_up: float | None = None,
    prove_bound: float | None = None,
    prove: float | None = None,
    candidates: int | None = None,
    place_tracker: bool = False,
    placed_study: Path | str | None = None,
    progress: Progress = ...,
) -> ExactPlan: ...


@overload
def plan(
    study: Problem,
    size: int | None = None,
    criterion: CriterionLike | None = None,
    seed: int | None = None,
    *,
    starts: int | None = None,
    keep: ArrayLike | Problem | None = None,
    least: ArrayLike | None = None,
    most: ArrayLike | None = None,
    costs: ArrayLike | None = None,
    cost_budget: ArrayLike | None = None,
    constraints: "Sequence[Constraint] | None" = None,
    blocks: Sequence[int] | None = None,
    block_variance: float = ...,
    errors: "Errors | None" = None,
    prove: float | None = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    progress: Progress = ...,
) -> "ProblemPlan": ...


@overload
def plan(
    study: Region,
    size: int,
    criterion: CriterionLike | None = None,
    seed: int | None = None,
    *,
    starts: int | None = None,
    keep: ArrayLike | Problem | None = None,
    out: Path | str | None = None,
    progress: Progress = ...,
    prove_bound: float | None = None,
) -> "RegionPlan": ...


@checked
def plan(
    study: StudyLike | Problem | Region,
    size: int | None = None,
    criterion: CriterionLike | None = None,
    seed: int | None = None,
    *,
    starts: int | None = None,
    least: "ArrayLike | None" = None,
    most: "ArrayLike | None" = None,
    costs: "ArrayLike | None" = None,
    cost_budget: "ArrayLike | None" = None,
    constraints: "Sequence[Constraint] | None" = None,
    blocks: "Sequence[int] | None" = None,  # read below, in words of its own
    block_variance: float = FIXED,
    errors: "Errors | None" = None,
    prove: float | None = None,
    candidates: int | None = None,
    keep: "PlanLike | ArrayLike | Problem | None" = None,
    distinct: int | None = None,
    exclude: Path | str | None = None,
    budget: float | None = None,
    workers: int | None = None,
    dask: str | None = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    rest: Path | str | None = None,
    detect: Mapping[str, str] | None = None,
    second: CriterionLike | None = None,
    give_up: float | None = None,
    prove_bound: float | None = None,
    place_tracker: bool = False,
    placed_study: Path | str | None = None,
    progress: Progress = no_progress,
) -> "ExactPlan | ProblemPlan | RegionPlan":
    """Search for the best plan of `size` experiments, and bound how much better any plan can be.

    The same seed gives the same plan on any number of workers. Ctrl-C, or the end of the budget,
    returns the best plan so far; `.ended` says so.

    A `Problem` of arrays is searched over its candidates: plans from random places and from the
    weights of the relaxation are improved by exchanges. The second list of arguments is about such
    plans, the third about those of studies. In a `Region`, exchanges on a grid come first, and then
    all points of a plan move together; of the options it takes `starts` (32 by default),
    `keep` and `prove_bound`.

    Args:
        study: A study, the path of a study file, a `Problem`, or a `Region`.
        size: Number of experiments m; kept experiments count. A problem or a study with a
            budget of costs needs none.
        criterion: Name of the criterion to optimise; defaults to the study's main criterion. A
            problem or a region takes an object as well, and defaults to "D".
        seed: Seed of the search; defaults to the study's, and to 0 for a problem or a region.
        keep: A plan of experiments that were made already, or a sheet of which the rows that are
            filled in count; as a CSV file, or a data frame. For a problem:
            indices of candidates, each as often as it was measured, or another `Problem` of which
            every candidate was measured once; a data frame with the candidates' columns is one.
            For a region: points (n, d), a data frame with its variables, or a `Problem`.
        prove: Seconds in which to prove that no plan of the same candidates is better, by branch
            and bound. Of a problem the search ends when that is proved: `.proved_exact` tells
            whether it is, and `.bound_exact` how much better any plan can be. A plan of a study may
            be off its candidates: `.on_candidates` tells of all plans on them, and the best.
        candidates: Of a study, beside `prove`: number of candidates; defaults to the study's.
        progress: Called with a line about the current step, and its gap or its best cost.

        starts: Number of starts; by default as many as bring improvements, and as many again.
        least: How often each candidate must be measured, kept ones counted: a number (n,) for each,
            or one for all.
        most: How often each candidate may be measured, kept ones counted: a number (n,) for each,
            or one for all; 1 is a plan without replacement. Defaults to no limit.
        costs: Costs (n,) of one experiment with each candidate; (k, n) for k budgets.
        cost_budget: What the new experiments may cost together, a number for each budget (k,). For
            a study: what a day may cost, load changes included, by the costs that the study says.
        constraints: A list of linear constraints on the counts, kept candidates counted: triples of
            coefficients (n,), a least and a largest sum, with None for no limit. Of candidates
            from a data frame the coefficients may be an expression of its columns, such as
            "hours" or "oven == 'left'"; and {"oven": 4} says that each level of a column is used
            four times, {"oven": (2, 6)} two to six times, {"oven": {"left": 4}} one level.
        blocks: Sizes of the blocks in which the experiments are made, each with an unknown effect
            of its own on all its readings. It is nuisance: only what differs within blocks counts.
        block_variance: Variance of random effects of blocks, in units of the noise; infinite, the
            default, are fixed effects, of which nothing is known.
        errors: How the errors of the runs hang together (`edtk.Errors`): split plots and other
            strata, series in time or space, trends. The plan is an order of runs then, the best
            under generalised least squares; of the other options it takes `starts`, `most`, and
            `keep` with the candidates of the first runs in order.

        distinct: Distinct new poses at most; defaults to p(p+1)/2 + 1 for p parameters.
        exclude: A plan (CSV file) of poses to stay away from.
        budget: Seconds for bound and plan together [s], after which the best so far is given; a
            first plan is waited for. Defaults to no limit.
        workers: Processes on this machine; defaults to one a core.
        dask: Address of a Dask scheduler (tcp://HOST:PORT) whose workers do the work instead.
        out: File to write all experiments to (CSV), of problems and regions too; "-" is standard
            output.
        certificate: File to write what proves the numbers to (JSON), for `edtk.verify`; likewise.
            Of a problem it is about a proof, see `prove`.
        rest: Beside `keep`: file to write the new experiments alone to (CSV), from which
            `edtk.template` makes the sheet of the rest of the day.
        detect: Sizes of faults like {"tool_z": "5mm", "load_direction": "2deg"}: the plan tells how
            likely each would be noticed, and each two be told apart, and the experiment that would
            help most.
        second: A second criterion, for which a part of the first is given up: its name, a table
            with its parameters, or names of parameters, apart by commas, for Ds of these. What
            extends a model is told best by Ds of the parameters that extend it.
        give_up: The part in percent, 5 by default: the plan is the best for the second criterion
            among those whose cost is at most 1 / (1 - give_up/100) times that of the plan for the
            first one alone.
        prove_bound: Relative gap between the bound and the best weights, such as 0.001, up to which
            the bound is proved for all feasible poses, or for all points of a region; `.efficiency`
            is against that bound then. It takes its time after the search of a study; Ctrl-C leaves
            the best bound so far.
        place_tracker: Whether the place of the tracker is chosen together with the poses, among
            those that the study's [noise] lists or in its box, and where reflectors look, among the
            normals of each marker; `.placement` tells it. The bound of the plan is about its place
            and mounts; that over the listed ones is the best of theirs.
        placed_study: File to write the study with that place to (TOML), from which `edtk.template`
            and `edtk.identify` go on.

    Returns:
        The plan with its `.value`, its `.bound`, and its `.efficiency` between 0 and 1. That of a
        problem has the `.counts` (n,) of the candidates, that of a region `.points` (k, d) with
        their `.counts` (k,).

    Raises:
        UserError: One line that says what cannot be done, and where.

    Example:
        >>> import edtk
        >>> found = edtk.plan("studies/kr270_milling.toml", size=4)  # doctest: +SKIP
        >>> found.plan.to_csv("plan.csv", found.robot)  # doctest: +SKIP

        Six measurements of a parabola, at eleven places:

        >>> import numpy as np
        >>> x = np.linspace(-1.0, 1.0, 11)
        >>> parabola = edtk.Problem(np.stack([np.ones(11), x, x**2], axis=-1)[:, None, :])
        >>> edtk.plan(parabola, size=6, criterion="D").counts
        array([2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2])
    """
    question = question_of(study)
    call = PlanCall(
        size=size,
        criterion=criterion,
        seed=seed,
        keep=keep,
        out=out,
        progress=progress,
        starts=starts,
        least=least,
        most=most,
        costs=costs,
        cost_budget=cost_budget,
        constraints=constraints,
        blocks=blocks,
        block_variance=None if block_variance == FIXED else float(block_variance),
        errors=errors,
        prove=prove,
        candidates=candidates,
        distinct=distinct,
        exclude=exclude,
        budget=budget,
        workers=workers,
        dask=dask,
        certificate=certificate,
        rest=rest,
        detect=detect,
        second=second,
        give_up=give_up,
        prove_bound=prove_bound,
        place_tracker=place_tracker,
        placed_study=placed_study,
    )
    question.require("plan", **vars(call))
    return question.plan(call)
