"""Residuals that the stated noise makes improbable: causes, outliers, shared noise."""

from collections.abc import Callable, Iterator

import numpy as np

from edtk.findings.causes.family import Cause
from edtk.findings.causes.faults import FAULTS, cause_wording
from edtk.findings.causes.find_causes import MOSTLY, UNEXPLAINED
from edtk.findings.causes.try_faults import NO_NOISE
from edtk.findings.causes.wrong_pose import FITS
from edtk.findings.finding import (
    Data,
    Finding,
    Severity,
    Wording,
    leading_digit,
    row_names,
    shown_probability,
)
from edtk.findings.fitted_data import FittedData
from edtk.findings.moving_joints import asked_of_sheets, stated_repeatability
from edtk.fit.distributions import chi_square_tail
from edtk.fit.estimate_noise import NoiseEstimate, told_apart
from edtk.fit.identify import INTERPOLATED, Identification, identify
from edtk.fit.least_squares import OUTSIDE, SingularPlanError, chance_of_outside
from edtk.fit.outliers import UNLIKELY, LackOfFit

LIKE_LOADS = 2  # decimals of loads, over the largest, up to which they are the same
TOO_MANY = 3  # of so many rows one outlier is the most for a result that can be used
UNLIKELY_NOISE = 0.01  # p-value of the residuals that is worth a warning
IMPOSSIBLE = 0.001  # and an alarm
RARE_DAYS = 5e-3  # of sound days leave as few coordinates inside their bands as make a finding
# What [uncertainty] states of the size of a cause.
STATED = {
    "load_size": "load_percent",
    "load_direction": "load_direction_deg",
    "tool_x": "tool_mm",
    "tool_y": "tool_mm",
    "tool_z": "tool_mm",
}
AS_STATED = 2.5  # standard deviations: of two axes, 4 % are longer
HELD = 0.75  # of the coordinates: below it bands are no bands
FAR_BELOW_STATED = 0.2  # estimated noise over the stated one that looks like another unit


def cause_findings(fitted: FittedData) -> Iterator[Finding]:
    """Name what explains the residuals; noise of another size has findings of its own.

    Two causes are two explanations of the same residuals, and not two faults: a finding names both.
    """
    causes = fitted.structural_causes
    if causes:
        data = {"cause": causes[0], "others": causes[1:], "aside": fitted.found_causes.outliers}
        yield Finding.of(Severity.WARNING, WORDING, "cause", rows=causes[0].rows, **data)
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
            "of_model": fitted.model_error is not None,
        }
        severity = Severity.WARNING if is_noise or _is_counted(fitted) else Severity.ALARM
        if is_noise and "discrepancy" in asked_of_sheets(fitted.study):
            severity = Severity.NOTE
        yield Finding.of(severity, WORDING, "lack_of_fit", **data)


def no_cause_findings(fitted: FittedData) -> Iterator[Finding]:
    """A misfit that no fault explains, with what was not measured that would tell more of it."""
    if not fitted.found_causes.unexplained or _is_as_doubted(fitted):
        return
    data = fitted.data
    repeated = len(np.unique(data.places)) < len(data)
    shape = data.wrench / np.abs(data.wrench).max()
    loads = len(np.unique(shape.round(LIKE_LOADS), axis=0))
    severity = Severity.WARNING if _is_counted(fitted) else Severity.ALARM
    yield Finding.of(
        severity,
        WORDING,
        "no_cause",
        scale=fitted.fit.scale,
        repeated=repeated,
        loads=loads > 1,
        possible=fitted.found_causes.possible,
    )


def _is_noise(fitted: FittedData, test: LackOfFit) -> bool:
    """Whether what repetitions share may be noise; a wrong sign or row makes more of it."""
    own = 1.0 if fitted.fit.known else test.pure_error
    return test.common <= NO_NOISE * own


def _moving_joints(fitted: FittedData) -> Iterator[Finding]:
    """Markers of a visit that move together, more or less than the study's [noise] states."""
    found = fitted.noise_estimate
    asked = asked_of_sheets(fitted.study)
    untold = _untold(found, asked)
    if untold:
        yield Finding.of(Severity.WARNING, WORDING, "noise_untold", errors=untold)
    if found is None:
        return
    stated = stated_repeatability(fitted.study)
    if stated is not None and "joints" not in asked:
        yield from _repeatability(found, stated)
    elif found.moves and (found.revisited or not fitted.structural_causes):
        yield Finding.of(
            Severity.NOTE if "joints" in asked else Severity.WARNING,
            WORDING,
            "moving_joints",
            F=found.F,
            p=found.p,
            joints=found.joints,
            moved=found.by_joints * float(fitted.data.own_sigma[fitted.data.lengths].mean()),
            used=fitted.common_noise,
            revisited=found.revisited,
        )


