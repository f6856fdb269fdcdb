"""The sentence of each finding: the one place where findings become words."""

from collections.abc import Callable

from edtk.findings.cause_wording import (
    READINGS,
    causes_wording,
    no_cause_wording,
    reading_wording,
)
from edtk.findings.finding import Finding, Kind
from edtk.findings.match_plan import row_names

# Which of two estimates to believe, by the reason why they differ.
BELIEVE = {
    "contradiction": "believe neither before it is clear whether prior or measurements are wrong",
    "prior": "believe the posterior, as the prior says more than the measurements, and fits them",
    "noise": "believe the posterior, which also infers the noise, and bounds outliers",
    "model": "believe neither: both rest on the same measurements, so model or signs are wrong",
}
LEAST_P = 0.01  # probability of residuals that still fit


def prior_wording(found: Finding) -> str:
    """One line that says how prior, measurements and posterior agree."""
    return _PRIOR_SENTENCES[found.kind](found)


def _rests_on_prior(found: Finding) -> str:
    """Parameters that the measurements do not tell."""
    names = ", ".join(found.parameters)
    return (
        f"the measurements alone do not tell {names}: least squares have no answer, and k and std "
        "are mean and standard deviation of the posterior, which rests on the [prior]"
    )


def _prior_contradicted(found: Finding) -> str:
    """A prior under which the estimate is improbable."""
    p = found.data["p"]
    likely = f"p = {p:.1g}" if p > 1e-300 else "p < 1e-300"
    if found.data["earlier"]:
        return (
            f"the earlier calibration contradicts the measurements ({likely}): one of them is "
            "wrong, or the robot has changed"
        )
    return (
        f"the prior of {', '.join(found.parameters)} contradicts the measurements ({likely}): one "
        "of them is wrong"
    )


def _posterior_differs(found: Finding) -> str:
    """A posterior that is far from least squares."""
    data = found.data
    return (
        f"{found.parameters[0]}: the posterior's mean {data['mean']:.3g} is {data['distance']:.2g} "
        f"of its standard deviations from the fit's {data['k']:.3g}: {BELIEVE[data['reason']]}"
    )


_PRIOR_SENTENCES: dict[Kind, Callable[[Finding], str]] = {
    Kind.RESTS_ON_PRIOR: _rests_on_prior,
    Kind.PRIOR_CONTRADICTED: _prior_contradicted,
    Kind.POSTERIOR_DIFFERS: _posterior_differs,
}
ON_PRIORS = tuple(_PRIOR_SENTENCES)


ON_VISITS = (Kind.MOVING_JOINTS, Kind.REPEATABILITY)


def visit_wording(found: Finding) -> str:
    """One line that says what moves together, and what to write into the study."""
    if found.kind is Kind.REPEATABILITY:
        return _repeatability(found)
    data = found.data
    test = f"F = {data['F']:.3g}, p = {data['p']:.1g}"
    moved = f"by {1e3 * data['moved']:.2g} mm ({test}), as where joints do not return exactly"
    used = "it is taken into account, and " if data["used"] else ""
    write = f"{used}repeatability_deg = {data['joints']:.2g} in the study's [noise] states it"
    if data["revisited"]:
        return f"all markers of a visit move together {moved}: {write}"
    return (
        f"markers of a pose are off together {moved}, or the model does not fit (visiting poses "
        f"again would tell): {write}"
    )


def _repeatability(found: Finding) -> str:
    """Joints that return better or worse than the study states."""
    data = found.data
    size = f"{data['joints']:.2g} +- {data['std']:.1g} deg"
    return (
        f"visits say that joints return within {size}, stated {data['stated']:.3g} deg "
        f"(p = {data['p']:.1g}): repeatability_deg in the study's [noise] is wrong, or poses are"
    )


def wording(finding: Finding) -> str:
    """One line that says what is wrong, where, and what was expected."""
    return _SENTENCES[finding.kind](finding)


def _force_unit(found: Finding) -> str:
    """Forces of another size than expected."""
    whose = "the plan" if found.data["planned"] else "the study's [load]"
    unit = found.data["unit"]
    why = "; expected those that were applied, in newtons"
    if unit:
        why = f": are they in {unit}? expected newtons"
    ratio = found.data["ratio"]
    return f"columns Fx_N to Fz_N: the forces are {ratio:.3g} times those of {whose}{why}"


def _other_load(found: Finding) -> str:
    """Loads that are not those planned."""
    within = f"{100 * found.data['tolerance']:g} %"
    rows = row_names(found.rows)
    return f"{rows}: the load is not the one planned in this pose; expected it within {within}"


def _length_unit(found: Finding) -> str:
    """Displacements a thousand times off."""
    ratio = f"{found.data['ratio']:.2g}"
    size = f"the residuals are {ratio} times sigma"
    if found.data["predicted"]:
        size = f"the displacements are {ratio} times those that the study's [simulation] predicts"
    return f"{size}: are they in {found.data['unit']}? expected millimetres"


def _rotation_unit(found: Finding) -> str:
    """Rotations in radians."""
    ratio = f"{found.data['ratio']:.2g}"
    return f"the rotations are {ratio} times those predicted: are they in radians? expected degrees"


