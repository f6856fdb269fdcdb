"""A small study from file to folder, at once or in pieces."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import criteria
from edtk.cli import main
from edtk.design.exact.apportion import apportion
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.study import run_study as runner
from edtk.study.checkpoint import checkpoint_of
from edtk.study.evaluate import evaluate
from edtk.study.relax_study import relax_study
from edtk.study.run_study import run_study, steps
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.run import run as run_and_report

STUDIES = Path(__file__).parents[2] / "studies"
SIZES = "sizes = [1, 3]"
OPTIMISE = 'optimise = ["rho0", "E"]'
CRITERIA = 'criteria = ["rho0", "E"]'


def write(folder, *changes, published=True):
    """A small copy of the KR 270 study in a folder, with further replacements."""
    text = (STUDIES / "kr270_milling.toml").read_text(encoding="utf-8")
    small = [
        ("sizes = [2, 3, 4, 6, 12]", SIZES),
        ("candidates = 2000", "candidates = 200"),
        ("starts = 32", "starts = 1"),
        ('optimise = ["rho0", "A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5"]', OPTIMISE),
        ('criteria = ["A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0"]', CRITERIA),
    ]
    for old, new in (*small, *changes):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    head, rest = text.split("published = [")
    named = '"plans/table_4_3.csv"' if published else ""
    text = f"{head}published = [{named}]{rest.split(']', 1)[1]}"
    (folder / "plans").mkdir(parents=True, exist_ok=True)
    (folder / "plans" / "table_4_3.csv").write_bytes(
        (STUDIES / "plans" / "table_4_3.csv").read_bytes()
    )
    path = folder / "small.toml"
    path.write_text(text, encoding="utf-8")
    tomllib.loads(text)
    return path


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """The study, its table, its folder, and the labels of its progress."""
    folder = tmp_path_factory.mktemp("study")
    labels = []
    study = load_study(write(folder))

    def progress(label, share):
        labels.append((label, share))

    found = run_and_report(study, folder / "first", workers=1, progress=progress)
    return study, found.table, folder / "first", labels


def test_columns(done):
    """results.csv has one row a plan: what it is, every criterion, efficiencies, and where it comes from."""
    study, table, out, _ = done
    read = pd.read_csv(out / "results.csv", keep_default_na=False)
    expected = [
        "plan",
        "kind",
        "optimised_for",
        "experiments",
        "distinct_at_most",
        "poses",
        "reason",
    ]
    expected += study.specification.criteria
    expected += ["efficiency_rho0", "efficiency_E", "seed", "study_sha256", "edtk"]
    assert list(read) == list(table) == expected
    assert read["plan"].tolist() == [
        "optimised_rho0_m1", "optimised_E_m1", "optimised_rho0_m3", "optimised_E_m3", "distinct_rho0_m3_k2",
        "random_m1", "random_m3", "published_m3",
    ]  # fmt: skip
    assert read["distinct_at_most"].tolist() == [1, 1, 3, 3, 2, 1, 3, 3]
    assert (read["study_sha256"] == study.digest).all()
    assert (read["seed"].astype(int) == study.specification.seed).all()


def test_plan_files_are_what_the_table_says(done):
    """Every plan in the folder is read back as feasible, has its size, and its criteria are those of its row."""
    study, _, out, _ = done
    table = pd.read_csv(out / "results.csv").set_index("plan")
    files = sorted((out / "plans").iterdir())
    assert [f.stem for f in files] == [
        "distinct_rho0_m3_k2",
        "optimised_E_m3",
        "optimised_rho0_m3",
        "random_m3",
    ]
    for file in files:
        plan = study.load_plan(file)
        row = table.loc[file.stem]
        assert plan.experiments == row["experiments"] == 3
        assert len(plan.q) == row["poses"] <= row["distinct_at_most"]
        for name in study.specification.criteria:
            assert evaluate(study, plan).criteria[name] == pytest.approx(row[name], rel=1e-6)


def test_written_plans_are_feasible_without_rounding_allowance(done):
    """A study's own plans are read back by the same study that allows no rounding of plans at all."""
    _, _, out, _ = done
    change = ("plan_resolution_deg = 0.1 ", "plan_resolution_deg = 0.0 ")
    strict = load_study(write(out.parent / "strict", change, published=False))
    for file in (out / "plans").iterdir():
        strict.load_plan(file)


