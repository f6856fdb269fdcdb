"""Fig. 7's random plan, and how much random plans differ."""

from dataclasses import dataclass

import numpy as np

from edtk import Plan, Study
from edtk.design.candidate_source import sample_feasible
from edtk.fit.least_squares import covariance
from edtk.system.typing import Array
from paper_figures.example import target_of
from paper_figures.mean_distance import mean_distance
from paper_figures.targets import both

EXPERIMENTS = 12
PLANS = 1001  # odd, so that one of them is the median

# Beside the study's seed: a stream of random numbers that nothing else uses.
STREAM = 1_000


@dataclass(frozen=True, eq=False)
class RandomPlans:
    """Random plans of twelve poses, with their expected errors.

    Attributes:
        median: The plan with the median exact mean error under the true A0; a single draw may be a
            freak.
        means: Exact mean errors [m] of all plans, by A0.
    """

    median: Plan
    means: dict[str, Array]


def random_plans(study: Study, plans: int = PLANS) -> RandomPlans:
    """Draw plans of feasible poses, uniform in the joint limits.

    Args:
        study: Robot, constraints and seed.
        plans: How many; odd.
    """
    space = study.space
    parameters = study.model.parameters
    p = len(parameters)
    q = sample_feasible(space, plans * EXPERIMENTS, (study.specification.seed, STREAM))
    blocks = space.problem(q).blocks().reshape(plans, EXPERIMENTS, p, p)
    cov = np.array([covariance(M, parameters) for M in blocks.sum(axis=1)])
    means = {name: mean_distance(A0 @ cov @ A0.T) for name, A0 in both(target_of(study)).items()}
    middle = int(np.argsort(means["true"], kind="stable")[plans // 2])
    poses = q.reshape(plans, EXPERIMENTS, -1)[middle]
    return RandomPlans(space.plan(poses, np.ones(EXPERIMENTS, dtype=int)), means)
