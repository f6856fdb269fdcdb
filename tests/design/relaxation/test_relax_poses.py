"""The relaxation over poses: in memory, beyond it, and over the continuum."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from designs import DESIGNS, KR270, STUDY

from criteria import Criterion, create
from criteria.linalg.inverse import whitener
from edtk.design.candidate_source import CandidateSource, EmptyFeasibleSetError
from edtk.design.distinct import distinct
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.ascend import ascend
from edtk.design.relaxation.capacity import MemoryLimitError, capacity
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relax_options import RelaxOptions
from edtk.design.relaxation.relax_poses import PlanInterrupted, relax_poses
from edtk.design.sample_feasible import sample_feasible
from edtk.model.constraints.height import Height
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.loads.free_load import FreeLoad
from edtk.model.loads.listed_load import ListedLoad
from edtk.model.workspace import Workspace

GAP = 1e-6
TOLERANCE = 5e-5
TWO = replace(KR270, model=ElastostaticModel(KR270.workspace.robot, (1, 2)))
RHO0 = STUDY.criterion("rho0")


@cache
def paper(seed, n):
    """The paper's problem over all poses."""
    return relax_poses(
        CandidateSource(KR270, seed), n, RHO0, True, RelaxOptions(tolerance=TOLERANCE)
    )


@cache
def easy(name, space=TWO):
    """A few candidates, a coarse tolerance and few ascents, where the dearest pose of all is not the point."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.design.relaxation.search_continuum.STARTS", 6)
        return relax_poses(
            CandidateSource(space, 0, "sobol"),
            200,
            create(name),
            True,
            RelaxOptions(tolerance=1e-3),
        )


def slip(plan):
    """Relative error to which a cost and a bound are defined in rounding: 64 p eps cond(M)."""
    M = plan.information
    return 64 * len(M) * np.finfo(float).eps * np.linalg.cond(M)


def assert_sound(plan):
    """A design of feasible poses, its own cost, and bounds in their order."""
    assert plan.space.at(plan.x).feasible.all()
    held = np.setdiff1d(np.arange(plan.space.workspace.robot.n), plan.space.free)
    np.testing.assert_array_equal(
        plan.x[:, held], np.tile(plan.space.fixed[held], (len(plan.x), 1))
    )
    assert (plan.weights > 0).all()
    assert plan.weights.sum() == pytest.approx(1, abs=1e-12)
    assert plan.cost == pytest.approx(float(plan.criterion.cost(plan.information)), rel=slip(plan))
    assert 0 < plan.proved_bound.cost <= plan.cost * (1 + slip(plan))
    assert plan.searched_bound is None or 0 < plan.searched_bound.cost <= plan.proved_bound.cost * (
        1 + slip(plan)
    )


def assert_certified(plan):
    """Cost and bound come out again from poses, weights and multipliers; fewer poses are priced, never more."""
    cost, bound = plan.certify()
    assert cost == pytest.approx(plan.cost, rel=slip(plan))
    assert plan.proved_bound.cost * (1 - slip(plan)) <= bound <= plan.cost * (1 + slip(plan))
    assert bound == pytest.approx(plan.proved_bound.cost, rel=GAP)


@pytest.mark.parametrize(("seed", "n"), [(0, 1000), (1, 200)])
def test_the_papers_problem(seed, n):
    """From any seed the continuous relaxation of rho0 is 9.645e-3 mm per experiment, to 1e-4, with its proof."""
    plan = paper(seed, n)
    assert plan.value == pytest.approx(9.645e-6, rel=1e-4)
    assert 1 - plan.searched_bound.cost / plan.cost <= TOLERANCE
    assert_sound(plan)
    assert_certified(plan)


def test_leaving_the_candidates_pays():
    """Over all poses a design is cheaper than any over the candidates: below the bound that is proved for them."""
    discrete = relax_poses(CandidateSource(KR270, 0), 1000, RHO0)
    assert paper(0, 1000).cost < discrete.proved_bound.cost * (1 - 1e-3)
    assert paper(0, 1000).proved_bound.cost < discrete.proved_bound.cost


def test_no_pose_is_dearer_than_the_search_says():
    """Neither random poses nor ascents from the dearest of them take the searched bound down by the tolerance."""
    plan = paper(0, 1000)
    (Z,) = plan.multipliers
    fresh = sample_feasible(KR270, 30_000, 77)
    sensitivities = KR270.problem(fresh).sensitivities(Z)
    starts = fresh[np.argsort(-sensitivities)[:2000:100]]
    ends = ascend(
        KR270,
        starts,
        np.tile(Z, (len(starts), 1, 1)),
        unit=float(sensitivities.max()),
        accuracy=1e-8,
    )
    assert KR270.problem(ends).sensitivities(Z).max() > sensitivities.max()
    for x in (fresh, ends):
        dearest = np.array([KR270.problem(x).sensitivities(Z).max()])
        assert plan.criterion.lower_bound(
            plan.multipliers, dearest, plan.information
        ) >= plan.searched_bound.cost * (1 - TOLERANCE)


@pytest.mark.parametrize(("seed", "n"), [(0, 1000), (1, 200)])
def test_support_is_merged(seed, n):
    """No two poses of the support tell the same, symmetric ones included, and there are p(p+1)/2 + 1 at most."""
    plan = paper(seed, n)
    chosen = distinct(KR270.problem(plan.x).blocks(), whitener(plan.information), 1e-6)
    assert len(chosen) == len(plan.x) <= 16


@pytest.mark.parametrize("name", ["A", "D", "E", "O2", "O4"])
def test_two_parameters(name):
    """Every kind of criterion leaves the candidates: smooth or not, of degree zero, and a family of convex ones."""
    plan = easy(name)
    assert 1 - plan.searched_bound.cost / plan.cost <= 1e-3
    assert_sound(plan)
    assert_certified(plan)


@pytest.mark.parametrize("name", ["A", "D", "E", "O2", "O4"])
def test_support_of_two_parameters(name):
    """By Caratheodory's theorem p(p+1)/2 + 1 poses are enough for any information matrix of a design."""
    assert len(easy(name).x) <= 4


