"""The prior that a study's file describes."""

import numpy as np

from edtk.inference.prior import Normal, Prior
from edtk.study.study import Study
from edtk.tables.compliances import load_compliances


def study_prior(study: Study) -> Prior:
    """The [prior] table on the study's unknown compliances, which are positive.

    Raises:
        UserError: The table names another joint, or its covariance is none, or its file cannot be read.
    """
    table, unknown = study.specification.prior, study.specification.joints.unknown
    for name in table.joints:
        if name not in unknown:
            raise study.error(
                "prior.joints", f"{name!r} is no unknown joint; expected {', '.join(unknown)}"
            )
    marginals = tuple(table.joints.get(name, table.all).build() for name in unknown)
    if table.earlier_file is not None:
        return Prior(marginals, _from_file(study, table.earlier_file))
    if table.earlier is None:
        return Prior(marginals)
    mean = table.earlier.mean_rad_per_Nm
    if set(mean) != set(unknown):
        raise study.error(
            "prior.earlier.mean_rad_per_Nm", f"expected one value each for {', '.join(unknown)}"
        )
    p, rows = len(unknown), table.earlier.covariance
    if len(rows) != p or any(len(row) != p for row in rows):
        raise study.error(
            "prior.earlier.covariance", f"expected {p} rows of {p} numbers, one per unknown joint"
        )
    covariance = np.array(rows)
    find_input_error = study.error(
        "prior.earlier.covariance", "expected a symmetric, positive definite matrix"
    )
    if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=0):
        raise find_input_error
    try:
        return Prior(marginals, Normal(np.array([mean[name] for name in unknown]), covariance))
    except np.linalg.LinAlgError:
        raise find_input_error from None


def _from_file(study: Study, name: str) -> Normal:
    """What `edtk identify` found earlier, and wrote as k.json; where it estimated sigma, as wide as Student's t is."""
    unknown = study.specification.joints.unknown
    found = load_compliances(study.folder / name, study.robot.joint_names, unknown)
    find_input_error = study.error(
        "prior.earlier_file", f"{name}: expected a positive definite covariance, or std, beside k"
    )
    if found.covariance is None:
        raise find_input_error
    dof, chosen = found.covariance_dof, [found.joints.index(joint) for joint in unknown]
    if dof <= 2:
        raise study.error(
            "prior.earlier_file",
            f"{name}: expected a covariance_dof above 2, or no variance is finite",
        )
    wider = dof / (dof - 2) if np.isfinite(dof) else 1.0
    try:
        return Normal(found.unbounded[chosen], wider * found.covariance[np.ix_(chosen, chosen)])
    except np.linalg.LinAlgError:
        raise find_input_error from None