def test_published_plan_is_compared(done):
    """The published plan has a row with the values of its own file, and is not copied."""
    study, table, out, _ = done
    row = table.set_index("plan").loc["published_m3"]
    values = evaluate(study, study.published_plans()["table_4_3"]).criteria
    assert row["rho0"] == pytest.approx(values["rho0"], rel=1e-12)
    assert not (out / "plans" / "published_m3.csv").exists()


@pytest.mark.parametrize(("name", "best"), [("rho0", "min"), ("E", "max")])
def test_optimised_plan_is_the_best_of_its_size(done, name, best):
    """Under the criterion that it was optimised for no other plan of that size is better."""
    table = done[1].query("experiments == 3").set_index("plan")
    assert table.loc[f"optimised_{name}_m3", name] == getattr(table[name], best)()


def test_efficiency_follows_from_value_and_bound(done):
    """One bound stands behind all rows: efficiency times cost times m^degree is the same number."""
    table = done[1].query("experiments == 3")
    for bound in (
        table["efficiency_rho0"] * table["rho0"] * 3**0.5,
        table["efficiency_E"] / table["E"] * 3,
    ):
        np.testing.assert_allclose(bound, bound.iloc[0], rtol=1e-12)
    assert table[["efficiency_rho0", "efficiency_E"]].gt(0).all(axis=None)
    assert table[["efficiency_rho0", "efficiency_E"]].lt(1).all(axis=None)


def test_bound_is_over_all_poses(done):
    """A study of few candidates has the bound of the paper's problem over all poses, within the search's 1e-4."""
    row = done[1].query("experiments == 3").iloc[0]
    assert row["efficiency_rho0"] * row["rho0"] * 3**0.5 == pytest.approx(9.645e-6, rel=1e-4)


@pytest.mark.parametrize("name", ["O2", "O4", "O5"])
def test_every_criterion_can_be_optimised(tmp_path, name):
    """A study may ask for any criterion, and its whole experiments are never worse than mere rounding of weights."""
    study = load_study(write(tmp_path, (OPTIMISE, f'optimise = ["{name}"]'), published=False))
    relaxed = relax_study(study, name)
    plan = find_plan(relaxed, 3, options=SearchOptions(seed=1, starts=16)).plan
    repeats = apportion(relaxed.weights, 3)
    rounded = study.space.plan(relaxed.x[repeats > 0], repeats[repeats > 0])
    cost = criteria.create(name).cost
    assert plan.experiments == 3
    assert study.space.workspace.contains(plan.q).all()
    assert cost(study.space.information(plan)) <= cost(study.space.information(rounded)) < np.inf


def test_criteria_that_share_their_plans_are_searched_once(tmp_path):
    """O1 is D^(1/2): one relaxation and one search serve both, and O1's rows follow from D's."""
    changes = [
        (SIZES, "sizes = [3]"),
        (OPTIMISE, 'optimise = ["O1", "D"]'),
        (CRITERIA, 'criteria = ["O1"]'),
    ]
    found = run_study(load_study(write(tmp_path, *changes, published=False)), tmp_path / "out")
    assert {path.stem for path in (tmp_path / "out/cases").iterdir()} == {
        "relaxation_D", "optimised_D_m3", "distinct_D_m3_k2",
    }  # fmt: skip
    plans = tmp_path / "out/plans"
    assert (plans / "optimised_O1_m3.csv").read_bytes() == (
        plans / "optimised_D_m3.csv"
    ).read_bytes()
    table = found.to_frame().set_index("plan")
    np.testing.assert_allclose(table["efficiency_O1"] ** 2, table["efficiency_D"], rtol=1e-12)
    by_name = {case.name: case.found for case in found.cases}
    for name in ("O1", "D"):
        exact = by_name[f"optimised_{name}_m3"]
        M = exact.relaxed.space.information(exact.plan)
        assert exact.relaxed.criterion.name == name
        assert exact.cost == pytest.approx(float(exact.relaxed.criterion.cost(M)), rel=1e-12)
        assert exact.efficiency == pytest.approx(
            table.loc[f"optimised_{name}_m3", f"efficiency_{name}"], rel=1e-12
        )


