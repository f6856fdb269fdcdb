"""`edtk.bayes`: the sampled posterior of a plan beside Eq. (13), and options of sampling."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.posterior_check import PosteriorCheck, inference_data
from edtk.fit.noise import NU_IN_WORDS, Noise
from edtk.study.tables_of_measurement import LEAST_NU
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, UserError
from edtk.system.fields import LARGEST
from edtk.system.files import Content, write_files
from edtk.verbs.inputs import (
    PlanLike,
    StudyLike,
    as_plan,
    as_study,
    files_of,
    name_of,
    require_file,
    require_folder,
    require_output,
)

MOST_MEASUREMENTS = 100_000  # the density of the posterior is a sum over them, at every step


@dataclass(frozen=True)
class Sampling:
    """How a posterior is sampled.

    Attributes:
        accuracy: Monte-Carlo error of every standard deviation, relative to it, at most; None for
            0.01.
        most: Limit on the steps of the chain; None for 60000.
        chain: File that keeps the chain (HDF5), and from which sampling goes on; None for none.
        export: File for ArviZ InferenceData (NetCDF), "-" for standard output; None for none.
        seed: Seed; None for the study's.
        progress: Called with the number of steps so far.
    """

    accuracy: float | None = None
    most: int | None = None
    chain: Path | str | None = None
    export: Path | str | None = None
    seed: int | None = None
    progress: Callable[[int], object] = lambda steps: None

    def require_writable(self, *inputs: Path | str | None) -> None:
        """Check that both files can be written, are no inputs, and that ArviZ is installed.

        Raises:
            UserError: A file is an input, or ArviZ is missing.
            OSError: A file cannot be written.
        """
        from edtk.calibration.posterior_check import require_arviz

        require_file(self.chain)
        if self.export is not None:
            require_arviz(self.export)
        for path in (self.chain, self.export):
            require_output(path, *inputs)
        require_output(self.export, self.chain)

    @contextmanager
    def arguments(self, source: Path, study_seed: int) -> Iterator[dict[str, Any]]:
        """Arguments of a posterior check; errors of the sampler name the input.

        Args:
            source: The file, or the word, that begins a message.
            study_seed: Seed of the study, for where no seed is given.

        Raises:
            UserError: The chain does not converge, cannot be kept, or has no proper posterior.
        """
        from edtk.fit.least_squares import SingularPlanError
        from edtk.fit.posterior import ImproperPosteriorError, SamplingOptions
        from edtk.fit.run_chain import ChainFileError, Demand, UnconvergedError

        default = Demand()
        demand = Demand(
            self.accuracy or default.accuracy, default.length, self.most or default.most
        )
        seed = study_seed if self.seed is None else self.seed
        try:
            chain = None if self.chain is None else Path(self.chain)
            options = SamplingOptions(demand, chain, self.progress)
            yield {"rng": np.random.default_rng(seed), "options": options}
        except (SingularPlanError, ImproperPosteriorError, UnconvergedError) as error:
            raise UserError(str(error), where=source) from error
        except ChainFileError as error:
            raise UserError(str(error)) from error


@checked
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
    from edtk.calibration.planned import check_plan_posterior  # sheets are sampled without it

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
        from edtk.report.calibration_report import PICTURES, posterior_pictures

        for name in PICTURES:
            require_output(Path(figures) / name, *inputs, sampling.chain, sampling.export)
    noise = _noise(question.specification.prior.noise(), sigma_factor, nu)
    where = name_of(plan, "plan")
    with sampling.arguments(where, question.specification.seed) as arguments:
        check = check_plan_posterior(question, measured, noise=noise, **arguments)
    files: dict[Path, Content] = {}
    if sampling.export is not None:
        files[Path(sampling.export)] = inference_data(check)
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
    found = NU_IN_WORDS.get(nu, 0.0) if isinstance(nu, str) else nu
    if found is not None and not (LEAST_NU <= found <= LARGEST or found == math.inf):
        message = "expected a number from 0.1 to 1e6, 'normal' or 'sampled'"
        raise ArgumentError(message, argument="nu", given=nu)
    return Noise(factor, found)
