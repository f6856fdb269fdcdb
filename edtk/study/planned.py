"""The exact plan that a study asks for."""

from collections.abc import Callable
from time import time

import numpy as np

from edtk.design import (
    EmptyFeasibleSetError,
    ExactPlan,
    Plan,
    PlanInterrupted,
    PoseDesign,
    RankDeficientError,
    RelaxedPlan,
    TooFewError,
    find_plan,
)
from edtk.design.find_plan import STARTS, require_enough
from edtk.errors import UserError
from edtk.parallel import Team, WorkersLostError
from edtk.study.relaxed import relaxed_plan
from edtk.study.study import Study

Progress = Callable[[str], object]


def planned(
    study: Study,
    size: int,
    name: str,
    distinct: int | None = None,
    kept: Plan | None = None,
    budget: float | None = None,
    seed: int | None = None,
    team: Team = Team(),  # noqa: B008, frozen
    progress: Progress = lambda label: None,
) -> ExactPlan:
    """The best plan of `size` experiments in all, for one criterion of a study, with its bound.

    Args:
        study: The question.
        size: Number of experiments, those that are there already counted.
        name: Name of a criterion.
        distinct: Number of distinct new poses at most; None for any.
        kept: Experiments that are there already.
        budget: Seconds after which to return the best plan so far; None for no limit. At least the relaxation over
            the candidates, and one round of starts, are made.
        seed: Seed; None for the study's.
        team: Who does the work.
        progress: Called with a line about where it stands.

    Raises:
        UserError: One line that says what cannot be done, and where.
    """
    deadline = np.inf if budget is None else time() + budget
    there = 0 if kept is None else kept.experiments
    new = size - there
    if new < 1:
        raise UserError(f"--size {size}: {there} experiments are kept; expected more than that")
    if distinct is not None and distinct > new:
        raise UserError(f"--distinct {distinct}: expected at most {new}, the number of new experiments")
    design = study.design if kept is None else study.design.beside(study.design.information(kept), new)
    try:
        require_enough(design, new, new if distinct is None else distinct)
        relaxed = _relaxed(study, name, design, seed, deadline, progress)
        return find_plan(
            relaxed,
            new,
            distinct,
            study.file.seed if seed is None else seed,
            kept,
            starts=STARTS,
            deadline=deadline,
            team=team,
            progress=lambda starts, cost: progress(f"{starts} starts"),
        )
    except TooFewError as error:
        which = "--size" if new < error.least else "--distinct"
        total = f"; with the {there} kept ones: {there + error.least}" if there and which == "--size" else ""
        raise UserError(f"{study.path}: {which}: {error}{total}") from error
    except EmptyFeasibleSetError as error:
        raise study.error("workspace", str(error)) from error
    except RankDeficientError as error:
        raise study.error("joints.unknown", str(error)) from error
    except WorkersLostError as error:
        raise UserError(str(error)) from error


def _relaxed(
    study: Study, name: str, design: PoseDesign, seed: int | None, deadline: float, progress: Progress
) -> RelaxedPlan:
    """The relaxation over all feasible poses, or what there is of it when half of the time is over."""
    half = 0.5 * (time() + deadline)

    def report(stage: str, gap: float) -> None:
        progress(f"bound: {stage}")
        if stage == "continuum" and time() >= half:
            raise KeyboardInterrupt

    try:
        return relaxed_plan(study, name, seed=seed, continuous=True, design=design, progress=report)
    except PlanInterrupted as interrupt:
        if time() < half:
            raise
        return interrupt.best
