"""Plans that may rest on more poses are no worse than those on fewer."""

from types import SimpleNamespace

from edtk.study.run_study import GAIN, none_worse
from edtk.study.study_run import Case


def case(cost, distinct=None, size=3, optimised="rho0"):
    """A case that was answered at a cost, with a plan of that name; without one, in vain."""
    kind = "optimised" if distinct is None else "distinct"
    found = None if cost is None else SimpleNamespace(cost=cost)
    reason = "none" if cost is None else ""
    plan = None if cost is None else f"plan at {cost}"
    return Case(kind, optimised, size, distinct, plan, found, reason)


def costs(cases):
    """Costs of the plans of some cases."""
    return [None if each.found is None else each.found.cost for each in none_worse(cases)]


def test_a_limit_never_helps():
    """A plan of few poses serves wherever more are allowed, and not where fewer are."""
    assert costs([case(2.0), case(3.0, 1), case(1.0, 2), case(4.0, 3)]) == [1.0, 3.0, 1.0, 1.0]
    better = none_worse([case(2.0), case(1.0, 2)])[0]
    assert (better.plan, better.distinct, better.kind) == ("plan at 1.0", None, "optimised")


def test_other_questions_have_nothing_to_say():
    """Plans of other sizes or criteria are no answers."""
    cases = [case(2.0), case(1.0, 2, size=4), case(1.0, 2, optimised="D")]
    assert costs(cases) == [2.0, 1.0, 1.0]


def test_a_plan_instead_of_none():
    """Where a search has found no plan, one of fewer poses is one, without a reason why not."""
    answered = none_worse([case(None), case(1.0, 2), case(None, 1)])
    assert [each.reason for each in answered] == ["", "", "none"]


def test_rounding_changes_no_plan():
    """Plans that differ by rounding stay those of their own searches."""
    assert costs([case(1.0), case(1.0 - GAIN / 2, 2)]) == [1.0, 1.0 - GAIN / 2]
