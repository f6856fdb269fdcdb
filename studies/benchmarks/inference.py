"""How long do identification and the sampled posterior take, and how near does that come to the closed form?

    python studies/benchmarks/inference.py

writes inference.md beside this file. With a flat prior and sigma known the posterior is normal, and Eq. (13) gives its
standard deviations at once; the chain's are held against them, in units of their Monte-Carlo errors.
"""

import statistics
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from measure import machine, measure

from edtk.design.plan import Plan
from edtk.inference.identify import identify
from edtk.inference.least_squares import estimate
from edtk.inference.measurements import Measurements
from edtk.inference.noise import Noise
from edtk.inference.sample_posterior import sample_posterior
from edtk.inference.simulate import simulate
from edtk.report.markdown_table import markdown_table
from edtk.study.study import load_study
from edtk.system.atomic_file import write_text
from edtk.tables.sheet_columns import DEFLECTION_COLUMNS, MARKER_COLUMNS

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


def identification(rows: int, markers: bool, robust: bool) -> tuple[float, float]:
    """Median seconds to read a file of so many measurements, and to identify from it with all statistics."""
    study = load_study(STUDY)
    plan = study.published_plans()["table_4_12"]
    each = np.arange(rows) % len(plan.q)
    q, wrench = plan.q[each], plan.wrench[each]
    measured = simulate(
        study.model.regressor(q, wrench), study.compliances, study.sigma, np.random.default_rng(0)
    )[0]
    table = Plan(q, wrench, np.ones(rows, dtype=int)).to_frame(study.robot).drop(columns="repeats")
    table[list(DEFLECTION_COLUMNS)] = 1e3 * measured
    if markers:
        table[list(MARKER_COLUMNS)] = 0.001
    reading, fitting = [], []
    with TemporaryDirectory() as folder:
        path = Path(folder) / "measured.csv"
        table.to_csv(path, index=False, float_format="%.10g")
        for _ in range(REPEATS):
            start = perf_counter()
            data = Measurements.from_csv(path, study.robot, study.fixed, None, study.sigma)
            reading.append(perf_counter() - start)
            start = perf_counter()
            A = data.regressor(study.model)
            identify(A, data.deflection, data.sigma, study.model.parameters, robust)
            fitting.append(perf_counter() - start)
    return statistics.median(reading), statistics.median(fitting)


def calibration(case: int) -> float:
    """Seconds of 500 simulated calibrations on all cores, each with its chain, ranks and intervals."""
    sys.path.insert(0, str(HERE.parent))
    from calibration_check import run_case

    start = perf_counter()
    run_case(load_study(STUDY), case, 500, None, lambda runs: None)
    return perf_counter() - start


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
    kinds = {"": (False, False), "with markers": (True, False), "Huber's loss": (False, True)}
    calibrate = []
    for n in (1_000, 100_000):
        for kind, options in kinds.items():
            got = measure(identification, n, *options)
            calibrate.append(
                (f"{n}", kind, *(f"{s:.3f}" for s in got.answer), f"{got.peak_mb:.0f}")
            )
    studies = [
        (title, f"{calibration(case):.0f}")
        for title, case in (("sigma known", 0), ("sigma unknown", 1))
    ]
    header = (
        "plan", "noise", "chain [s]", "closed form [ms]", "steps", "error of std", "deviation [errors]",
    )  # fmt: skip
    text = (
        "# Seconds of identification and posterior\n\n"
        f"`python studies/benchmarks/inference.py` wrote this file on {machine()}.\n\n"
        "## Sampled posterior\n\n"
        f"KUKA KR 270, flat prior, 32 walkers, the accuracy that `edtk bayes` asks for; medians of {REPEATS} simulated "
        "calibrations. The error of std is the greatest Monte-Carlo error of a posterior standard deviation. The "
        f"deviation is the greatest distance of the {5 * REPEATS} sampled standard deviations from the closed form, "
        "Eq. (13), in such errors; of as many independent normal numbers the greatest is 2.2 in the median and below "
        "3.5 in 99 cases of a hundred.\n\n"
        + markdown_table(header, rows)
        + "\n## Identification\n\nMedians of "
        f"{REPEATS}; a measurement is three coordinates. Statistics are all those of `edtk identify`.\n\n"
        + markdown_table(
            ("measurements", "kind", "read CSV [s]", "identify [s]", "peak memory [MB]"), calibrate
        )
        + "\n## Simulation-based calibration\n\n500 simulated calibrations of `studies/calibration_check.py`, all "
        "cores.\n\n" + markdown_table(("case", "seconds"), studies)
    )
    write_text(HERE / "inference.md", text)


if __name__ == "__main__":
    main()
