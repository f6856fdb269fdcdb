"""`edtk.bayes`: the sampled posterior of a plan beside Eq. (13)."""

import math
from pathlib import Path

from edtk.calibration.check_plan_posterior import check_plan_posterior
from edtk.calibration.inference_data import inference_data
from edtk.calibration.posterior_check import PosteriorCheck
from edtk.inference.noise import NU_IN_WORDS, Noise
from edtk.study.prior_table import LEAST_NU
from edtk.system.atomic_file import Content, write_files
from edtk.system.errors import ArgumentError, UserError
from edtk.system.finite import LARGEST
from edtk.verbs.inputs import PlanLike, StudyLike, as_plan, as_study, files_of, name_of
from edtk.verbs.require_output import require_folder, require_output
from edtk.verbs.sampling import Sampling

MOST_MEASUREMENTS = 100_000  # the density of the posterior is a sum over them, at every step


def bayes(
    study: StudyLike,
    plan: PlanLike,
    *,
    sigma_factor: float | None = None,
    nu: float | str | None = None,
    sampling: Sampling | None = None,
    figures: Path | str | None = None,
) -> PosteriorCheck:
    """Simulate measurements of a plan, sample their posterior, and compare it with Eq. (13).

    The [prior] of the study says what is known before the measurements.

    Args:
        study: A study, or the path of a study file; it must have a [simulation].
        plan: A plan, or the path of its CSV file.
        sigma_factor: Sigma is known to this factor: 1 exactly, infinite not at all; defaults to
            the study's.
        nu: Degrees of freedom of Student-t errors, "normal" or "sampled"; defaults to the study's.
        sampling: How the posterior is sampled; defaults to an accuracy of 1 %.
        figures: Folder for pictures (PNG).

    Returns:
        Posterior standard deviations beside those of Eq. (13), and the samples.

    Raises:
        UserError: A file is not valid, the plan leaves parameters open, or the chain does not
            converge.
    """
    question = as_study(study)
    sampling = sampling or Sampling()
    inputs = (*question.reads, *files_of(plan))
    sampling.require_writable(*inputs)
    measured = as_plan(question, plan)
    require_folder(figures)
    if measured.experiments > MOST_MEASUREMENTS:
        raise UserError(
            f"{measured.experiments} experiments, each of which is simulated; "
            f"expected {MOST_MEASUREMENTS} at most",
            where=name_of(plan, "plan"),
        )
    if figures is not None:
        from edtk.report.posterior_pictures import NAMES, posterior_pictures

        for name in NAMES:
            require_output(Path(figures) / name, *inputs, sampling.chain, sampling.export)
    noise = _noise(question.specification.prior.noise(), sigma_factor, nu)
    where = name_of(plan, "plan")
    with sampling.arguments(where, question.specification.seed) as arguments:
        check = check_plan_posterior(question, measured, noise=noise, **arguments)
    files: dict[Path, Content] = {}
    if sampling.export is not None:
        files[Path(sampling.export)] = inference_data(check, question.tasks)
    if figures is not None:
        files |= posterior_pictures(check, Path(figures))
    write_files(files)
    return check


def _noise(given: Noise, sigma_factor: float | None, nu: float | str | None) -> Noise:
    """The study's noise, with what the caller says in its place.

    Raises:
        ArgumentError: A number is outside the range that a study allows.
    """
    factor = given.sigma_factor if sigma_factor is None else sigma_factor
    if not (1 <= factor <= LARGEST or factor == math.inf):
        message = "expected a number from 1 to 1e6, or inf"
        raise ArgumentError(message, argument="sigma_factor", given=factor)
    if nu is None:
        return Noise(factor, given.nu)
    found = NU_IN_WORDS[nu] if isinstance(nu, str) else nu
    if found is not None and not (LEAST_NU <= found <= LARGEST or found == math.inf):
        message = "expected a number from 0.1 to 1e6, 'normal' or 'sampled'"
        raise ArgumentError(message, argument="nu", given=nu)
    return Noise(factor, found)
