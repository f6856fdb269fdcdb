"""Residuals that the stated noise makes improbable: causes, outliers, shared noise."""

from collections.abc import Iterator

import numpy as np

from edtk.findings.causes.find_causes import UNEXPLAINED
from edtk.findings.causes.try_faults import NO_NOISE
from edtk.findings.diagnostic import Diagnostic, Severity
from edtk.findings.finding import Finding, Kind
from edtk.findings.fitted_data import FittedData
from edtk.findings.moving_joints import stated_repeatability
from edtk.fit.distributions import chi_square_tail
from edtk.fit.estimate_noise import NoiseEstimate
from edtk.fit.identify import INTERPOLATED, Identification, identify
from edtk.fit.least_squares import SingularPlanError
from edtk.fit.outliers import UNLIKELY, LackOfFit

LIKE_LOADS = 2  # decimals of loads, over the largest, up to which they are the same
TOO_MANY = 3  # of so many rows one outlier is the most for a result that can be used
UNLIKELY_NOISE = 0.01  # p-value of the residuals that is worth a warning
IMPOSSIBLE = 0.001  # and an alarm
TINY = 0.2  # estimated noise over the stated one that looks like another unit


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


def outlier_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Name the outliers, and say whether the rest fits, or whether there are too many of them."""
    fit = fitted.fit
    if fit.too_few_for_robust:
        numbers = {
            "coordinates": fit.residual.size,
            "parameters": len(fit.k),
            "needed": INTERPOLATED * len(fit.k),
        }
        yield Diagnostic(Severity.WARNING, Finding(Kind.TOO_FEW_FOR_ROBUST, data=numbers))
    if not len(fit.outliers):
        return
    too_many = TOO_MANY * len(fit.outliers) > len(fit.residual)
    severity = Severity.ALARM if too_many else Severity.WARNING
    rows = tuple(fit.outliers.tolist())
    rest = _rest(fitted)
    p_rest = None if rest is None else rest.p_value
    if fitted.found_causes.unexplained and p_rest is not None and p_rest < UNEXPLAINED:
        return  # the model does not fit the other rows either
    data = {
        "robust": fit.robust,
        "p_rest": p_rest,
        "off": None if rest is None else _off(fitted, rest),
    }
    yield Diagnostic(severity, Finding(Kind.OUTLIERS, rows, data=data))


def _rest(fitted: FittedData) -> Identification | None:
    """The fit of the other rows alone; None where it cannot tell whether they fit."""
    fit = fitted.fit
    if not fit.known or fit.robust:
        return None
    rest = np.delete(np.arange(len(fitted.data)), fit.outliers)
    noise = fitted.noise[rest]
    try:
        return identify(fitted.A[rest], fitted.measured[rest], noise, fit.parameters)
    except SingularPlanError:
        return None


def _off(fitted: FittedData, rest: Identification) -> float | None:
    """By how much outliers are off what the other rows predict, at most [m]; None for rotations."""
    rows = fitted.fit.outliers
    lengths = fitted.data.lengths[rows]
    off = fitted.as_linear[rows] - fitted.linear_regressor[rows] @ rest.unbounded
    size = np.linalg.norm(np.where(lengths, off, 0.0), axis=1)
    return float(size.max()) if lengths.any(axis=1).all() else None


def noise_diagnostics(fitted: FittedData) -> Iterator[Diagnostic]:
    """Compare the residuals with the stated noise.

    The sum of squares has the chi-square distribution with dof degrees of freedom; with Huber's
    loss the scale, from a median absolute deviation, has about 0.37 dof. Where repetitions share a
    part of the noise, or markers of a visit do, which is estimated, the stated noise is that of
    their scatter.
    """
    fit = fitted.fit
    if not fit.dof:
        yield Diagnostic(Severity.WARNING, Finding(Kind.NO_RESIDUALS))
        return
    n = fit.scale_dof
    scale = fit.scale
    repeated = fitted.lack_of_fit
    visits = fitted.noise_estimate
    if fitted.common_noise and visits is not None:
        n = visits.relative_dof(0)
        scale = visits.tracker
    elif fitted.common_noise and repeated is not None:
        n = repeated.dof[1]
        scale = repeated.pure_error
    p = float(chi_square_tail(scale**2 * n, n))
    explanation = fitted.explanation
    unexplained = explanation is not None and not explanation.refits
    found = fitted.found_causes
    caused = bool(fitted.structural_causes or found.outliers or found.unexplained)
    data = {"scale": scale, "p": p, "unexplained": unexplained, "caused": caused}
    large = p < UNLIKELY_NOISE if fit.known else p < IMPOSSIBLE
    small = p > 1 - IMPOSSIBLE
    if large and fit.known:
        severity = Severity.ALARM if p < IMPOSSIBLE else Severity.WARNING
        yield Diagnostic(severity, Finding(Kind.NOISE_ABOVE_SIGMA, data=data))
    elif large:
        yield Diagnostic(Severity.WARNING, Finding(Kind.NOISE_ESTIMATED_LARGE, data=data))
    elif small and fit.known:
        yield Diagnostic(Severity.WARNING, Finding(Kind.NOISE_BELOW_SIGMA, data=data))
    elif small and scale < TINY:
        # Where sigma is estimated everything scales with the unit of the displacements: only the
        # size of the noise can tell that it is another one.
        yield Diagnostic(Severity.ALARM, Finding(Kind.NOISE_ESTIMATED_SMALL, data=data))
