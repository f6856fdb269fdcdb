"""Where the tracker is to stand: chosen together with the poses, for springs as for geometry."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm import arm
from click.testing import CliRunner
from loaded_arm import STUDY as LOADED
from short_search import short_search

import edtk
from edtk.cell.cell import signed_point
from edtk.cell.shapes import Box, Capsule, Cylinder, Plane
from edtk.cli import main
from edtk.study import place_tracker
from edtk.study.place_tracker import PlaceSearch, Setup
from edtk.study.study import Study
from edtk.system.errors import ArgumentError, UserError

pytestmark = pytest.mark.usefixtures("shortest_searches")

PLACES = [[2600, 800, 900], [-2500, -600, 1500]]
TRACKER = {"tracker_position_mm": PLACES[0], "along": [10, 8], "across": [15, 60]}
BOX = [[2200, -500, 500], [3500, 900, 2500]]
TASK = {
    "q_deg": [10, -60],
    "tool": {"position_mm": [500, 0, 0]},
    "load": {"F_N": [0, 0, -50]},
}
SPRINGS = arm(noise=TRACKER | {"tracker_places_mm": PLACES}, measurement={}, test_pose=TASK)
GEOMETRY = LOADED.replace(noise=TRACKER | {"tracker_places_mm": PLACES}, measurement={})
SIZES = {"springs": 3, "parameters": 6}
STUDIES = {"springs": SPRINGS, "parameters": GEOMETRY}
KINDS = [pytest.param(kind, id=kind) for kind in STUDIES]


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Searches of one round from few places: what is said of places holds for them too."""
    few = replace(place_tracker.SEARCH, drawn=1, descents=1, rounds=2, tried_places=12)
    monkeypatch.setattr(place_tracker, "SEARCH", few)
    with short_search():
        yield


def noise(**keys: object) -> dict[str, Any]:
    """The table of a tracker with other keys."""
    return TRACKER | keys


@pytest.mark.cell("`plan --place-tracker`")
@pytest.mark.parametrize("kind", KINDS)
def test_the_best_listed_place_has_the_best_plan(kind: str, tmp_path: Path) -> None:
    """Its plan is that of `edtk.plan` there, and the bound is the best of the bounds of each."""
    study, size = STUDIES[kind], SIZES[kind]
    path = tmp_path / "placed.toml"
    found = edtk.plan(study, size, place_tracker=True, placed_study=path, workers=1)
    each = [edtk.plan(Setup(np.array(p) / 1e3, {}).of(study), size, workers=1) for p in PLACES]
    costs = [one.cost for one in each]
    best = int(np.argmin(costs))
    assert found.cost == costs[best]
    np.testing.assert_array_equal(found.whole.q, each[best].whole.q)
    placement = found.placement
    assert placement is not None
    assert (1e3 * placement.position).tolist() == PLACES[best]
    assert [one.cost for one in placement.tried] == costs
    assert placement.bound is not None
    assert placement.bound.cost == min(one.told_bound.cost for one in each)
    assert placement.bound.cost <= found.cost
    written = edtk.load_study(path)
    assert written.specification.noise is not None
    assert list(written.specification.noise.tracker_position_mm or ()) == PLACES[best]
    assert edtk.evaluate(written, found.whole).criteria["rho0"] == pytest.approx(found.value)
    assert found.to_dict()["tracker"]["position"] == (np.array(PLACES[best]) / 1e3).tolist()
    assert "the best of 2 listed places" in found.summary()


UP, AHEAD = [0, 0, 1], [2, 0, 0]
FRONT = {"name": "a", "position_mm": [50, 0, 0], "normal": AHEAD, "acceptance_deg": 50}
SIDE = {"name": "b", "position_mm": [0, 50, 0]}
MOUNTED = {"marker": [FRONT | {"normals": [UP, AHEAD]}, SIDE]}


