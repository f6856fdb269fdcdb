"""Runs that are killed, interrupted or repeated, and folders with files of other runs."""

import itertools
import json
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from arm import arm
from click.testing import CliRunner
from forked_command import ForkedCommand
from loaded_arm import STUDY

from edtk.cli import main
from edtk.study.checkpoint import Checkpoint, checkpoint_of
from edtk.study.plan_study import RunOptions
from edtk.study.run_study import NOT_BEGUN, run_study
from edtk.study.study import load_study
from edtk.study.study_run import TABLE_TOLERANCE, run_files
from edtk.system import time_limit
from edtk.system.errors import UserError
from edtk.verbs.of_kinds import of_study
from edtk.verbs.run import run

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("shortest_searches")]

ROOT = Path(__file__).parents[2]


def load_study_of(study, folder):
    """The same study from a file in a folder."""
    study.to_toml(folder / "study.toml")
    return load_study(folder / "study.toml")


def files(folder):
    """Every file below a folder, by its relative path, with its bytes."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def assert_same(one, other):
    """Two folders have the same files, byte by byte."""
    one = files(one)
    other = files(other)
    assert list(one) == list(other)
    assert [name for name in one if one[name] != other[name]] == []


def times(paths):
    """When each file was last written."""
    return {path: path.stat().st_mtime_ns for path in paths}


def started(study, out):
    """`edtk run` in a process of its own."""
    return ForkedCommand("run", study, "--out", out, "--workers", 1)


def wait_for(process, there):
    """Come back as soon as something is there, while the process is running."""
    end = time.monotonic() + 120
    while not there():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)


STUDIES = {
    "springs": arm(sizes=[3, 4], optimise=["A", "D"]),
    "parameters": STUDY.replace(sizes=[4], optimise=["rho0", "D"], starts=1),
}


@pytest.mark.cell("`run --budget`", "springs", "parameters")
@pytest.mark.parametrize("kind", STUDIES)
def test_a_run_within_a_budget_goes_on(kind, tmp_path, monkeypatch):
    """Wherever the time ends there is a largest plan for the main criterion that no bound excludes,
    what was finished is kept, and runs that go on end with the bytes of one without a budget.

    Each look at the clock takes a second, so that nothing depends on the machine.
    """
    study = load_study_of(STUDIES[kind], tmp_path)
    designs_of = of_study(study).designs
    whole = run_study(study, tmp_path / "whole", designs_of=designs_of)
    out = tmp_path / "out"
    looks = itertools.count()
    monkeypatch.setattr(time_limit, "monotonic", lambda: float(next(looks)))
    kept = []
    for budget in (0, 100, 200, 320, 440, 100_000):
        with time_limit.time_limit(budget):
            found = run_study(study, out, designs_of=designs_of)
        kept.append(len(list(out.glob("cases/*"))))
        assert found.best.experiments == max(study.specification.sizes)
        for name in found.relaxations:
            assert found.table[f"efficiency_{name}"].max() <= 1 + TABLE_TOLERANCE
        is_short = (found.table["reason"] == NOT_BEGUN).any()
        assert found.ended == ("budget" if found.cut else "finished")
        assert found.cut or not is_short
    assert kept == sorted(kept)
    assert kept[0] == 0
    assert len(set(kept)) > 2
    assert not found.cut
    assert {k.name: v for k, v in run_files(found).items()} == {
        k.name: v for k, v in run_files(whole).items()
    }
    assert_same(out / "cases", tmp_path / "whole" / "cases")


def test_the_end_of_a_budget_is_said(tmp_path):
    """The command writes a report that says so, ends well, and says how to go on."""
    study = load_study_of(arm(sizes=[3], optimise=["D"]), tmp_path)
    words = ["run", study.path, "--out", tmp_path / "out", "--workers", 1, "--budget", 1e-3]
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == 0
    assert "the budget ended the run; these are the best plans so far" in result.stderr
    assert "The time for this run was over" in (tmp_path / "out" / "report.md").read_text()
    assert (tmp_path / "out" / "plans" / "optimised_D_m3.csv").exists()


@pytest.mark.unix
def test_killed_run_goes_on(tmp_path):
    """Killed in the middle and started again, a run keeps what it had and ends as any other."""
    study = load_study_of(arm(sizes=[3, 4]), tmp_path)
    run(study, tmp_path / "first", workers=1)
    out = tmp_path / "killed"
    with started(study.path, out) as process:
        wait_for(process, lambda: len(list(out.glob("cases/[dor]*.json"))) >= 3)
        process.send_signal(signal.SIGKILL)
        process.communicate()
    assert process.returncode == -signal.SIGKILL
    finished = times(out.glob("cases/[dor]*.json"))
    assert 3 <= len(finished) < len(list(tmp_path.glob("first/cases/*")))
    assert not (out / "results.csv").exists()
    run(study, out, workers=1)
    assert times(finished) == finished
    assert_same(tmp_path / "first", out)


@pytest.mark.unix
def test_ctrl_c_keeps_finished_cases_only(tmp_path):
    """Ctrl-C ends a run with code 130; the search that it interrupted is no finished case."""
    study = load_study_of(arm(sizes=[12, 13, 14], starts=9999), tmp_path)
    out = tmp_path / "out"
    with started(study.path, out) as process:
        wait_for(process, (out / "cases/relaxation_D.json").exists)
        process.send_signal(signal.SIGINT)
        said = process.communicate()[1].decode()
    assert process.returncode == 130, said
    assert said.splitlines()[-1] == "edtk: interrupted"
    assert "Traceback" not in said
    answers = [json.loads(path.read_bytes())["answer"] for path in out.glob("cases/*.json")]
    assert all(answer.get("ended") != "interrupted" for answer in answers)
    assert set(files(out)) < {"cases/relaxation_D.json", "cases/optimised_D_m14.json"}


FOREIGN = ("notes.txt", "table.csv", "plans/mine.csv", "plans/published_m3.csv", "cases/readme.txt")
STALE = (
    "plans/optimised_D_m99.csv",
    "plans/optimised_A_m2.csv",
    "plans/distinct_D_m99_k2.csv",
    "plans/random_m99.csv",
    "efficiency_m99.png",
    "certificates/optimised_D_m99.json",
    "cases/optimised_D_m99.json",
)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The smallest study, and its folder, in which files of others and of earlier runs lay."""
    folder = tmp_path_factory.mktemp("small")
    study = load_study_of(arm(), folder)
    out = folder / "out"
    for name in (*FOREIGN, *STALE):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(name)
    run(study, out, workers=1)
    return study, out


