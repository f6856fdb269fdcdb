"""`edtk plan`: whole experiments that are what they are said to be, with a bound."""

import json
from functools import partial
from pathlib import Path
from time import sleep

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from forked_command import ForkedCommand
from short_search import short_search

from edtk.cli import main
from edtk.design.exact.find_plan import SearchOptions
from edtk.design.relaxation.relax_poses import RelaxOptions
from edtk.findings.causes.faults import FAULTS
from edtk.study.study import load_study
from edtk.system.errors import UserError

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("shortest_searches")]

ROOT = Path(__file__).parents[2]
PATH = ROOT / "studies" / "kr270_milling.toml"
PAPERS = ROOT / "studies" / "plans" / "table_4_3.csv"
POSES = [f"q{i}_deg" for i in range(1, 7)]
FORCES = ["Fx_N", "Fy_N", "Fz_N"]
WRENCH = [*FORCES, "Tx_Nm", "Ty_Nm", "Tz_Nm"]
KEYS = [
    "criterion",
    "experiments",
    "value",
    "bound",
    "bound_searched",
    "bound_proved",
    "bounds",
    "bound_gap",
    "efficiency",
    "starts",
    "found",
]
KEYS += ["optima", "ended", "seconds", "constraint_violation"]
KEYS += ["expected_error", "warnings", "on_limits", "budget_mm", "detect", "plan", "exact"]
LOADS = {
    "bounded": "F_max_N = 2500\ndirection = [0, 0, -2]",
    "free": "F_max_N = 2500",
    "listed": "list_F_N = [[0, 0, -2500], [1500, 0, -2000], [0, 2500, 0]]",
}


def write(folder, load="F_N = [0, 0, -2500]", workspace=""):
    """A study of few candidates in a folder, which allows for no rounding of plans."""
    text = PATH.read_text(encoding="utf-8")
    head, rest = text.split("published = [")
    text = head + rest.split("]", 1)[1]
    changes = {
        "F_N = [0, 0, -2500]": load,
        "candidates = 2000": "candidates = 100",
        "plan_resolution_deg = 0.1 ": f"{workspace}\nplan_resolution_deg = 0.0 ",
    }
    for old, new in changes.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def edtk(*args):
    """The command's answer, which has to be a success."""
    result = CliRunner().invoke(main, [*map(str, args)], catch_exceptions=False)
    assert result.exit_code == 0, result.stderr
    return result


def plan(study, *options):
    """`edtk plan` as JSON."""
    return json.loads(edtk("plan", study, *options, "--json").stdout)


def untimed(answer):
    """All but the seconds."""
    return {key: value for key, value in answer.items() if key != "seconds"}


def distances(q, others):
    """Degrees between poses (k, n) and (l, n), each angle the short way round."""
    d = (q[:, None] - others + 180) % 360 - 180
    return np.sqrt((d**2).sum(axis=-1))


@pytest.fixture(scope="module")
def found(tmp_path_factory, sharp_bounds):
    """The study, answers by one worker for two criteria, with two batches of starts, and the
    files of these plans.
    """
    folder = tmp_path_factory.mktemp("plan")
    study = write(folder)
    answers = {}
    outs = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.study.plan_study.STARTS", 32)
        for name in ("rho0", "D"):
            outs[name] = folder / name / "plan.csv"
            options = ["--size", 3, "--criterion", name, "--workers", 1, "--out", outs[name]]
            answers[name] = plan(study, *options)
    return study, answers, outs


@pytest.mark.parametrize("name", ["rho0", "D"])
def test_json_is_what_the_plan_is_worth(found, name):
    """All promised fields are there; the value is that of the written file, and efficiency follows
    from the bound.
    """
    study, answers, outs = found
    answer = answers[name]
    assert list(answer) == KEYS
    assert (answer["criterion"], answer["experiments"], answer["bound_searched"]) == (name, 3, True)
    assert (answer["starts"], answer["ended"], answer["constraint_violation"]) == (32, "starts", 0)
    assert answer["found"] >= 1
    assert answer["optima"] >= 1
    assert answer["seconds"] > 0
    evaluated = json.loads(edtk("evaluate", study, outs[name], "--json").stdout)
    assert evaluated["experiments"] == 3
    assert answer["value"] == pytest.approx(evaluated["criteria"][name], rel=1e-8)
    ratio = (
        answer["bound"] / answer["value"] if name == "rho0" else answer["value"] / answer["bound"]
    )
    assert answer["efficiency"] == pytest.approx(ratio, rel=1e-14)
    assert 0.8 < answer["efficiency"] < 1
    assert all(list(row) == ["q_deg", "repeats", "wrench", "kept"] for row in answer["plan"])
    assert sum(row["repeats"] for row in answer["plan"]) == 3
    assert not any(row["kept"] for row in answer["plan"])