def _angle_unit(found: Finding) -> str:
    """Joint angles in radians."""
    return "all joint angles are within 6.3 degrees of zero: are they in radians? expected degrees"


def _all_negative(found: Finding) -> str:
    """No positive compliance."""
    return (
        "every compliance comes out negative, and was set to zero: signs of the displacements, the "
        "load or the axes are wrong, or poses are"
    )


def _far_below_zero(found: Finding) -> str:
    """A negative compliance that noise does not explain."""
    k = f"{found.data['k']:.2g} +- {found.data['std']:.2g}"
    why = "far below zero: model, tool, units or poses are wrong"
    return f"{found.parameters[0]} comes out as {k}, {why}"


def _near_zero(found: Finding) -> str:
    """A compliance that might as well be zero."""
    k = f"{found.data['k']:.2g} +- {found.data['std']:.2g}"
    bounded = ", and was set to zero" if found.data["k"] < 0 else ""
    return f"{found.parameters[0]} can hardly be told from zero ({k}){bounded}"


def _no_residuals(found: Finding) -> str:
    """No degrees of freedom."""
    return (
        "there are no more measured coordinates than parameters: no residual tells whether "
        "anything is wrong"
    )


def _noise_above_sigma(found: Finding) -> str:
    """Residuals larger than sigma allows."""
    p = found.data["p"]
    likely = f"p = {p:.1g}" if p > 0 else "p < 1e-300"
    scale = f"{found.data['scale']:.3g}"
    if found.data["caused"]:
        return f"the residuals are {scale} times what the stated noise allows ({likely})"
    if found.data["unexplained"]:
        return (
            f"the residuals are {scale} times what the stated noise allows ({likely}): there are "
            "outliers, the model does not fit, or sigma is far too small; no other sign, order or "
            "zero of a column alone explains it"
        )
    return (
        f"the residuals are {scale} times what the stated noise allows "
        f"({likely}): sigma is too small, there are outliers, or the model does not fit"
    )


def _noise_below_sigma(found: Finding) -> str:
    """Residuals smaller than sigma says."""
    scale = f"{found.data['scale']:.3g}"
    return f"the residuals are only {scale} times what sigma says: sigma is too large"


def _noise_estimated_large(found: Finding) -> str:
    """An estimated noise above the stated one."""
    return (
        f"the noise is estimated as {found.data['scale']:.3g} times the stated one: if that was "
        "right, the model, the tool or the poses are wrong"
    )


def _noise_estimated_small(found: Finding) -> str:
    """An estimated noise far below the stated one."""
    return (
        f"the noise is estimated as only {found.data['scale']:.2g} times the stated one: "
        "displacements in another unit? expected millimetres"
    )


def _outliers(found: Finding) -> str:
    """Rows that do not belong to the others."""
    plural = "s" * (len(found.rows) > 1)
    text = f"{row_names(found.rows)}: outlier{plural}"
    off = found.data["off"]
    if off is not None:
        text += f", {'up to ' if plural else ''}{1e3 * off:.2g} mm off"
    rest = found.data["p_rest"]
    if rest is not None and rest > LEAST_P:
        return f"{text}; the other rows fit without {'them' if plural else 'it'} (p = {rest:.2g})"
    hidden = "; several can hide each other, a robust fit shows them all"
    return f"{text}{'' if found.data['robust'] else hidden}"


def _too_few_for_robust(found: Finding) -> str:
    """A robust fit that was replaced by least squares."""
    data = found.data
    return (
        f"{data['coordinates']} measured coordinates for {data['parameters']} parameters are too "
        f"few for a robust fit that estimates sigma, which needs more than {data['needed']}: this "
        "is the least-squares fit, in which outliers count fully"
    )


def _twins(found: Finding) -> str:
    """Rows that are the same."""
    later, earlier = found.rows
    others = found.data["others"]
    more = f", and {others} more rows have such a twin" if others else ""
    return f"row {later + 1} is row {earlier + 1} to the last digit, in all columns{more}"


def _equal_rows(found: Finding) -> str:
    """Rows that chance may have made the same."""
    chance = f"{found.data['chance']:.2g}"
    return f"{_twins(found)}: as readings so coarse may be by chance ({chance}), or was it copied?"


def _alike_parameters(found: Finding) -> str:
    """Two parameters that measurements hardly tell apart."""
    pair = " and ".join(found.parameters)
    return f"{pair} are hardly told apart (correlation {found.data['correlation']:+.3f})"


def _one_pose(found: Finding) -> str:
    """Parameters that would be unknown, or hardly known, without a pose."""
    data = found.data
    names = ", ".join(found.parameters)
    many = len(found.parameters) > 1
    would = f"standard deviation{'s' * many} would be at least {data['times']:.2g} times as large"
    if data["unknown"]:
        would = f"value{'s' * many} would be unknown"
    into = "them" if many else "it"
    rows = row_names(found.rows)
    if data["poses"] == 1:
        return (
            f"{names}: only one pose tells enough ({rows}); without that pose the {would}, and an "
            f"error in it goes into {into} and hardly shows in the residuals"
        )
    return (
        f"{names}: only {data['poses']} poses tell enough ({rows}), and each is needed; without "
        f"one of them the {would}, and an error in one goes into {into} and hardly shows in the "
        "residuals"
    )


