"""Faults that explain the residuals, and noise that repetitions and markers share."""

from collections.abc import Iterator

import numpy as np

from edtk.calibration.causes.try_faults import NO_NOISE
from edtk.calibration.diagnostics.diagnostic import Diagnostic, Severity
from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.calibration.moving_joints import stated_repeatability
from edtk.inference.distributions import chi_square_tail
from edtk.inference.estimate_noise import NoiseEstimate
from edtk.inference.lack_of_fit import UNLIKELY, LackOfFit

LIKE_LOADS = 2  # decimals of loads, over the largest, up to which they are the same


def cause_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name what explains the residuals; noise of another size has findings of its own.

    Two causes are two explanations of the same residuals, and not two faults: a finding names both.
    """
    causes = fitted.structural_causes
    if causes:
        data = {"cause": causes[0], "others": causes[1:]}
        yield Diagnostic(Severity.WARNING, Finding(Kind.CAUSE, causes[0].rows, data=data))
    if fitted.found_causes.unexplained:
        yield Diagnostic(Severity.ALARM, _no_cause(fitted))
    yield from _moving_joints(fitted)
    test = fitted.lack_of_fit
    if fitted.noise_estimate is not None and not fitted.noise_estimate.revisited:
        return  # the test of moving joints is that of lack of fit, too
    if test is not None and test.seen:
        common = test.common * float(fitted.data.sigma[fitted.data.lengths].mean())
        if fitted.noise_estimate is not None:
            common = fitted.noise_estimate.discrepancy
        is_noise = _is_noise(fitted, test)
        data = {
            "F": test.F,
            "p": test.p,
            "common": common,
            "used": fitted.common_noise,
            "is_noise": is_noise,
        }
        severity = Severity.WARNING if is_noise else Severity.ALARM
        yield Diagnostic(severity, Finding(Kind.LACK_OF_FIT, data=data))


def _no_cause(fitted: FittedData) -> Finding:
    """A misfit that no fault explains, with what was not measured that would tell more of it."""
    data = fitted.data
    repeated = len(np.unique(data.places)) < len(data)
    shape = data.wrench / np.abs(data.wrench).max()
    loads = len(np.unique(shape.round(LIKE_LOADS), axis=0))
    lost = {"scale": fitted.fit.scale, "repeated": repeated, "loads": loads > 1}
    return Finding(Kind.NO_CAUSE, data=lost)


def _is_noise(fitted: FittedData, test: LackOfFit) -> bool:
    """Whether what repetitions share may be noise; a wrong sign or row makes more of it."""
    own = 1.0 if fitted.fit.known else test.pure_error
    return test.common <= NO_NOISE * own


def _moving_joints(fitted: FittedData) -> Iterator[Diagnostic]:
    """Markers of a visit that move together, more or less than the study's [noise] states."""
    found = fitted.noise_estimate
    if found is None:
        return
    stated = stated_repeatability(fitted.study)
    if stated is not None:
        yield from _repeatability(found, stated)
    elif found.moves and (found.revisited or not fitted.structural_causes):
        data = {
            "F": found.F,
            "p": found.p,
            "joints": found.joints,
            "moved": found.by_joints * float(fitted.data.own_sigma[fitted.data.lengths].mean()),
            "used": fitted.common_noise,
            "revisited": found.revisited,
        }
        yield Diagnostic(Severity.WARNING, Finding(Kind.MOVING_JOINTS, data=data))


def _repeatability(found: NoiseEstimate, stated: float) -> Iterator[Diagnostic]:
    """An estimate of the joints' repeatability that contradicts the stated one [deg]."""
    dof = found.relative_dof(1)
    if not found.joints > 0 or not dof >= 1:
        return
    tail = float(chi_square_tail(dof * (found.joints / stated) ** 2, dof))
    p = 2 * min(tail, 1 - tail)
    if p < UNLIKELY:
        data = {"joints": found.joints, "std": found.std[1], "stated": stated, "p": p}
        yield Diagnostic(Severity.WARNING, Finding(Kind.REPEATABILITY, data=data))
