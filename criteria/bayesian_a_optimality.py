"""Bayesian A-optimality: the sum of the posterior's variances."""

from criteria.a_optimality import AOptimality
from criteria.bayesian_criterion import BayesianCriterion
from criteria.registry import register


@register
class BayesianAOptimality(BayesianCriterion):
    """``trace((M + R)^-1)`` for a prior precision R, see `BayesianCriterion`."""

    name = "bayes_A"
    title = "Bayesian A-optimality"
    formula = "trace((M + R)^-1)"
    sense = "min"
    degree = 1.0
    base_class = AOptimality