def _untold(found: NoiseEstimate | None, asked: tuple[str, ...]) -> tuple[str, ...]:
    """Errors that the study wants to be estimated, and that the sheet does not tell."""
    if found is None:
        return asked
    told = dict(zip(("tracker", "joints", "discrepancy"), told_apart(found.strata), strict=True))
    return tuple(one for one in asked if not told[one])


def _noise_untold(data: Data) -> str:
    """A sheet that does not tell what it was asked for."""
    return (
        f"the sheet does not tell noise.estimated ({', '.join(data['errors'])}), and stated sizes "
        "count: several markers in a visit tell how well joints come back, and repeated visits "
        "besides tell the discrepancy"
    )


def _repeatability(found: NoiseEstimate, stated: float) -> Iterator[Finding]:
    """An estimate of the joints' repeatability that contradicts the stated one [deg]."""
    dof = found.relative_dof(1)
    if not found.joints > 0 or not dof >= 1:
        return
    tail = float(chi_square_tail(dof * (found.joints / stated) ** 2, dof))
    p = 2 * min(tail, 1 - tail)
    if p < UNLIKELY:
        yield Finding.of(
            Severity.WARNING,
            WORDING,
            "repeatability",
            joints=found.joints,
            std=found.std[1],
            stated=stated,
            p=p,
        )


def outlier_findings(fitted: FittedData) -> Iterator[Finding]:
    """Name the outliers, and say whether the rest fits, or whether there are too many of them."""
    fit = fitted.fit
    if fit.too_few_for_robust:
        yield Finding.of(
            Severity.WARNING,
            WORDING,
            "too_few_for_robust",
            coordinates=fit.residual.size,
            unknowns=len(fit.k),
            needed=INTERPOLATED * len(fit.k),
        )
    if not len(fit.outliers):
        return
    too_many = TOO_MANY * len(fit.outliers) > len(fit.residual)
    severity = Severity.ALARM if too_many else Severity.WARNING
    rows = tuple(fit.outliers.tolist())
    rest = _rest(fitted)
    p_rest = None if rest is None else rest.p_value
    beyond = fitted.model_error is not None and fitted.model_error.beyond is not None
    misfit = fitted.found_causes.unexplained and p_rest is not None and p_rest < UNEXPLAINED
    if misfit and not beyond:
        return  # the model does not fit the other rows either
    yield Finding.of(
        severity,
        WORDING,
        "outliers",
        rows=rows,
        robust=fit.robust,
        p_rest=p_rest,
        beyond_model=beyond,
        off=None if rest is None else _off(fitted, rest),
        typed=tuple(one for one in fitted.found_causes.typed if set(one.rows) <= set(rows)),
    )


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


def noise_findings(fitted: FittedData) -> Iterator[Finding]:
    """Compare the residuals with the stated noise.

    The sum of squares has the chi-square distribution with dof degrees of freedom; with Huber's
    loss the scale, from a median absolute deviation, has about 0.37 dof. Where repetitions share a
    part of the noise, or markers of a visit do, which is estimated, the stated noise is that of
    their scatter.
    """
    fit = fitted.fit
    if not fit.dof:
        yield Finding.of(Severity.WARNING, WORDING, "no_residuals")
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
    counted = _is_counted(fitted)
    data = {"scale": scale, "p": p, "unexplained": unexplained, "caused": caused}
    if _is_as_doubted(fitted):
        data["doubted"] = fitted.as_doubted
    large = p < UNLIKELY_NOISE if fit.known else p < IMPOSSIBLE
    small = p > 1 - IMPOSSIBLE
    if large and fit.known:
        severity = Severity.ALARM if p < IMPOSSIBLE and not counted else Severity.WARNING
        yield Finding.of(severity, WORDING, "noise_above_sigma", counted=counted, **data)
    elif large:
        yield Finding.of(Severity.WARNING, WORDING, "noise_estimated_large", **data)
    elif small and fit.known:
        yield Finding.of(Severity.WARNING, WORDING, "noise_below_sigma", **data)
    elif small and scale < FAR_BELOW_STATED:
        # Where sigma is estimated everything scales with the unit of the displacements: only the
        # size of the noise can tell that it is another one.
        yield Finding.of(Severity.ALARM, WORDING, "noise_estimated_small", **data)


