"""A small study from file to folder."""

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import criteria
from edtk.design import apportion
from edtk.errors import UserError
from edtk.study import evaluate, load_study, run_study
from edtk.study.relaxed import candidates_of, relaxed_plan
from edtk.study.runner import exact_plan, steps

STUDIES = Path(__file__).parents[2] / "studies"
SIZES = "sizes = [1, 3]"


def write(folder, *changes, published=True):
    """A small copy of the KR 270 study in a folder, with further replacements."""
    text = (STUDIES / "kr270_milling.toml").read_text(encoding="utf-8")
    small = [
        ("sizes = [2, 3, 4, 6, 12]", SIZES),
        ("candidates = 2000", "candidates = 200"),
        ("starts = 6", "starts = 2"),
        ('optimise = ["rho0", "A", "D", "E"]', 'optimise = ["rho0", "E"]'),
        ('criteria = ["A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0"]', 'criteria = ["rho0", "E"]'),
    ]
    for old, new in (*small, *changes):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    head, rest = text.split("published = [")
    named = '"plans/table_4_3.csv"' if published else ""
    text = f"{head}published = [{named}]{rest.split(']', 1)[1]}"
    (folder / "plans").mkdir(parents=True, exist_ok=True)
    (folder / "plans" / "table_4_3.csv").write_bytes((STUDIES / "plans" / "table_4_3.csv").read_bytes())
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
    table = run_study(study, folder / "first", labels.append)
    return study, table, folder / "first", labels


def test_columns(done):
    """results.csv has one row a plan: what it is, every criterion, efficiencies, and where it comes from."""
    study, table, out, _ = done
    read = pd.read_csv(out / "results.csv", keep_default_na=False)
    expected = ["plan", "kind", "optimised_for", "experiments", "reason", *study.file.criteria]
    expected += ["efficiency_rho0", "efficiency_E", "seed", "study_sha256", "edtk"]
    assert list(read) == list(table) == expected
    assert read["plan"].tolist() == [
        "optimised_rho0_m1", "optimised_E_m1", "random_m1",
        "optimised_rho0_m3", "optimised_E_m3", "random_m3", "published_m3",
    ]  # fmt: skip
    assert (read["study_sha256"] == study.digest).all()
    assert (read["seed"].astype(int) == study.file.seed).all()


def test_plan_files_are_what_the_table_says(done):
    """Every plan in the folder is read back as feasible, has its size, and its criteria are those of its row."""
    study, _, out, _ = done
    table = pd.read_csv(out / "results.csv").set_index("plan")
    files = sorted((out / "plans").iterdir())
    assert [f.stem for f in files] == ["optimised_E_m3", "optimised_rho0_m3", "random_m3"]
    for file in files:
        plan = study.load_plan(file)
        row = table.loc[file.stem]
        assert plan.experiments == row["experiments"] == 3
        for name in study.file.criteria:
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
    for bound in (table["efficiency_rho0"] * table["rho0"] * 3**0.5, table["efficiency_E"] / table["E"] * 3):
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
    change = ('optimise = ["rho0", "E"]', f'optimise = ["{name}"]')
    study = load_study(write(tmp_path, change, published=False))
    candidates = candidates_of(study)
    relaxed = relaxed_plan(study, name, candidates=candidates)
    plan = exact_plan(relaxed, candidates.q, 3, 1, np.random.default_rng(1))
    repeats = apportion(relaxed.weights, 3)
    rounded = study.design.plan(relaxed.q[repeats > 0], repeats[repeats > 0])
    cost = criteria.create(name).cost
    assert plan.experiments == 3
    assert study.design.workspace.contains(plan.q).all()
    assert cost(study.design.information(plan)) <= cost(study.design.information(rounded)) < np.inf


def test_second_run_is_the_same(done, tmp_path):
    """The same study gives byte-identical tables, reports and plans in another folder."""
    study, _, first, _ = done
    second = tmp_path / "second"
    run_study(load_study(study.path), second)
    names = sorted(p.relative_to(first) for p in first.rglob("*") if p.is_file())
    assert names == sorted(p.relative_to(second) for p in second.rglob("*") if p.is_file())
    assert {"results.csv", "report.md", "comparison.png"} <= {str(n) for n in names}
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


def test_size_too_small_is_a_row_with_its_reason(done):
    """One experiment cannot identify five parameters: its rows say so, have no values and no plan file."""
    _, table, out, _ = done
    rows = table[(table["experiments"] == 1) & (table["kind"] == "optimised")]
    assert len(rows) == 2
    assert rows["reason"].str.fullmatch("1 experiments? cannot identify 5 parameters").all()
    assert rows[["rho0", "E"]].isna().all(axis=None)
    assert (rows[["efficiency_rho0", "efficiency_E"]] == 0).all(axis=None)
    assert (table.query("experiments == 3")["reason"] == "").all()
    assert "cannot identify" in (out / "report.md").read_text(encoding="utf-8")


def test_progress(done):
    """Progress is reported as often as `steps` promises, the report last."""
    study, _, _, labels = done
    assert len(labels) == steps(study)
    assert labels[:3] == ["candidates", "relaxation rho0", "relaxation E"]
    assert labels[-1] == "report"


def test_report_links_its_figure_and_names_its_study(done):
    """The report shows the figure beside it and the digest of the study file."""
    study, _, out, _ = done
    text = (out / "report.md").read_text(encoding="utf-8")
    assert text.startswith(f"# {study.file.title}\n")
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
