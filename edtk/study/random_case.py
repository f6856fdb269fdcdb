"""The plan that chance would choose, to compare optimised plans with."""

import numpy as np

from edtk.design.exact.round_poses import round_poses
from edtk.design.sample_feasible import sample_feasible
from edtk.study.case import Case
from edtk.study.designs import Designs
from edtk.study.study import Study

PLANS = 101  # of which the median is shown; odd, so that the median is one of them
STREAM = 2  # of random numbers, apart from those of the candidates


def random_case(study: Study, size: int, index: int, designs: Designs | None = None) -> Case:
    """Draw many plans of feasible poses at random, and take the one of median cost.

    Args:
        study: The study, whose main criterion orders the plans.
        size: Number of experiments of each.
        index: Number of the stream of random numbers, one for each size.
        designs: The designs of the study; default to those of compliances.

    Returns:
        The median plan, in poses that a controller takes, or the reason why it has no cost.
    """
    seed = (study.specification.seed, STREAM, index)
    designs = Designs(study) if designs is None else designs
    space = designs.space(size)
    x = sample_feasible(space, PLANS * size, seed).reshape(PLANS, size, -1)
    costs = designs.criterion().cost(space.at(x).information(np.ones((PLANS, size))))
    middle = int(np.argsort(costs, kind="stable")[PLANS // 2])
    if not np.isfinite(costs[middle]):
        return Case("random", "", size, reason="such a plan cannot identify all parameters")
    poses, repeats = round_poses(space, designs.criterion(), x[middle], np.ones(size))
    return Case("random", "", size, plan=space.plan(poses, repeats.astype(int)))
