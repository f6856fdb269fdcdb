"""The relaxation that a study asks for."""

from collections.abc import Callable

import criteria
from edtk.design.candidate_source import CandidateSource, EmptyFeasibleSetError
from edtk.design.design_space import DesignSpace
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax_poses import MEMORY_MB, MemoryLimitError, Progress, relax_poses
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.study.study import Study
from edtk.system.errors import UserError


def source_of(
    study: Study, seed: int | None = None, space: DesignSpace | None = None
) -> CandidateSource:
    """Where the study's candidates come from; `design` takes the place of the study's own."""
    return CandidateSource(
        space or study.space,
        (study.specification.seed if seed is None else seed, 0),
        study.specification.sampling,
    )


def relax_study(
    study: Study,
    name: str,
    n: int | None = None,
    seed: int | None = None,
    continuous: bool = False,
    tolerance: float = 1e-5,
    memory_mb: float = MEMORY_MB,
    space: DesignSpace | None = None,
    progress: Progress = lambda stage, gap: None,
    stop: Callable[[], bool] = lambda: False,
) -> RelaxedPlan:
    """`relax_poses` for one criterion of a study.

    Args:
        study: The question.
        name: Name of a criterion.
        n: Number of candidates; None for the study's.
        seed: Seed; None for the study's.
        continuous: Whether to leave the candidates.
        tolerance: Relative gap at which the search over the continuum ends.
        memory_mb: Limit on memory [MB].
        space: What takes the place of the study's own; None for that.
        progress: Called with the stage and its relative gap.
        stop: Asked, in the continuum, whether the bound so far is enough.

    Raises:
        UserError: One line that says what cannot be done, and where.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    try:
        criterion = study.criterion(name)
        return relax_poses(
            source_of(study, seed, space),
            study.specification.candidates if n is None else n,
            criterion,
            continuous,
            tolerance=tolerance,
            memory_mb=memory_mb,
            progress=progress,
            stop=stop,
        )
    except EmptyFeasibleSetError as error:
        raise study.error("workspace", str(error)) from error
    except RankDeficientError as error:
        raise study.error("joints.unknown", str(error)) from error
    except MemoryLimitError as error:
        raise UserError(f"--memory: {error}") from error
    except criteria.CriterionError as error:
        wanted = ", and the study has no [test_pose]" if "needs a target" in str(error) else ""
        raise UserError(f"{study.path}: {error}{wanted}") from error
    except (NotImplementedError, RelaxationError) as error:
        raise UserError(f"{study.path}: {error}") from error
