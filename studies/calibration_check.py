"""Is the check of `edtk bayes` itself right? Simulation-based calibration, and Eq. (13).

    python studies/calibration_check.py

writes calibration_check.md beside this file. A truth is drawn from the prior, a calibration is
simulated and its posterior sampled. If the sampler is right, the truth's rank among independent
posterior draws is uniform, and 95 % intervals hold the truth in 95 % of the cases (Talts et al.,
2018). Least squares is held against Eq. (13).
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from time import perf_counter

import click
import numpy as np
from scipy import stats
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from edtk import Study, load_study
from edtk.inference.least_squares import estimate
from edtk.inference.noise import Noise
from edtk.inference.posterior import Posterior
from edtk.inference.prior import Flat, HalfNormal, LogNormal, Normal, Prior
from edtk.inference.run_chain import Demand
from edtk.inference.sample_posterior import SamplingOptions, sample_posterior
from edtk.inference.simulate import simulate
from edtk.report.markdown_table import markdown_table
from edtk.system.atomic_file import write_text
from edtk.system.typing import Array
from edtk.system.workers import open_workers

HERE = Path(__file__).parent
PLAN = "table_4_12"
SEED = 2026

# Posterior draws a run, so that a rank is one of 100, in bins of five.
DRAWS = 99
BINS = 20

# Hundreds of independent samples are enough for a rank.
OPTIONS = SamplingOptions(Demand(accuracy=0.06, length=20.0))

# Runs that one process does before it takes the next ones.
RUNS_A_PIECE = 10
RUNS_OF_LEAST_SQUARES = 20_000

# What holds: p-values of everything together above 1 %, coverage of intervals 93 to 97 % on
# average, and of each parameter within so many standard errors of 95 %.
LEAST_P = 0.01
COVERAGE = (0.93, 0.97)
MOST_ERRORS = 3.5


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


def least_squares(
    A: Array, sigma: Array, k: Array, rng: np.random.Generator, runs: int
) -> tuple[float, float]:
    """Greatest deviation of the empirical covariance from Eq. (13), and a p-value of all of them.

    In whitened parameters n times the empirical covariance is Wishart's: its diagonal has variance
    2/n, the rest 1/n. The deviation is of an entry, in those standard errors; their squares sum to
    about chi-square.
    """
    measured = simulate(A, k, sigma, rng, runs)
    fit = estimate(A, measured, sigma, _names(k))
    whitener = np.linalg.inv(np.linalg.cholesky(fit.covariance))
    z = (fit.k - k) @ whitener.T
    S = z.T @ z / runs - np.eye(len(k))
    i, j = np.tril_indices(len(k))
    deviations = S[i, j] * np.sqrt(runs / np.where(i == j, 2.0, 1.0))
    together = stats.chi2.sf((deviations**2).sum(), len(deviations))
    return float(np.abs(deviations).max()), float(together)


@dataclass(frozen=True)
class Verdict:
    """Whether a case holds, and by which numbers.

    Attributes:
        p: P-value of all parameters' ranks together.
        mean: Mean coverage of the 95 % intervals.
        off: Greatest distance of one parameter's coverage from 95 %, in standard errors.
    """

    p: float
    mean: float
    off: float

    @property
    def holds(self) -> bool:
        """Whether ranks are uniform and intervals cover."""
        least, most = COVERAGE
        return self.p > LEAST_P and least <= self.mean <= most and self.off < MOST_ERRORS

    def cells(self) -> list[str]:
        """As a row of the table."""
        word = "holds" if self.holds else "does not hold"
        return [f"{self.p:.3f}", f"{100 * self.mean:.1f} %", f"{self.off:.1f}", word]


def verdict_of(p: Array, covered: Array, runs: int) -> Verdict:
    """A case's verdict from the parameters' p-values (d,) and shares of intervals (d,) that cover.

    The least of d p-values counts d times. A single parameter's coverage has a standard error of
    1 % in 500 runs.
    """
    together = min(1.0, float(p.min() * len(p)))
    off = float(np.abs(covered - 0.95).max()) / np.sqrt(0.95 * 0.05 / runs)
    return Verdict(together, float(covered.mean()), off)


@click.command()
@click.option("--runs", default=500, show_default=True, help="Simulated calibrations per case.")
@click.option("--workers", type=int, help="Processes [default: one a core].")
def main(runs: int, workers: int | None) -> None:
    """Run the study; exit code 1 if something does not hold."""
    study = load_study(HERE / "kr270_milling.toml")
    rows = []
    verdicts = []
    good = True
    with tqdm(total=runs * len(CASES), unit="run") as bar:
        for i, case in enumerate(CASES):
            start = perf_counter()
            found = run_case(study, i, runs, workers, bar.update)
            seconds = perf_counter() - start
            p = uniformity(found.ranks)
            covered = found.covered.mean(axis=0)
            names = (*study.model.parameters, *case.noise.names)
            for name, a, b in zip(names, p, covered, strict=True):
                rows.append((case.title, name, f"{a:.3f}", f"{100 * b:.1f} %"))
            verdict = verdict_of(p, covered, runs)
            verdicts.append((case.title, *verdict.cells(), f"{seconds:.0f}"))
            good = good and verdict.holds
    fits = _fits_of_all_plans(study)
    good = good and min(p for _, _, p in fits) * len(fits) > LEAST_P
    write_text(HERE / "calibration_check.md", _page(runs, verdicts, rows, fits))
    sys.exit(0 if good else 1)


def _fits_of_all_plans(study: Study) -> list[tuple[str, float, float]]:
    """Name, greatest deviation from Eq. (13) and p-value of every published plan."""
    rng = np.random.default_rng(SEED)
    found = []
    for name in study.published_plans():
        A = plan_rows(study, name)
        runs = RUNS_OF_LEAST_SQUARES
        found.append((name, *least_squares(A, study.sigma, study.compliances, rng, runs)))
    return found


def _page(
    runs: int,
    verdicts: list[tuple[str, ...]],
    rows: list[tuple[str, ...]],
    fits: list[tuple[str, float, float]],
) -> str:
    """The report, as Markdown."""
    head = (
        "case",
        "p-value, all parameters",
        "coverage, mean",
        "farthest from 95 % [errors]",
        "verdict",
        "seconds",
    )
    details = ("case", "parameter", "p-value of uniform ranks", "coverage of 95 % intervals")
    deviations = [(name, f"{z:.2f}", f"{p:.3f}") for name, z, p in fits]
    error = f"{100 * np.sqrt(0.95 * 0.05 / runs):.1f} %"
    accuracy = f"{100 * OPTIONS.demand.accuracy:g} %"
    return (
        "# Are the posterior and Eq. (13) right?\n\n"
        "`python studies/calibration_check.py` wrote this file; it ends with code 1 if something "
        "does not hold.\n\n"
        "## Simulation-based calibration\n\n"
        f"KUKA KR 270, {PLAN}, {runs} simulated calibrations per case, truths drawn from priors "
        "about the study's compliances: log-normal of factor 2, half-normal, or normal with ten "
        f"times the errors of the plan. Ranks among {DRAWS} independent draws in {BINS} bins; "
        f"chains with a Monte-Carlo error of standard deviations below {accuracy}. The test over "
        "all parameters of a case multiplies the least p-value by their number. Were the sampler "
        "exact, p-values would be below 1 % in one case of a hundred, and one parameter's coverage "
        f"would have a standard error of {error}.\n\n"
        f"{markdown_table(head, verdicts)}\n{markdown_table(details, rows)}\n"
        "## Least squares\n\n"
        f"Empirical covariance of {RUNS_OF_LEAST_SQUARES} simulated calibrations against Eq. (13), "
        "in whitened parameters: the entry that deviates most, in its standard errors, and the "
        "chi-square test of all 15 entries together.\n\n"
        f"{markdown_table(('plan', 'greatest deviation', 'p-value'), deviations)}"
    )


if __name__ == "__main__":
    main()
