"""The exact plan that a study asks for."""

from collections.abc import Callable
from dataclasses import replace
from time import monotonic

import numpy as np

from edtk.design.candidate_source import EmptyFeasibleSetError
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.exact.find_plan import STARTS, TooFewError, find_plan, require_enough
from edtk.design.plan import Plan
from edtk.design.problem import RankDeficientError
from edtk.study.relax_study import relax_study
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.system.workers import Workers, WorkersLostError

Progress = Callable[[str], object]
MOST_PLACES = 200  # distinct poses: descents hold matrices of the square of their number


def plan_study(
    study: Study,
    size: int,
    name: str,
    distinct: int | None = None,
    kept: Plan | None = None,
    budget: float | None = None,
    seed: int | None = None,
    workers: Workers = Workers(),  # noqa: B008, frozen
    progress: Progress = lambda label: None,
) -> ExactPlan:
    """The best plan of `size` experiments in all, for one criterion of a study, with its bound.

    Args:
        study: The question.
        size: Number of experiments, those that are there already counted.
        name: Name of a criterion.
        distinct: Number of distinct new poses at most; None for p(p+1)/2 + 1, as the best weights need no more.
        kept: Experiments that are there already.
        budget: Seconds after which to return the best plan so far; None for no limit. The bound takes half of it at
            most; at least the relaxation over the candidates, and one round of starts, are made.
        seed: Seed; None for the study's.
        workers: Who does the work.
        progress: Called with a line about where it stands.

    Raises:
        UserError: One line that says what cannot be done, and where.
    """
    since, limit = monotonic(), np.inf if budget is None else budget
    there = 0 if kept is None else kept.experiments
    new = size - there
    if new < 1:
        raise UserError(f"--size {size}: {there} experiments are kept; expected more than that")
    if distinct is not None and distinct > new:
        raise UserError(
            f"--distinct {distinct}: expected at most {new}, the number of new experiments"
        )
    if (distinct or 0) > MOST_PLACES:
        raise UserError(f"--distinct {distinct}: expected at most {MOST_PLACES}")
    space = (
        study.space if kept is None else study.space.with_kept(study.space.information(kept), new)
    )
    try:
        require_enough(space, new, new if distinct is None else distinct)
        relaxed = relax_study(
            study,
            name,
            seed=seed,
            continuous=True,
            space=space,
            progress=lambda stage, gap: progress(f"bound: {stage}"),
            stop=lambda: monotonic() >= since + limit / 2,
        )
        found = find_plan(
            relaxed,
            new,
            distinct,
            study.specification.seed if seed is None else seed,
            kept,
            starts=STARTS,
            seconds=since + limit - monotonic(),
            workers=workers,
            progress=lambda starts, cost: progress(f"{starts} starts"),
        )
        return replace(found, seconds=monotonic() - since)
    except TooFewError as error:
        which = "--size" if new < error.least else "--distinct"
        total = (
            f"; with the {there} kept ones: {there + error.least}"
            if there and which == "--size"
            else ""
        )
        raise UserError(f"{study.path}: {which}: {error}{total}") from error
    except EmptyFeasibleSetError as error:
        raise study.error("workspace", str(error)) from error
    except RankDeficientError as error:
        raise study.error("joints.unknown", str(error)) from error
    except WorkersLostError as error:
        raise UserError(str(error)) from error
