"""The relaxation over poses: in memory, beyond it, and over the continuum."""

from dataclasses import replace
from functools import cache
from itertools import count

import numpy as np
import pytest
from designs import DESIGNS, KR270, STUDY

from criteria import Criterion, create
from criteria.linalg.inverse import whitener
from edtk.certificate.verify_certificate import EXCESS
from edtk.design.candidate_source import CandidateSource, EmptyFeasibleSetError, sample_feasible
from edtk.design.information import distinct
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.proof import is_normalised, normalised
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relax_poses import (
    MemoryLimitError,
    PlanInterrupted,
    RelaxOptions,
    capacity,
    relax_poses,
)
from edtk.design.relaxation.search_continuum import ascend
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.constraints.height import Height
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.workspace import Workspace
from edtk.system.time_limit import time_limit

pytestmark = pytest.mark.slow

GAP = 1e-6
TOLERANCE = 5e-5
TWO = replace(KR270, model=ElastostaticModel(KR270.workspace.robot, (1, 2)))
RHO0 = STUDY.criterion("rho0")


@cache
def paper(seed, n):
    """The paper's problem over all poses, searched as thoroughly as users have it."""
    options = RelaxOptions(tolerance=TOLERANCE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.design.relaxation.search_continuum.SCREEN", 20_000)
        patch.setattr("edtk.design.relaxation.search_continuum.STARTS", 96)
        return relax_poses(CandidateSource(KR270, seed), n, RHO0, True, options)


@cache
def easy(name, space=TWO):
    """Few candidates and ascents, to a coarse tolerance: quick, where the best pose is no point."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.design.relaxation.search_continuum.STARTS", 6)
        source = CandidateSource(space, 0, "sobol")
        return relax_poses(source, 200, create(name), True, RelaxOptions(tolerance=1e-3))


def slip(plan):
    """Relative error to which a cost and a bound are defined in rounding: 64 p eps cond(M)."""
    M = plan.information
    return 64 * len(M) * np.finfo(float).eps * np.linalg.cond(M)


def assert_sound(plan):
    """A design of feasible poses, its own cost, and bounds in their order."""
    assert plan.space.at(plan.x).feasible.all()
    held = np.setdiff1d(np.arange(plan.space.workspace.robot.n), plan.space.free)
    fixed = np.tile(plan.space.fixed[held], (len(plan.x), 1))
    np.testing.assert_array_equal(plan.x[:, held], fixed)
    assert (plan.weights > 0).all()
    assert plan.weights.sum() == pytest.approx(1, abs=1e-12)
    assert plan.cost == pytest.approx(float(plan.criterion.cost(plan.information)), rel=slip(plan))
    proved = plan.proved_bound.cost
    assert 0 < proved <= plan.cost * (1 + slip(plan))
    if plan.searched_bound is not None:
        assert 0 < plan.searched_bound.cost <= proved * (1 + slip(plan))


def assert_certified(plan):
    """Cost and bound follow from poses, weights and multipliers.

    The plan may know of poses that are no candidates any more, so that its bound may be lower.
    """
    cost, bound = plan.certify()
    assert cost == pytest.approx(plan.cost, rel=slip(plan))
    assert plan.proved_bound.cost * (1 - slip(plan)) <= bound <= plan.cost * (1 + slip(plan))
    assert bound == pytest.approx(plan.proved_bound.cost, rel=GAP)


def assert_proved_by_sensitivities(plan):
    """Each bound follows from multipliers and largest sensitivities, which stated poses have."""
    pairs = [(plan.proved_bound, plan.proved_sensitivities)]
    if plan.searched_bound is not None:
        pairs.append((plan.searched_bound, plan.searched_sensitivities))
    Z = plan.multipliers
    for bound, largest in pairs:
        again = plan.criterion.lower_bound(Z, largest.values, plan.information)
        assert bound.cost == pytest.approx(again, rel=slip(plan))
        assert plan.space.at(largest.x).feasible.all()
        problem = plan.space.problem(largest.x)
        if plan.criterion.degree == 0:
            problem = problem.with_unit_trace()
        own = np.diagonal(problem.sensitivities(Z))
        size = np.abs(problem.sensitivities(np.abs(Z))).max(axis=1)
        np.testing.assert_allclose(own, largest.values, rtol=0, atol=1e-12 * size.max())


@pytest.mark.parametrize(("seed", "n"), [(0, 1000), (1, 200)])
def test_the_papers_problem(seed, n):
    """From any seed the least rho0 is 9.645e-3 mm per experiment, to 1e-4, with its proof."""
    plan = paper(seed, n)
    assert plan.value == pytest.approx(9.645e-6, rel=1e-4)
    assert plan.searched_bound.gap_to(plan.cost) <= TOLERANCE
    assert_sound(plan)
    assert_certified(plan)
    assert_proved_by_sensitivities(plan)


def test_leaving_the_candidates_pays():
    """Over all poses a design costs less than the bound over the candidates allows."""
    discrete = relax_poses(CandidateSource(KR270, 0), 1000, RHO0)
    assert paper(0, 1000).cost < discrete.proved_bound.cost * (1 - 1e-3)
    assert paper(0, 1000).proved_bound.cost < discrete.proved_bound.cost


def test_no_pose_lowers_the_searched_bound():
    """Neither random poses nor ascents from the best of them lower it by the tolerance."""
    plan = paper(0, 1000)
    (Z,) = plan.multipliers
    fresh = sample_feasible(KR270, 30_000, 77)
    sensitivities = KR270.problem(fresh).sensitivities(Z)
    starts = fresh[np.argsort(-sensitivities)[:2000:100]]
    multipliers = np.tile(Z, (len(starts), 1, 1))
    unit = float(sensitivities.max())
    ends = ascend(KR270, starts, multipliers, unit=unit, accuracy=1e-8)
    assert KR270.problem(ends).sensitivities(Z).max() > sensitivities.max()
    for x in (fresh, ends):
        largest = np.array([KR270.problem(x).sensitivities(Z).max()])
        bound = plan.criterion.lower_bound(plan.multipliers, largest, plan.information)
        assert bound >= plan.searched_bound.cost * (1 - TOLERANCE)


@pytest.mark.parametrize(("seed", "n"), [(0, 1000), (1, 200)])
def test_support_is_merged(seed, n):
    """At most p(p+1)/2 + 1 poses remain, and no two have the same information."""
    plan = paper(seed, n)
    chosen = distinct(KR270.problem(plan.x).blocks(), whitener(plan.information), 1e-6)
    assert len(chosen) == len(plan.x) <= 16


@pytest.mark.parametrize("name", ["A", "D", "E", "O2", "O4"])
def test_two_parameters(name):
    """Every kind of criterion leaves the candidates: smooth, kinked, degree zero, a family."""
    plan = easy(name)
    assert plan.searched_bound.gap_to(plan.cost) <= 1e-3
    assert_sound(plan)
    assert_certified(plan)
    assert_proved_by_sensitivities(plan)


@pytest.mark.parametrize("name", ["A", "D", "E", "O2", "O4"])
def test_support_of_two_parameters(name):
    """By Caratheodory's theorem p(p+1)/2 + 1 poses are enough for any design."""
    assert len(easy(name).x) <= 4


def test_any_force():
    """Forces are designed with the poses, and such a design is worth more than the paper's force.

    Sensitivities grow with the square of a force, so that no design rests on small forces.
    """
    plan = easy("D", replace(TWO, load=FreeLoad(2500.0)))
    assert_sound(plan)
    assert_certified(plan)
    assert plan.searched_bound.gap_to(plan.cost) <= 1e-3
    assert plan.cost < easy("D").searched_bound.cost
    drawn = plan.source.take(200).x
    short, drawn_short = (1 - np.linalg.norm(x[:, 6:], axis=1) for x in (plan.x, drawn))
    assert plan.weights @ short < 0.1 * drawn_short.mean()


def test_listed_forces():
    """A choice of two opposite forces and a small one changes no cost: their information is equal.

    The candidates' draws differ, so that costs agree to the tolerance only.
    """
    down = KR270.load.always
    load = ListedLoad(np.array([down, -down, 0.1 * down]))
    plan = easy("A", replace(TWO, load=load))
    one_force = easy("A")
    assert_sound(plan)
    assert_certified(plan)
    assert set(plan.x[:, 6]) <= {0.0, 1.0}
    assert plan.searched_bound.cost <= one_force.cost * (1 + slip(plan))
    assert one_force.searched_bound.cost <= plan.cost * (1 + slip(plan))


def test_condition_number_of_two_parameters():
    """Two compliances can be equally well known in every direction: the condition number is one."""
    assert easy("O2").value == pytest.approx(1, rel=1e-3)


def test_another_robot():
    """Prismatic joints, torques, six rows and a fixed joint: the plan is sound and pays."""
    plan = easy("E", DESIGNS["odd"])
    assert plan.searched_bound.gap_to(plan.cost) <= 1e-3
    assert_sound(plan)
    assert_certified(plan)
    assert plan.cost < relax_poses(plan.source, 200, create("E")).proved_bound.cost


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "O2", "O5", "rho0"])
def test_over_candidates(name):
    """Over candidates alone the gap is proved, nothing is searched, and no pose is merged away."""
    source = CandidateSource(KR270, 1)
    criterion = STUDY.criterion(name)
    plan = relax_poses(source, 800, criterion)
    assert plan.gap <= GAP
    assert plan.searched_bound is None
    assert plan.searched_sensitivities is None
    assert plan.best_bound == plan.proved_bound
    assert plan.candidates == 800
    assert_sound(plan)
    assert_certified(plan)
    assert_proved_by_sensitivities(plan)
    known = source.take(800)
    assert (np.abs(known.x[:, None] - plan.x).max(axis=-1).min(axis=0) == 0).all()
    assert plan.cost == pytest.approx(relax(known.problem, criterion).cost, rel=GAP)


