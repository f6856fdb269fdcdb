"""The search for exact plans: the same wherever it is done, feasible, and below its bound."""

from dataclasses import replace
from functools import cache
from typing import ClassVar

import numpy as np
import pytest
from designs import KR270, LOADED, STUDY

from criteria import create
from criteria.linalg.inverse import whitener
from edtk.design.candidate_source import CandidateSource, sample_feasible
from edtk.design.design_space import DesignSpace
from edtk.design.exact.exact_plan import TooFewExperimentsError, smallest_size
from edtk.design.exact.find_plan import ELITE, SearchOptions, find_plan
from edtk.design.exact.refine import draw_starts, refine
from edtk.design.information import distinct
from edtk.design.plan import Plan
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax_poses import RelaxOptions, relax_poses
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.joint import Joint
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.robots.workspace import Workspace
from edtk.system.time_limit import time_left
from edtk.system.workers import Workers, WorkersLostError

pytestmark = pytest.mark.slow

BATCH = 16  # starts of one
GAP = 1e-3  # of the relaxations, searched over all poses
RUNS = [("rho0", 2), ("rho0", 3), ("rho0", 4), ("D", 3), ("D", 20), ("O2", 4)]


@pytest.fixture(autouse=True, scope="module")
def _kicked():
    """As many starts are refined as users have, and the best plans are kicked in one turn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.design.exact.find_plan.ELITE", ELITE)
        patch.setattr("edtk.design.exact.search_record.KICK_TURNS", 1)
        yield


@cache
def relaxed(name="rho0", space=KR270, continuous=False):
    """A relaxation over a few candidates; on request with a few ascents over all poses."""
    criterion = STUDY.criterion("rho0") if name == "rho0" else create(name)
    source = CandidateSource(space, 0, "sobol", workers=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.design.relaxation.search_continuum.STARTS", 6)
        return relax_poses(source, 200, criterion, continuous, RelaxOptions(tolerance=GAP))


def search(plan, m, k=None, kept=None, **options):
    """The search with these options."""
    return find_plan(plan, m, k, kept, SearchOptions(**options))


@cache
def found(name, m, k=None, seed=0):
    """The plan of one batch."""
    return search(relaxed(name, KR270, True), m, k, seed=seed, starts=BATCH)


@cache
def kept():
    """Five experiments, four of them in different poses, that are there already."""
    return Plan(
        sample_feasible(KR270, 4, 1), np.tile(KR270.load.always, (4, 1)), np.array([1, 2, 1, 1])
    )


def slip(M):
    """Relative error to which a cost is defined: 64 p eps cond."""
    return 64 * len(M) * np.finfo(float).eps * np.linalg.cond(M)


def assert_sound(exact, m, k=None):
    """The plan has m experiments in feasible poses, and its own cost; fixed joints stay."""
    space = exact.relaxed.space
    plan = exact.plan
    M = space.information(plan)
    assert plan.experiments == m
    assert k is None or len(plan.q) <= k
    assert exact.violation == 0
    assert space.workspace.contains(plan.q).all()
    assert exact.cost == pytest.approx(float(exact.relaxed.criterion.cost(M)), rel=slip(M))
    held = np.setdiff1d(np.arange(plan.q.shape[1]), space.free)
    np.testing.assert_array_equal(plan.q[:, held], np.tile(space.fixed[held], (len(plan.q), 1)))
    assert (np.diff(plan.repeats) <= 0).all()
    assert 1 <= exact.found <= exact.starts
    assert 1 <= exact.optima <= exact.starts


def assert_same(one, other):
    """Two searches went the same way, to the same plan bit by bit."""
    assert one.plan.q.tobytes() == other.plan.q.tobytes()
    assert one.plan.wrench.tobytes() == other.plan.wrench.tobytes()
    assert one.plan.repeats.tolist() == other.plan.repeats.tolist()
    fields = ("cost", "starts", "found", "optima", "ended")
    assert [getattr(one, f) for f in fields] == [getattr(other, f) for f in fields]


@pytest.mark.parametrize(("name", "m"), RUNS)
def test_sound(name, m):
    """A plan of each size is feasible without any tolerance, and has the stated cost."""
    assert_sound(found(name, m), m)


@pytest.mark.parametrize(("name", "m"), RUNS)
def test_below_the_bound(name, m):
    """No plan is better than its bound by more than the gap of the search, and none is hopeless.

    The even plan of 2 experiments for 5 parameters has the least efficiency; the weights of a
    relaxation cannot be had with so few, and half of the bound is far below anything that was ever
    found.
    """
    exact = found(name, m)
    gap = exact.relaxed.best_bound.gap
    assert 0 <= gap <= GAP
    assert 0.5 < exact.efficiency <= 1 + gap
    assert m < 12 or exact.efficiency > 0.99


@pytest.mark.parametrize("index", [0, 1, 2])
def test_better_than_the_published_plans(index):
    """For 2, 3 and 4 experiments the plan is no worse than that of the paper."""
    path = STUDY.path.parent / STUDY.specification.published[index]
    published = Plan.from_csv(path, KR270.workspace.robot, STUDY.fixed, KR270.load.always)
    theirs = STUDY.criterion("rho0").cost(KR270.information(published))
    assert found("rho0", published.experiments).cost <= theirs


def test_a_pose_that_occurs_twice_is_one_with_repetitions():
    """In a plan of many experiments no two poses have the same information."""
    plan = found("D", 20).plan
    blocks = KR270.problem(plan.q).blocks()
    assert len(distinct(blocks, whitener(blocks.mean(axis=0)), 1e-3)) == len(plan.q) < 20
    assert len(plan.q) <= 16  # p(p + 1)/2 + 1


@pytest.mark.parametrize(("name", "m"), [("rho0", 4), ("D", 3)])
def test_seeds_agree(name, m):
    """Two seeds of a few starts each come within 0.3 % of each other for a few experiments."""
    costs = [found(name, m, None, seed).cost for seed in (0, 1)]
    assert max(costs) <= 1.003 * min(costs)


def test_seeds_agree_by_chance_alone(monkeypatch):
    """Three seeds agree without the start that they share, and find different poses."""

    def without_the_first(*args):
        return draw_starts(*args)[np.array([*range(1, BATCH), 1])]

    monkeypatch.setattr("edtk.design.exact.find_plan.draw_starts", without_the_first)
    plans = [search(relaxed(), 4, seed=seed, starts=BATCH) for seed in (0, 1, 2)]
    costs = [p.cost for p in plans]
    assert max(costs) <= 1.003 * min(costs)
    assert len({p.plan.q.tobytes() for p in plans}) == 3


def test_the_same_from_every_team():
    """One, two and three processes find the very same plan, though some do batches in vain."""
    options = {"m": 3, "starts": 10 * BATCH, "patience": 2}
    one, two, three = (search(relaxed("D"), **options, workers=Workers(size)) for size in (1, 2, 3))
    assert one.ended == "stagnation"
    assert one.starts < 10 * BATCH
    assert_same(one, two)
    assert_same(one, three)


def test_a_short_search_starts_no_processes():
    """Of a search that is over in time the plan is the same, and nobody else was asked."""

    class Unasked(Workers):
        def run(self, pieces):
            raise AssertionError

    options = {"m": 3, "starts": 10 * BATCH, "patience": 2}
    alone = search(relaxed("D"), **options, workers=Unasked(2), alone=np.inf)
    assert_same(alone, search(relaxed("D"), **options))


def test_a_batch_has_its_own_seed():
    """What one batch finds is also among what two find, and the second adds plans of its own."""
    costs = []
    both = search(
        relaxed(), 3, starts=2 * BATCH, progress=lambda starts, cost: costs.append((starts, cost))
    )
    one = search(relaxed(), 3, starts=BATCH)
    assert [starts for starts, _ in costs] == [BATCH, 2 * BATCH]
    assert costs[1][1] <= costs[0][1]
    # The kicks at the end begin elsewhere, and may come to the same plan with another last digit.
    assert both.cost <= one.cost * (1 + 1e-9)
    assert both.optima + both.found > one.optima + one.found


@pytest.mark.parametrize("patience", [1, 3])
def test_stagnation(patience):
    """The search ends after so many batches in a row without a gain of 1e-4, and not before."""
    costs = []
    plan = search(
        relaxed("D"),
        3,
        starts=50 * BATCH,
        patience=patience,
        progress=lambda _, cost: costs.append(cost),
    )
    gains = [i for i in range(len(costs)) if i == 0 or costs[i] < costs[i - 1] * (1 - 1e-4)]
    assert plan.ended == "stagnation"
    assert len(costs) == gains[-1] + 1 + patience
    assert plan.starts == BATCH * len(costs)


@pytest.mark.parametrize(("starts", "batches"), [(1, 1), (16, 1), (17, 2)])
def test_limit_on_starts(starts, batches):
    """The number of starts is rounded up to whole batches."""
    plan = search(relaxed("D"), 2, starts=starts)
    assert (plan.ended, plan.starts) == ("starts", batches * BATCH)


@pytest.mark.parametrize("name", ["rho0", "O2"])
def test_no_time(name):
    """Even then one batch of starts is made, and the best of them comes back, feasible."""
    plan = search(relaxed(name), 4, seconds=0.0)
    assert (plan.ended, plan.starts) == ("budget", BATCH)
    assert_sound(plan, 4)


def test_a_search_that_is_cut_off_brings_its_best_plan_to_an_optimum(monkeypatch):
    """Its starts have gone nowhere yet; of the best of them alone loads come to their limits."""
    space = LOADED["kr270 free"]
    clock = [0.0]
    monkeypatch.setattr("edtk.system.time_limit.monotonic", lambda: clock[0])

    def cut_off(self, record):
        plans = self._batch(0)._starts()
        costs = refine(space, self.relaxed.criterion, plans.x, plans.repeats, iterations=1)[1]
        order = np.argsort(costs)
        record.enter(costs[order], plans[order])
        clock[0] += time_left()
        return "budget"

    monkeypatch.setattr("edtk.design.exact.find_plan._Search.run", cut_off)
    plan = search(relaxed("D", space), 3, seconds=10.0)
    assert plan.ended == "budget"
    size = np.linalg.norm(plan.plan.wrench[:, :3], axis=1)
    assert size == pytest.approx(space.load.largest, rel=1e-6)


def test_interrupted():
    """Ctrl-C after the first batch leaves its plan; before, the first plan that can be given."""

    def interrupt(starts, cost):
        raise KeyboardInterrupt

    plan = search(relaxed("D"), 3, progress=interrupt)
    assert (plan.ended, plan.starts) == ("interrupted", BATCH)
    assert_sound(plan, 3)

    class Impatient(Workers):
        """Workers of which the user has enough at once."""

        asked: ClassVar[list[int]] = []

        def run(self, pieces):
            self.asked.append(len(pieces))
            if len(self.asked) == 1:
                raise KeyboardInterrupt
            return super().run(pieces)

    plan = search(relaxed("D"), 3, workers=Impatient())
    assert (plan.ended, plan.starts) == ("interrupted", BATCH)
    assert_sound(plan, 3)


def test_a_team_that_goes_away():
    """The loss of the workers reaches the caller."""

    class Leaving(Workers):
        def run(self, pieces):
            raise WorkersLostError("gone")

    with pytest.raises(WorkersLostError, match="gone"):
        search(relaxed("D"), 3, workers=Leaving())


@pytest.mark.parametrize(("m", "k"), [(3, 2), (4, 3), (3, 6)])
def test_distinct_poses(m, k):
    """No more poses than one asks for, and more experiments than poses mean repetitions."""
    plan = search(relaxed(), m, k, starts=BATCH)
    assert_sound(plan, m, k)
    assert plan.cost >= found("rho0", m).cost * (
        1 - 3e-3
    )  # what any number of poses reaches, see above


@pytest.mark.parametrize("kind", ["bounded", "listed", "free"])
def test_loads(kind):
    """Loads are chosen from their family, and D is no worse where they are free to move."""
    space = LOADED[f"kr270 {kind}"]
    exact = search(relaxed("D", space), 3, starts=2 * BATCH)
    assert_sound(exact, 3)
    wrench = exact.plan.wrench
    size = np.linalg.norm(KR270.load.always)
    if kind == "listed":
        assert (wrench[:, None] == space.load.wrenches).all(axis=-1).any(axis=-1).all()
    else:
        assert (np.linalg.norm(wrench, axis=1) <= size * (1 + 1e-12)).all()
        assert exact.cost <= found("D", 3).cost * 1.01  # what seeds differ by


def test_experiments_that_are_there_already():
    """The cost is that of all experiments; one new one is enough where kept ones suffice."""
    criterion = STUDY.criterion("rho0")
    for m in (1, 3):
        beside = KR270.with_kept(KR270.information(kept()), m)
        plan = search(relaxed("rho0", beside), m, kept=kept(), starts=BATCH)
        M = KR270.information(plan.whole)
        assert_sound(plan, m)
        assert plan.whole.experiments == 5 + m
        np.testing.assert_array_equal(plan.whole.q[:4], kept().q)
        assert plan.cost == pytest.approx(float(criterion.cost(M)), rel=slip(M))
        assert plan.cost < criterion.cost(KR270.information(kept()))


def test_what_is_there_counts():
    """New experiments that know of the kept ones are better beside them than those that do not."""
    criterion = STUDY.criterion("rho0")
    m = 3
    beside = KR270.with_kept(KR270.information(kept()), m)
    plan = search(relaxed("rho0", beside), m, kept=kept(), starts=BATCH)
    assert plan.cost < criterion.cost(KR270.information(kept() + found("rho0", m).plan)) * (
        1 - 1e-3
    )


def test_bound_beside_very_many_kept_experiments(monkeypatch):
    """Beside four thousand kept experiments two new ones gain what the bound allows, and not more.

    When each pose counted with its share of the kept ones, all poses looked alike, ascents started
    from one of them only, and the plan's gain was two per cent beyond the bound's.
    """
    many = STUDY.published_plans()["table_4_4"].repeated(1000)
    K = KR270.information(many)
    source = CandidateSource(KR270.with_kept(K, 2), 0, "sobol", workers=1)
    monkeypatch.setattr("edtk.design.relaxation.search_continuum.SCREEN", 20_000)
    monkeypatch.setattr("edtk.design.relaxation.search_continuum.STARTS", 96)
    bounded = relax_poses(source, 200, create("E"), True, RelaxOptions(tolerance=1e-6))
    plan = search(bounded, 2, kept=many, starts=BATCH)
    before = float(create("E").cost(K))
    allowed = before - plan.lower_bound.cost
    assert 0.999 * allowed <= before - plan.cost <= (1 + 1e-3) * allowed


def test_kept_experiments_may_identify_what_no_new_one_can():
    """A joint that no pose excites under the load is no obstacle where kept experiments tell it."""
    model = replace(KR270.model, unknown=tuple(range(6)))
    space = replace(KR270, model=model)
    with pytest.raises(RankDeficientError):
        smallest_size(space)
    pushed = np.tile([0.0, 1500.0, -800.0, 0.0, 0.0, 0.0], (4, 1))
    sideways = Plan(sample_feasible(KR270, 4, 2), pushed, np.ones(4, dtype=int))
    beside = space.with_kept(space.information(sideways), 3)
    plan = search(relaxed("D", beside), 3, kept=sideways, starts=BATCH)
    assert_sound(plan, 3)
    assert plan.cost < plan.relaxed.criterion.cost(space.information(sideways))


def planar():
    """Five revolute joints with parallel axes: deflections have two components only."""
    joints = tuple(
        Joint(f"q{i + 1}", transform([0.3 + 0.1 * i, 0, 0]), [0, 1, 0], (-2, 2)) for i in range(5)
    )
    robot = Robot("planar", joints, np.eye(4), transform([0.4, 0, 0]))
    load = FixedLoad(np.array([100.0, 0, -300, 0, 0, 0]))
    return DesignSpace(
        ElastostaticModel(robot),
        Workspace(robot),
        np.full(3, 1e-4),
        load,
        list(range(5)),
        np.zeros(5),
    )


def six_rows():
    """The paper's design with rotations measured too."""
    model = replace(KR270.model, rows="pose")
    return replace(KR270, model=model, sigma=np.append(KR270.sigma, np.full(3, 1e-4)))


