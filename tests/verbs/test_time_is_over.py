"""After the end of a budget nothing is begun: counted on a clock that counts looks at it."""

import pkgutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from arm import arm
from loaded_arm import STUDY
from short_search import short_search

import edtk
from edtk.design.exact import visit_search
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.exact.spread import _Spread
from edtk.design.exact.visit_search import VisitSearch
from edtk.design.interior_point import descend
from edtk.design.relaxation import relax_poses, search_continuum
from edtk.system import time_limit
from edtk.verbs.of_kinds import OfCompliances

pytestmark = pytest.mark.slow

NOISE = {"discrepancy_mm": 0.1, "discrepancy_within_deg": 5}
PRICED = {"visit": 1, "load_change": 2, "budget": 9}
STUDIES = {
    "springs": arm(noise=NOISE),
    "parameters": STUDY.replace(noise=NOISE),
    "a day": STUDY.replace(noise=NOISE, costs=PRICED),
}
# What may be left out, by the place where it is begun.
LATE = {
    "parameters are judged": (STUDIES["parameters"], "edtk.verbs.of_kinds.OfGeometry._judged"),
    "springs are judged": (STUDIES["springs"], "edtk.verbs.of_kinds.OfCompliances._judged"),
    "places are exchanged": (STUDIES["parameters"], "edtk.design.exact.visit_search.exchange"),
}
STEPS: dict[str, tuple[object, str]] = {
    "another search of poses": (relax_poses, "fresh_poses"),
    "ascents": (relax_poses, "search_continuum"),
    "a step of a descent": (descend, "step"),
    "a refinement": (VisitSearch, "_refined"),
    "a visit moves": (_Spread, "moved"),
}


class Clock:
    """Each look at it takes a second."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        """The time."""
        self.now += 1.0
        return self.now


def begun(
    monkeypatch: pytest.MonkeyPatch, study: edtk.Study, budget: float
) -> dict[str, list[float]]:
    """How long before the end of the budget each step was begun."""
    clock = Clock()
    found: dict[str, list[float]] = {name: [] for name in STEPS}

    def counted(name: str, own: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            limit = time_limit._limit.get()
            assert limit is not None
            found[name].append(limit.end - clock.now)
            return own(*arguments, **options)

        return call

    with monkeypatch.context() as patch:
        patch.setattr(time_limit, "monotonic", clock)
        patch.setattr(search_continuum, "SCREEN", 500)
        for name, (place, attribute) in STEPS.items():
            patch.setattr(place, attribute, counted(name, getattr(place, attribute)))
        size = None if study.specification.costs else 6
        plan = edtk.plan(study, size, "D", budget=budget, workers=1)
    assert plan.plan.experiments >= 3
    assert plan.efficiency <= 1 + 1e-9
    return found


@pytest.mark.parametrize("kind", STUDIES)
def test_after_the_deadline_nothing_is_begun(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the time ends, no step begins after it; with more time each kind of step does."""
    every: set[str] = set()
    for budget in (1, 20, 60, 150, 400, 1000, 3000, 10000):
        steps = begun(monkeypatch, STUDIES[kind], budget)
        for name, left in steps.items():
            assert all(seconds > 0 for seconds in left), (name, budget, min(left))
            every |= {name} if left else set()
    expected = set(STEPS) - ({"a refinement"} if kind == "springs" else set())
    assert every == expected


@pytest.mark.cell("`relax --budget`", "springs", "parameters")
@pytest.mark.parametrize("kind", ["springs", "parameters"])
def test_weights_within_a_budget_have_a_bound_and_say_so(
    kind: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """No design is better than the bound wherever the time ends, and more time cuts off less."""
    ended = []
    with short_search():
        best = edtk.relax(STUDIES[kind], "D", continuous=True)
        for budget in (1, 100, 1000, 1e9):
            with monkeypatch.context() as patch:
                patch.setattr(time_limit, "monotonic", Clock())
                written = {"out": tmp_path / "weights.csv", "certificate": tmp_path / "proof.json"}
                found = edtk.relax(
                    STUDIES[kind], "D", continuous=True, budget=budget, workers=1, **written
                )
            assert found.proved_bound.cost <= found.cost * (1 + 1e-9)
            assert found.proved_bound.cost <= best.cost * (1 + 1e-9)
            assert found.to_dict().get("ended", "proved") == found.ended
            assert edtk.verify(written["certificate"]).valid
            ended.append(found.ended)
    assert ended == sorted(ended)
    assert (ended[0], ended[-1]) == ("budget", "proved")
    assert found.weights == pytest.approx(best.weights)


@pytest.mark.parametrize("when", LATE)
def test_ctrl_c_keeps_the_plan(when: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a first design it leaves a plan, with a bound that this does not beat."""
    study, place = LATE[when]
    own = pkgutil.resolve_name(place)
    calls = iter(range(100))

    def interrupted(*arguments: Any, **options: Any) -> Any:
        if next(calls) == 0:
            raise KeyboardInterrupt
        return own(*arguments, **options)

    monkeypatch.setattr(place, interrupted)
    with short_search():
        plan = edtk.plan(study, 6, "D", workers=1)
    assert plan.ended == "interrupted"
    assert plan.plan.experiments == 6
    assert plan.efficiency <= 1 + 1e-9
    assert "6 " in plan.summary()


def test_ctrl_c_in_counts_is_not_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where visits under a load cost more, numbers of visits are searched; they may be cut off."""
    own = visit_search.find_counts
    ends = iter(["interrupted"])

    def interrupted(*arguments: Any, **options: Any) -> Any:
        found = own(*arguments, **options)
        return replace(found, ended=next(ends, found.ended))

    monkeypatch.setattr(visit_search, "find_counts", interrupted)
    priced = {"visit": 1, "loaded_visit": 2, "load_change": 2, "budget": 12}
    with short_search():
        plan = edtk.plan(STUDY.replace(costs=priced), criterion="D", workers=1)
    assert plan.ended == "interrupted"
    assert plan.efficiency <= 1 + 1e-9


def test_ctrl_c_in_a_second_search_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second criterion whose search gains nothing before it is interrupted leaves the first."""
    found: list[ExactPlan] = []
    own = OfCompliances._best_plan

    def interrupted(*arguments: Any) -> Any:
        first = found[0] if found else own(*arguments)
        found.append(first)
        return replace(first, ended="interrupted") if len(found) > 1 else first

    monkeypatch.setattr(OfCompliances, "_best_plan", interrupted)
    with short_search():
        plan = edtk.plan(arm(), 6, "D", second="A", workers=1)
    assert len(found) == 2
    assert plan.ended == "interrupted"