def test_any_force():
    """Forces are designed with the poses: sound, certified, and worth more than the one force of the paper.

    Prices grow with the square of a force: candidates that are short of the largest are not what a design rests on.
    """
    plan = easy("D", replace(TWO, load=FreeLoad(2500.0)))
    assert_sound(plan)
    assert_certified(plan)
    assert 1 - plan.searched_bound.cost / plan.cost <= 1e-3
    assert plan.cost < easy("D").searched_bound.cost
    short, drawn = (1 - np.linalg.norm(x[:, 6:], axis=1) for x in (plan.x, plan.source.take(200).x))
    assert plan.weights @ short < 0.1 * drawn.mean()


def test_listed_forces():
    """With a choice of two opposite forces nothing changes, as information is the same; with a third it does not grow.

    The candidates' draws differ, so that costs agree to the tolerance only.
    """
    down = KR270.load.always
    load = ListedLoad(np.array([down, -down, 0.1 * down]))
    plan = relax_poses(
        CandidateSource(replace(KR270, load=load), 0), 500, RHO0, True, RelaxOptions(tolerance=1e-4)
    )
    assert_sound(plan)
    assert_certified(plan)
    assert set(plan.x[:, 6]) <= {0.0, 1.0}
    assert plan.searched_bound.cost <= paper(0, 1000).cost * (1 + slip(plan))
    assert paper(0, 1000).searched_bound.cost <= plan.cost * (1 + slip(plan))


def test_condition_number_of_two_parameters():
    """Two compliances can be made equally well known in every direction: the condition number is one."""
    assert easy("O2").value == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize("name", ["D", "E"])
