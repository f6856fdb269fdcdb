"""How long does the sampled check of a plan take, and how near does it come to the closed form?

    python studies/benchmarks/inference.py

writes inference.md beside this file. With a flat prior and sigma known the posterior is normal, and Eq. (13) gives its
standard deviations at once; the chain's are held against them, in units of their Monte-Carlo errors.
"""

import statistics
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from measure import machine, measure

from edtk.atomic import write_text
from edtk.inference import Noise, estimate, sample_posterior, simulate
from edtk.study import load_study
from edtk.study.markdown import markdown_table

HERE = Path(__file__).parent
STUDY = HERE.parent / "kr270_milling.toml"
REPEATS = 5
CASES = {
    "normal, sigma known": Noise(),
    "normal, sigma unknown": Noise(np.inf),
    "Student-t, nu and sigma unknown": Noise(np.inf, None),
}


@dataclass(frozen=True)
class Timing:
    """Of one plan and noise.

    Attributes:
        seconds: Median seconds of the chain.
        exact: Median seconds of the closed form.
        steps: Median steps.
        error: Greatest Monte-Carlo error of a standard deviation, relative to it.
        off: Greatest deviation of a standard deviation from Eq. (13), in Monte-Carlo errors.
    """

    seconds: float
    exact: float
    steps: float
    error: float
    off: float


def timing(plan_name: str, case: str) -> Timing:
    """Chains of REPEATS seeds."""
    study = load_study(STUDY)
    plan = study.published_plans()[plan_name]
    A = np.repeat(study.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0)
    seconds, exact, steps, errors, off = [], [], [], [], []
    for seed in range(REPEATS):
        rng = np.random.default_rng(seed)
        measured = simulate(A, study.compliances, study.sigma, rng)[0]
        start = perf_counter()
        fit = estimate(A, measured, study.sigma, study.model.parameters)
        std = np.sqrt(np.diag(fit.covariance))
        exact.append(perf_counter() - start)
        start = perf_counter()
        found = sample_posterior(A, measured, study.sigma, fit, rng, noise=CASES[case])
        seconds.append(perf_counter() - start)
        steps.append(found.steps)
        errors.append((found.std_error / found.std).max())
        off.append((np.abs(found.std - std) / found.std_error).max())
    median = statistics.median
    return Timing(median(seconds), median(exact), median(steps), max(errors), max(off))


def main() -> None:
    """Run the benchmark."""
    plans = load_study(STUDY).published_plans()
    asked = [(name, "normal, sigma known") for name in plans]
    asked += [("table_4_12", case) for case in CASES if case != "normal, sigma known"]
    rows = []
    for name, case in asked:
        got = measure(timing, name, case).answer
        off = f"{got.off:.1f}" if case == "normal, sigma known" else "-"
        rows.append(
            (
                name,
                case,
                f"{got.seconds:.2f}",
                f"{1e3 * got.exact:.2f}",
                f"{got.steps:.0f}",
                f"{100 * got.error:.2f} %",
                off,
            )
        )
    header = (
        "plan", "noise", "chain [s]", "closed form [ms]", "steps", "error of std", "deviation [errors]",
    )  # fmt: skip
    text = (
        "# Seconds of the sampled posterior\n\n"
        f"`python studies/benchmarks/inference.py` wrote this file on {machine()}.\n\n"
        f"KUKA KR 270, flat prior, 32 walkers, the accuracy that `edtk bayes` asks for; medians of {REPEATS} simulated "
        "calibrations. The error of std is the greatest Monte-Carlo error of a posterior standard deviation. The "
        f"deviation is the greatest distance of the {5 * REPEATS} sampled standard deviations from the closed form, "
        "Eq. (13), in such errors; of as many independent normal numbers the greatest is 2.2 in the median and below "
        "3.5 in 99 cases of a hundred.\n\n" + markdown_table(header, rows)
    )
    write_text(HERE / "inference.md", text)


if __name__ == "__main__":
    main()