def _linear_model(found: Finding) -> str:
    """A linear model that costs more than noise."""
    error = f"{1e3 * found.data['rho0_bias']:.2g} mm"
    place = found.data.get("place", "in the test pose")
    return f"the linear model leaves {error} {place}, more than noise: use lighter loads"


def _lack_of_fit(found: Finding) -> str:
    """Repetitions that agree among themselves better than with the model."""
    data = found.data
    test = f"F = {data['F']:.3g}, p = {data['p']:.1g}"
    agree = f"repetitions of a pose agree with each other better than with the model ({test})"
    if not data["used"]:
        return f"{agree}: the model does not fit"
    common = f"{1e3 * data['common']:.2g} mm"
    if not data["is_noise"]:
        return (
            f"{agree}: they share {common}, too much for noise; a row, a sign or the model is wrong"
        )
    return f"{agree}: {common} of noise that they share is taken into account"


def _do_not_compensate(found: Finding) -> str:
    """A compensation that does harm."""
    total = f"{1e3 * found.data['total']:.2g} mm"
    without = f"{1e3 * found.data['uncompensated']:.2g} mm"
    return (
        f"do not compensate with this: the expected error is {total}, and {without} without any "
        "compensation"
    )


def _gains_little(found: Finding) -> str:
    """A compensation that leaves most of the error."""
    total = f"{1e3 * found.data['total']:.2g} mm"
    without = f"{1e3 * found.data['uncompensated']:.2g} mm"
    return (
        f"compensation gains little: the expected error is {total}, and {without} without any "
        f"compensation; the largest part of it is {found.data['largest'].replace('_', ' ')}"
    )


def _beyond_limits(found: Finding) -> str:
    """A pose beyond a joint's limits."""
    data = found.data
    return (
        f"row {found.rows[0] + 1}, column {found.columns[0]}: {data['value']:g} is beyond the "
        f"joint's limits, {data['low']:g} to {data['high']:g}"
    )


def _not_measured(found: Finding) -> str:
    """Planned experiments without a measurement."""
    return f"{row_names(found.rows)} of the plan: not measured"


def _other_pose(found: Finding) -> str:
    """A measured pose that is not planned."""
    data = found.data
    more = f"; {data['others']} more rows are not either" if data["others"] else ""
    return (
        f"row {found.rows[0] + 1}, column {found.columns[0]}: the pose is not in the plan; the "
        f"nearest planned one, row {data['nearest'] + 1}, is {data['distance']:.3g} "
        f"{data['unit']} away; expected {data['within']:.3g} at most (plan_resolution_deg in the "
        f"study's [workspace] allows more){more}"
    )


def _copied_rows(found: Finding) -> str:
    """Rows that were copied."""
    return f"{_twins(found)}; expected measurements anew"


_SENTENCES: dict[Kind, Callable[[Finding], str]] = {
    Kind.FORCE_UNIT: _force_unit,
    Kind.OTHER_LOAD: _other_load,
    Kind.LENGTH_UNIT: _length_unit,
    Kind.ROTATION_UNIT: _rotation_unit,
    Kind.ANGLE_UNIT: _angle_unit,
    Kind.ALL_NEGATIVE: _all_negative,
    Kind.FAR_BELOW_ZERO: _far_below_zero,
    Kind.NEAR_ZERO: _near_zero,
    Kind.NO_RESIDUALS: _no_residuals,
    Kind.NOISE_ABOVE_SIGMA: _noise_above_sigma,
    Kind.NOISE_BELOW_SIGMA: _noise_below_sigma,
    Kind.NOISE_ESTIMATED_LARGE: _noise_estimated_large,
    Kind.NOISE_ESTIMATED_SMALL: _noise_estimated_small,
    Kind.OUTLIERS: _outliers,
    Kind.TOO_FEW_FOR_ROBUST: _too_few_for_robust,
    **dict.fromkeys(ON_PRIORS, prior_wording),
    Kind.EQUAL_ROWS: _equal_rows,
    Kind.ALIKE_PARAMETERS: _alike_parameters,
    Kind.ONE_POSE: _one_pose,
    Kind.LINEAR_MODEL: _linear_model,
    Kind.LACK_OF_FIT: _lack_of_fit,
    **dict.fromkeys(ON_VISITS, visit_wording),
    Kind.CAUSE: causes_wording,
    Kind.NO_CAUSE: no_cause_wording,
    Kind.DO_NOT_COMPENSATE: _do_not_compensate,
    Kind.GAINS_LITTLE: _gains_little,
    Kind.BEYOND_LIMITS: _beyond_limits,
    Kind.NOT_MEASURED: _not_measured,
    Kind.OTHER_POSE: _other_pose,
    Kind.COPIED_ROWS: _copied_rows,
    **dict.fromkeys(READINGS, reading_wording),
}
