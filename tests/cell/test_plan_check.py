"""What is seen of a plan: the same words in `check`, in the text of a plan and in its JSON."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from arm import arm
from loaded_arm import STUDY as LOADED
from short_search import short_search

import edtk
from edtk.study.study import Study
from edtk.system.errors import UserError

KEYS = {
    "noise": {"tracker_position_mm": [2600, 800, 900], "along": [10, 8], "across": [15, 60]},
    "measurement": {},
    "marker": [
        {"name": "a", "position_mm": [0, 0, 50], "normal": [0, 0, 1], "acceptance_deg": 40},
        {"name": "b", "position_mm": [50, 0, 0], "normal": [1, 0, 0], "acceptance_deg": 40},
        {"name": "c", "position_mm": [0, 50, 0]},
    ],
}
SPRINGS = arm(**KEYS)
GEOMETRY = LOADED.replace(**KEYS)


@pytest.fixture(autouse=True)
def _short() -> Iterator[None]:
    """Searches of one round: what is said of a plan holds for any."""
    with short_search():
        yield


@pytest.mark.cell("hidden markers in `check` and `plan`")
@pytest.mark.parametrize(
    ("study", "size"),
    [pytest.param(SPRINGS, 3, id="springs"), pytest.param(GEOMETRY, 6, id="parameters")],
)
def test_what_is_hidden_is_said_of_a_plan(study: Study, size: int) -> None:
    """A check needs no [scene]; it and the plan name what is read in each row, and what is not."""
    found = edtk.plan(study, size, "D", workers=1)
    sight = found.relaxed.space.sight
    assert sight is not None
    names = ["a", "b", "c"]
    expected = [
        {name: str(why) for name, why in zip(names, row, strict=True) if why is not None}
        for row in sight.hidden(found.whole.q)
    ]
    assert any(expected)
    check = edtk.check(study, found.whole)
    for rows in (check.to_dict()["poses"], found.to_dict()["plan"]):
        assert [row["hidden"] for row in rows] == expected
        assert [row["read"] for row in rows] == [[n for n in names if n not in e] for e in expected]
    assert check.free
    assert check.to_dict()["free"] is None
    read = 3 * len(expected) - sum(map(len, expected))
    poses = f"{len(expected)} pose{'s' * (len(expected) > 1)}"
    assert check.headline() == f"a marker is read {read} times of {3 * len(expected)} in {poses}"
    for text in (check.summary(), found.summary()):
        assert all(f"{name} {why}" in text for row in expected for name, why in row.items())


def test_a_check_needs_a_scene_or_a_sight() -> None:
    """Without both there is nothing to look at: one line."""
    plain = arm()
    plan = edtk.plan(plain, 3, "D", workers=1)
    with pytest.raises(UserError, match=r"scene: expected this table, .* or \[sight\]"):
        edtk.check(plain, plan.whole)


def test_a_report_says_what_is_hidden(tmp_path: Path) -> None:
    """The verdict of a run names each row of its plan that hides a marker, with the reasons."""
    edtk.run(SPRINGS.replace(sizes=[3], optimise=["D"]), tmp_path, workers=1)
    report = (tmp_path / "report.md").read_text()
    check = edtk.check(SPRINGS, tmp_path / "plans" / "optimised_D_m3.csv")
    assert check.seen is not None
    assert f"Seen: {check.seen.headline()}." in report
    hiding = [i for i, row in enumerate(check.seen.hidden) if row]
    assert hiding
    assert all(f"row {i + 1}: {check.seen.words(i)}" in report for i in hiding)
