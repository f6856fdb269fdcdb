"""The sentence of each finding about prior knowledge."""

from collections.abc import Callable

from edtk.calibration.finding import Finding, Kind


def prior_wording(found: Finding) -> str:
    """One line that says how prior, measurements and posterior agree."""
    return _SENTENCES[found.kind](found)


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


# Which of two estimates to believe, by the reason why they differ.
BELIEVE = {
    "contradiction": "believe neither before it is clear whether prior or measurements are wrong",
    "prior": "believe the posterior, as the prior says more than the measurements, and fits them",
    "noise": "believe the posterior, which also infers the noise, and bounds outliers",
    "model": "believe neither: both rest on the same measurements, so model or signs are wrong",
}


def _posterior_differs(found: Finding) -> str:
    """A posterior that is far from least squares."""
    data = found.data
    return (
        f"{found.parameters[0]}: the posterior's mean {data['mean']:.3g} is {data['distance']:.2g} "
        f"of its standard deviations from the fit's {data['k']:.3g}: {BELIEVE[data['reason']]}"
    )


_SENTENCES: dict[Kind, Callable[[Finding], str]] = {
    Kind.RESTS_ON_PRIOR: _rests_on_prior,
    Kind.PRIOR_CONTRADICTED: _prior_contradicted,
    Kind.POSTERIOR_DIFFERS: _posterior_differs,
}
ON_PRIORS = tuple(_SENTENCES)