@pytest.fixture
def copied(small, tmp_path):
    """The smallest study, and a copy of its folder."""
    return small[0], Path(shutil.copytree(small[1], tmp_path / "out"))


def test_stale_files_vanish_and_foreign_ones_stay(small):
    """Plans and cases of other runs are removed; files of other names are left as they were."""
    _, out = small
    assert [path.name for path in sorted((out / "plans").glob("*_*.csv"))] == [
        "distinct_D_m2_k1.csv",
        "optimised_D_m2.csv",
        "published_m3.csv",
        "random_m2.csv",
    ]
    assert {path.stem for path in (out / "cases").glob("*.json")} == {
        "relaxation_D",
        "optimised_D_m2",
        "distinct_D_m2_k1",
    }
    assert all((out / name).read_text() == name for name in FOREIGN)


def test_fresh_begins_anew(small, copied):
    """`fresh` computes every case again, with the same answer; without it none is computed."""
    study, out = copied
    before = times(out.glob("cases/*.json"))
    run(study, out, workers=1)
    assert times(before) == before
    run(study, out, workers=1, fresh=True)
    assert all(path.stat().st_mtime_ns > time for path, time in before.items())
    assert_same(small[1], out)


def test_another_study_has_other_cases(small, copied):
    """In the folder of an earlier run a changed study finds nothing finished, and replaces it."""
    study, out = copied
    changed = study.replace(measurement={"sigma_mm": 0.2})
    keys = [checkpoint_of(asked, out / "cases").key for asked in (study, changed)]
    assert keys[0] != keys[1]
    found = run_study(changed, out)
    assert {json.loads(path.read_text())["key"] for path in out.glob("cases/*.json")} == {keys[1]}
    theirs = run_study(study, small[1]).to_frame()["D"]
    # The searches differ in the plans that they find.
    np.testing.assert_allclose(4 * found.to_frame()["D"], theirs, rtol=1e-3)


def test_unusable_cases_are_computed_anew(small, copied):
    """A case file that is garbage, or of another key, is computed again; others stay."""
    study, out = copied
    garbage = out / "cases/distinct_D_m2_k1.json"
    other = out / "cases/optimised_D_m2.json"
    garbage.write_bytes(garbage.read_bytes()[:-100])
    content = json.loads(other.read_text())
    content["key"] = "0" * 16
    content["answer"]["exact"]["plan"]["q"][0][1] = 0.0
    other.write_text(json.dumps(content))
    kept = times([out / "cases/relaxation_D.json"])
    run(study, out, workers=1)
    assert times(kept) == kept
    assert_same(small[1], out)


