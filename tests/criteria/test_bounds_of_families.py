"""Bounds and convex programs of criteria with parameters, by the suites of the others."""

import pytest
import test_formulation as programs
import test_lower_bound as bounds

pytestmark = pytest.mark.slow

NAMES = ("I", "c", "Ds", "phi 0", "phi 0.5", "phi 3", "prediction_G", "compound", "minimax")
# Their dual weights are searched for, which takes milliseconds a multiplier.
SEARCHED = ("prediction_G", "minimax")

every = pytest.mark.parametrize("name", NAMES)


@every
def test_bounds(name):
    """Below every design, tight at a gradient, homogeneous, and never lowered by a multiplier."""
    bounds.test_bound_is_below_every_design(name, 0)
    for p in (1, 3):
        bounds.test_bound_is_tight_at_the_design_that_a_gradient_belongs_to(name, p)
    bounds.test_bound_is_homogeneous(name)
    if name not in SEARCHED:
        bounds.test_further_multipliers_never_lower_the_bound(name)
        bounds.test_bound_is_a_bound_in_bad_units(name, 0)


@every
def test_programs(name):
    """Convex by the rules, and their optimum is the least cost, whatever whitens them."""
    programs.test_programs_are_convex_by_the_rules(name, 3)
    programs.test_optimum_over_one_candidate_is_its_cost(name, 3, False)
    programs.test_optimum_over_two_candidates_is_the_least_cost_between_them(name)
    programs.test_optimum_does_not_depend_on_what_whitens(name)