def test_a_run_shows_itself(tmp_path):
    """The result of a run has its plans by name, is plain data, and one line long."""
    changes = [(SIZES, "sizes = [2, 1]"), (OPTIMISE, 'optimise = ["D"]')]
    changes.append((CRITERIA, 'criteria = ["D"]'))
    found = run_study(load_study(write(tmp_path, *changes)), tmp_path / "out")
    assert list(found.plans) == ["optimised_D_m2", "random_m2", "published_m3"]
    assert found.to_frame().equals(found.table)
    assert "\n" not in repr(found)
    assert "3 plans" in repr(found)
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert [row["plan"] for row in data["table"]] == found.table["plan"].tolist()
    assert data["table"][1]["D"] is None  # one experiment identifies nothing
    assert data["relaxations"]["D"]["multipliers"]
    np.testing.assert_array_equal(
        data["plans"]["optimised_D_m2"]["q"], found.plans["optimised_D_m2"].q
    )


def files(folder):
    """Every file below a folder, by its relative path."""
    return {str(p.relative_to(folder)): p for p in sorted(folder.rglob("*")) if p.is_file()}


def contents(folder):
    """The same with their bytes."""
    return {name: path.read_bytes() for name, path in files(folder).items()}


def assert_same(one, other):
    """Two folders have the same files, byte by byte."""
    one, other = contents(one), contents(other)
    assert list(one) == list(other)
    assert [name for name in one if one[name] != other[name]] == []


def run(study, out, *options):
    """`edtk run`, which has to succeed."""
    result = CliRunner().invoke(main, ["run", str(study), "--out", str(out), *map(str, options)])
    assert result.exit_code == 0, result.stderr


def started(study, out, *options):
    """`edtk run` in a process of its own."""
    command = [sys.executable, "-m", "edtk", "run", study, "--out", out, *map(str, options)]
    env = {**os.environ, "PYTHONPATH": str(STUDIES.parent)}
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=env)


def wait_for(process, there):
    """Come back as soon as something is there, while the process is running."""
    end = time.monotonic() + 120
    while not there():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.01)


def test_second_run_is_the_same_with_two_workers(done, tmp_path):
    """The same study gives byte-identical files in another folder, and whoever does the work: one process or two."""
    study, _, first, _ = done
    run(study.path, tmp_path / "second", "--workers", 2)
    assert {"results.csv", "report.md", "comparison.png", "cases/relaxation_E.json"} <= set(
        files(first)
    )
    assert_same(first, tmp_path / "second")


def test_killed_run_goes_on(done, tmp_path):
    """Killed in the middle and started again, a run ends with the files of one that was not, and keeps what it had."""
    study, _, first, _ = done
    out = tmp_path / "killed"
    with started(study.path, out, "--workers", 1) as process:
        wait_for(process, lambda: len(list(out.glob("cases/[dor]*.json"))) >= 3)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    finished = {path: path.stat().st_mtime_ns for path in out.glob("cases/[dor]*.json")}
    assert 3 <= len(finished) < len(list(first.glob("cases/*")))
    assert not (out / "results.csv").exists()
    run(study.path, out, "--workers", 2)
    assert {path: path.stat().st_mtime_ns for path in finished} == finished
    assert_same(first, out)