def rarely():
    """The paper's design with joint 1 unknown too, which one load of thirty in the list excites."""
    wrenches = np.array([[0, 0, -2500.0, 0, 0, 0]] * 29 + [[0, 1500.0, 0, 0, 0, 0]])
    return replace(
        KR270, model=replace(KR270.model, unknown=(0, 1, 2, 3, 4, 5)), load=ListedLoad(wrenches)
    )


SIZES = {
    "a direction that few poses excite": (rarely, 2),
    "three rows, five parameters": (lambda: KR270, 2),
    "three rows, two parameters": (
        lambda: replace(KR270, model=replace(KR270.model, unknown=(1, 2))),
        1,
    ),
    "six rows, five parameters": (six_rows, 1),
    "two rows that tell, five parameters": (planar, 3),
    "beside others": (lambda: KR270.with_kept(KR270.information(kept()), 1), 1),
    "beside one other": (lambda: KR270.with_kept(KR270.problem(kept().q[:1]).blocks()[0], 1), 1),
}


@pytest.mark.parametrize("case", SIZES)
def test_smallest_size(case):
    """The least number of experiments follows from rows, parameters, and kept experiments."""
    space, least = SIZES[case]
    assert smallest_size(space()) == least


@pytest.mark.parametrize(
    "case", ["three rows, five parameters", "two rows that tell, five parameters"]
)
def test_too_few(case):
    """One experiment or pose less than the smallest number is rejected, and that number works."""
    space = SIZES[case][0]()
    least = SIZES[case][1]
    plan = relaxed("D", KR270 if space is KR270 else _cached(case))
    for m, k, what in ((least - 1, None, "experiment"), (12, least - 1, "distinct pose")):
        said = (
            rf"^{least - 1} {what}s? cannot identify 5 parameters; the smallest number is {least}$"
        )
        with pytest.raises(TooFewExperimentsError, match=said) as e:
            search(plan, m, k)
        assert e.value.least == least
    assert_sound(search(plan, least, starts=BATCH), least)


@cache
def _cached(case):
    """One design, so that its relaxation is solved once."""
    return SIZES[case][0]()


def test_one_experiment():
    """Where six rows are measured, one experiment identifies five parameters, and is found."""
    plan = search(relaxed("rho0", _cached("six rows, five parameters")), 1, starts=BATCH)
    assert_sound(plan, 1)
    assert np.isfinite(plan.value)