@pytest.mark.cell("mounts of reflectors in `plan --place-tracker`")
@pytest.mark.parametrize("kind", KINDS)
def test_the_best_listed_mount_has_the_best_plan(kind: str, tmp_path: Path) -> None:
    """So it is with normals of markers, each of them at each listed place."""
    places = PLACES if kind == "springs" else PLACES[:1]
    few = noise(tracker_places_mm=places)
    study, size = STUDIES[kind].replace(**MOUNTED, noise=few), SIZES[kind]
    path = tmp_path / "placed.toml"
    found = edtk.plan(study, size, "D", place_tracker=True, placed_study=path, workers=1)
    placement = found.placement
    assert placement is not None
    setups = [(place, looks) for place in places for looks in (UP, AHEAD)]
    costs = [one.cost for one in placement.tried]
    for which in (0, -1):
        one, (place, looks) = placement.tried[which], setups[which]
        alone = study.replace(
            marker=[FRONT | {"normal": looks}, SIDE], noise=noise(tracker_position_mm=place)
        )
        plan = edtk.plan(alone, size, "D", workers=1)
        assert (one.cost, one.bound) == (plan.cost, plan.told_bound)
    assert len(set(costs)) == len(costs) == len(setups)
    assert found.cost == min(costs)
    place, looks = setups[int(np.argmin(costs))]
    assert placement.position is not None
    assert (1e3 * placement.position).tolist() == place
    assert placement.normals["a"].tolist() == looks
    assert placement.bound is not None
    assert placement.bound.cost == min(one.bound.cost for one in placement.tried if one.bound)
    written = edtk.load_study(path)
    assert list(written.specification.marker[0].normal or ()) == looks
    assert edtk.evaluate(written, found.whole).criteria["D"] == pytest.approx(found.value)
    assert found.to_dict()["tracker"]["normals"] == {"a": looks}
    assert f"the best of {len(setups)} listed setups" in found.summary()


def test_mounts_alone_are_chosen_before_a_camera() -> None:
    """Where no tracker has a place, reflectors are mounted for what cameras see."""
    camera = {"position_mm": PLACES[0]}
    white = {"noise": None, "measurement": {"sigma_mm": 0.1}}
    watched = SPRINGS.replace(**white, **MOUNTED, sight={"camera": [camera]})
    found = edtk.plan(watched, 3, "D", place_tracker=True, workers=1)
    assert found.placement is not None
    assert found.placement.position is None
    assert [one.position for one in found.placement.tried] == [None, None]
    assert found.cost == min(one.cost for one in found.placement.tried if one.cost)
    assert "mounts      a looks to" in found.summary()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_place_in_a_box_beats_random_ones(kind: str) -> None:
    """None of some random places, each with its own plan, is better than what is searched."""
    study, size = STUDIES[kind].replace(noise=noise(tracker_box_mm=BOX)), SIZES[kind]
    found = edtk.plan(study, size, place_tracker=True, workers=1)
    placement = found.placement
    assert placement is not None
    box = np.array(BOX) / 1e3
    assert ((placement.position >= box[0]) & (placement.position <= box[1])).all()
    assert placement.bound is None
    assert "none is known for all of the box" in found.summary()
    rng = np.random.default_rng(2)
    for place in rng.uniform(*box, (1, 3)):
        assert edtk.plan(Setup(place, {}).of(study), size, workers=1).cost >= found.cost
    there = edtk.evaluate(Setup(placement.position, {}).of(study), found.whole)
    assert there.criteria["rho0"] == pytest.approx(found.value)


@pytest.mark.slow
def test_each_mount_has_its_own_search_of_a_box() -> None:
    """The best place in a box is chosen with the mount, and no listed mount is better there."""
    study = SPRINGS.replace(**MOUNTED, noise=noise(tracker_box_mm=BOX))
    found = edtk.plan(study, 3, "D", place_tracker=True, workers=1)
    placement = found.placement
    assert placement is not None
    box = np.array(BOX) / 1e3
    assert ((placement.position >= box[0]) & (placement.position <= box[1])).all()
    costs = {}
    for looks in (UP, AHEAD):
        there = Setup(placement.position, {"a": np.array(looks)}).of(study)
        costs[tuple(looks)] = edtk.plan(there, 3, "D", workers=1).cost
    assert len(set(costs.values())) == len(costs)
    assert costs[tuple(placement.normals["a"].tolist())] == found.cost == min(costs.values())