def test_ctrl_c_keeps_finished_cases_only(tmp_path):
    """Ctrl-C ends a run with code 130; the search that it interrupted is no finished case."""
    study = write(
        tmp_path, (SIZES, "sizes = [6]"), ("starts = 1 ", "starts = 9999 "), published=False
    )
    out = tmp_path / "out"
    with started(study, out, "--workers", 1) as process:
        wait_for(process, (out / "cases/relaxation_E.json").exists)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 130, said
    assert said.splitlines()[-1] == "edtk: interrupted"
    assert "Traceback" not in said
    answers = [json.loads(path.read_bytes())["answer"] for path in out.glob("cases/*.json")]
    assert all(answer.get("ended") != "interrupted" for answer in answers)
    assert set(files(out)) < {
        "cases/relaxation_E.json",
        "cases/relaxation_rho0.json",
        "cases/optimised_rho0_m6.json",
    }


def test_what_an_interrupted_search_leaves_is_no_answer(monkeypatch):
    """A search that Ctrl-C ended with a plan is interrupted all the same, and not kept as a case."""
    monkeypatch.setattr(
        runner, "find_plan", lambda *args, **options: SimpleNamespace(ended="interrupted")
    )
    with pytest.raises(KeyboardInterrupt):
        runner._Search(None, 6, None, SearchOptions())()


def test_unusable_cases_are_computed_anew(done, tmp_path):
    """A case file that is garbage, or of another key, is computed again; all others stay as they are."""
    study, _, first, _ = done
    out = tmp_path / "out"
    shutil.copytree(first, out)
    garbage, other = out / "cases/distinct_rho0_m3_k2.json", out / "cases/optimised_E_m3.json"
    garbage.write_bytes(garbage.read_bytes()[:-100])
    content = json.loads(other.read_text())
    content["key"] = "0" * 16
    content["answer"]["certificate"]["plan"]["q"][0][1] = 0.0
    other.write_text(json.dumps(content))
    kept = {p: p.stat().st_mtime_ns for p in out.glob("cases/*.json") if p not in (garbage, other)}
    assert len(kept) == 5
    run(study.path, out, "--workers", 1)
    assert {p: p.stat().st_mtime_ns for p in kept} == kept
    assert_same(first, out)