def test_plan_beats_the_papers(found):
    """A few starts find what is better in rho0 than the paper's own plan of as many experiments."""
    _, answers, _ = found
    papers = json.loads(edtk("evaluate", PATH, PAPERS, "--json").stdout)["criteria"]["rho0"]
    assert answers["rho0"]["value"] < papers


def test_bound_is_that_of_the_relaxation(found):
    """The bound is the searched one of `edtk relax --continuous`, scaled to the number of
    experiments.
    """
    study, answers, _ = found
    relaxed = json.loads(
        edtk("relax", study, "--criterion", "rho0", "--continuous", "--json").stdout
    )
    assert answers["rho0"]["bound"] == pytest.approx(relaxed["bound_searched"] / 3**0.5, rel=1e-12)


def test_file_is_the_json(found):
    """--out writes poses in degrees, repetitions and wrenches, in the order of the JSON, and
    nothing else.
    """
    _, answers, outs = found
    table = pd.read_csv(outs["rho0"])
    assert list(table) == [*POSES, "repeats", *WRENCH]
    rows = answers["rho0"]["plan"]
    np.testing.assert_allclose(
        table[POSES], [row["q_deg"] for row in rows], rtol=1e-9
    )  # written to ten digits
    assert table["repeats"].tolist() == [row["repeats"] for row in rows]
    assert (
        table[WRENCH].to_numpy().tolist()
        == [row["wrench"] for row in rows]
        == [[0, 0, -2500, 0, 0, 0]] * len(rows)
    )
    assert list(outs["rho0"].parent.iterdir()) == [outs["rho0"]]


@pytest.mark.cell("`plan --workers` and `--dask`", "springs")
def test_seed_and_workers(found, tmp_path, monkeypatch):
    """Two workers and the study's own seed, named, come to the same file; another seed comes to
    another plan.
    """
    study, answers, outs = found
    monkeypatch.setattr("edtk.study.plan_study.STARTS", 32)
    out = tmp_path / "plan.csv"
    named = plan(
        study, "--size", 3, "--criterion", "D", "--workers", 2, "--seed", 2026, "--out", out
    )
    assert untimed(named) == untimed(answers["D"])
    assert out.read_bytes() == outs["D"].read_bytes()
    other = plan(study, "--size", 3, "--criterion", "D", "--workers", 1, "--seed", 7)
    assert other["plan"] != answers["D"]["plan"]


@pytest.mark.cell("`plan --distinct`", "springs")
def test_distinct(tmp_path):
    """Four experiments in two distinct poses at most, all four of them counted."""
    answer = plan(write(tmp_path), "--size", 4, "--distinct", 2, "--budget", 1, "--workers", 1)
    assert len(answer["plan"]) == 2
    assert sum(row["repeats"] for row in answer["plan"]) == answer["experiments"] == 4
    assert answer["efficiency"] <= 1