def _is_counted(fitted: FittedData) -> bool:
    """Whether what explains the misfit counts in what is expected of commands.

    It is the robot's own, which expected error and bands have as an error of the model; or a load
    or tool that is off by no more than the study says that it may be, by themselves or together.
    Then the result can be used as far as it promises. A sheet that is wrong itself has another
    cause, or none.
    """
    if _is_as_doubted(fitted):
        return True
    first = next(iter(fitted.structural_causes), fitted.found_causes.possible)
    if first is None or first.explained < MOSTLY:
        return False
    if first.cause in STATED:
        stated = getattr(fitted.study.specification.uncertainty, STATED[first.cause])
        return first.size <= AS_STATED * stated
    return fitted.model_error is not None and FAULTS[first.cause].in_tasks


def _is_as_doubted(fitted: FittedData) -> bool:
    """Whether noise and what the study doubts leave such residuals."""
    return fitted.as_doubted > UNLIKELY_NOISE


def left_out_findings(
    inside: float, independent: Callable[[], float], named: bool, robust: bool
) -> Iterator[Finding]:
    """Bands that hold too few of the coordinates that were left out, where nothing else says why.

    Args:
        inside: Share of the coordinates inside; NaN where there are none.
        independent: Finds as how many independent coordinates these count.
        named: Whether what errs by much is named already.
        robust: Whether a robust loss trusts some of them less.
    """
    if not inside < 1 - OUTSIDE or (named and inside > HELD):
        return
    if chance_of_outside(1 - inside, independent()) > RARE_DAYS:
        return
    severity = Severity.ALARM if inside < HELD else Severity.WARNING
    yield Finding.of(severity, WORDING, "outside", inside=inside, robust=robust)


def _outside(data: Data) -> str:
    """Bands that are too narrow."""
    look = "look at the largest residuals"
    return (
        f"{100 * data['inside']:.0f} % of the coordinates left out are inside their 95 % bands: "
        "errors of some poses are far larger than those of others, and bands and standard "
        f"deviations say too little; {look if data['robust'] else f'{look}, or see --robust'}"
    )


def _no_residuals(data: Data) -> str:
    """No degrees of freedom."""
    return (
        "there are no more measured coordinates than parameters: no residual tells whether "
        "anything is wrong"
    )


def _noise_above_sigma(data: Data) -> str:
    """Residuals larger than sigma allows."""
    p = data["p"]
    likely = f"p {shown_probability(p, 1)}"
    scale = f"{data['scale']:.3g}"
    if "doubted" in data:
        return (
            f"the residuals are {scale} times what the stated noise allows ({likely}), and what it "
            "allows beside load direction, tool and drift that are as uncertain as the study says "
            f"(p {shown_probability(data['doubted'], 1)}): the expected error counts these"
        )
    if data.get("counted"):
        return (
            f"the residuals are {scale} times what the stated noise allows ({likely}); the "
            "expected error counts what they come from"
        )
    if data["caused"]:
        return f"the residuals are {scale} times what the stated noise allows ({likely})"
    if data["unexplained"]:
        return (
            f"the residuals are {scale} times what the stated noise allows ({likely}): there are "
            "outliers, the model does not fit, or sigma is far too small; no other sign, order or "
            "zero of a column alone explains it"
        )
    return (
        f"the residuals are {scale} times what the stated noise allows "
        f"({likely}): sigma is too small, there are outliers, or the model does not fit"
    )


def _noise_below_sigma(data: Data) -> str:
    """Residuals smaller than sigma says."""
    scale = f"{data['scale']:.3g}"
    return f"the residuals are only {scale} times what sigma says: sigma is too large"


def _noise_estimated_large(data: Data) -> str:
    """An estimated noise above the stated one."""
    return (
        f"the noise is estimated as {data['scale']:.3g} times the stated one: if that was "
        "right, the model, the tool or the poses are wrong"
    )


def _noise_estimated_small(data: Data) -> str:
    """An estimated noise far below the stated one."""
    return (
        f"the noise is estimated as only {data['scale']:.2g} times the stated one: "
        "displacements in another unit? expected millimetres"
    )


def _outliers(data: Data) -> str:
    """Rows that do not belong to the others."""
    plural = "s" * (len(data["rows"]) > 1)
    text = f"{row_names(data['rows'])}: outlier{plural}"
    off = data["off"]
    if off is not None:
        text += f", {'up to ' if plural else ''}{1e3 * off:.2g} mm off"
    rest = data["p_rest"]
    if rest is not None and rest > FITS:
        them = "them" if plural else "it"
        text = f"{text}; the other rows fit without {them} (p {shown_probability(rest)})"
        return "; ".join([text, *map(_perhaps_typed, data.get("typed", ()))])
    if data.get("beyond_model"):
        return f"{text}: beyond what the model leaves out of the other rows"
    hidden = "; several can hide each other, a robust fit shows them all"
    return f"{text}{'' if data['robust'] else hidden}"


