"""Is M^-1 the covariance of calibrations with a tracker's noise? 200,000 of each robot, simulated.

    python studies/tracker_noise.py

writes tracker_noise.md beside this file. Nothing of the simulation knows a covariance: the joints
of each reading miss their angles, the reflectors are where the robot's kinematics puts them, and
the tracker errs along and across its beam to each. Poses are random, some of them visited several
times; all visits of a pose share what the model leaves out. The estimate weighs each visit by
`VisitNoise`, and its sample covariance stands beside M^-1.
"""

from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm
from tracked_robots import tracked_robots

from edtk import Study
from edtk.design.candidate_source import sample_feasible
from edtk.design.plan import Plan
from edtk.measure.whitening import Whitener
from edtk.report.tables import markdown_table
from edtk.system.files import write_text

HERE = Path(__file__).parent
Array = NDArray[np.float64]

SEED = 2026
REPEATS = np.array([1, 1, 2, 1, 3, 1, 2, 1])  # visits of the poses of a plan
BATCH = 1000  # calibrations that are simulated at once
ALLOWED = 0.01  # of variances, as the issue asks for it


def random_plan(study: Study, seed: int) -> Plan:
    """Random feasible poses with their visits."""
    space = study.space
    return space.plan(sample_feasible(space, len(REPEATS), seed), REPEATS)


def simulated(study: Study, plan: Plan, runs: int, rng: np.random.Generator) -> Array:
    """Displacements (runs, visits, rows) of the visits of a plan [m]."""
    noise = study.noise
    assert noise is not None
    visits = np.repeat(np.arange(len(plan.q)), plan.repeats)
    q = np.broadcast_to(plan.q[visits], (runs, len(visits), study.robot.n))
    unloaded = _reading(study, q, rng)
    loaded = _reading(study, q, rng)
    bent = study.model.regressor(plan.q, plan.wrench) @ study.compliances
    left_out = noise.discrepancy * rng.standard_normal((runs, len(plan.q), len(noise.white)))
    own = noise.white * rng.standard_normal(loaded.shape)
    return loaded - unloaded + bent[visits] + left_out[:, visits] + own


def _reading(study: Study, q: Array, rng: np.random.Generator) -> Array:
    """Positions (..., rows) of the reflectors as the tracker sees them, the robot at q (..., n)."""
    noise = study.noise
    assert noise is not None
    assert noise.tracker is not None
    missed = q + noise.repeatability * rng.standard_normal(q.shape)
    points = np.moveaxis(study.model.points_of(study.model.frames(missed)), (0, 1), (-2, -1))
    beam = points - noise.tracker.position
    r = np.linalg.norm(beam, axis=-1, keepdims=True)
    u = beam / r
    any_way = rng.standard_normal(points.shape)
    across = any_way - u * (u * any_way).sum(axis=-1, keepdims=True)
    along = u * rng.standard_normal(r.shape)
    seen = (
        points + _error(noise.tracker.along, r) * along + _error(noise.tracker.across, r) * across
    )
    return seen.reshape(*seen.shape[:-2], -1)


def _error(coefficients: tuple[float, float], r: Array) -> Array:
    return coefficients[0] + coefficients[1] * r


def weights(study: Study, plan: Plan) -> Array:
    """The linear estimator (p, poses, rows) of the means over the visits of each pose."""
    noise = study.noise
    assert noise is not None
    frames = study.model.frames(plan.q)
    whitener = Whitener.of(noise.covariance_of(study.model, frames, plan.wrench, plan.repeats))
    A = study.model.regressor_of(frames, plan.wrench)
    seen = whitener.transposed(whitener.rows(A)) * plan.repeats
    M = study.space.information(plan)
    return np.linalg.solve(M, seen.transpose(0, 2, 1).reshape(len(M), -1)).reshape(
        len(M), len(plan.q), -1
    )


def estimates(study: Study, plan: Plan, runs: int, seed: int) -> Array:
    """Compliances (runs, p) of simulated calibrations [rad/(N m)]."""
    rng = np.random.default_rng(seed)
    H = weights(study, plan)
    first = np.concatenate([[0], np.cumsum(plan.repeats)[:-1]])
    found = []
    for start in tqdm(range(0, runs, BATCH), desc=study.robot.name, leave=False):
        y = simulated(study, plan, min(BATCH, runs - start), rng)
        means = np.add.reduceat(y, first, axis=1) / plan.repeats[:, None]
        found.append(np.einsum("pkr,bkr->bp", H, means))
    return np.concatenate(found)


def compared(study: Study, plan: Plan, k: Array) -> tuple[float, float, float, float]:
    """How far a sample covariance is from M^-1, and how far white noise would be.

    Returns:
        Largest relative error of a variance; largest entry of ``L' C L - I`` with ``M = L L'``;
        the same of a variance that white noise of the same mean square would promise; largest bias
        in standard deviations.
    """
    M = study.space.information(plan)
    expected = np.linalg.inv(M)
    C = np.cov(k.T)
    of_variance = np.abs(np.diag(C) / np.diag(expected) - 1).max()
    L = np.linalg.cholesky(M)
    of_matrix = np.abs(L.T @ C @ L - np.eye(len(M))).max()
    noise = study.noise
    assert noise is not None
    Sigma = noise.covariance_of(study.model, study.model.frames(plan.q), plan.wrench)
    sigma = np.sqrt(np.einsum("rrk->rk", Sigma).mean())
    A = study.model.regressor(plan.q, plan.wrench) / sigma
    promised = np.linalg.inv(np.einsum("k,kri,krj->ij", plan.repeats, A, A))
    white = (np.diag(C) / np.diag(promised)).max()
    bias = np.abs((k.mean(axis=0) - study.compliances) / np.sqrt(np.diag(expected))).max()
    return float(of_variance), float(of_matrix), float(white), float(bias)


@click.command(help=__doc__)
@click.option("--runs", default=200_000, show_default=True)
def main(runs: int) -> None:
    """Simulate, compare, and write the table."""
    rows = []
    for name, study in tracked_robots().items():
        plan = random_plan(study, SEED)
        k = estimates(study, plan, runs, SEED)
        variance, matrix, white, bias = compared(study, plan, k)
        assert variance < ALLOWED, f"{name}: a variance is off by {variance:.2%}"
        rows.append(
            [name, f"{runs:,}", f"{variance:.2%}", f"{matrix:.2%}", f"{bias:.4f}", f"{white:.1f}"]
        )
    header = [
        "robot",
        "calibrations",
        "largest error of a variance",
        "largest entry of L'CL - I",
        "largest bias / std",
        "variance beside that promised by white noise, at most",
    ]
    text = (
        "# Is M^-1 the covariance of calibrations with a tracker's noise?\n\n"
        "Eight random poses, twelve visits, three reflectors; see `tracker_noise.py`. C is the "
        "sample covariance and M = LL'. By chance alone a variance of so many calibrations is off "
        f"by {np.sqrt(2 / runs):.2%} (one standard deviation). White noise is that of the same "
        "mean square per row.\n\n"
        f"{markdown_table(header, rows)}"
    )
    write_text(HERE / "tracker_noise.md", text)
    click.echo(text)


if __name__ == "__main__":
    main()
