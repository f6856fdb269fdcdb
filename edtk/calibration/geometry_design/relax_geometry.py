"""The relaxation that a study of geometry asks for."""

from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.capacity import DEFAULT_MB
from edtk.design.relaxation.relax_options import RelaxOptions
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.relax_study import source_of
from edtk.study.run_options import DEFAULTS, RunOptions
from edtk.study.study import Study
from edtk.study.study_errors import study_errors
from edtk.system.errors import ArgumentError

# Relative gap at which a search over all poses ends. Designs of 35 parameters rest on a hundred
# poses and more, whose last digits would take minutes.
TOLERANCE = 1e-3


def relax_geometry(
    study: Study,
    criterion: str | None = None,
    *,
    candidates: int | None = None,
    continuous: bool = False,
    size: int | None = None,
    memory_mb: float = DEFAULT_MB,
    options: RunOptions = DEFAULTS,
) -> RelaxedPlan:
    """Find the best weights over poses, without and with a load, with a bound on every plan.

    Args:
        study: The study, with [parameters].
        criterion: Name of a criterion; defaults to the one that the study is about.
        candidates: Number of candidate visits; defaults to the study's.
        continuous: Whether to search over all feasible poses, beyond the candidates.
        size: Has no effect, as there is no prior; expected None.
        memory_mb: Limit on memory [MB].
        options: Seed and progress.

    Raises:
        UserError: One line that says what cannot be done, and where.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    if size is not None:
        message = "has no effect without a prior in the design; expected none"
        raise ArgumentError(message, argument="size", given=size)
    with study_errors(study):
        question = GeometryQuestion.of(study)
        source: CandidateSource = source_of(study, options.seed, question.space)
        return relax_poses(
            source,
            study.specification.candidates if candidates is None else candidates,
            question.criterion(criterion),
            continuous,
            RelaxOptions(tolerance=TOLERANCE, memory_mb=memory_mb, progress=options.progress),
        )
