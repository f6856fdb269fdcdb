"""Bayesian D-optimality: the volume of the posterior's ellipsoid."""

from criteria.bayesian_criterion import BayesianCriterion
from criteria.d_optimality import DOptimality
from criteria.registry import register


@register
class BayesianDOptimality(BayesianCriterion):
    """``det(M + R)^(1/p)`` for a prior precision R, see `BayesianCriterion`."""

    name = "bayes_D"
    title = "Bayesian D-optimality"
    formula = "det(M + R)^(1/p)"
    sense = "max"
    degree = 1.0
    unit_free = True
    base_class = DOptimality
