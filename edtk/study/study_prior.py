"""The prior that a study's file describes."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.prior import Normal, Prior
from edtk.system.errors import UserError
from edtk.tables.compliances import load_compliances

if TYPE_CHECKING:
    from edtk.study.study import Study

ASYMMETRY = 1e-6  # relative: printed digits of a covariance may differ by that
LEAST_STD = 1e-20  # [rad/(N m)]: a compliance that is known so well is no prior
TOO_CERTAIN = f"expected standard deviations of at least {LEAST_STD:g} rad/(N m)"
NO_VARIANCE = 2  # degrees of freedom up to which Student's t has no variance


def study_prior(study: "Study") -> Prior:
    """Build the prior of a study's unknown compliances, which are positive, from its [prior] table.

    Raises:
        UserError: The table names another joint, its covariance is no covariance, or its file
            cannot be read.
    """
    table = study.specification.prior
    unknown = study.specification.joints.unknown
    for name in table.joints:
        if name not in unknown:
            message = f"{name!r} is no unknown joint; expected {', '.join(unknown)}"
            raise study.error("prior.joints", message)
    marginals = tuple(table.joints.get(name, table.all).build() for name in unknown)
    if table.earlier_file is not None:
        return Prior(marginals, _from_file(study, table.earlier_file))
    if table.earlier is not None:
        return Prior(marginals, _from_table(study))
    return Prior(marginals)


def _from_table(study: "Study") -> Normal:
    """The normal prior that the study's file states itself."""
    unknown = study.specification.joints.unknown
    earlier = study.specification.prior.earlier
    assert earlier is not None
    mean = earlier.mean_rad_per_Nm
    if set(mean) != set(unknown):
        message = f"expected one value each for {', '.join(unknown)}"
        raise study.error("prior.earlier.mean_rad_per_Nm", message)
    p = len(unknown)
    rows = earlier.covariance
    if len(rows) != p or any(len(row) != p for row in rows):
        message = f"expected {p} rows of {p} numbers, one per unknown joint"
        raise study.error("prior.earlier.covariance", message)
    covariance = np.array(rows)
    not_positive = study.error(
        "prior.earlier.covariance", "expected a symmetric, positive definite matrix"
    )
    if not np.allclose(covariance, covariance.T, rtol=ASYMMETRY, atol=0):
        raise not_positive
    if 0 < np.diag(covariance).min() < LEAST_STD**2:
        raise study.error("prior.earlier.covariance", TOO_CERTAIN)
    try:
        return Normal(np.array([mean[name] for name in unknown]), covariance)
    except np.linalg.LinAlgError:
        raise not_positive from None


def _from_file(study: "Study", name: str) -> Normal:
    """The result of an earlier calibration, as `edtk identify` has written it.

    Where sigma was estimated the covariance is widened to that of Student's t.
    """
    unknown = study.specification.joints.unknown
    key = "prior.earlier_file"
    try:
        found = load_compliances(study.folder / name, study.robot.joint_names, unknown)
    except UserError as error:
        place = name if error.key is None else f"{name}: {error.key}"
        raise study.error(key, f"{place}: {error.message}") from error
    not_positive = study.error(
        key, f"{name}: expected a positive definite covariance, or std, beside k"
    )
    if found.covariance is None:
        raise not_positive
    dof = found.covariance_dof
    if dof <= NO_VARIANCE:
        message = f"{name}: expected a covariance_dof above {NO_VARIANCE}, or no variance is finite"
        raise study.error(key, message)
    wider = dof / (dof - NO_VARIANCE) if np.isfinite(dof) else 1.0
    if 0 < np.diag(found.covariance).min() < LEAST_STD**2:
        raise study.error(key, f"{name}: {TOO_CERTAIN}")
    chosen = [found.joints.index(joint) for joint in unknown]
    try:
        return Normal(found.unbounded[chosen], wider * found.covariance[np.ix_(chosen, chosen)])
    except np.linalg.LinAlgError:
        raise not_positive from None