def test_finished_cases_are_taken_at_their_word(copied):
    """A case file of the right key is believed: it is not computed again."""
    study, out = copied
    before = run_study(study, out).to_frame().set_index("plan")
    path = out / "cases/optimised_D_m2.json"
    content = json.loads(path.read_text())
    plan = content["answer"]["exact"]["plan"]
    plan["q"] = plan["q"][::-1]
    plan["repeats"] = [2 * times for times in plan["repeats"][::-1]]
    Checkpoint(path.parent, content["key"]).keep(path.stem, content["answer"])
    after = run_study(study, out).to_frame().set_index("plan")
    name = "optimised_D_m2"
    assert after.loc[name, "D"] == pytest.approx(2 * before.loc[name, "D"], rel=1e-12)
    assert after.drop(name).equals(before.drop(name))


def test_a_study_in_python_is_taken_up_from_its_file(small, copied):
    """Cases of a study that was built in Python count for the same study from its file."""
    study, out = copied
    in_python = arm()
    assert in_python.digest == study.digest
    finished = times(out.glob("cases/*.json"))
    run_study(in_python, out)
    assert times(finished) == finished


def test_criteria_that_share_their_plans_are_searched_once(tmp_path):
    """O1 is D^(1/2): one relaxation and one search serve both, and O1's rows follow from D's."""
    found = run_study(arm(sizes=[3], optimise=["O1", "D"], criteria=["O1"]), tmp_path)
    assert {path.stem for path in (tmp_path / "cases").iterdir()} == {
        "relaxation_D",
        "optimised_D_m3",
        "distinct_D_m3_k1",
        "distinct_D_m3_k2",
    }
    plans = run_files(found)
    mine, theirs = (plans[tmp_path / f"plans/optimised_{name}_m3.csv"] for name in ("O1", "D"))
    assert mine == theirs
    table = found.to_frame().set_index("plan")
    np.testing.assert_allclose(table["efficiency_O1"] ** 2, table["efficiency_D"], rtol=1e-12)
    for case in found.cases[:2]:
        exact = case.found
        criterion = exact.relaxed.criterion
        M = exact.relaxed.space.information(exact.plan)
        efficiency = table.loc[case.name, f"efficiency_{criterion.name}"]
        assert case.optimised == criterion.name
        assert exact.cost == pytest.approx(float(criterion.cost(M)), rel=1e-12)
        assert exact.efficiency == pytest.approx(efficiency, rel=1e-12)


def test_a_run_shows_itself(tmp_path):
    """The result of a run has its plans by name, is plain data, and one line long."""
    point = {"q_deg": [10, 20], "tool": {"position_mm": [0, 0, 0]}, "load": {"F_N": [0, 0, -1]}}
    found = run_study(arm(test_pose=point, optimise=["D"], criteria=["D", "rho0"]), tmp_path)
    names = ["optimised_D_m2", "distinct_D_m2_k1", "random_m2"]
    assert list(found.plans) == names
    assert found.to_frame().equals(found.table)
    assert "\n" not in repr(found)
    assert "3 plans" in repr(found)
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert [row["plan"] for row in data["table"]] == names
    assert data["relaxations"]["D"]["multipliers"]
    np.testing.assert_array_equal(data["plans"][names[0]]["q"], found.plans[names[0]].q)


def test_a_run_may_have_another_seed(tmp_path):
    """The option takes the place of the study's seed, in every row and in the digest."""
    found = run_study(arm(), tmp_path, options=RunOptions(seed=5))
    assert (found.table["seed"] == 5).all()
    assert (found.table["study_sha256"] == arm(seed=5).digest).all()


def test_published_plans_of_one_name(tmp_path):
    """Two files of the same stem and size are two plans, in the table, in tables of the report."""
    for name, angle in (("pub.csv", 40), ("sub/pub.csv", 90)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(f"q1_deg,q2_deg\n10,{angle}\n-30,{angle}\n")
    study = arm(published=["pub.csv", "sub/pub.csv"]).replace(folder=tmp_path)
    found = run(study, tmp_path / "out", workers=1)
    names = ["published_m2_pub.csv", "published_m2_sub/pub.csv"]
    table = found.to_frame().set_index("plan")
    assert table.loc[names, "D"].nunique() == 2
    assert set(names) <= set(found.plans)
    report = (tmp_path / "out/report.md").read_text()
    for name in ("published (pub.csv)", "published (sub/pub.csv)"):
        assert report.count(name) >= 3
    with pytest.raises(UserError, match=r"published: 'pub.csv' is named twice"):
        study.replace(published=["pub.csv", "pub.csv"]).published_plans()
