"""Plans of both kinds of studies in a cell: free, bounded with it and without, and checked."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from kr270 import REQUIRED
from small_arm import ROBOT as SMALL

import edtk
from edtk.cli import main
from edtk.design.plan import Plan
from edtk.study.study import Study, load_study
from edtk.system.errors import UserError

pytestmark = pytest.mark.usefixtures("shortest_searches")

ROOT = Path(__file__).parents[2]
MILLING = ROOT / "studies" / "kr270_cell.toml"
HANGING = ROOT / "studies" / "kr270_hanging.toml"
PUBLISHED = ROOT / "studies" / "plans" / "table_4_3.csv"
BLOCK = {"name": "block", "size_mm": [600, 600, 600], "position_mm": [1900, 0, 1700]}
SPRINGS = Study(
    **REQUIRED,
    workspace={"height_min_mm": 800, "tilt_max_deg": 30},
    candidates=300,
    starts=16,
    criteria=["D"],
    optimise=["D"],
    scene={"margin_mm": 20, "box": [BLOCK], "plane": [{"name": "floor"}]},
)
ARM = [
    {"name": f"link {i}", "joint": f"q{i}", "from_mm": [0, 0, 0], "to_mm": to, "radius_mm": 40}
    for i, to in ((4, [180, 0, 0]), (6, [60, 0, 0]))
]
PARAMETERS = Study(
    robot=SMALL,
    marker=[
        {"name": name, "position_mm": place}
        for name, place in (("A", [90, 0, 0]), ("B", [0, 80, 40]))
    ],
    load={"list_F_N": [[0, 0, 0], [0, 0, -50]]},
    measurement={"sigma_mm": 0.05},
    parameters={"geometry": ["zeros"], "compliance": ["q2", "q3"]},
    candidates=200,
    scene={
        "margin_mm": 10,
        "bodies": False,
        "capsule": ARM,
        "box": [
            {"name": "wall", "size_mm": [100, 2000, 2000], "position_mm": [400, 0, 0]},
            {"name": "shelf", "size_mm": [900, 900, 40], "position_mm": [0, 0, 900]},
        ],
    },
)
STUDIES = {"springs": (SPRINGS, "D", 5), "parameters": (PARAMETERS, "D", 8)}
both = pytest.mark.parametrize("kind", list(STUDIES))


@cache
def planned(kind: str) -> Any:
    """The plan of a kind of study in its cell."""
    study, criterion, size = STUDIES[kind]
    return edtk.plan(study, size=size, criterion=criterion)


def run(*words: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    answer = CliRunner().invoke(main, [*map(str, words)])
    return answer.exit_code, answer.stdout, answer.stderr


@pytest.mark.cell("`[scene]` in plans and relaxations")
@both
def test_plans_and_weights_are_free_and_have_a_bound_with_the_cell_and_one_without(
    kind: str,
) -> None:
    """Each pose is free; the bound over free poses is no less sharp; words name both."""
    study, criterion, _ = STUDIES[kind]
    plan = planned(kind)
    assert study.cell is not None
    assert study.cell.free(plan.whole.q).all()
    assert plan.certified.efficiency <= plan.efficiency + 1e-6
    assert "with the cell" in plan.summary()
    assert "without the cell the bound is" in plan.summary()
    free_candidates = edtk.relax(study, criterion, candidates=200)
    assert study.cell.free(free_candidates.plan.q).all()
    assert "free candidates" in free_candidates.summary()


@both
def test_the_best_poses_touch_where_nobody_looks(kind: str) -> None:
    """The cells of these tests are worth their name: without them plans touch."""
    study, criterion, size = STUDIES[kind]
    assert study.cell is not None
    alone = edtk.plan(study.replace(scene=None), size=size, criterion=criterion)
    assert not study.cell.free(alone.whole.q).all()
    assert "cell" not in alone.to_dict()
    assert "cell" not in alone.summary()


@pytest.mark.cell("`check`")
@both
def test_check_says_of_each_pose_how_free_it_is_and_ends_with_one_where_it_touches(
    kind: str, tmp_path: Path
) -> None:
    """Exit code 0 for a free plan, 1 for one that touches; names and numbers are the cell's."""
    study = STUDIES[kind][0]
    assert study.cell is not None
    path, free, touching = (tmp_path / n for n in ("study.toml", "free.csv", "touching.csv"))
    path.write_text(study.to_toml(), encoding="utf-8")
    planned(kind).whole.to_csv(free, study.robot)
    q = np.random.default_rng(1).uniform(*study.robot.limits, (300, study.robot.n))
    if kind == "springs":
        q = study.space.without_cell.draw(np.random.default_rng(1).random((3000, 5)))[:, :6]
        q = q[study.workspace.contains(q)]
    q = q[~study.cell.free(q)][:3]
    wrench = np.tile(planned(kind).whole.wrench[-1], (3, 1))
    Plan(q, wrench, np.ones(3, dtype=int)).to_csv(touching, study.robot)
    code, out, _ = run("check", path, free, "--json")
    said = json.loads(out)
    assert (code, said["free"]) == (0, True)
    assert all(leg["free"] for leg in said["legs"])
    for file, ends in ((free, 0), (touching, 1)):
        code, out, _ = run("check", path, file, "--json")
        said = json.loads(out)
        assert (code, said["free"]) == (ends, not ends)
        poses = study.load_plan(file).q
        found = study.cell.clearance(poses)
        assert [1e-3 * one["clearance_mm"] for one in said["poses"]] == pytest.approx(found.least)
        assert [tuple(one["pair"]) for one in said["poses"]] == [
            found.names(i) for i in range(len(poses))
        ]
    code, out, _ = run("check", path, touching)
    assert code == 1
    assert "3 of 3 poses touch" in out
    assert out.count("touches") == 3


def test_check_needs_a_scene_and_a_plan_of_the_same_robot() -> None:
    """Each mistake is one line, with exit code 2."""
    code, _, err = run("check", ROOT / "studies" / "kr270_milling.toml", PUBLISHED)
    assert code == 2
    assert "scene: expected this table, which says what stands around the robot, or [sight]" in err
    small = planned("parameters").whole
    with pytest.raises(UserError, match="has poses of 5 joints; expected the 6"):
        edtk.check(MILLING, Plan(small.q[:, :5], small.wrench, small.repeats))


def test_a_certificate_is_about_poses_that_may_touch(tmp_path: Path) -> None:
    """`edtk verify` knows no cell: the bound that it checks is that without it."""
    proof = tmp_path / "proof.json"
    found = edtk.relax(SPRINGS, "D", candidates=200, certificate=proof)
    assert edtk.verify(proof).valid
    assert found.without_cell is not None
    claims = json.loads(proof.read_text(encoding="utf-8"))["claims"]
    assert claims["bound"] == pytest.approx(found.without_cell.bound)


@pytest.mark.parametrize("path", [MILLING, HANGING])
def test_the_example_cells_can_be_read_and_have_free_poses(path: Path) -> None:
    """The studies that ship have bodies of their own, and poses that are free, but not all."""
    study = load_study(path)
    cell = study.cell
    assert cell is not None
    assert {"floor", "marker arm"} <= {body.name for body in cell.bodies}
    x = study.space.without_cell.draw(np.random.default_rng(0).random((2000, 5)))[:, :6]
    x = x[study.workspace.contains(x)]
    assert 0.05 < cell.free(x).mean() < 0.999
