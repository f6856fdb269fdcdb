"""A prior that measurements contradict or rest on, and a posterior far from least squares."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from edtk.findings.finding import Data, Finding, Severity, Wording, shown_probability
from edtk.findings.fitted_data import FittedData
from edtk.fit.distributions import chi_square_tail, fisher_tail, student_below
from edtk.fit.identify import Identification
from edtk.fit.posterior import Posterior
from edtk.fit.prior import Flat, Marginal, Prior
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.parameters import Parameter
from edtk.study.study import Study
from edtk.study.tables_of_robot import KNOWN_WITHIN, KnownCompliance
from edtk.system.typing import Array

# Which of two estimates to believe, by the reason why they differ.
BELIEVE = {
    "contradiction": "believe neither before it is clear whether prior or measurements are wrong",
    "prior": "believe the posterior, as the prior says more than the measurements, and fits them",
    "noise": "believe the posterior, which also infers the noise, and bounds outliers",
    "model": "believe neither: both rest on the same measurements, so model or signs are wrong",
}
UNLIKELY = 0.01  # probability of so large a step of a known compliance, as of a fault that is named
CONTRADICTION = 1e-3  # probability of so large a distance between prior and estimate
# Standard normal variables of a prior, over which the distribution of an estimate is averaged, with
# tails beyond any probability that counts.
NORMAL = np.linspace(-8.0, 8.0, 2001)
FAR_APART = (
    2.0  # posterior standard deviations between mean and least squares that are worth a line
)
TWICE = 2.0  # the promised error: beyond it a promise is broken
SHARE = 0.1  # of the error, from which a joint is named
WIDER = 2.0  # standard deviation of the fit over the posterior's, where the prior says more


def prior_findings(fit: Identification, prior: Prior) -> Iterator[Finding]:
    """Priors under which the least-squares estimate of compliances is improbable.

    The estimate is normal about the compliances, with the covariance of the fit, and these are
    distributed as the prior says: the distance to an earlier calibration is Mahalanobis's, under
    the sum of both covariances.
    """
    earlier = None if prior.earlier is None else _far_from_earlier(fit, prior)
    told = (fit.unbounded, fit.std)
    yield from contradictions(fit.parameters, prior, told, fit.covariance_dof, earlier)


def contradictions(
    parameters: tuple[str, ...],
    prior: Prior,
    told: tuple[Array, Array],
    dof: float,
    earlier: float | None,
) -> Iterator[Finding]:
    """What was known before of parameters of any kind, where all else makes it improbable.

    One of n densities counts if its probability is below an n-th.

    Args:
        parameters: Names (p,), or words.
        prior: What was known.
        told: Estimates and standard deviations (p,) without the density of each, in SI units; NaN
            where nothing else says anything of a parameter.
        dof: Degrees of freedom of the noise.
        earlier: Probability of an earlier calibration that is as far from all else; None without.
    """
    if earlier is not None and earlier < CONTRADICTION:
        yield _contradicted(parameters, p=earlier, earlier=True)
    rows = zip(parameters, prior.marginals, *told, strict=True)
    chances = {
        name: _chance(marginal, k, std, dof)
        for name, marginal, k, std in rows
        if not isinstance(marginal, Flat) and np.isfinite(k)
    }
    named = [name for name, p in chances.items() if p < CONTRADICTION / len(chances)]
    if named:
        yield _contradicted(tuple(named), p=min(chances.values()), earlier=False)


def _chance(marginal: Marginal, k: float, std: float, dof: float) -> float:
    """Probability of an estimate k as far out, on either side, under a density of the parameter."""
    assert not isinstance(marginal, Flat)
    density = np.exp(-0.5 * NORMAL**2)
    spread = max(std, np.finfo(float).tiny)
    above = (marginal.of_normal(NORMAL) - k) / spread
    # Both tails by themselves: one less a number near one has no digits.
    tails = [float(density @ student_below(side, dof)) for side in (above, -above)]
    return 2 * min(tails) / float(density.sum())


def rescue_findings(rescued: Sequence[Parameter], beyond: Sequence[Parameter]) -> list[Finding]:
    """Parameters that are told by what was known before, as the poses alone do not tell them.

    Args:
        rescued: Those that other poses would tell.
        beyond: Those that no poses would.
    """
    kinds = ((Severity.WARNING, rescued, True), (Severity.NOTE, beyond, False))
    return [
        Finding.of(
            severity,
            WORDING,
            "rests_on_prior",
            parameters=tuple(one.name for one in some),
            other_poses=by_others,
        )
        for severity, some, by_others in kinds
        if some
    ]


def _contradicted(parameters: tuple[str, ...], p: float, earlier: bool) -> Finding:
    """A prior of some parameters that is as improbable."""
    return Finding.of(
        Severity.WARNING, WORDING, "prior_contradicted", parameters=parameters, p=p, earlier=earlier
    )


def known_findings(asked: Study, left: Mapping[str, AssumedJoint]) -> Iterator[Finding]:
    """Known compliances that are improbable by the measurements.

    Of a value v that is known to s, measurements make v' that is known to s'; the step ``v' - v``
    is normal, of variance ``s^2 - s'^2``. One of n counts if its probability is below an n-th.

    Args:
        asked: The study, with the values before.
        left: The joints as the measurements tell them, too, by name.
    """
    known = asked.specification.joints.known
    for name, one in known.items():
        now = left[name]
        variance = one.deviation**2 - now.std**2
        step = now.compliance - one.value
        if not step or variance <= 0:
            continue
        p = float(chi_square_tail(step**2 / variance, 1))
        if p < UNLIKELY / len(known):
            data = {
                "value": one.value,
                "std": one.deviation,
                "measured": now.compliance,
                "left": now.std,
                "p": p,
            }
            kind = "known_contradicted"
            yield Finding.of(Severity.WARNING, WORDING, kind, parameters=(name,), **data)


def unstated(asked: Study) -> dict[str, KnownCompliance]:
    """Known compliances whose standard deviation nobody stated, by joint."""
    known = asked.specification.joints.known
    return {name: one for name, one in known.items() if one.std is None and one.deviation}


def unstated_findings(
    asked: Study, errors: Mapping[str, tuple[float, ArrayLike]], total: ArrayLike
) -> Iterator[Finding]:
    """Known compliances whose standard deviation nobody stated, where the promise rests on it.

    A value v counts with `KNOWN_WITHIN` of it as its standard deviation s, and the posterior
    covariance C of all parameters follows. Where the joint is twice as soft, the prior's mean is
    off by v, and the estimates by ``C e_j v / s^2``: of the error e that goes with what is left of
    s, the standard deviation ``s' = sqrt(C_jj)``, that is ``v s' / s^2`` times. It is said where it
    would break the promise, of the task where it makes most.

    Args:
        asked: The study, with the values before.
        errors: By joint, s' [rad/(N m)] and e (t,) in each task [m].
        total: The errors (t,) that are promised [m].
    """
    promised = np.atleast_1d(np.asarray(total, dtype=float))
    softer = {
        name: np.atleast_1d(errors[name][1]) * one.value * errors[name][0] / one.deviation**2
        for name, one in unstated(asked).items()
        if name in errors
    }
    every = np.sqrt(np.square([promised, *softer.values()]).sum(axis=0))
    broken = np.where(every > TWICE * promised, every, 0.0)
    worst = int(broken.argmax())
    if not broken[worst]:
        return
    joints = tuple(name for name, error in softer.items() if error[worst] > SHARE * every[worst])
    data = {"total": float(promised[worst]), "softer": float(every[worst])}
    yield Finding.of(Severity.WARNING, WORDING, "known_unstated", parameters=joints, **data)


def _far_from_earlier(fit: Identification, prior: Prior) -> float:
    """Probability of an estimate that is as far from the earlier calibration's."""
    assert prior.earlier is not None
    off = fit.unbounded - prior.earlier.mean
    covariance = fit.covariance + prior.earlier.covariance
    scale = np.sqrt(np.diag(covariance))
    square = (off / scale) @ np.linalg.solve(covariance / np.outer(scale, scale), off / scale)
    return chance_of_square(float(square), len(off), fit.covariance_dof)


