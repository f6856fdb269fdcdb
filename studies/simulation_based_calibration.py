"""Is a sampler of posteriors right? Ranks of truths that are drawn from the prior.

A truth is drawn from the prior, a calibration is simulated and its posterior sampled. If the
sampler is right, the truth's rank among independent posterior draws is uniform, and 95 % intervals
hold the truth in 95 % of the cases (Talts et al., 2018).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf

import numpy as np
from scipy import stats
from threadpoolctl import threadpool_limits

from edtk import Study
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import simulate
from edtk.fit.noise import Noise
from edtk.fit.posterior import Posterior, SamplingOptions, sample_posterior
from edtk.fit.prior import Flat, HalfNormal, LogNormal, Normal, Prior
from edtk.fit.run_chain import Demand
from edtk.system.typing import Array
from edtk.system.workers import open_workers

PLAN = "table_4_12"
SEED = 2026

# Posterior draws a run, so that a rank is one of 100, in bins of five.
DRAWS = 99
BINS = 20

# Hundreds of independent samples are enough for a rank.
OPTIONS = SamplingOptions(Demand(accuracy=0.06, length=20.0))

# Runs that one process does before it takes the next ones.
RUNS_A_PIECE = 10


@dataclass(frozen=True)
class Case:
    """What is known a priori.

    Attributes:
        title: What a person reads.
        prior: From the study's compliances (p,), and the standard deviations (p,) that its plan
            gives, the prior from which truths are drawn.
        noise: What is assumed of sigma; where sigma is known to a factor, the true one is drawn
            too.
        coarser: Factor on sigma; where it is large the prior matters.
        flat: Sample with a flat prior all the same. With Jeffreys' prior of sigma and positivity
            irrelevant, ranks are uniform whatever the truth.
    """

    title: str
    prior: Callable[[Array, Array], Prior]
    noise: Noise
    coarser: float = 1.0
    flat: bool = False


def log_normal(k: Array, std: Array) -> Prior:
    """Each compliance known to a factor of two."""
    return Prior(tuple(LogNormal(float(median), 2.0) for median in k))


def half_normal(k: Array, std: Array) -> Prior:
    """Each compliance known to be of that size, or smaller."""
    return Prior(tuple(HalfNormal(float(scale)) for scale in k))


def earlier(k: Array, std: Array) -> Prior:
    """An earlier calibration, with ten times the errors of the plan, correlated by a half."""
    correlation = 0.5 * np.eye(len(k)) + 0.5
    return Prior((Flat(),) * len(k), Normal(k, 100 * correlation * np.outer(std, std)))


CASES = (
    Case("sigma known, log-normal prior", log_normal, Noise()),
    Case("sigma unknown, flat prior", log_normal, Noise(inf), flat=True),
    Case(
        "sigma 30 times as large, known to a factor 1.5, half-normal prior",
        half_normal,
        Noise(1.5),
        coarser=30.0,
    ),
    Case("sigma 10 times as large, after an earlier calibration", earlier, Noise(), coarser=10.0),
)


@dataclass(frozen=True, eq=False)
class Ranks:
    """Where the truth lay in some runs.

    Attributes:
        ranks: Ranks (runs, d) of the truth among DRAWS draws.
        covered: Whether the 95 % interval held it (runs, d).
    """

    ranks: Array
    covered: Array


def ranks(A: Array, sigma: Array, centre: Array, case: int, seeds: list[int]) -> Ranks:
    """Simulated calibrations, one a seed.

    Args:
        A: Regressors (m, rows, p).
        sigma: The study's noise per row (rows,) [m, rad].
        centre: The study's compliances (p,) [rad/(N m)].
        case: Which of the cases.
        seeds: One for each run.
    """
    of = CASES[case]
    std = estimate(A, A @ centre, sigma, _names(centre)).std
    truths = of.prior(centre, std)
    found = []
    inside = []
    with threadpool_limits(1):
        for seed in seeds:
            rng = np.random.default_rng([SEED, case, seed])
            truth, posterior = _simulated(A, sigma * of.coarser, of, truths, rng)
            samples = np.concatenate([posterior.samples, posterior.noise], axis=-1)
            found.append(_rank(truth, samples, posterior, rng))
            low, high = np.quantile(samples, [0.025, 0.975], axis=(0, 1))
            inside.append((low <= truth) & (truth <= high))
    return Ranks(np.array(found), np.array(inside))


def _simulated(
    A: Array, sigma: Array, of: Case, truths: Prior, rng: np.random.Generator
) -> tuple[Array, Posterior]:
    """A truth (d,), what is unknown of the noise included, and its posterior."""
    k = truths.draw(rng, 1)[0]
    s = 1.0
    if 1 < of.noise.sigma_factor < inf:
        s = of.noise.sigma_factor ** rng.standard_normal()
    measured = simulate(A, k, s * sigma, rng)[0]
    fit = estimate(A, measured, sigma, _names(k))
    prior = Prior.flat(len(k)) if of.flat else truths
    posterior = sample_posterior(
        A, measured, sigma, fit, rng, prior=prior, noise=of.noise, options=OPTIONS
    )
    return np.append(k, [s] * len(posterior.noise_names)), posterior


def _rank(truth: Array, samples: Array, posterior: Posterior, rng: np.random.Generator) -> Array:
    """Rank (d,) of a truth among draws from samples (steps, walkers, d) that are independent."""
    longest = max(*posterior.tau, *posterior.noise_tau)
    thinned = samples[:: int(np.ceil(longest))].reshape(-1, len(truth))
    return (rng.choice(thinned, DRAWS, replace=False) < truth).sum(axis=0)


def _names(k: Array) -> tuple[str, ...]:
    """Names of compliances (p,) that nobody reads."""
    return tuple(f"k{i}" for i in range(len(k)))


def uniformity(found: Array) -> Array:
    """P-values (d,) of the chi-square test that ranks (runs, d) are uniform, in BINS bins."""
    everything = (0, DRAWS + 1)
    counts = [np.histogram(column, bins=BINS, range=everything)[0] for column in found.T]
    return stats.chisquare(np.stack(counts), axis=1).pvalue


def run_case(
    study: Study, case: int, runs: int, workers: int | None, progress: Callable[[int], object]
) -> Ranks:
    """All runs of a case on the cores of this machine; progress is told of runs as they end."""
    A = plan_rows(study, PLAN)
    pieces = []
    for first in range(0, runs, RUNS_A_PIECE):
        seeds = list(range(first, min(first + RUNS_A_PIECE, runs)))
        pieces.append(partial(ranks, A, study.sigma, study.compliances, case, seeds))
    found: dict[int, Ranks] = {}
    with open_workers(workers) as pool:
        for i, piece in pool.run(pieces):
            found[i] = piece
            progress(len(piece.ranks))
    # Pieces end in any order; the answer must not depend on it.
    parts = [found[i] for i in sorted(found)]
    return Ranks(
        np.concatenate([part.ranks for part in parts]),
        np.concatenate([part.covered for part in parts]),
    )


def plan_rows(study: Study, name: str) -> Array:
    """Regressors (m, rows, p) of a published plan's measurements."""
    plan = study.published_plans()[name]
    return np.repeat(study.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0)