def test_another_robot(name):
    """Prismatic joints, forces with torques, six rows and a fixed joint: sound, certified, and cheaper than before."""
    plan = easy(name, DESIGNS["odd"])
    assert 1 - plan.searched_bound.cost / plan.cost <= 1e-3
    assert_sound(plan)
    assert_certified(plan)
    assert plan.cost < relax_poses(plan.source, 200, create(name)).proved_bound.cost


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "O2", "O5", "rho0"])
def test_over_candidates(name):
    """Without leaving the candidates: their relaxation to the gap, proved, no search, and nothing merged away."""
    source, criterion = CandidateSource(KR270, 1), STUDY.criterion(name)
    plan = relax_poses(source, 800, criterion)
    assert plan.gap <= GAP
    assert plan.searched_bound is None
    assert plan.best_bound == plan.proved_bound
    assert plan.candidates == 800
    assert_sound(plan)
    assert_certified(plan)
    known = source.take(800)
    assert (np.abs(known.x[:, None] - plan.x).max(axis=-1).min(axis=0) == 0).all()
    assert plan.cost == pytest.approx(relax(known.problem, criterion).cost, rel=GAP)


def test_a_bound_that_is_enough():
    """A search over the continuum that is told to stop leaves a bound that holds, and is wider."""
    source = CandidateSource(KR270, 2)
    short, whole = (
        relax_poses(source, 500, RHO0, True, RelaxOptions(stop=stop))
        for stop in (lambda: True, lambda: False)
    )
    assert short.searched_bound.cost < whole.searched_bound.cost
    assert short.searched_bound.cost <= whole.cost


@pytest.fixture
def little_memory(monkeypatch):
    """A limit that leaves room for fewer than a hundred candidates, and what was ever held at once."""
    monkeypatch.setattr("edtk.design.relaxation.capacity.BASE_MB", 0.0)
    monkeypatch.setattr("edtk.design.relaxation.capacity.KEPT", 50)
    monkeypatch.setattr("edtk.design.relaxation.relax_poses.KEPT", 50)
    monkeypatch.setattr("edtk.design.candidate_source.CHUNK", 1024)
    held, take = [], CandidateSource.take
    monkeypatch.setattr(CandidateSource, "take", lambda self, n: held.append(n) or take(self, n))
    return held


@pytest.mark.parametrize("name", ["rho0", "D", "E", "O2"])
def test_beyond_memory(name, little_memory):
    """Candidates that are only ever priced in chunks give the value and the proof of those held at once."""
    source, criterion, n = CandidateSource(KR270, 3), STUDY.criterion(name), 5000
    assert 50 <= capacity(5, 6, 0.03) < 100
    streamed = relax_poses(source, n, criterion, options=RelaxOptions(memory_mb=0.03))
    assert little_memory == [capacity(5, 6, 0.03)]
    whole = relax_poses(source, n, criterion)
    assert streamed.candidates == whole.candidates == n
    assert streamed.gap <= GAP
    assert streamed.cost == pytest.approx(whole.cost, rel=GAP)
    assert streamed.proved_bound.cost == pytest.approx(whole.proved_bound.cost, rel=GAP)
    assert_sound(streamed)
    assert_certified(streamed)


def test_beyond_memory_and_the_candidates(little_memory):
    """Both at once: the bound is proved on all candidates, though few of them were ever held."""
    source = CandidateSource(TWO, 4)
    plan = relax_poses(
        source, 3000, create("D"), True, RelaxOptions(tolerance=1e-3, memory_mb=0.03)
    )
    assert plan.candidates == 3000
    assert 1 - plan.searched_bound.cost / plan.cost <= 1e-3
    assert little_memory[0] == capacity(2, 6, 0.03) < 300
    assert_sound(plan)
    assert_certified(plan)