def test_a_flat_box_keeps_its_height() -> None:
    """A box without height is a floor on which the tracker moves; one without size is a place."""
    flat = [[2200, -500, 900], [3500, 900, 900]]
    found = edtk.plan(
        SPRINGS.replace(noise=noise(tracker_box_mm=flat)), 3, place_tracker=True, workers=1
    )
    assert found.placement is not None
    assert found.placement.position[2] == 0.9
    point = SPRINGS.replace(noise=noise(tracker_box_mm=[PLACES[1], PLACES[1]]))
    there = edtk.plan(point, 3, place_tracker=True, workers=1)
    assert there.placement is not None
    assert (1e3 * there.placement.position).tolist() == PLACES[1]


def test_what_else_is_asked_is_told_of_the_placed_plan(tmp_path: Path) -> None:
    """The certificate is that of the plan at its place, and holds for the written study."""
    proof, path, table = (tmp_path / name for name in ("proof.json", "placed.toml", "plan.csv"))
    source = tmp_path / "study.toml"
    SPRINGS.to_toml(source)
    words = ["plan", source, "--size", 3, "--place-tracker", "--placed-study", path, "--workers", 1]
    words += ["--certificate", proof, "--out", table, "--json"]
    result = CliRunner().invoke(main, [*map(str, words)])
    assert result.exit_code == 0, result.stderr
    content = json.loads(result.stdout)
    assert content["tracker"]["source"] == "listed"
    assert edtk.verify(proof, path).valid
    assert edtk.evaluate(path, table).criteria["rho0"] == pytest.approx(content["value"], rel=1e-6)


def test_a_place_that_sees_nothing_has_no_plan() -> None:
    """Reflectors that look away from a listed place leave it without a plan, and the reason."""
    looking = SPRINGS.replace(
        sight={"range_mm": [100, 3500]},
        noise=noise(tracker_places_mm=[PLACES[0], [9000, 0, 1000]]),
    )
    found = edtk.plan(looking, 3, place_tracker=True, workers=1)
    assert found.placement is not None
    assert (1e3 * found.placement.position).tolist() == PLACES[0]
    first, second = found.placement.tried
    assert first.cost == found.cost
    assert second.why
    assert found.placement.bound == first.bound
    assert "no plan, " in found.summary()


WALL = {
    "bodies": False,
    "box": [{"name": "wall", "size_mm": [400, 4000, 3000], "position_mm": [-2500, 0, 1500]}],
}


def test_a_tracker_inside_a_wall_is_refused() -> None:
    """A listed place is named by its number; in a box the search goes around it."""
    walled = SPRINGS.replace(scene=WALL)
    with pytest.raises(UserError, match=r"tracker_places_mm\.1: .* mm inside 'wall'"):
        edtk.plan(walled, 3, place_tracker=True, workers=1)
    with pytest.raises(UserError, match=r"tracker_position_mm: .* mm inside 'wall'"):
        SPRINGS.replace(scene=WALL, noise=noise(tracker_position_mm=PLACES[1]))
    around = SPRINGS.replace(
        scene=WALL, noise=noise(tracker_box_mm=[[-2700, -400, 900], [-2200, 400, 1000]])
    )
    found = edtk.plan(around, 3, place_tracker=True, workers=1)
    assert found.placement is not None
    assert not -2.7 < found.placement.position[0] < -2.3


