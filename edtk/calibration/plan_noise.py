"""The noise of a plan's experiments, white or as the study's [noise] states it."""

import numpy as np

from edtk.design.plan import Plan
from edtk.inference.correlated_noise import CorrelatedNoise, NoiseBlocks
from edtk.inference.visit_covariance import MOST_COORDINATES
from edtk.inference.whiten import RowNoise
from edtk.model.noise.shared_visits import shared_visits
from edtk.model.noise.visit_noise import VisitNoise
from edtk.study.study import Study
from edtk.system.typing import Array


def plan_noise(study: Study, plan: Plan) -> RowNoise:
    """The noise of the mean of each experiment's repeats (m, rows) [m, rad].

    Repeats average out what is not shared: ``sigma^2 / r``, or ``V/r + diag(d^2)`` with the
    covariance V of a visit and the discrepancy d.

    Args:
        study: The noise, and the rows that are measured.
        plan: The experiments.
    """
    if study.noise is None:
        return np.asarray(study.sigma / np.sqrt(plan.repeats)[:, None])
    scatter, shared = _parts(study, study.noise, plan)
    return CorrelatedNoise.by_row(scatter / plan.repeats[:, None, None] + shared)


def visits_noise(study: Study, plan: Plan) -> RowNoise:
    """The noise of every single visit (sum of repeats, rows), those of a pose one after another.

    Raises:
        UserError: Too many repeats of a pose share a discrepancy.
    """
    visits = int(plan.repeats.sum())
    if study.noise is None:
        return np.broadcast_to(study.sigma, (visits, len(study.sigma)))
    scatter, shared = _parts(study, study.noise, plan)
    rows = scatter.shape[1]
    if not study.noise.shares:
        return CorrelatedNoise.by_row(np.repeat(scatter, plan.repeats, axis=0))
    most = MOST_COORDINATES // rows
    if plan.repeats.max() > most:
        raise study.error(
            "noise.discrepancy_mm",
            f"{plan.repeats.max()} repeats of a pose share it; expected {most} at most here",
        )
    first = np.cumsum(plan.repeats) - plan.repeats
    blocks = []
    for r in np.unique(plan.repeats):
        of_size = np.flatnonzero(plan.repeats == r)
        own = np.einsum("ij,gab->giajb", np.eye(r), scatter[of_size])
        whole = own + shared[of_size][:, None, :, None]
        members = first[of_size][:, None] + np.arange(r)
        blocks.append(NoiseBlocks(members, whole.reshape(len(of_size), r * rows, r * rows)))
    return CorrelatedNoise.of(blocks, (visits, rows))


def _parts(study: Study, noise: VisitNoise, plan: Plan) -> tuple[Array, Array]:
    """What repeats average out, and what they share (m, rows, rows) [m^2, rad^2]."""
    frames = study.model.frames(plan.q)
    scatter = np.moveaxis(noise.scatter_of(study.model, frames), -1, 0)
    prismatic = np.array([joint.kind == "prismatic" for joint in study.robot.joints])
    near = shared_visits(plan.q, plan.repeats, prismatic, noise.within) / plan.repeats
    return scatter, near[:, None, None] * np.diag(noise.discrepancy**2)
