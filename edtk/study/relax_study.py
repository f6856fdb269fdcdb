"""The relaxation that a study asks for."""

from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.relaxation.capacity import DEFAULT_MB
from edtk.design.relaxation.relax_options import RelaxOptions
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.planning_space import planning_space
from edtk.study.run_options import DEFAULTS, RunOptions
from edtk.study.study import Study
from edtk.study.study_errors import study_errors
from edtk.system.errors import ArgumentError

TOLERANCE = 1e-5  # relative gap, beyond which a bound would not change how a plan is judged
CANDIDATES = 0  # the stream of random numbers that candidates come from


def source_of(
    study: Study, seed: int | None = None, space: DesignSpace | None = None
) -> CandidateSource:
    """Where the candidates of a study come from.

    Args:
        study: The study.
        seed: Seed; defaults to the study's.
        space: Design space; defaults to the study's.
    """
    return CandidateSource(
        space or study.space,
        (study.specification.seed if seed is None else seed, CANDIDATES),
        study.specification.sampling,
    )


def relax_study(
    study: Study,
    criterion: str | None = None,
    *,
    candidates: int | None = None,
    continuous: bool = False,
    size: int | None = None,
    tolerance: float = TOLERANCE,
    memory_mb: float = DEFAULT_MB,
    options: RunOptions = DEFAULTS,
) -> RelaxedPlan:
    """Find the best weights over feasible poses, with a bound on every plan.

    Args:
        study: The study.
        criterion: Name of a criterion; defaults to the one that the study is about.
        candidates: Number of candidate poses; defaults to the study's.
        continuous: Whether to search over all feasible poses, beyond the candidates.
        size: Number of experiments that share a prior which counts in designs; defaults to the
            first of the study's sizes.
        tolerance: Relative gap at which that search ends.
        memory_mb: Limit on memory [MB].
        options: Seed and progress; the work is done by threads of this process.

    Raises:
        UserError: One line that says what cannot be done, and where.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    if size is not None and not study.specification.prior.in_design:
        message = "has no effect without a prior in the design; expected none"
        raise ArgumentError(message, argument="size", given=size)
    with study_errors(study):
        space = planning_space(study, size or study.specification.sizes[0])
        return relax_poses(
            source_of(study, options.seed, space),
            study.specification.candidates if candidates is None else candidates,
            study.criterion(criterion),
            continuous,
            RelaxOptions(tolerance=tolerance, memory_mb=memory_mb, progress=options.progress),
        )