def test_a_bound_that_is_enough():
    """A search that is told to stop leaves a true bound, and a wider one."""
    options = RelaxOptions(tolerance=TOLERANCE, stop=lambda plan: True)
    short = relax_poses(CandidateSource(KR270, 0), 1000, RHO0, True, options)
    whole = paper(0, 1000)
    assert short.searched_bound.cost < whole.searched_bound.cost
    assert short.searched_bound.cost <= whole.cost
    assert_proved_by_sensitivities(short)


@pytest.mark.parametrize("name", ["rho0", "E", "c"])
def test_without_time_the_bound_is_that_of_a_first_design(name):
    """One program over the candidates is solved, and proves a bound on them that holds."""
    criterion = {"rho0": RHO0, "E": create("E"), "c": create("c", c=[1.0, 0, 0, 0, 0])}[name]
    source = CandidateSource(KR270, 0)
    with time_limit(0.0):
        first = relax_poses(source, 1000, criterion, True)
    assert first.searched_bound is None
    best = relax_poses(source, 1000, criterion)
    assert 0 < first.proved_bound.cost <= best.cost
    assert best.proved_bound.cost <= first.cost < np.inf
    assert first.certify() == (
        pytest.approx(first.cost),
        pytest.approx(first.proved_bound.cost, rel=1e-6),
    )