def test_memory_limit():
    """A limit too small is refused with the least that will do, which will; and more memory holds more."""
    with pytest.raises(
        MemoryLimitError, match=r"limit of 100 MB is too small, expected (\d+) MB or more"
    ) as caught:
        relax_poses(CandidateSource(KR270), 10, RHO0, options=RelaxOptions(memory_mb=100))
    least = float(str(caught.value).split("expected ")[1].split()[0])
    assert (
        relax_poses(CandidateSource(KR270), 50, RHO0, options=RelaxOptions(memory_mb=least)).gap
        <= GAP
    )
    with pytest.raises(MemoryLimitError):
        capacity(5, 6, least - 1)
    assert capacity(5, 6, least) < capacity(5, 6, 1000) < capacity(5, 6, 2000)
    assert capacity(10, 6, 1000) < capacity(5, 6, 1000)


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
    """Ctrl-C while solving or searching leaves a plan with its proof, and searched only if there was a search."""
    source = CandidateSource(KR270, 5)
    with pytest.raises(PlanInterrupted) as caught:
        relax_poses(
            source,
            3000,
            RHO0,
            True,
            RelaxOptions(tolerance=TOLERANCE, progress=stop_at(stage, count)),
        )
    plan = caught.value.best
    assert isinstance(caught.value, KeyboardInterrupt)
    assert plan.candidates == 3000
    assert (plan.searched_bound is not None) == (stage == "continuum")
    assert_sound(plan)
    assert_certified(plan)


def test_interruption_beyond_memory(little_memory):
    """Ctrl-C between two passes over the candidates leaves a plan whose bound holds for all of them."""
    heard = []

    def progress(stage, gap):
        heard.append(gap)
        if stage == "solve" and heard[-1] > heard[-2]:  # over all candidates, after those in memory
            raise KeyboardInterrupt

    source = CandidateSource(KR270, 3)
    with pytest.raises(PlanInterrupted) as caught:
        relax_poses(source, 5000, RHO0, options=RelaxOptions(memory_mb=0.03, progress=progress))
    plan = caught.value.best
    assert plan.candidates == 5000
    assert plan.gap > GAP
    assert_sound(plan)
    assert_certified(plan)


def test_interruption_before_there_is_a_plan():
    """Ctrl-C while candidates are generated is a plain interruption."""
    with pytest.raises(KeyboardInterrupt) as caught:
        relax_poses(
            CandidateSource(KR270), 100, RHO0, options=RelaxOptions(progress=stop_at("candidates"))
        )
    assert not isinstance(caught.value, PlanInterrupted)


def test_progress_and_seconds():
    """The stages are told in their order, the last gap is within the tolerance, and each stage has its seconds."""
    told = []
    plan = relax_poses(
        CandidateSource(TWO, 1),
        200,
        create("D"),
        True,
        RelaxOptions(tolerance=1e-3, progress=lambda *call: told.append(call)),
    )
    stages = [stage for stage, _ in told]
    assert list(dict.fromkeys(stages)) == ["candidates", "solve", "continuum"]
    assert stages == sorted(stages, key=["candidates", "solve", "continuum"].index)
    assert told[-1][1] <= 1e-3
    assert set(plan.seconds) == {"candidates", "solve", "continuous"}
    assert min(plan.seconds.values()) > 0


def test_candidates_that_identify_too_little():
    """A vertical load does not excite joint 1: its compliance is named, whatever the number of candidates."""
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
    """Fewer than one candidate is refused."""
    with pytest.raises(ValueError, match="at least one candidate"):
        relax_poses(CandidateSource(KR270), n, create("D"))


def test_criterion_without_convex_form():
    """A criterion that cannot be relaxed is refused by name."""

    class Plain(Criterion):
        name, title, formula, sense, degree = "plain", "Plain", "1/trace(M)", "min", 1.0

        def _cost(self, M, cov):
            return 1.0 / np.trace(M, axis1=-2, axis2=-1)

        def _gradient(self, M, cov):
            return -(self._cost(M, cov)[..., None, None] ** 2) * np.eye(M.shape[-1])

    with pytest.raises(NotImplementedError, match="plain"):
        relax_poses(CandidateSource(KR270), 50, Plain())