def chance_of_square(square: float, rank: int, dof: float) -> float:
    """Probability of as large a squared distance of so many numbers, noise of so many dof."""
    if np.isinf(dof):
        return float(chi_square_tail(square, rank))
    return float(fisher_tail(square / rank, rank, dof))


def posterior_findings(fitted: FittedData, prior: Prior, posterior: Posterior) -> Iterator[Finding]:
    """Compare prior, least squares and posterior.

    Args:
        fitted: The measurements and their fit.
        prior: Knowledge before the measurements.
        posterior: Knowledge after them.
    """
    if fitted.untold:
        # The estimate is the posterior's: no least-squares fit is there to be compared with it.
        yield Finding.of(Severity.WARNING, WORDING, "rests_on_prior", parameters=fitted.untold)
        return
    contradicted = list(prior_findings(fitted.fit, prior))
    yield from contradicted
    fit = fitted.fit
    distance = np.abs(posterior.mean - fit.k) / posterior.std
    i = int(distance.argmax())
    if distance[i] <= FAR_APART:
        return
    reason = "model"
    if contradicted:
        reason = "contradiction"
    elif fit.std[i] > WIDER * posterior.std[i]:
        reason = "prior"
    elif posterior.noise_names:
        reason = "noise"
    data = {
        "distance": float(distance[i]),
        "mean": float(posterior.mean[i]),
        "k": float(fit.k[i]),
        "reason": reason,
    }
    # Where the prior simply says more than few measurements, nothing is wrong.
    severity = Severity.NOTE if reason == "prior" else Severity.WARNING
    yield Finding.of(
        severity, WORDING, "posterior_differs", parameters=(fit.parameters[i],), **data
    )