@pytest.mark.cell("`plan --keep`", "springs")
def test_keep(tmp_path):
    """Kept experiments come first, as they were, repetitions and loads included, and count in size
    and value.
    """
    study = write(tmp_path)
    out = tmp_path / "plan.csv"
    kept = tmp_path / "kept.csv"
    rows = PAPERS.read_text().split()
    kept.write_text(f"{rows[0]},repeats,Fz_N\n{rows[1]},2,-1000\n{rows[2]},1,-2500\n")
    study.write_text(
        study.read_text().replace("plan_resolution_deg = 0.0 ", "plan_resolution_deg = 0.1 ")
    )
    rest = tmp_path / "rest.csv"
    options = ("--budget", 1, "--workers", 1, "--out", out, "--rest", rest)
    answer = plan(study, "--size", 5, "--keep", kept, *options)
    assert answer["experiments"] == 5
    assert [row["kept"] for row in answer["plan"]][:3] == [True, True, False]
    assert not any(row["kept"] for row in answer["plan"][2:])
    assert sum(row["repeats"] for row in answer["plan"][2:]) == 2
    given = pd.read_csv(kept)
    table = pd.read_csv(out)
    shared = [column for column in POSES if column in given]
    np.testing.assert_allclose(table[shared][:2], given[shared], rtol=1e-9)
    assert table["repeats"][:2].tolist() == [2, 1]
    assert table["Fz_N"][:2].tolist() == [-1000, -2500]
    new = pd.read_csv(rest)
    pd.testing.assert_frame_equal(new, table[2:][list(new)].reset_index(drop=True))
    refused = CliRunner().invoke(main, ["plan", str(study), "--size", "5", "--rest", str(rest)])
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert "rest: expected keep beside it" in refused.stderr
    evaluated = json.loads(edtk("evaluate", study, out, "--json").stdout)
    assert evaluated["experiments"] == 5
    assert answer["value"] == pytest.approx(evaluated["criteria"]["rho0"], rel=1e-8)
    assert 0.5 < answer["efficiency"] <= 1


def test_one_more_experiment_where_one_alone_would_not_do(tmp_path):
    """One pose identifies nothing, but beside one that is kept it does; the plan has
    one new pose.
    """
    study = write(tmp_path)
    kept = tmp_path / "kept.csv"
    study.write_text(
        study.read_text().replace("plan_resolution_deg = 0.0 ", "plan_resolution_deg = 0.1 ")
    )
    kept.write_text("\n".join(PAPERS.read_text().split()[:2]))
    answer = plan(study, "--size", 2, "--keep", kept, "--budget", 1, "--workers", 1)
    assert [(row["kept"], row["repeats"]) for row in answer["plan"]] == [(True, 1), (False, 1)]
    assert 0 < answer["value"] < 1e-4  # metres


@pytest.mark.cell("`plan --exclude`", "springs")
def test_exclude(found, tmp_path):
    """No pose is within 5 degrees of an excluded one, so that the best plan has to be another."""
    study, answers, outs = found
    answer = plan(study, "--size", 3, "--exclude", outs["rho0"], "--workers", 1)
    away = pd.read_csv(outs["rho0"])[POSES].to_numpy()
    q = np.array([row["q_deg"] for row in answer["plan"]])
    assert distances(q, away).min() >= 5 - 1e-6
    assert answer["constraint_violation"] == 0
    assert answer["plan"] != answers["rho0"]["plan"]
    assert answer["bound"] >= answers["rho0"]["bound"] * (
        1 - 1e-5
    )  # less room; at that gap the search ends


def test_exclusions_of_the_study_and_of_the_option(found, tmp_path):
    """Poses excluded in the study and by option count both, at the distance that the
    study names.
    """
    _, _, outs = found
    table = pd.read_csv(outs["rho0"])
    table[:1].to_csv(tmp_path / "one.csv", index=False)
    table[1:].to_csv(tmp_path / "others.csv", index=False)
    study = write(tmp_path, workspace='excluded = "one.csv"\nexcluded_within_deg = 60')
    options = ["--size", 3, "--exclude", tmp_path / "others.csv", "--budget", 1, "--workers", 1]
    q = np.array([row["q_deg"] for row in plan(study, *options)["plan"]])
    assert distances(q, table[POSES].to_numpy()).min() >= 60 - 1e-6


def test_a_budget_begins_with_the_command(tmp_path, monkeypatch):
    """What takes time before the search, such as reading the study, is a part of it."""
    given = []

    def read(path):
        sleep(0.05)
        return load_study(path)

    def search(study, *_, budget, **__):
        given.append(budget)
        raise UserError("nothing is searched")

    monkeypatch.setattr("edtk.verbs.inputs.load_study", read)
    monkeypatch.setattr("edtk.verbs.plan.plan", search)
    for seconds in (5, 0.01):
        command = ["plan", str(write(tmp_path)), "--size", "3", "--budget", str(seconds)]
        assert CliRunner().invoke(main, command).exit_code == 2
    assert 0 < given[0] <= 4.95
    assert given[1] == 0


