"""A small study from file to folder."""

import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from arm import arm
from click.testing import CliRunner

import criteria
from edtk.cli import main
from edtk.design.exact.apportion import apportion
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.study import run_study as runner
from edtk.study.plan_study import relax_study
from edtk.study.run_study import run_study
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate
from edtk.verbs.run import run as run_and_report

pytestmark = pytest.mark.slow

STUDIES = Path(__file__).parents[2] / "studies"
SIZES = "sizes = [1, 3]"
OPTIMISE = 'optimise = ["rho0", "D"]'
CRITERIA = 'criteria = ["rho0", "D"]'


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
def done(tmp_path_factory, whole_searches):
    """The study, its table, its folder, and the labels of its progress."""
    folder = tmp_path_factory.mktemp("study")
    labels = []
    study = load_study(write(folder))

    def progress(label, share):
        labels.append((label, share))

    found = run_and_report(study, folder / "first", workers=1, progress=progress)
    return study, found.table, folder / "first", labels


@pytest.mark.cell("`run`", "springs")
def test_columns(done):
    """results.csv has a row for each plan: kind, criteria, efficiencies, seed and versions."""
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
    expected += ["efficiency_rho0", "efficiency_D"]
    expected += ["error_test_pose", "error_mean", "error_largest"]
    expected += ["seed", "study_sha256", "edtk"]
    assert list(read) == list(table) == expected
    assert read["plan"].tolist() == [
        "optimised_rho0_m1", "optimised_D_m1", "optimised_rho0_m3", "optimised_D_m3",
        "distinct_rho0_m3_k2", "random_m1", "random_m3", "published_m3",
    ]  # fmt: skip
    assert read["distinct_at_most"].tolist() == [1, 1, 3, 3, 2, 1, 3, 3]
    assert (read["study_sha256"] == study.digest).all()
    assert (read["seed"].astype(int) == study.specification.seed).all()


def test_plan_files_are_what_the_table_says(done):
    """Every written plan is feasible and has the size and the criteria of its row."""
    study, _, out, _ = done
    table = pd.read_csv(out / "results.csv").set_index("plan")
    files = sorted((out / "plans").iterdir())
    assert [f.stem for f in files] == [
        "distinct_rho0_m3_k2",
        "optimised_D_m3",
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
    """The written plans are feasible even if the study allows no rounding."""
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


@pytest.mark.parametrize(("name", "best"), [("rho0", "min"), ("D", "max")])
def test_optimised_plan_is_the_best_of_its_size(done, name, best):
    """Under the criterion that it was optimised for no other plan of that size is better."""
    table = done[1].query("experiments == 3").set_index("plan")
    assert table.loc[f"optimised_{name}_m3", name] == getattr(table[name], best)()


def test_efficiency_follows_from_value_and_bound(done):
    """One bound stands behind all rows: efficiency times cost times m^degree is the same number."""
    table = done[1].query("experiments == 3")
    for bound in (
        table["efficiency_rho0"] * table["rho0"] * 3**0.5,
        table["efficiency_D"] / table["D"] * 3,
    ):
        np.testing.assert_allclose(bound, bound.iloc[0], rtol=1e-12)
    assert table[["efficiency_rho0", "efficiency_D"]].gt(0).all(axis=None)
    assert table[["efficiency_rho0", "efficiency_D"]].lt(1).all(axis=None)


def test_bound_is_over_all_poses(done):
    """Few candidates give the bound of the paper's problem over all poses, to the search's 1e-4."""
    row = done[1].query("experiments == 3").iloc[0]
    assert row["efficiency_rho0"] * row["rho0"] * 3**0.5 == pytest.approx(9.645e-6, rel=1e-4)


@pytest.mark.parametrize("name", ["O2", "O4", "O5"])
def test_every_criterion_can_be_optimised(name):
    """A study may ask for any criterion; its plan is never worse than mere rounding of weights."""
    study = arm(optimise=[name])
    relaxed = relax_study(study)
    plan = find_plan(relaxed, 3, options=SearchOptions(seed=1, starts=16)).plan
    repeats = apportion(relaxed.weights, 3)
    rounded = study.space.plan(relaxed.x[repeats > 0], repeats[repeats > 0])
    cost = criteria.create(name).cost
    assert relaxed.criterion.name == name
    assert plan.experiments == 3
    assert study.space.workspace.contains(plan.q).all()
    assert cost(study.space.information(plan)) <= cost(study.space.information(rounded)) < np.inf


def files(folder):
    """Every file below a folder, by its relative path."""
    return {str(p.relative_to(folder)): p for p in sorted(folder.rglob("*")) if p.is_file()}


def contents(folder):
    """The same with their bytes."""
    return {name: path.read_bytes() for name, path in files(folder).items()}


def assert_same(one, other):
    """Two folders have the same files, byte by byte."""
    one = contents(one)
    other = contents(other)
    assert list(one) == list(other)
    assert [name for name in one if one[name] != other[name]] == []


def run(study, out, *options):
    """`edtk run`, which has to succeed."""
    result = CliRunner().invoke(main, ["run", str(study), "--out", str(out), *map(str, options)])
    assert result.exit_code == 0, result.stderr


def test_second_run_is_the_same_with_two_workers(done, tmp_path):
    """One process or two give byte-identical files."""
    study, _, first, _ = done
    run(study.path, tmp_path / "second", "--workers", 2)
    assert {"results.csv", "report.md", "comparison.png", "cases/relaxation_D.json"} <= set(
        files(first)
    )
    assert_same(first, tmp_path / "second")


def test_what_an_interrupted_search_leaves_is_no_answer():
    """A search that Ctrl-C ended with a plan is not kept as a case."""
    interrupted = SimpleNamespace(search=lambda *args: SimpleNamespace(ended="interrupted"))
    with pytest.raises(KeyboardInterrupt):
        runner._Search(interrupted, None, None, 1)()


def test_size_too_small_is_a_row_with_its_reason(done):
    """One experiment cannot identify five parameters: its rows have the reason and no values."""
    _, table, out, _ = done
    rows = table[(table["experiments"] == 1) & (table["kind"] == "optimised")]
    assert len(rows) == 2
    assert (
        rows["reason"] == "1 experiment cannot identify 5 parameters; the smallest number is 2"
    ).all()
    assert rows[["rho0", "D"]].isna().all(axis=None)
    assert (rows[["efficiency_rho0", "efficiency_D"]] == 0).all(axis=None)
    assert (table.query("experiments == 3")["reason"] == "").all()
    assert "cannot identify" in (out / "report.md").read_text(encoding="utf-8")


def test_progress(done):
    """Progress is reported in equal steps, as many as were announced, the results last."""
    _, _, _, progress = done
    labels = [label for label, _ in progress]
    assert labels[:3] == ["questions", "relaxation_rho0", "relaxation_D"]
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
    """A study without an answer is rejected in a line that names the key; no folder is made."""
    with pytest.raises(UserError) as caught:
        run_study(load_study(write(tmp_path, change, published=False)), tmp_path / "out")
    for word in (str(tmp_path / "small.toml"), *words):
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()