@pytest.mark.parametrize("stopped", ["by the clock", "by Ctrl-C"])
def test_a_box_is_looked_at_no_longer_than_there_is_time(
    stopped: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of its places is weighed, and has a plan."""
    weighed = 0
    own = PlaceSearch._weights

    def counted(search: PlaceSearch, place: Any) -> Any:
        nonlocal weighed
        weighed += 1
        if stopped == "by Ctrl-C" and weighed == 2:
            raise KeyboardInterrupt
        return own(search, place)

    monkeypatch.setattr(PlaceSearch, "_weights", counted)
    study = SPRINGS.replace(noise=noise(tracker_box_mm=BOX))
    budget = 1e-3 if stopped == "by the clock" else None
    found = edtk.plan(study, 3, place_tracker=True, workers=1, budget=budget)
    assert weighed == (1 if budget else 2)
    assert found.ended == ("budget" if budget else "interrupted")
    assert found.placement is not None
    assert found.placement.source == "box"
    assert found.plan.experiments == 3


def test_each_listed_place_has_its_share_of_the_time() -> None:
    """All are tried, and have a plan and a bound each, however short the time is."""
    found = edtk.plan(SPRINGS, 3, place_tracker=True, workers=1, budget=1e-3)
    assert found.placement is not None
    assert all(one.cost is not None for one in found.placement.tried)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"tracker_places_mm": []}, "expected one place"),
        ({"tracker_box_mm": [[1, 1, 1], [0, 2, 2]]}, "expected its lower corner first"),
        ({"tracker_places_mm": [[1, 2]]}, "tracker_places_mm"),
        ({"tracker_places_mm": [[100, 0, 1000], PLACES[0]]}, r"mm\.0: the tracker stands inside"),
    ],
)
def test_bad_places_are_one_line(keys: dict[str, Any], said: str) -> None:
    """Empty lists, boxes inside out and places within the arm's reach are refused by their key."""
    with pytest.raises(UserError, match=said):
        edtk.plan(SPRINGS.replace(noise=noise(**keys)), 3, place_tracker=True, workers=1)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"normals": []}, r"marker\.0: normals: expected directions, got none or zeros"),
        ({"normals": [UP, [0, 0, 0]]}, r"marker\.0: normals: expected directions, got none or"),
        ({"normals": [[0, 1]]}, r"marker\.0\.normals"),
        ({"normal": None, "acceptance_deg": None}, r"marker\.0: expected normal too"),
        ({"normals": [UP] * 101}, "202 places and mounts together; expected 200 at most"),
    ],
)
def test_bad_mounts_are_one_line(keys: dict[str, Any], said: str) -> None:
    """No mount, one that looks nowhere, one without today's, and too many."""
    marker = [FRONT | {"normals": [UP]} | keys, SIDE]

    def asked() -> None:
        edtk.plan(SPRINGS.replace(marker=marker), 3, place_tracker=True, workers=1)

    with pytest.raises(UserError, match=said) as error:
        asked()
    assert "\n" not in str(error.value)


def test_what_cannot_be_asked_is_refused(tmp_path: Path) -> None:
    """Without a tracker, without places, with kept readings, or with a file and no question."""
    plan = edtk.Plan(np.zeros((1, 2)), np.zeros((1, 6)), np.ones(1, dtype=int))
    asked: list[tuple[Study, dict[str, Any], str]] = [
        (arm(), {}, "has no tracker in"),
        (SPRINGS.replace(noise=noise()), {}, "expected places in noise.tracker_places_mm"),
        (SPRINGS, {"keep": plan}, "were read from where the tracker stood"),
    ]
    for study, more, said in asked:
        with pytest.raises(ArgumentError, match=said):
            edtk.plan(study, 3, place_tracker=True, workers=1, **more)
    with pytest.raises(ArgumentError, match="expected place_tracker beside it"):
        edtk.plan(SPRINGS, 3, placed_study=tmp_path / "study.toml", workers=1)
    with pytest.raises(UserError, match="along and across too"):
        SPRINGS.replace(noise={"tracker_position_mm": PLACES[0], "tracker_places_mm": PLACES})
    with pytest.raises(ArgumentError, match="not for plans of a problem"):
        edtk.plan(edtk.Problem(np.ones((3, 1, 1))), 3, place_tracker=True)


def test_points_know_how_deep_they_are_in_solids() -> None:
    """Of each shape a point inside, and one outside, by hand."""
    pose = np.eye(4)
    pose[:3, 3] = [1, 0, 0]
    box = Box(pose, np.array([0.5, 0.4, 0.3]))
    assert signed_point(box, np.array([1.0, 0, 0.1])) == pytest.approx(-0.2)
    assert signed_point(box, np.array([1.8, 0.8, 0])) == pytest.approx(0.5)
    cylinder = Cylinder(pose, 0.5, 1.0)
    assert signed_point(cylinder, np.array([1.2, 0, 0])) == pytest.approx(-0.3)
    capsule = Capsule(np.zeros(3), np.array([0, 0, 1.0]), 0.1)
    assert signed_point(capsule, np.array([0.3, 0, 0.5])) == pytest.approx(0.2)
    assert signed_point(capsule, np.array([0, 0, 2.0])) == pytest.approx(0.9)
    assert signed_point(Plane(np.array([0, 0, 1.0]), 0.2), np.zeros(3)) == pytest.approx(-0.2)
