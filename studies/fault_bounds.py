"""What the best possible test, and the best possible naming, of a fault would reach.

*Detection*: of all tests with the same share of false alarms, the likelihood ratio of the fault,
whose direction, joint and pose are drawn by chance, against good data finds most (Neyman and
Pearson). It knows which fault to look for, and its size.

*Naming*: where all causes are equally likely beforehand, naming the one with the largest mean
likelihood is right most often, on the average over the causes (Bayes). It knows the sizes that
faults have in this study; or knows them only within a factor of SPREAD.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from fault_signals import AS_BEFORE, Alternative, log_mean_exp, signals_of
from faults import FAULTS

from edtk import Study
from edtk.fit.distributions import chi_square_quantile
from edtk.system.typing import Array

LEVEL = 0.01  # false alarms of the test of all residuals alike
SPREAD = 2.5
FACTORS = tuple(SPREAD ** np.linspace(-1, 1, 5))
GOOD = 2000  # simulated residuals without a fault
WITH_FAULT = 400  # and with each
CAUSES = {fault.title: fault.cause for fault in FAULTS}
SEEN_BEFORE = {title for *_, title, _ in AS_BEFORE}  # other sizes of a fault that has its row


@dataclass(frozen=True)
class Bound:
    """Shares of sheets [%] with a fault.

    Attributes:
        plain: That the sum of squares of all residuals alone detects, with p < 0.01.
        detected: That the best possible test detects.
        named: Of those detected by a test for all faults at once, that the best possible naming
            names right, where sizes are known.
        named_unknown: The same where sizes are known within a factor only.
    """

    plain: float
    detected: float
    named: float
    named_unknown: float


def bounds(
    study: Study, plans: Sequence[Array], false_alarms: float, seed: int
) -> dict[str, Bound]:
    """The mean of what is possible with each of some plans, for each fault by its title.

    Args:
        study: The study of a robot.
        plans: Joint variables (N, n) of the rows of each plan [rad].
        false_alarms: Share of good sheets that are detected.
        seed: Of the simulations.
    """
    counted: dict[str, list[Array]] = {}
    for number, q in enumerate(plans):
        rng = np.random.default_rng((seed, number))
        poses_of = np.unique(q, axis=0, return_inverse=True)[1].ravel()
        known = signals_of(study, q, poses_of)
        for title, counts in _count(known, false_alarms, rng).items():
            counted.setdefault(title, []).append(counts)
    found = {}
    for title, rows in counted.items():
        plain, detected, *rest = np.mean(rows, axis=0)
        seen, right, unknown_seen, unknown_right = rest
        found[title] = Bound(
            100 * plain,
            100 * detected,
            100 * right / max(seen, 1e-9),
            100 * unknown_right / max(unknown_seen, 1e-9),
        )
    return found


def _count(
    known: Mapping[str, Alternative], false_alarms: float, rng: np.random.Generator
) -> dict[str, Array]:
    """Shares (6,) for one plan: plain, detected, and twice detected by all and named right."""
    unknown = {title: _of_unknown_size(title, one) for title, one in known.items()}
    d = next(iter(known.values())).draw(rng, 1).shape[1]
    good = rng.standard_normal((GOOD, d))
    quantile = float(chi_square_quantile(1 - LEVEL, d))
    limits = [
        np.quantile(log_mean_exp(_by_cause(which, good)[1]), 1 - false_alarms)
        for which in (known, unknown)
    ]
    found = {}
    for title in known:
        if title not in CAUSES:
            continue
        r = known[title].draw(rng, WITH_FAULT)
        own = known[title].log_ratio
        counts = [
            ((r**2).sum(axis=1) > quantile).mean(),
            (own(r) > np.quantile(own(good), 1 - false_alarms)).mean(),
        ]
        for which, limit in zip((known, unknown), limits, strict=True):
            causes, ratios = _by_cause(which, r)
            seen = log_mean_exp(ratios) > limit
            right = np.array(causes)[ratios.argmax(axis=0)] == CAUSES[title]
            counts += [seen.mean(), (seen & right).mean()]
        found[title] = np.array(counts)
    return found


def _by_cause(known: Mapping[str, Alternative], r: Array) -> tuple[list[str], Array]:
    """Causes, and logarithms (causes, n) of their mean likelihood ratios."""
    found: dict[str, list[Array]] = {}
    for title, one in known.items():
        if title in SEEN_BEFORE:
            continue
        found.setdefault(CAUSES.get(title, title), []).append(one.log_ratio(r))
    return list(found), np.stack([log_mean_exp(np.stack(parts)) for parts in found.values()])


def _of_unknown_size(title: str, one: Alternative) -> Alternative:
    """A fault of one of several sizes; poses, outliers and noise are drawn from wide ranges."""
    return one if CAUSES.get(title) in ("pose", "outlier") else one.of_sizes(FACTORS)