def test_a_bound_that_holds_for_other_poses():
    """Poses that are no candidates may lower a bound on the candidates, and never raise it."""
    with time_limit(0.0):
        first = relax_poses(CandidateSource(KR270, 0), 50, RHO0, True)
    better = paper(0, 1000)
    held = first.holding_for(better.x)
    assert held.proved_bound.cost < first.proved_bound.cost
    assert held.proved_bound.cost <= better.cost


def test_a_searched_bound_holds_for_poses_that_the_search_has_missed():
    """It becomes lower for more sensitive poses, so that no design on them beats it."""
    better = paper(0, 1000)
    options = RelaxOptions(stop=lambda plan: True)
    short = relax_poses(CandidateSource(KR270, 0), 50, RHO0, True, options)
    blind = replace(
        short,
        searched_bound=short.proved_bound,
        searched_sensitivities=short.proved_sensitivities,
    )
    assert blind.best_bound.cost > better.cost
    held = blind.holding_for(better.x)
    assert held.best_bound.cost <= better.cost
    assert held.best_bound.kind is blind.best_bound.kind
    np.testing.assert_array_equal(held.x, blind.x)
    assert held.holding_for(better.x).best_bound == held.best_bound


@pytest.mark.parametrize(("name", "seed"), [("rho0", 0), ("A", 3), ("E", 1)])
def test_a_search_that_is_cut_short_is_sharp(name, seed):
    """Its ends are uphill to a hundredth of the excess that a check of the claim tolerates."""
    criterion = RHO0 if name == "rho0" else create(name)
    options = RelaxOptions(stop=lambda plan: True)
    short = relax_poses(CandidateSource(KR270, seed), 200, criterion, True, options)
    largest = short.searched_sensitivities
    multipliers = short.multipliers / largest.values[:, None, None]
    ends = ascend(KR270, largest.x, multipliers, is_normalised(criterion), accuracy=1e-9)
    found = normalised(KR270.problem(ends), criterion).sensitivities(multipliers).diagonal()
    assert found.min() >= 1 - 1e-12
    assert found.max() <= 1 + EXCESS / 100


