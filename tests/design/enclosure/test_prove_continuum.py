"""Bounds over all poses: designs of small arms, held against poses of their own."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import criteria
from edtk.design.bound import BoundKind
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.enclosure import prove_continuum
from edtk.design.enclosure.cover import Covering
from edtk.design.enclosure.polynomial import NotEnclosedError
from edtk.design.enclosure.prove_continuum import ProvedPlan, prove_poses
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.relax_poses import PlanInterrupted, RelaxOptions
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.radius import Radius
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.workspace import Workspace
from edtk.system.time_limit import time_limit
from tests.support.chains import mixed_chain

pytestmark = pytest.mark.slow

EPS = 0.01
CRITERIA = ("A", "D", "G", "O2", "O3")


def arm(**changes: object) -> DesignSpace:
    """An arm of three joints, one of which slides, above a height and outside a radius."""
    robot = mixed_chain(3)
    wrench = np.array([30.0, -20.0, 50.0, 4.0, -7.0, 9.0])
    given: dict[str, object] = {
        "model": ElastostaticModel(robot),
        "workspace": Workspace(robot, (Height(-0.4), Radius(0.3))),
        "sigma": np.array([3e-5, 4e-5, 5e-5]),
        "load": FixedLoad(wrench),
        "free": [0, 1, 2],
        "fixed": np.zeros(3),
    }
    return DesignSpace(**(given | changes))  # type: ignore[arg-type]


@cache
def proved(name: str, accuracy: float = EPS) -> ProvedPlan:
    """A design of the arm with its bound."""
    return prove_poses(CandidateSource(arm(), (1,)), 200, criteria.create(name), accuracy)


def costs(plan: ProvedPlan, designs: int = 50) -> np.ndarray:
    """Costs of designs of random feasible poses with random weights."""
    rng = np.random.default_rng(3)
    source = CandidateSource(plan.space, (5,))
    problem = plan.space.problem(source.take(400).x)
    M = [problem.information(w) for w in rng.dirichlet(np.full(400, 0.02), designs)]
    return np.array([plan.criterion.cost(one) for one in M])


@pytest.mark.parametrize("name", CRITERIA)
def test_bounds_of_all_criteria_are_proved_to_the_gap_that_is_asked_for(name: str) -> None:
    """The bound is within one per cent of the design, below it and below other designs, and no
    random pose is more sensitive than its covering says.
    """
    plan = proved(name)
    bound = plan.continuum_bound
    assert bound.kind is BoundKind.PROVED
    assert plan.best_bound is bound
    assert bound.gap <= EPS
    assert plan.cost * (1 - EPS) <= bound.cost <= plan.cost
    assert (costs(plan) >= bound.cost).all()
    x = CandidateSource(plan.space, (9,)).take(3000).x
    problem = normalised(plan.space.problem(x), plan.criterion)
    U = np.array([covering.upper for covering in plan.coverings])
    assert (problem.sensitivities(plan.continuum_multipliers).max(axis=1) <= U).all()


def test_the_bound_follows_from_multipliers_and_coverings_alone() -> None:
    """What is printed is the criterion's bound of the largest sensitivities, less its rounding."""
    plan = proved("A")
    U = np.array([covering.upper for covering in plan.coverings])
    cost = plan.criterion.lower_bound(plan.continuum_multipliers, U, plan.information)
    assert plan.continuum_bound.cost == pytest.approx(cost, rel=1e-9)
    assert plan.continuum_bound.cost <= cost
    answer = plan.to_dict()
    assert answer["bound_proved"] == plan.continuum_bound.value
    assert answer["bound_searched"] == plan.searched_bound.value  # type: ignore[union-attr]
    assert answer["boxes"] == plan.boxes > 0
    assert "proved on the continuum" in plan.summary()


def test_a_millionth_is_proved_too() -> None:
    """Single precision does not limit the gap."""
    plan = proved("D", 1e-6)
    assert plan.continuum_bound.gap <= 1e-6


def test_a_prior_and_several_loads_count() -> None:
    """Each listed load is an objective of its own, and a prior lifts all sensitivities."""
    wrench = np.array([30.0, -20.0, 50.0, 4.0, -7.0, 9.0])
    loads = np.stack([wrench, -wrench[[1, 2, 0, 3, 4, 5]]])
    space = replace(arm(load=ListedLoad(loads)), prior=np.diag([3e4, 1e4, 2e4]) ** 2 * 1e-3)
    plan = prove_poses(CandidateSource(space, (1,)), 200, criteria.create("A"), EPS)
    assert plan.continuum_bound.gap <= EPS
    assert (costs(plan) >= plan.continuum_bound.cost).all()
    assert len(plan.coverings[0].leaves) == len(loads)


def test_a_pose_that_the_search_has_missed_joins_the_design(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where a search is blind, boxes find the pose, and the next design has it."""
    blind = prove_continuum.relax_poses
    calls = []

    def relax_few(source, n, criterion, continuous, options, known=None):  # type: ignore[no-untyped-def]
        calls.append(known)
        return blind(source, n, criterion, known is not None, options, known)

    monkeypatch.setattr(prove_continuum, "relax_poses", relax_few)
    plan = prove_poses(CandidateSource(arm(), (1,)), 60, criteria.create("D"), EPS)
    assert len(calls) > 1
    assert plan.continuum_bound.gap <= EPS
    assert plan.cost == pytest.approx(proved("D").cost, rel=2 * EPS)


def test_without_time_and_after_ctrl_c_a_bound_stays() -> None:
    """The bound of the first boxes holds; Ctrl-C keeps what was reached."""
    reached: list[float] = []

    def progress(stage: str, gap: float) -> None:
        if stage.startswith("all poses"):
            reached.append(gap)
            if len(set(reached)) == 2:
                raise KeyboardInterrupt

    source = CandidateSource(arm(), (1,))
    with pytest.raises(PlanInterrupted) as caught:
        prove_poses(source, 200, criteria.create("A"), 1e-4, RelaxOptions(progress=progress))
    stopped = caught.value.best
    assert isinstance(stopped, ProvedPlan)
    assert 0 < stopped.continuum_bound.cost < stopped.cost
    assert 1e-4 < stopped.continuum_bound.gap < 1
    assert all(isinstance(one, Covering) for one in stopped.coverings)


def test_a_space_that_has_no_polynomials_says_so() -> None:
    """Before anything is computed."""

    class Odd(FixedLoad):
        pass

    source = CandidateSource(arm(load=Odd(np.ones(6))), (1,))
    with time_limit(0.0), pytest.raises(NotEnclosedError, match="Odd"):
        prove_poses(source, 200, criteria.create("A"), EPS)
