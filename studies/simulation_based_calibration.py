"""Is a sampler of posteriors right? Ranks of truths that are drawn from the prior.

A truth is drawn from the prior, a calibration is simulated and its posterior sampled. If the
sampler is right, the truth's rank among independent posterior draws is uniform, and 95 % intervals
hold the truth in 95 % of the cases (Talts et al., 2018).

The prior of geometry is flat. Truths are drawn a hundred times as wide as their posteriors, within
which that makes no difference. Sizes of errors are not told to the fit, but estimated by it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf

import numpy as np
from scipy import stats
from threadpoolctl import threadpool_limits

from edtk import Study
from edtk.fit.fit_geometry import NU, fit_geometry
from edtk.fit.fitted_geometry import GeometricFit, loading_of
from edtk.fit.geometry_posterior import GeometryDensity, geometry_posterior, many_seen
from edtk.fit.least_squares import estimate
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.measurements import simulate
from edtk.fit.noise import Noise
from edtk.fit.posterior import Posterior, SamplingOptions, sample_posterior
from edtk.fit.prior import Flat, HalfNormal, LogNormal, Normal, Prior
from edtk.fit.run_chain import Demand
from edtk.measure.measured_model import MeasuredModel
from edtk.study.study_geometry import StudyGeometry
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


@dataclass(frozen=True)
class GeometryCase:
    """Sheets of positions of an arm whose geometry errs.

    Attributes:
        title: What a person reads.
        geometry: Which parameters of the joints are asked for.
        springs: Joints whose compliances are.
        poses: Poses in a sheet.
        markers: Markers on the tool; one where they are at their places.
        robust: Whether errors of a pose are multivariate t, and fitted as such.
    """

    title: str
    geometry: str | list[str]
    springs: tuple[str, ...]
    poses: int
    markers: int
    robust: bool = False

    @property
    def setting(self) -> StudyGeometry:
        """The question."""
        places = [[100, 0, 50], [-50, 80, 60], [0, -70, 90]][: self.markers]
        study = Study(
            robot="kuka_kr270",
            parameters={
                "geometry": self.geometry,
                "compliance": list(self.springs),
                "base": True,
                "tool": self.markers > 1,
            },
            measurement={"sigma_mm": WHITE_MM},
            load={"list_F_N": [[0, 0, 0], [0, 0, -2500]]},
            marker=[
                {"name": name, "position_mm": place}
                for name, place in zip("ABC", places, strict=False)
            ],
        )
        return StudyGeometry.of(study)


# True errors of a reading, and of a joint, anew in each pose. The fit knows the first.
WHITE_MM = 0.05
JOINTS_MRAD = 0.05
DOWN = np.array([0.0, 0.0, -2500.0, 0.0, 0.0, 0.0])  # [N, N m]
# Standard deviation of true parameters [mm, mrad], and the range of true compliances
# [1e-6 rad/(N m)].
OFF = 0.7
SOFT = (0.5, 3.0)
PLACES = 3  # poses in which predicted positions of a loaded marker are ranked
MOST_DRAWS = 1000  # of which intervals are made

GEOMETRY_CASES = (
    GeometryCase("two tilts and two springs, by a chain", ["q2.ry", "q3.ry"], ("q2", "q3"), 16, 1),
    GeometryCase(
        "all geometry and five springs, by weighted draws",
        "all",
        ("q2", "q3", "q4", "q5", "q6"),
        40,
        3,
    ),
    GeometryCase(
        "all geometry and two springs, t errors and --robust",
        "all",
        ("q2", "q3"),
        40,
        3,
        robust=True,
    ),
)


@cache
def told(case: int) -> tuple[str, ...]:
    """Parameters that sheets of a case tell, as one without errors does; only these err."""
    of = GEOMETRY_CASES[case]
    data = _sheet(of, np.random.default_rng([SEED, case]), of.setting.model, None)
    return tuple(one.name for one in _fit(of, data).fitted.model.parameters)


def geometry_ranks(case: int, seeds: Sequence[int]) -> Ranks:
    """Simulated calibrations of geometry, one a seed: ranks of predictions, and of parameters.

    Args:
        case: Which of the cases of geometry.
        seeds: One for each run.

    Returns:
        Ranks of the coordinates of a marker in further poses, and of the parameters of joints and
        springs where these are asked for by name. Of all geometry each sheet has a minimal set of
        its own, whose values stand for those of others; base and tool depend on where a fit begins.
    """
    of = GEOMETRY_CASES[case]
    setting = of.setting
    names = told(case)
    true_model = setting.model.with_parameters(
        tuple(one for one in setting.model.parameters if one.name in names)
    )
    found = []
    inside = []
    with threadpool_limits(1):
        for seed in seeds:
            rng = np.random.default_rng([SEED, case, seed])
            theta = _truth(true_model, rng)
            fit = _fit(of, _sheet(of, rng, true_model, theta))
            if fit.rank != len(names):
                raise RuntimeError(f"the sheet of seed {seed} tells {fit.rank} parameters")
            density = GeometryDensity.of(fit, setting.loads, of.robust)
            posterior = geometry_posterior(density, rng, OPTIONS)
            draws = _independent(posterior, rng)
            q = _poses(true_model, rng, PLACES)
            values = _ranked(of, density.model, draws, q)
            truth = _ranked(of, true_model, theta[None] / true_model.scales, q)[0]
            found.append((values[:DRAWS] < truth).sum(axis=0))
            low, high = np.quantile(values, [0.025, 0.975], axis=0)
            inside.append((low <= truth) & (truth <= high))
    return Ranks(np.array(found), np.array(inside))


def ranked_names(case: int) -> tuple[str, ...]:
    """What is ranked in a case of geometry."""
    named = isinstance(GEOMETRY_CASES[case].geometry, list)
    own = (name for name in told(case) if named and not name.startswith(("base", "tool")))
    return (*own, *(f"{axis} in pose {i + 1}" for i in range(PLACES) for axis in "xyz"))


def _truth(model: MeasuredModel, rng: np.random.Generator) -> Array:
    """Parameters (p,) in SI units."""
    soft = rng.uniform(*SOFT, model.p)
    springs = np.array([one.place == "compliance" for one in model.parameters])
    return np.where(springs, soft, rng.normal(0, OFF, model.p)) * model.scales


def _poses(model: MeasuredModel, rng: np.random.Generator, count: int) -> Array:
    """Poses (m, n) anywhere within the limits [rad]."""
    lower, upper = model.robot.limits
    return np.asarray(rng.uniform(lower, upper, (count, model.robot.n)))


def _sheet(
    of: GeometryCase, rng: np.random.Generator, model: MeasuredModel, theta: Array | None
) -> MarkerPositions:
    """Positions in random poses, half of them loaded; without errors where nothing errs."""
    q = _poses(model, rng, of.poses)
    wrench = np.tile(DOWN, (of.poses, 1))
    wrench[::2] = 0.0
    row = np.tile(np.arange(of.poses)[:, None], (1, of.markers))
    blank = MarkerPositions(q, wrench, np.zeros((*row.shape, 3)), row, model.markers)
    errs = theta is not None
    theta = np.zeros(model.p) if theta is None else theta
    # Heavy tails are of whole poses: one factor each, of mean square one over nu - 2.
    scale = np.ones((of.poses, 1))
    if of.robust:
        scale = np.sqrt(NU / rng.chisquare(NU, (of.poses, 1)))
    turned = q + errs * 1e-3 * JOINTS_MRAD * scale * rng.standard_normal(q.shape)
    torque = loading_of(model.bending(theta), blank, of.setting.loads)
    points = model.see(theta, turned, torque, derivatives=False).points
    white = 1e-3 * WHITE_MM * scale[..., None] * rng.standard_normal(points.shape)
    return replace(blank, measured=points + errs * white)


def _fit(of: GeometryCase, data: MarkerPositions) -> GeometricFit:
    setting = of.setting
    return fit_geometry(setting.model, data, setting.noise, setting.loads, of.robust)


def _independent(posterior: Posterior, rng: np.random.Generator) -> Array:
    """Some independent draws (s, p) of equal weight, in random order."""
    step = 1 if posterior.weights is not None else int(np.ceil(posterior.tau.max()))
    flat = posterior.evenly().samples[::step].reshape(-1, posterior.samples.shape[-1])
    return np.asarray(flat[rng.permutation(len(flat))[:MOST_DRAWS]])


def _ranked(of: GeometryCase, model: MeasuredModel, draws: Array, q: Array) -> Array:
    """Values (s, d) of parameters that were asked for by name, and of a marker's coordinates."""
    named = isinstance(of.geometry, list)
    own = [named and one.place in ("joint", "compliance") for one in model.parameters]
    loads = of.setting.loads
    torque = None if loads is None else loads(q, np.tile(DOWN, (len(q), 1)))
    points = many_seen(model, draws * model.scales, q, torque).points[:, :, 0]
    return np.concatenate([draws[:, own], points.reshape(len(draws), -1)], axis=1)


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
    return _in_pieces(
        partial(ranks, A, study.sigma, study.compliances, case), runs, workers, progress
    )


def run_geometry_case(
    case: int, runs: int, workers: int | None, progress: Callable[[int], object]
) -> Ranks:
    """The same of a case of geometry."""
    return _in_pieces(partial(geometry_ranks, case), runs, workers, progress)


def _in_pieces(
    call: Callable[[list[int]], Ranks],
    runs: int,
    workers: int | None,
    progress: Callable[[int], object],
) -> Ranks:
    """The ranks of all runs, some at a time, on several cores."""
    pieces = []
    for first in range(0, runs, RUNS_A_PIECE):
        seeds = list(range(first, min(first + RUNS_A_PIECE, runs)))
        pieces.append(partial(call, seeds))
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