def test_budget(tmp_path):
    """When the budget ends the search, there is a feasible plan of the size that was asked for, and
    a line says so.
    """
    study = write(tmp_path)
    out = tmp_path / "plan.csv"
    options = ["--size", 3, "--budget", 0.01, "--workers", 1, "--json", "--out", out]
    result = edtk("plan", study, *options)
    answer = json.loads(result.stdout)
    last = result.stderr.replace("\r", "\n").splitlines()[-1]
    assert last == "edtk: the budget ended the search; this is the best plan so far"
    assert answer["ended"] == "budget"
    assert answer["constraint_violation"] == 0
    evaluated = json.loads(edtk("evaluate", study, out, "--json").stdout)
    assert evaluated["experiments"] == 3
    assert answer["value"] == pytest.approx(evaluated["criteria"]["rho0"], rel=1e-8)


@pytest.mark.unix
def test_ctrl_c_leaves_the_best_plan(tmp_path, monkeypatch):
    """Ctrl-C during the search prints and writes the best plan so far, says so, and
    exits with 130.
    """
    study = write(tmp_path)
    out = tmp_path / "plan.csv"
    options = ["--size", 6, "--criterion", "A", "--workers", 1, "--json", "--out", out]
    # It does not end by itself, neither by its starts nor because nothing better is found.
    monkeypatch.setattr("edtk.study.plan_study.STARTS", 10**6)
    endless = partial(SearchOptions, patience=10**4)
    monkeypatch.setattr("edtk.study.plan_study.SearchOptions", endless)
    with ForkedCommand("plan", study, *options) as running:
        stdout, said = running.interrupted(b"starts")
    assert running.returncode == 130, said
    assert said.decode().splitlines()[-1] == "edtk: interrupted; this is the best plan so far"
    assert b"Traceback" not in said
    answer = json.loads(stdout)
    assert (answer["ended"], answer["experiments"]) == ("interrupted", 6)
    evaluated = json.loads(edtk("evaluate", study, out, "--json").stdout)
    assert answer["value"] == pytest.approx(evaluated["criteria"]["A"], rel=1e-8)


@pytest.mark.unix
def test_ctrl_c_leaves_a_plan_while_the_bound_is_sought(tmp_path, monkeypatch):
    """Ctrl-C before the search has begun leaves a plan, rounded from the design so far."""
    study = write(tmp_path)
    options = ["--size", 6, "--criterion", "A", "--workers", 1, "--json"]
    monkeypatch.setattr("edtk.commands.shared.SHOWN_AFTER_S", 0.0)
    # No gap is small enough, so that the search for the bound does not end by itself.
    endless = partial(RelaxOptions, tolerance=-1.0)
    monkeypatch.setattr("edtk.study.plan_study.RelaxOptions", endless)
    monkeypatch.setattr("edtk.design.relaxation.relax_poses.ROUNDS", 10**6)
    with ForkedCommand("plan", study, *options) as running:
        stdout, said = running.interrupted(b"bound: continuum")
    assert running.returncode == 130, said
    assert said.decode().splitlines()[-1] == "edtk: interrupted; this is the best plan so far"
    answer = json.loads(stdout)
    assert (answer["ended"], answer["experiments"]) == ("interrupted", 6)
    assert answer["constraint_violation"] == 0
    assert 0 < answer["efficiency"] <= 1


def test_text_says_what_json_says(found, monkeypatch):
    """Without --json a person reads value and bound in mm, efficiency and poses; rho0 is this
    study's default.
    """
    study, answers, _ = found
    monkeypatch.setattr("edtk.study.plan_study.STARTS", 32)
    answer = answers["rho0"]
    lines = edtk("plan", study, "--size", 3, "--workers", 1).stdout.splitlines()
    assert lines[0].startswith("rho0, Test-pose accuracy; 3 experiments in ")
    assert lines[1].split() == ["value", f"{1e3 * answer['value']:.6g}", "mm"]
    assert lines[2].split()[:3] == ["bound", f"{1e3 * answer['bound']:.6g}", "mm"]
    assert "not proved" in lines[2]
    assert lines[3].split() == ["efficiency", f"{100 * answer['efficiency']:.2f}", "%"]
    head = next(i for i, line in enumerate(lines) if line.startswith("repeats"))
    assert lines[head].split() == ["repeats", *POSES]
    table = lines[head + 1 : head + 1 + len(answer["plan"])]
    rows = np.array([line.split() for line in table], dtype=float)
    np.testing.assert_allclose(rows[:, 1:], [row["q_deg"] for row in answer["plan"]], atol=5.1e-4)
    assert rows[:, 0].tolist() == [row["repeats"] for row in answer["plan"]]


