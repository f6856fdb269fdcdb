"""Displacements in centimetres or inches, which are too few times too small to be seen at once."""

from dataclasses import replace

import numpy as np

from edtk.calibration.fitted_data import FittedData
from edtk.inference.fit_equilibrium import NoFitError, fit_equilibrium
from edtk.model.all_compliances import all_compliances
from edtk.model.equilibrium import NoEquilibriumError

UNITS = ((1 / 10, "centimetres"), (1 / 25.4, "inches"))
ENOUGH = 5  # degrees of freedom from which residuals tell their size
SUSPECT = 0.3  # residuals over sigma below which other units are tried
# Factor up to which residuals are as large as sigma says: the two units are 2.5 apart.
AS_LARGE = 1.5


def small_unit(fitted: FittedData, ratio: float | None) -> str | None:
    """Find the unit in which displacements and residuals have the sizes that they should.

    A factor on all displacements is one on all compliances and on the residuals. The residuals in
    millimetres are smaller than sigma by the factor, and the displacements smaller than predicted.

    Args:
        fitted: The measurements and their fit.
        ratio: Size of the displacements over that of the predicted ones; None without assumed
            compliances, where a sigma that is as many times too large looks the same.

    Returns:
        The unit's name, in the plural; None where millimetres are as likely.
    """
    fit = fitted.fit
    if fit.dof < ENOUGH or not fit.scale < SUSPECT:
        return None
    found = []
    for factor, name in UNITS:
        near = ratio is None or ratio < np.sqrt(factor)
        off = abs(np.log(_noise(fitted, factor))) if near else np.inf
        if off < np.log(AS_LARGE):
            found.append((off, name))
    return min(found, key=lambda entry: entry[0])[1] if found else None


def _noise(fitted: FittedData, factor: float) -> float:
    """Residuals over sigma, where displacements are in a unit; inf where that does not fit."""
    study = fitted.study
    data = fitted.data
    data = replace(data, deflection=data.deflection / factor)
    start = all_compliances(study.model, fitted.fit.unbounded / factor)
    try:
        return fit_equilibrium(study.model, data, start)[1].scale
    except (NoEquilibriumError, NoFitError):
        return np.inf