def test_finished_cases_are_taken_at_their_word(done, tmp_path):
    """What a case file of the right key says is what the results say: it is not computed again."""
    study, table, first, _ = done
    out = tmp_path / "out"
    shutil.copytree(first, out)
    path = out / "cases/optimised_E_m3.json"
    content = json.loads(path.read_text())
    plan = content["answer"]["certificate"]["plan"]
    plan["q"] = plan["q"][::-1]
    plan["repeats"] = [2 * r for r in plan["repeats"][::-1]]
    path.write_text(json.dumps(content))
    ours = run_study(study, out).to_frame().set_index("plan")
    theirs = table.set_index("plan")
    assert ours.loc["optimised_E_m3", "E"] == pytest.approx(
        2 * theirs.loc["optimised_E_m3", "E"], rel=1e-12
    )
    assert ours.drop("optimised_E_m3").equals(theirs.drop("optimised_E_m3"))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The smallest study, its folder after a run, and what lay there before: of somebody else, and of earlier runs."""
    folder = tmp_path_factory.mktemp("small")
    one = (OPTIMISE, 'optimise = ["D"]'), (CRITERIA, 'criteria = ["D"]')
    study = write(
        folder,
        (SIZES, "sizes = [2]"),
        ("candidates = 200", "candidates = 100"),
        *one,
        published=False,
    )
    out = folder / "out"
    foreign = [
        "notes.txt",
        "table.csv",
        "plans/mine.csv",
        "plans/published_m3.csv",
        "cases/readme.txt",
    ]
    stale = ["optimised_D_m99.csv", "optimised_A_m2.csv", "distinct_D_m99_k2.csv", "random_m99.csv"]
    for name in (*foreign, *(f"plans/{name}" for name in stale), "cases/optimised_D_m99.json"):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(name)
    run(study, out, "--workers", 1)
    return study, out, foreign


def test_stale_files_vanish_and_foreign_ones_stay(small):
    """Plans and cases that are not of this study go; files that are nobody's but the user's are as they were."""
    _, out, foreign = small
    assert [path.name for path in sorted((out / "plans").glob("*_*.csv"))] == [
        "optimised_D_m2.csv",
        "published_m3.csv",
        "random_m2.csv",
    ]
    assert {p.name for p in (out / "cases").glob("*.json")} == {
        "relaxation_D.json",
        "optimised_D_m2.json",
    }
    assert all((out / name).read_text() == name for name in foreign)


def test_fresh_begins_anew(small, tmp_path):
    """`--fresh` computes every case again, and comes to the same; without it none is; foreign files stay."""
    study, first, _ = small
    out = tmp_path / "out"
    shutil.copytree(first, out)
    before = {p: p.stat().st_mtime_ns for p in out.glob("cases/*.json")}
    run(study, out)
    assert {p: p.stat().st_mtime_ns for p in before} == before
    run(study, out, "--fresh", "--workers", 1)
    assert all(p.stat().st_mtime_ns > t for p, t in before.items())
    assert_same(first, out)


def test_another_study_has_other_cases(small, tmp_path):
    """In the folder of an earlier run, a changed study finds nothing finished, and its files replace the others."""
    study, first, _ = small
    out = tmp_path / "out"
    shutil.copytree(first, out)
    changed = tmp_path / "changed.toml"
    changed.write_text(study.read_text().replace("sigma_mm = 0.03 ", "sigma_mm = 0.06 "))
    keys = [checkpoint_of(load_study(path), out / "cases").key for path in (study, changed)]
    assert keys[0] != keys[1]
    run(changed, out, "--workers", 1)
    found = {json.loads(path.read_text())["key"] for path in out.glob("cases/*.json")}
    assert found == {keys[1]}
    D = [pd.read_csv(folder / "results.csv")["D"] for folder in (first, out)]
    np.testing.assert_allclose(4 * D[1], D[0], rtol=1e-3)  # the searches differ in what they find


def test_size_too_small_is_a_row_with_its_reason(done):
    """One experiment cannot identify five parameters: its rows say so, have no values and no plan file."""
    _, table, out, _ = done
    rows = table[(table["experiments"] == 1) & (table["kind"] == "optimised")]
    assert len(rows) == 2
    assert (
        rows["reason"] == "1 experiment cannot identify 5 parameters; the smallest number is 2"
    ).all()
    assert rows[["rho0", "E"]].isna().all(axis=None)
    assert (rows[["efficiency_rho0", "efficiency_E"]] == 0).all(axis=None)
    assert (table.query("experiments == 3")["reason"] == "").all()
    assert "cannot identify" in (out / "report.md").read_text(encoding="utf-8")


def test_progress(done):
    """Progress is reported as often as `steps` promises, up to the whole, the results last."""
    study, _, _, progress = done
    labels = [label for label, _ in progress]
    assert len(labels) == steps(study)
    assert labels[:3] == ["questions", "relaxation_rho0", "relaxation_E"]
    assert labels[-1] == "results"
    np.testing.assert_allclose(
        [share for _, share in progress], np.arange(1, len(labels) + 1) / len(labels)
    )


def test_report_links_its_figure_and_names_its_study(done):
    """The report shows the figure beside it and the digest of the study file."""
    study, _, out, _ = done
    text = (out / "report.md").read_text(encoding="utf-8")
    assert text.startswith(f"# {study.specification.title}\n")
    assert "(comparison.png)" in text
    assert study.digest in text
    assert "nan" not in text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("height_min_mm = 800", "height_min_mm = 9000"), ["workspace", "height p_z > 9000 mm"]),
        (('"q3", "q4"', '"q1", "q3", "q4"'), ["joints.unknown", "k1"]),
    ],
    ids=["empty feasible set", "unidentifiable"],
)
def test_nothing_is_written_when_it_cannot_be_done(tmp_path, change, words):
    """A study without an answer is refused in a line that names the key, and leaves no folder behind."""
    with pytest.raises(UserError) as caught:
        run_study(load_study(write(tmp_path, change, published=False)), tmp_path / "out")
    for word in (str(tmp_path / "small.toml"), *words):
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()