def assert_allowed(kind, forces):
    """Forces (k, 3) belong to that family, to the digits of a file."""
    assert len(forces)
    size = np.linalg.norm(forces, axis=1)
    if kind == "listed":
        allowed = np.array([[0, 0, -2500], [1500, 0, -2000], [0, 2500, 0]])
        assert np.abs(forces[:, None] - allowed).max(axis=-1).min(axis=1).max() == 0
    else:
        assert size.max() <= 2500 * (1 + 1e-8)
    if kind == "bounded":
        assert (forces[:, :2] == 0).all()
        assert (forces[:, 2] <= 0).all()


@pytest.mark.cell("free and bounded loads", "springs")
@pytest.mark.parametrize("kind", LOADS)
def test_loads_are_designed_from_study_to_file(tmp_path, kind):
    """`plan` and `relax` write the load of every pose, from the family in the study, and `evaluate`
    reads it back.
    """
    study = write(tmp_path, LOADS[kind])
    out = tmp_path / "plan.csv"
    weights = tmp_path / "weights.csv"
    with short_search():
        answer = plan(study, "--size", 3, "--criterion", "D", "--workers", 1, "--out", out)
    table = pd.read_csv(out)
    assert list(table) == [*POSES, "repeats", *WRENCH]
    assert_allowed(kind, table[FORCES].to_numpy())
    np.testing.assert_allclose(
        table[WRENCH], [row["wrench"] for row in answer["plan"]], rtol=1e-9, atol=1e-9
    )
    evaluated = json.loads(edtk("evaluate", study, out, "--json").stdout)
    assert answer["value"] == pytest.approx(evaluated["criteria"]["D"], rel=1e-8)
    if kind != "listed":  # information grows with the square of the force
        assert np.linalg.norm(table[FORCES], axis=1) == pytest.approx(2500, rel=1e-4)
    if kind == "free":
        assert (np.abs(table[FORCES[:2]]) > 1).any(axis=None)  # the direction is designed too
    relaxed = json.loads(
        edtk("relax", study, "--criterion", "D", "--json", "--out", weights).stdout
    )
    table = pd.read_csv(weights)
    assert list(table) == [*POSES, *WRENCH, "weight"]
    assert_allowed(kind, table[FORCES].to_numpy())
    np.testing.assert_allclose(
        table[WRENCH], [row["wrench"] for row in relaxed["support"]], rtol=1e-9, atol=1e-9
    )
    loaded = load_study(study)
    q = np.deg2rad(table[POSES].to_numpy())
    W = table[WRENCH].to_numpy()
    A = loaded.model.regressor(q, W) / loaded.sigma[:, None]
    M = np.einsum("k,kri,krj->ij", table["weight"], A, A)
    assert relaxed["value"] == pytest.approx(np.linalg.det(M) ** 0.2, rel=1e-8)


def test_limits_of_numbers_can_be_read():
    """A help text has no number of thirteen digits, and a number beyond the limit is refused."""
    text = " ".join(CliRunner().invoke(main, ["plan", "--help"]).output.split())
    assert "[1<=x<=1e+12]" in text
    found = CliRunner().invoke(main, ["plan", str(PATH), "--size", str(10**13)])
    assert found.exit_code == 2
    assert "1<=x<=1e+12" in found.output


def test_the_help_names_every_fault_with_its_unit():
    """A fault that is added to the registry is in the help of --detect at once."""
    text = " ".join(CliRunner().invoke(main, ["plan", "--help"]).output.split())
    units = text.partition("Units: ")[2].partition(". --")[0].split("; ")
    named = {
        name: unit
        for unit, _, names in (u.partition(" of ") for u in units)
        for name in names.rstrip(".").split(", ")
    }
    assert named == {one.name: one.unit for one in FAULTS.values() if one.unit}
