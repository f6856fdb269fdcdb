"""What in the promise of a plan is hard to believe, or a pity."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

import criteria
from edtk.design.candidate_source import CandidateSource, EmptyFeasibleSetError
from edtk.design.plan import Plan
from edtk.inference.least_squares import SingularPlanError, covariance
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.expected_error import WITHIN, ExpectedError
from edtk.model.neighbourhood import neighbourhood
from edtk.study.plausibility import (
    LONGEST_LINKS,
    MOST_NAMED,
    SAG,
    anywhere,
    length_of_links,
    listed,
    own_scale,
)
from edtk.study.poor_around import poor_around
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    from edtk.study.study import Study

# A plan that suits all parameters gives each a standard deviation of two to ten times the best that
# it could have alone; thirty times is that of a thousandth of the experiments.
HARDLY_EXCITED = 30.0
UNCERTAIN = 0.5  # standard deviation beside the parameter itself, where that is known
CANDIDATES = 300  # among which the best experiment for each parameter is looked for


def plan_plausibility(
    study: "Study", plan: Plan, expected: ExpectedError | None = None
) -> tuple[str, ...]:
    """Find what is hard to believe, or a pity, in what a plan promises.

    Args:
        study: The study.
        plan: All experiments.
        expected: Errors to expect in the test poses and around them; None where they are unknown.

    Returns:
        One line for each finding.
    """
    try:
        cov = covariance(study.information(plan), study.model.parameters)
    except SingularPlanError as error:
        return tuple(_untold(study, error.parameters))
    if length_of_links(study) > LONGEST_LINKS:
        return ()
    around = () if expected is None else poor_around(expected)
    return (*_useless(study, cov), *_hardly_excited(study, cov, plan.experiments), *around)


def _untold(study: "Study", parameters: Sequence[str]) -> Iterator[str]:
    """Parameters that a plan leaves open, as the criterion does not ask for them."""
    bad = np.array([study.model.parameters.index(name) for name in parameters])
    yield (
        f"not told by this plan: {listed(list(parameters))}; what the sheet does not tell, edtk "
        f"identify takes from a [prior] alone; {_cure(study, bad)}"
    )


def _useless(study: "Study", cov: Array) -> Iterator[str]:
    """An error after compensation that is larger than the one before."""
    if not study.tasks:
        return
    A = study.tasks.regressor
    after = float(compensation_accuracy(A, cov))
    k = own_scale(study)
    known = bool(np.isfinite(k).all())
    before = float(np.linalg.norm(A @ k)) if known else SAG * length_of_links(study)
    if 0 < before < after:
        place = "in the test pose" if len(study.tasks) == 1 else f"in {len(study.tasks)} test poses"
        usual = "" if known else ", as robots go"
        yield (
            f"the expected error {place}, {1e3 * after:.3g} mm, is larger than what the "
            f"load bends the robot there, {1e3 * before:.2g} mm{usual}; check tools, loads and "
            "sigma_mm, or measure more"
        )


def _hardly_excited(study: "Study", cov: Array, experiments: int) -> Iterator[str]:
    """Parameters about which a plan says much less than it could."""
    std = np.sqrt(np.diag(cov))
    share = std / own_scale(study)
    ratio = std / _best_alone(study, anywhere(study), experiments)
    # Feasible poses tell less than any poses do; they are drawn, which may take seconds, only where
    # they could make a difference.
    if (ratio[np.isnan(share)] > HARDLY_EXCITED).any():
        ratio = std / _best_alone(study, _candidates(study), experiments)
    # Beside its own size a parameter is judged by that, and else by what plans could do.
    bad = np.flatnonzero(np.where(np.isfinite(share), share > UNCERTAIN, ratio > HARDLY_EXCITED))
    if not len(bad):
        return
    names = [study.model.parameters[i] for i in bad]
    how = [
        f"+-{_round(100 * share[i])} % of itself"
        if np.isfinite(share[i])
        else f"{_round(ratio[i])} times the best"
        for i in bad[:MOST_NAMED]
    ]
    yield (
        f"hardly told by this plan: {listed(names)}, with a standard deviation of "
        f"{', '.join(how)}; {_cure(study, bad)}"
    )


def _cure(study: "Study", bad: Indices) -> str:
    """What helps against parameters (indices) that are hardly excited."""
    tasks = study.tasks
    if tasks and criteria.get(study.main_criterion).needs_target:
        around = (neighbourhood(one.robot, one.q, one.within or WITHIN) for one in tasks)
        harms = (one.harm(poses) for one, poses in zip(tasks, around, strict=True))
        # rho0 asks for a parameter only if it does harm in the task.
        if not any(A[..., bad].any() for A in harms):
            return "the task does not load it; for other tasks optimise another criterion such as D"
        if not any(one.within for one in tasks):
            return "set robust_deg in [test_pose], or optimise another criterion such as D"
    return "plan more experiments, or optimise another criterion such as D"


def _round(number: float) -> str:
    """Two digits, without an exponent where people would not write one."""
    return f"{float(f'{number:.2g}'):,.0f}" if number < 1e6 else f"{number:.1e}"


def _candidates(study: "Study") -> Array:
    """Feasible experiments (k, v); none where none turn up."""
    given = study.specification
    source = CandidateSource(study.space, (given.seed, 0), given.sampling)
    try:
        return source.take(min(CANDIDATES, given.candidates)).x
    except EmptyFeasibleSetError:
        return np.empty((0, study.space.size))


def _best_alone(study: "Study", x: Array, experiments: int) -> Array:
    """Standard deviations (p,) that no plan of the experiments x can beat, each for itself.

    ``(M^-1)_jj >= 1 / M_jj``, and M_jj is at most m times the largest that an experiment has. Inf
    where there are none to compare with.
    """
    if not len(x):
        return np.full(study.model.p, np.inf)
    blocks = study.space.problem(x).blocks()
    largest = np.diagonal(blocks, axis1=1, axis2=2).max(axis=0)
    with np.errstate(divide="ignore"):
        return np.asarray(1 / np.sqrt(experiments * largest))