@pytest.fixture
def little_memory(monkeypatch):
    """A limit that leaves room for few candidates; lists how many were ever held at once."""
    monkeypatch.setattr("edtk.design.relaxation.relax_poses.BASE_MB", 0.0)
    monkeypatch.setattr("edtk.design.relaxation.relax_poses.KEPT", 50)
    monkeypatch.setattr("edtk.design.relaxation.relax_poses.KEPT", 50)
    monkeypatch.setattr("edtk.design.candidate_source.SAMPLES_AT_ONCE", 1024)
    held = []
    take = CandidateSource.take

    def counted(self, n, **options):
        held.append(n)
        return take(self, n, **options)

    monkeypatch.setattr(CandidateSource, "take", counted)
    return held


@pytest.mark.parametrize("name", ["rho0", "D", "E", "O2"])
def test_beyond_memory(name, little_memory):
    """Candidates that are never held at once give the value and the proof of those that are."""
    source = CandidateSource(KR270, 3)
    criterion = STUDY.criterion(name)
    n = 5000
    assert 50 <= capacity(15, 6, 0.03) < 100
    streamed = relax_poses(source, n, criterion, options=RelaxOptions(memory_mb=0.03))
    assert little_memory == [capacity(15, 6, 0.03)]
    whole = relax_poses(source, n, criterion)
    assert streamed.candidates == whole.candidates == n
    assert streamed.gap <= GAP
    assert streamed.cost == pytest.approx(whole.cost, rel=GAP)
    assert streamed.proved_bound.cost == pytest.approx(whole.proved_bound.cost, rel=GAP)
    assert_sound(streamed)
    assert_certified(streamed)
    assert_proved_by_sensitivities(streamed)


def test_beyond_memory_and_the_candidates(little_memory):
    """In the continuum, too, the bound is proved on all candidates, of which few are ever held."""
    options = RelaxOptions(tolerance=1e-3, memory_mb=0.03)
    plan = relax_poses(CandidateSource(TWO, 4), 3000, create("D"), True, options)
    assert plan.candidates == 3000
    assert plan.searched_bound.gap_to(plan.cost) <= 1e-3
    assert little_memory[0] == capacity(3, 6, 0.03) < 300
    assert_sound(plan)
    assert_certified(plan)


def test_a_pass_that_is_cut_off_proves_nothing(little_memory, monkeypatch):
    """The bound is then on the candidates of the last whole pass, or on those in memory."""
    source = CandidateSource(TWO, 3)
    held = capacity(3, 6, 0.03)
    options = RelaxOptions(memory_mb=0.03)
    proved = set()
    for looks in (1, 20, 25, 30, 35, 40, 1000):
        clock = count()
        with monkeypatch.context() as patch:
            patch.setattr("edtk.system.time_limit.monotonic", lambda clock=clock: next(clock))
            with time_limit(looks):
                found = relax_poses(source, 5000, create("D"), options=options)
        proved.add(found.candidates)
        assert_certified(found)
    assert proved == {held, 5000}


def test_memory_limit():
    """A limit that is too small is rejected with the least that is enough."""
    message = r"limit of 100 MB is too small, expected (\d+) MB or more"
    with pytest.raises(MemoryLimitError, match=message) as caught:
        relax_poses(CandidateSource(KR270), 10, RHO0, options=RelaxOptions(memory_mb=100))
    enough = RelaxOptions(memory_mb=caught.value.least_mb)
    assert relax_poses(CandidateSource(KR270), 50, RHO0, options=enough).gap <= GAP