def _perhaps_typed(cause: Cause) -> str:
    """A joint value with which an outlier would fit."""
    return f"{row_names(cause.rows)} would fit if joint {cause.joint} was {cause.size:+.3g} deg off"


def _too_few_for_robust(data: Data) -> str:
    """A robust fit that was replaced by least squares."""
    return (
        f"{data['coordinates']} measured coordinates for {data['unknowns']} parameters are too "
        f"few for a robust fit that estimates sigma, which needs more than {data['needed']}: this "
        "is the least-squares fit, in which outliers count fully"
    )


def _lack_of_fit(data: Data) -> str:
    """Repetitions that agree among themselves better than with the model."""
    test = f"F = {data['F']:.3g}, p {shown_probability(data['p'], 1)}"
    agree = f"repetitions of a pose agree with each other better than with the model ({test})"
    if not data["used"]:
        return f"{agree}: the model does not fit"
    common = f"{1e3 * data['common']:.2g} mm"
    if not data["is_noise"]:
        return (
            f"{agree}: they share {common}, too much for noise; a row, a sign or the model is wrong"
        )
    if data["of_model"]:
        return f"{agree}: {common} that they share is an error of the model, and counts in tasks"
    return f"{agree}: {common} of noise that they share is taken into account"


def _moving_joints_words(data: Data) -> str:
    """One line that says what moves together, and what to write into the study."""
    test = f"F = {data['F']:.3g}, p {shown_probability(data['p'], 1)}"
    moved = f"by {1e3 * data['moved']:.2g} mm ({test}), as where joints do not return exactly"
    used = "it is taken into account, and " if data["used"] else ""
    write = f"{used}repeatability_deg = {data['joints']:.2g} in the study's [noise] states it"
    if data["revisited"]:
        return f"all markers of a visit move together {moved}: {write}"
    return (
        f"markers of a pose are off together {moved}, or the model does not fit (visiting poses "
        f"again would tell): {write}"
    )


def _repeatability_words(data: Data) -> str:
    """Joints that return better or worse than the study states."""
    size = f"{data['joints']:.2g} +- {leading_digit(data['std'])} deg"
    return (
        f"visits say that joints return within {size}, stated {data['stated']:.3g} deg "
        f"(p {shown_probability(data['p'], 1)}): repeatability_deg in the study's [noise] is "
        "wrong, or poses are"
    )


def causes_words(data: Data) -> str:
    """A fault that explains the residuals, or two of which it is one."""
    cause = data["cause"]
    others = data["others"]
    misfit = "the misfit"
    if data.get("aside"):
        misfit = f"what is left without {row_names(data['aside'])}"
    share = f"{100 * cause.explained:.3g} % of {misfit} (p {shown_probability(cause.p, 1)})"
    if cause.effect is not None:
        share += f" and puts the test pose off by {1e3 * cause.effect:.2g} mm"
    if not others:
        return f"{cause_wording(cause)}: that explains {share}"
    either = ", or ".join(cause_wording(one) for one in (cause, *others))
    times = others[0].times
    which = "these measurements cannot tell which"
    if times is not None and times > 1:
        which += f", measuring each experiment {times} times could"
    return f"{either}: {which}; the first explains {share}"


def no_cause_words(data: Data) -> str:
    """A misfit that no fault explains, and what would tell more."""
    tells = []
    if not data["repeated"]:
        tells.append("each pose measured twice, which tells noise from model")
    if not data["loads"]:
        tells.append("a pose under half the load and along another axis, which tells what bends")
    tells.append(
        "positions without load in many poses, which tell the geometry (docs/howto/geometry.md)"
    )
    part = ""
    if data["possible"] is not None:
        cause = data["possible"]
        share = f"{100 * cause.explained:.2g} % of it"
        part = f" What explains {share}, and leaves the rest: {cause_wording(cause)}."
    return (
        "no cause in the list explains this: the model. Something bends, slips or is placed "
        f"otherwise than in the study.{part} More would tell: {'; '.join(tells)}"
    )


WORDING: Wording = {
    "outside": _outside,
    "no_residuals": _no_residuals,
    "noise_above_sigma": _noise_above_sigma,
    "noise_below_sigma": _noise_below_sigma,
    "noise_untold": _noise_untold,
    "noise_estimated_large": _noise_estimated_large,
    "noise_estimated_small": _noise_estimated_small,
    "outliers": _outliers,
    "too_few_for_robust": _too_few_for_robust,
    "lack_of_fit": _lack_of_fit,
    "moving_joints": _moving_joints_words,
    "repeatability": _repeatability_words,
    "cause": causes_words,
    "no_cause": no_cause_words,
}