def _rests_on_prior(data: Data) -> str:
    """Parameters that the measurements do not tell."""
    names = ", ".join(data["parameters"])
    if "other_poses" in data:
        by = "the measurements alone do not tell" if data["other_poses"] else "no poses alone tell"
        return (
            f"{by} {names}: values and bands rest on what is known before, in [prior] or "
            "known_rad_per_Nm"
        )
    return (
        f"the measurements alone do not tell {names}: least squares have no answer, and k and std "
        "are mean and standard deviation of the posterior, which rests on the [prior]"
    )


def _prior_contradicted(data: Data) -> str:
    """A prior under which the estimate is improbable."""
    p = data["p"]
    likely = f"p {shown_probability(p, 1)}"
    if data["earlier"]:
        return (
            f"the earlier calibration contradicts the measurements ({likely}): one of them is "
            "wrong, or the robot has changed"
        )
    return (
        f"the prior of {', '.join(data['parameters'])} contradicts the measurements ({likely}): "
        "one of them is wrong"
    )


def _posterior_differs(data: Data) -> str:
    """A posterior that is far from least squares."""
    return (
        f"{data['parameters'][0]}: the posterior's mean {data['mean']:.3g} is "
        f"{data['distance']:.2g} of its standard deviations from the fit's {data['k']:.3g}: "
        f"{BELIEVE[data['reason']]}"
    )


def _known_contradicted(data: Data) -> str:
    """A known compliance that is measured as another one."""
    return (
        f"{data['parameters'][0]} is known as {data['value']:.3g} +- {data['std']:.2g} rad/(N m) "
        f"and measured as {data['measured']:.3g} +- {data['left']:.2g} "
        f"(p {shown_probability(data['p'], 1)}), which is taken: is the known value wrong, or "
        "something else that bends alike?"
    )


def _known_unstated(data: Data) -> str:
    """Known values without a standard deviation."""
    names = ", ".join(data["parameters"])
    return (
        f"known_rad_per_Nm of {names} has no std, and the measurements hardly tell it: the error "
        f"of {1e3 * data['total']:.2g} mm takes it as right to {100 * KNOWN_WITHIN:.0f} %, "
        f"and were the joint twice as soft, it would be "
        f"{1e3 * data['softer']:.2g} mm; state {{ value, std }}, or identify it"
    )


WORDING: Wording = {
    "known_unstated": _known_unstated,
    "known_contradicted": _known_contradicted,
    "rests_on_prior": _rests_on_prior,
    "prior_contradicted": _prior_contradicted,
    "posterior_differs": _posterior_differs,
}
