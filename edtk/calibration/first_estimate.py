"""The estimate about which a posterior is sampled."""

from edtk.inference.fit_with_prior import fit_with_prior
from edtk.inference.least_squares import Estimate, SingularPlanError, estimate
from edtk.inference.whiten import RowNoise
from edtk.study.study import Study
from edtk.study.study_prior import study_prior
from edtk.system.typing import Array


def first_estimate(
    study: Study, A: Array, measured: Array, sigma: RowNoise
) -> tuple[Estimate, tuple[str, ...]]:
    """Fit compliances by least squares; with the study's prior where these have no answer.

    Args:
        study: Names and prior.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise that broadcasts to (m, rows) [m, rad], or correlated noise.

    Returns:
        The estimate, and the names of the parameters that measurements alone do not tell.

    Raises:
        SingularPlanError: The prior does not tell these parameters either.
        UserError: The study's prior is not one.
    """
    names = study.model.parameters
    try:
        return estimate(A, measured, sigma, names), ()
    except SingularPlanError as error:
        prior = study_prior(study)
        return fit_with_prior(A, measured, sigma, names, prior), error.parameters