def stop_at(stage, count=1):
    """Progress that is interrupted at the n-th call of a stage."""
    calls = []

    def progress(name, gap):
        calls.append(name)
        if calls.count(stage) == count:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize(("stage", "count"), [("solve", 1), ("continuum", 1), ("continuum", 2)])
def test_interruption_leaves_the_best_certified_plan(stage, count):
    """Ctrl-C leaves a plan with its proof, and with a searched bound if the search had begun."""
    options = RelaxOptions(tolerance=TOLERANCE, progress=stop_at(stage, count))
    with pytest.raises(PlanInterrupted) as caught:
        relax_poses(CandidateSource(KR270, 5), 3000, RHO0, True, options)
    plan = caught.value.best
    assert isinstance(caught.value, KeyboardInterrupt)
    assert plan.candidates == 3000
    assert (plan.searched_bound is not None) == (stage == "continuum")
    assert_sound(plan)
    assert_certified(plan)


def test_interruption_beyond_memory(little_memory):
    """Ctrl-C between two passes leaves a plan whose bound holds for all candidates."""
    heard = []

    def progress(stage, gap):
        heard.append(gap)
        if stage == "solve" and heard[-1] > heard[-2]:  # over all candidates, after those in memory
            raise KeyboardInterrupt

    options = RelaxOptions(memory_mb=0.03, progress=progress)
    with pytest.raises(PlanInterrupted) as caught:
        relax_poses(CandidateSource(KR270, 3), 5000, RHO0, options=options)
    plan = caught.value.best
    assert plan.candidates == 5000
    assert plan.gap > GAP
    assert_sound(plan)
    assert_certified(plan)


def test_interruption_before_there_is_a_plan():
    """Ctrl-C while candidates are generated is a plain interruption."""
    options = RelaxOptions(progress=stop_at("candidates"))
    with pytest.raises(KeyboardInterrupt) as caught:
        relax_poses(CandidateSource(KR270), 100, RHO0, options=options)
    assert not isinstance(caught.value, PlanInterrupted)


def test_progress_and_seconds():
    """Stages are told in their order, to a gap within the tolerance; each has its seconds."""
    told = []
    options = RelaxOptions(tolerance=1e-3, progress=lambda *call: told.append(call))
    plan = relax_poses(CandidateSource(TWO, 1), 200, create("D"), True, options)
    stages = [stage for stage, _ in told]
    assert list(dict.fromkeys(stages)) == ["candidates", "solve", "continuum"]
    assert stages == sorted(stages, key=["candidates", "solve", "continuum"].index)
    assert told[-1][1] <= 1e-3
    assert set(plan.seconds) == {"candidates", "solve", "continuous"}
    assert min(plan.seconds.values()) > 0


def test_candidates_that_identify_too_little():
    """A vertical load does not excite joint 1: its compliance is named."""
    space = replace(KR270, model=ElastostaticModel(KR270.workspace.robot, (0, 1, 2)))
    with pytest.raises(RankDeficientError, match=r"no candidate excites k1"):
        relax_poses(CandidateSource(space), 100, create("D"))


def test_nothing_feasible():
    """An empty feasible set is named as such."""
    space = replace(KR270, workspace=Workspace(KR270.workspace.robot, (Height(9.0),)))
    with pytest.raises(EmptyFeasibleSetError, match="height"):
        relax_poses(CandidateSource(space, patience=1), 10, create("D"))


@pytest.mark.parametrize("n", [0, -3])
def test_no_candidates(n):
    """Fewer than one candidate is rejected."""
    with pytest.raises(ValueError, match="at least one candidate"):
        relax_poses(CandidateSource(KR270), n, create("D"))


def test_criterion_without_convex_form():
    """A criterion that cannot be relaxed is rejected by name."""

    class Plain(Criterion):
        name = "plain"
        title = "Plain"
        formula = "1/trace(M)"
        sense = "min"
        degree = 1.0

        def _cost(self, M, cov):
            return 1.0 / np.trace(M, axis1=-2, axis2=-1)

        def _gradient(self, M, cov):
            return -(self._cost(M, cov)[..., None, None] ** 2) * np.eye(M.shape[-1])

    with pytest.raises(NotImplementedError, match="plain"):
        relax_poses(CandidateSource(KR270), 100, Plain())
