"""The commands as a user types them, and every mistake that a user can make."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from forked_command import BAR_S

import criteria
from edtk.cli import main
from edtk.study.study import load_study
from edtk.system.workers import open_workers
from edtk.verbs.relax import relax

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("shortest_searches")]

ROOT = Path(__file__).parents[1]
PAPER = ROOT / "studies/kr270_milling.toml"
STUDY = PAPER.read_text()
HEADER = "q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
POSE = "-93.5,125.0,-118.7,-62.4,-168.9"
LOAD = "F_N = [0, 0, -2500]"
PLAN_3 = ROOT / "studies/plans/table_4_3.csv"
Answer = subprocess.CompletedProcess[str]


def edtk(*args: object) -> Answer:
    """The command in this process: as fast as it gets, and warnings are errors."""
    result = CliRunner().invoke(main, [*map(str, args)])
    if not isinstance(result.exception, SystemExit | None):
        raise result.exception
    return subprocess.CompletedProcess(args, result.exit_code, result.stdout, result.stderr)


def process(*args: object) -> Answer:
    """The command in a process of its own, as a user starts it."""
    command = [sys.executable, "-m", "edtk", *map(str, args)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def interrupted(after: bytes, *args: object) -> Answer:
    """The command's answer to Ctrl-C, which comes as soon as its progress says `after`."""
    command = [sys.executable, "-m", "edtk", *map(str, args)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT, preexec_fn=_hear_ctrl_c
    ) as running:
        assert running.stderr is not None
        said = b""
        while after not in said:
            said += (chunk := os.read(running.stderr.fileno(), 4096))
            assert chunk, f"ended before {after!r}: {said!r}"
        time.sleep(BAR_S)
        running.send_signal(signal.SIGINT)
        try:
            stdout, rest = running.communicate(timeout=60)
        finally:
            running.kill()  # one that gives no answer would be waited for without end
    return subprocess.CompletedProcess(
        command, running.returncode, stdout.decode(), (said + rest).decode()
    )


def _hear_ctrl_c() -> None:
    """A shell has jobs in its background ignore Ctrl-C, and so would all that they start."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def messages(answer: Answer) -> list[str]:
    """Lines on standard error other than those that a progress bar overwrites."""
    lines = answer.stderr.replace("\r", "\n").split("\n")
    return [line for line in lines if line.strip() and not re.search(r"\[\d\d:\d\d[],<]", line)]


def assert_one_line(answer: Answer, *words: str) -> None:
    """Exit code 2, nothing on standard output, and one line beside the progress that says what is
    wrong.
    """
    assert answer.returncode == 2, answer.stderr
    assert answer.stdout == ""
    assert len(lines := messages(answer)) == 1, answer.stderr
    assert lines[0].startswith("edtk: ")
    for word in words:
        assert word in lines[0], lines[0]


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A small copy of the paper's study with two criteria, without published plans."""
    text = STUDY[: STUDY.index("published = [")] + STUDY[STUDY.index("[tool]") :]
    text = text.replace("candidates = 2000", "candidates = 300").replace(
        "sizes = [2, 3, 4, 6, 12]", "sizes = [3]"
    )
    text = text.replace("starts = 32", "starts = 1")
    text = text.replace(
        '["rho0", "A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5"]', '["rho0", "E"]'
    )
    text = text.replace(
        '["A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0"]', '["E", "rho0"]'
    )
    path = tmp_path / "study.toml"
    path.write_text(text)
    return path


def edit(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


def test_a_foreign_folder_runs_nothing(tmp_path):
    """`python -m edtk` where somebody has put a plug-in does not look at it."""
    package = tmp_path / "foreign-1.0.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign\nVersion: 1.0\n")
    (package / "entry_points.txt").write_text("[edtk.criteria]\nforeign = foreign_plug:Foreign\n")
    (tmp_path / "foreign_plug.py").write_text("open('RAN', 'w').close()\n")
    (tmp_path / "click.py").write_text("open('RAN', 'w').close()\n")
    command = [sys.executable, "-m", "edtk", "criteria", "--json"]
    found = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    assert "foreign" not in found.stdout + found.stderr
    assert not (tmp_path / "RAN").exists()


def test_criteria_lists_the_registry() -> None:
    """`edtk criteria --json` is the registry as JSON, and the table names every criterion."""
    listed = json.loads(edtk("criteria", "--json").stdout)
    names = [row["name"] for row in listed]
    assert names == [*criteria.available(), *criteria.families()]
    assert {row["name"]: row["parameters"] for row in listed if "parameters" in row} == {
        name: list(criteria.parameters_of(name)) for name in criteria.families()
    }
    table = edtk("criteria").stdout
    assert all(row["title"] in table for row in listed)


def test_evaluate_json_is_alone_on_standard_output_and_in_si() -> None:
    """`edtk evaluate --json` prints one JSON document with the promised keys; rho0 is in metres."""
    answer = process("evaluate", "studies/kr270_milling.toml", PLAN_3, "--json")
    result = json.loads(answer.stdout)
    keys = {"criteria", "observability_unscaled", "std", "covariance", "parameters", "experiments"}
    assert set(result) == keys | {"budget_mm", "expected_error", "skipped", "warnings"}
    assert result["criteria"]["rho0"] == pytest.approx(6.588e-6, rel=2e-4)
    assert result["experiments"] == 3
    assert result["std"]["q2"] == pytest.approx(np.sqrt(result["covariance"][0][0]))
    sigma = 0.03e-3
    for name in ("O1", "O3", "O4"):
        assert result["observability_unscaled"][name] == pytest.approx(
            result["criteria"][name] * sigma
        )


def test_evaluate_counts_repeats_and_takes_a_wrench(tmp_path: Path) -> None:
    """Repeating every pose k times divides the covariance by k; doubling the force divides it by
    four.
    """
    plain = json.loads(edtk("evaluate", PAPER, PLAN_3, "--json").stdout)
    rows = PLAN_3.read_text().split()
    path = tmp_path / "plan.csv"
    path.write_text("\n".join([rows[0] + ",repeats,Fz_N", *(r + ",3,-5000" for r in rows[1:])]))
    more = json.loads(edtk("evaluate", PAPER, path, "--json").stdout)
    assert more["experiments"] == 9
    assert np.array(more["covariance"]) == pytest.approx(np.array(plain["covariance"]) / 12)


def test_run_writes_results_plans_and_report(study: Path, tmp_path: Path) -> None:
    """`edtk run` ends with a table, plans that can be evaluated, and a report with its figure."""
    out = tmp_path / "out"
    edit(edit(study, '["rho0", "E"]', '["E"]'), '["E", "rho0"]', '["E"]')
    answer = edtk("run", study, "--out", out)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == ""
    said = [line for line in messages(answer) if not line.startswith("  ")]
    assert [" ".join(line.split(" ")[:2]) for line in said[:2]] == ["total expected", "error by"]
    assert [line.split(" ")[0] for line in said[2:]] == ["wrote"]
    figures = {p.name for p in out.glob("*.png")}
    assert {p.name for p in out.iterdir()} - figures == {
        "results.csv",
        "report.md",
        "poses.html",
        "cases",
        "certificates",
        "plans",
    }
    assert "comparison.png" in figures
    assert all(f"({name})" in (out / "report.md").read_text() for name in figures)
    result = json.loads(edtk("evaluate", study, out / "plans/optimised_E_m3.csv", "--json").stdout)
    table = pd.read_csv(out / "results.csv").set_index("plan")
    assert result["criteria"]["E"] == pytest.approx(
        table.loc["optimised_E_m3", "E"], rel=1e-6
    )  # written to ten digits


def test_run_of_a_size_that_is_too_small(study: Path, tmp_path: Path) -> None:
    """Where a criterion is maximised, too, a size that cannot be planned is a row with a reason."""
    edit(edit(study, '["rho0", "E"]', '["D"]'), '["E", "rho0"]', '["D"]')
    edit(edit(study, "sizes = [3]", "sizes = [1]"), "candidates = 300", "candidates = 100")
    answer = edtk("run", study, "--out", tmp_path / "out")
    assert answer.returncode == 0, answer.stderr
    table = pd.read_csv(tmp_path / "out/results.csv").set_index("plan")
    assert table.loc["optimised_D_m1", "efficiency_D"] == 0
    assert "1 experiment cannot identify" in table.loc["optimised_D_m1", "reason"]
    assert "cannot identify" in (tmp_path / "out/report.md").read_text(encoding="utf-8")


def test_a_plug_in_criterion_is_found_by_name_in_a_study(
    study: Path, plugin_site: Path, plug_in: Callable[[Path], None], tmp_path: Path
) -> None:
    """A criterion of another distribution has values in the results, and efficiencies if it has a
    convex form.
    """
    edit(study, '["rho0", "E"]', '["E"]')
    edit(study, '["E", "rho0"]', '["E", "trace_M"]')
    assert_one_line(edtk("run", study), "trace_M", "available: A, D")
    plug_in(plugin_site)
    assert "trace_M" in [row["name"] for row in json.loads(edtk("criteria", "--json").stdout)]
    answer = edtk("run", study, "--out", tmp_path / "out")
    assert answer.returncode == 0, answer.stderr
    columns = list(pd.read_csv(tmp_path / "out/results.csv"))
    assert columns[7:10] == ["E", "trace_M", "efficiency_E"]
    assert "efficiency_trace_M" not in columns


def test_a_plug_in_criterion_without_convex_form_is_not_relaxed(
    study: Path, plugin_site: Path, plug_in: Callable[[Path], None], tmp_path: Path
) -> None:
    """`relax` refuses it in one line and writes nothing; so does a study that wants it
    optimised.
    """
    out = tmp_path / "plan.csv"
    plug_in(plugin_site)
    answer = edtk("relax", study, "--criterion", "trace_M", "--json", "--out", out)
    assert_one_line(answer, "study.toml", "trace_M", "no convex form")
    edit(study, '["rho0", "E"]', '["trace_M"]')
    assert_one_line(edtk("run", study, "--out", out), "study.toml", "optimise", "no convex form")
    assert list(tmp_path.iterdir()) == [study]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (f"{HEADER}\n{POSE}\n-103.4,NaN,-147.9,105.8,93.2\n", ("row 2", "q3_deg", "finite number")),
        (f"{HEADER}\n{POSE}\n-103.4,abc,-147.9,105.8,93.2\n", ("row 2", "q3_deg", "'abc'")),
        (f"{HEADER},colour\n{POSE},3\n", ("unknown column 'colour'", "expected q1_deg")),
        ("q2_deg,q3_deg\n1,2\n", ("'q4_deg' is missing",)),
        (f"{HEADER}\n{POSE}\n-93.5,185.0,-118.7,-62.4,-168.9\n", ("row 2", "joint limit q3")),
        (f"{HEADER}\n{POSE}\n-93.5,125.0,-118.7,62.4,-10.0\n", ("row 2", "violates")),
        (f"{HEADER},repeats\n{POSE},0\n", ("row 1", "repeats", "from 1 to 1e9")),
        (f"{HEADER}\n", ("no rows",)),
        ("", ("CSV",)),
        (f"{HEADER}\n{POSE}\n", ("cannot identify all parameters", "k2")),
    ],
)
@pytest.mark.parametrize("command", ["evaluate", "bayes"])
def test_bad_plan(
    study: Path, tmp_path: Path, command: str, content: str, words: tuple[str, ...]
) -> None:
    """Each mistake in a plan is one line that names the file, and the row or column where there is
    one.
    """
    path = tmp_path / "plan.csv"
    path.write_text(content)
    assert_one_line(edtk(command, study, path), "plan.csv", *words)


def test_a_note_beside_the_result(study: Path, tmp_path: Path) -> None:
    """A plan with decimal commas has the result of one with points, and one line says so."""
    path = tmp_path / "plan.csv"
    path.write_text(PLAN_3.read_text().replace(",", ";").replace(".", ","))
    answer = edtk("evaluate", study, path)
    assert answer.returncode == 0
    note = f"edtk: {path}: read with semicolons between columns, decimal commas\n"
    assert answer.stderr == note
    assert answer.stdout == edtk("evaluate", study, PLAN_3).stdout


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("seed = 2026", "sead = 2026", ("sead", "unknown key")),
        ('robot = "kuka_kr270"', 'robot = "kuka_kr271"', ("robot", "kuka_kr271", "kuka_kr270")),
        ('["E", "rho0"]', '["E", "O6"]', ("criteria", "'O6'", "available: A, D")),
        ('optimise = ["rho0", "E"]', 'optimise = ["O6"]', ("optimise", "'O6'", "available: A, D")),
        ("seed = 2026", 'sampling = "grid"', ("sampling", "'random' or 'sobol'", "'grid'")),
        (
            "sigma_mm = 0.03 ",
            "sigma_mm = -0.03 ",
            ("measurement.sigma_mm", "expected at least 1e-09"),
        ),
        ("sizes = [3]", "sizes = [3, 2, 3]", ("sizes", "3 is listed twice")),
        ("sigma_mm = 0.03 ", "sigma_mm = 1e-160 ", ("measurement.sigma_mm",)),
        ("sigma_mm = 0.03 ", "sigma_mm = nan ", ("measurement.sigma_mm",)),
        (
            "height_min_mm = 800",
            "height_min_mm = 9000",
            ("workspace", "no feasible pose", "height"),
        ),
        ("q_deg = [0, -56.9,", "q_deg = [-56.9,", ("test_pose.q_deg", "5 entries, expected 6")),
        ('unknown = ["q2",', 'unknown = ["q9",', ("joints.unknown", "'q9'", "q1, q2")),
        ('unknown = ["q2",', 'unknown = ["q1", "q2",', ("joints.unknown", "k1")),
        ("sizes = [3]", "sizes = [0]", ("sizes", "expected at least 1")),
        ("seed = 2026", "seed = ", ("not valid TOML",)),
        ("candidates = 300", 'published = ["nowhere.csv"]', ("nowhere.csv", "no such file")),
        ("height_min_mm = 800", 'excluded = "nowhere.csv"', ("nowhere.csv", "no such file")),
        (
            "height_min_mm = 800",
            "excluded_within_deg = 0",
            ("workspace.excluded_within_deg", "expected at least"),
        ),
        (LOAD, f"{LOAD}\nF_max_N = 2500", ("load", "one of F_N, F_max_N and list_F_N")),
        (
            LOAD,
            "F_max_N = 2500\nlist_F_N = [[0, 0, 1]]",
            ("load", "one of F_N, F_max_N and list_F_N"),
        ),
        (LOAD, "T_Nm = [1, 0, 0]", ("load", "one of F_N, F_max_N and list_F_N")),
        (LOAD, "F_max_N = 2500\nT_Nm = [1, 0, 0]", ("load", "T_Nm goes with F_N only")),
        (LOAD, f"{LOAD}\ndirection = [0, 0, 1]", ("load", "direction goes with F_max_N")),
        (LOAD, "F_max_N = 2500\ndirection = [0, 0, 0]", ("load", "direction", "not zero")),
        (LOAD, "F_max_N = 0", ("load.F_max_N", "expected at least")),
        (LOAD, "list_F_N = []", ("load.list_F_N", "at least 1")),
        (LOAD, "list_F_N = [[0, 0]]", ("load.list_F_N",)),
    ],
)
def test_bad_study(study: Path, tmp_path: Path, old: str, new: str, words: tuple[str, ...]) -> None:
    """Each mistake in a study is one line that names the file and the key, and nothing
    is written.
    """
    out = tmp_path / "out"
    assert_one_line(edtk("run", edit(study, old, new), "--out", out), *words)
    assert not out.exists()


def test_missing_files_and_wrong_usage(study: Path) -> None:
    """A study or plan that is not there, an unknown option and an unknown command are one line
    each.
    """
    assert_one_line(edtk("run", "nowhere.toml"), "nowhere.toml", "no such file")
    assert_one_line(edtk("evaluate", study, "nowhere.csv"), "nowhere.csv", "no such file")
    assert_one_line(edtk("run", study, "--color"), "--color")
    assert_one_line(edtk("walk"), "walk")


def test_ctrl_c_leaves_the_best_certified_plan(tmp_path: Path) -> None:
    """A long run that is interrupted prints and writes its best plan with the bound that is proved
    so far, says so, and exits with 130.
    """
    out = tmp_path / "plan.csv"
    study = load_study(PAPER)
    options = ["--criterion", "O4", "--candidates", 500, "--continuous", "--json", "--out", out]
    answer = interrupted(b"continuum: gap", "relax", PAPER, *options)
    assert answer.returncode == 130, answer.stderr
    assert [line.split(";")[0] for line in messages(answer)] == ["edtk: interrupted"]
    result = json.loads(answer.stdout)
    weights = np.array([s["weight"] for s in result["support"]])
    q = np.deg2rad([s["q_deg"] for s in result["support"]])
    A = np.sqrt(weights)[:, None, None] * study.model.regressor(q, [0, 0, -2500, 0, 0, 0]) / 0.03e-3
    s = np.linalg.svd(A.reshape(-1, 5), compute_uv=False)
    assert result["value"] == pytest.approx(
        s[-1] ** 2 / s[0], rel=1e-11
    )  # eps times a condition number of 1e3
    # How sharp the bound is depends on the search that was interrupted. It holds for candidates,
    # whose optimum is known; that over all poses, by the same multipliers, is no sharper.
    over_first = relax(study, "O4", candidates=500).value
    assert over_first * (1 - 1e-9) <= result["bound"]
    assert result["value"] <= result["bound"] <= result["bound_searched"] * (1 + 1e-9)
    assert result["gap"] == pytest.approx(1 - result["value"] / result["bound"], abs=1e-9)
    assert pd.read_csv(out)["weight"].to_numpy() == pytest.approx(weights, rel=1e-9)
    assert list(tmp_path.iterdir()) == [out]


def test_ctrl_c_before_there_is_a_plan(tmp_path: Path) -> None:
    """Interrupted while candidates are made, nothing is printed and nothing is written; exit code
    130.
    """
    options = ["--candidates", 10**9, "--json", "--out", tmp_path / "plan.csv"]
    answer = interrupted(b"candidates", "relax", PAPER, *options)
    assert answer.returncode == 130, answer.stderr
    assert messages(answer) == ["edtk: interrupted"]
    assert answer.stdout == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "change", "words"),
    [
        (["--criterion", "O6"], None, ("study.toml", "unknown criterion 'O6'", "available: A, D")),
        (["--criterion", ""], None, ("study.toml", "unknown criterion ''")),
        (["--candidates", "0"], None, ("--candidates", "0 is not in the range")),
        (["--candidates", "many"], None, ("--candidates", "'many'")),
        (["--candidates", "1"], None, ("study.toml", "no candidate excites")),
        (["--seed", "-1"], None, ("--seed", "-1 is not in the range x>=0")),
        (["--memory", "100"], None, ("--memory", "100 MB is too small", "MB or more")),
        (["--memory", "nan"], None, ("--memory",)),
        (["--colour"], None, ("--colour",)),
        (
            [],
            ('["q2",', '["q1", "q2",'),
            ("study.toml", "joints.unknown", "no candidate excites k1"),
        ),
        (
            [],
            ("height_min_mm = 800", "height_min_mm = 9000"),
            ("study.toml", "workspace", "height p_z > 9000 mm"),
        ),
        ([], ("seed = 2026", 'sampling = "grid"'), ("study.toml", "sampling", "'grid'")),
    ],
)
def test_bad_relax(
    study: Path,
    tmp_path: Path,
    options: list[str],
    change: tuple[str, str] | None,
    words: tuple[str, ...],
) -> None:
    """Each mistake is one line that names the file and key, or the option, and an earlier file
    stays as it was.
    """
    if change:
        edit(study, *change)
    out = tmp_path / "plan.csv"
    out.write_text("earlier")
    assert_one_line(edtk("relax", study, *options, "--json", "--out", out), *words)
    assert out.read_text() == "earlier"
    assert set(tmp_path.iterdir()) == {study, out}


@pytest.mark.parametrize(
    ("options", "change", "words"),
    [
        ([], None, ("--size",)),
        (["--size", "0"], None, ("--size", "0 is not in the range")),
        (
            ["--size", "1"],
            None,
            ("study.toml", "--size", "1 experiment cannot identify 5", "smallest number is 2"),
        ),
        (["--size", "3", "--distinct", "4"], None, ("--distinct 4", "at most 3")),
        (
            ["--size", "3", "--distinct", "1"],
            None,
            ("study.toml", "--distinct", "1 distinct pose", "number is 2"),
        ),
        (["--size", "3", "--distinct", "0"], None, ("--distinct", "0 is not in the range")),
        (["--size", "3", "--budget", "0"], None, ("--budget", "0.0 is not in the range x>0")),
        (["--size", "3", "--budget", "-1"], None, ("--budget", "-1.0 is not in the range x>0")),
        (["--size", "3", "--workers", "0"], None, ("--workers", "0 is not in the range")),
        (["--size", "3", "--seed", "-1"], None, ("--seed", "-1 is not in the range x>=0")),
        (["--size", "3", "--criterion", "O6"], None, ("unknown criterion 'O6'", "available: A, D")),
        (
            ["--size", "3", "--keep", str(PLAN_3)],
            None,
            ("--size 3", "3 experiments are kept", "more than that"),
        ),
        (
            ["--size", "2", "--keep", str(PLAN_3)],
            None,
            ("--size 2", "3 experiments are kept", "more than that"),
        ),
        (
            ["--size", "5", "--distinct", "3", "--keep", str(PLAN_3)],
            None,
            ("--distinct 3", "at most 2"),
        ),
        (["--size", "3", "--keep", "nowhere.csv"], None, ("nowhere.csv", "no such file")),
        (["--size", "3", "--exclude", "nowhere.csv"], None, ("nowhere.csv", "no such file")),
        (
            ["--size", "4", "--keep", str(PLAN_3)],
            (LOAD, "F_max_N = 2500"),
            ("table_4_3.csv", "Fx_N", "load open"),
        ),
        (
            ["--size", "3"],
            (LOAD, "F_max_N = 2500\ndirection = [0, 0, 0]"),
            ("study.toml", "load", "not zero"),
        ),
        (
            ["--size", "3"],
            ("height_min_mm = 800", 'excluded = "nowhere.csv"'),
            ("nowhere.csv", "no such file"),
        ),
        (
            ["--size", "3"],
            ("height_min_mm = 800", "height_min_mm = 9000"),
            ("study.toml", "workspace", "height"),
        ),
        (
            ["--size", "3"],
            ('["q2",', '["q1", "q2",'),
            ("study.toml", "joints.unknown", "no candidate excites k1"),
        ),
    ],
)
def test_bad_plan_question(
    study: Path,
    tmp_path: Path,
    options: list[str],
    change: tuple[str, str] | None,
    words: tuple[str, ...],
) -> None:
    """Each mistake is one line that says what was expected, and an earlier file stays as it was."""
    if change:
        edit(study, *change)
    out = tmp_path / "plan.csv"
    out.write_text("earlier")
    short = [
        "--budget",
        "1",
        "--workers",
        "1",
        *options,
    ]  # the relaxation comes before some of them
    assert_one_line(edtk("plan", study, *short, "--json", "--out", out), *words)
    assert out.read_text() == "earlier"
    assert set(tmp_path.iterdir()) == {study, out}


def test_kept_pose_that_is_infeasible_is_named_by_its_row(study: Path, tmp_path: Path) -> None:
    """A kept plan is checked as any other: the file, the row, the constraint; and nothing is
    written.
    """
    kept = tmp_path / "kept.csv"
    out = tmp_path / "plan.csv"
    kept.write_text(f"{HEADER}\n{POSE}\n-93.5,185.0,-118.7,-62.4,-168.9\n")
    answer = edtk("plan", study, "--size", 3, "--keep", kept, "--out", out)
    assert_one_line(answer, "kept.csv", "row 2", "joint limit q3")
    assert set(tmp_path.iterdir()) == {study, kept}


@pytest.mark.parametrize("command", ["evaluate", "bayes"])
def test_plan_without_forces_where_the_load_is_open(study: Path, command: str) -> None:
    """A plan has to say which forces are applied where the study does not."""
    edit(study, LOAD, "list_F_N = [[0, 0, -2500], [0, 0, -1000]]")
    assert_one_line(
        edtk(command, study, PLAN_3), "table_4_3.csv", "'Fx_N' is missing", "leaves the load open"
    )


def test_cluster_that_is_not_there(study: Path, tmp_path: Path) -> None:
    """An address at which no scheduler answers is one line without a log; nothing is written."""
    answer = process("run", study, "--dask", "tcp://127.0.0.1", "--out", tmp_path / "out")
    assert_one_line(answer, "--dask", "no Dask scheduler answers", "tcp://127.0.0.1")
    assert list(tmp_path.iterdir()) == [study]


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nobody at all", "carrier://a:1"])
def test_address_of_no_cluster(
    study: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    address: str,
) -> None:
    """An address where nobody answers, or that is none, is one line; nothing is written, and
    nothing is said by others.
    """
    soon = partial(open_workers, greeting_s=0.3)
    monkeypatch.setattr("edtk.verbs.inputs.open_workers", soon)
    options = ["--size", 3, "--dask", address, "--out", tmp_path / "out"]
    assert_one_line(edtk("plan", study, *options), "no Dask scheduler answers", address)
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == [study]


def test_relax_for_a_test_pose_that_is_not_there(study: Path) -> None:
    """A criterion of accuracy in a test pose is refused where the study has none; the others are
    relaxed.
    """
    text = study.read_text().replace('["rho0", "E"]', '["E"]').replace('["E", "rho0"]', '["E"]')
    start = text.index("[test_pose]")
    end = text.index("[simulation]")
    study.write_text(text[:start] + text[end:])
    assert_one_line(
        edtk("relax", study, "--criterion", "rho0", "--json"), "study.toml", "rho0", "test pose"
    )
    assert json.loads(edtk("relax", study, "--json").stdout)["criterion"] == "E"


def test_relax_to_a_place_that_cannot_be_written(study: Path, tmp_path: Path) -> None:
    """A folder, or a path below a file, is refused in one line, and no part of a plan is left
    anywhere.
    """
    file = tmp_path / "file"
    file.write_text("mine")
    for out in (tmp_path, file / "plan.csv", file / "below" / "plan.csv"):
        assert_one_line(
            edtk("relax", study, "--json", "--out", out), str(out if out == tmp_path else file)
        )
    assert file.read_text() == "mine"
    assert set(tmp_path.iterdir()) == {study, file}


@pytest.mark.parametrize(
    "line",
    [
        "plan STUDY --size 3 --out STUDY",
        "plan STUDY --size 3 --keep PLAN --out PLAN",
        "plan STUDY --size 3 --exclude PLAN --out PLAN",
        "relax STUDY --out STUDY",
        "template STUDY PLAN --out STUDY",
        "template STUDY PLAN --out PLAN",
        "compensate STUDY K PLAN --out PLAN",
        "compensate STUDY K PLAN --out K",
        "identify STUDY PLAN --out DIR --plan DIR/k.json",
        "identify STUDY PLAN --bayes --chain PLAN",
        "bayes STUDY PLAN --chain PLAN",
        "bayes STUDY PLAN --export STUDY",
        "bayes STUDY PLAN --chain K --export K",
    ],
)
def test_no_command_overwrites_what_it_reads(study: Path, tmp_path: Path, line: str) -> None:
    """One line, before any work, and every file is as it was."""
    plan = tmp_path / "plan.csv"
    k = tmp_path / "k.json"
    plan.write_text(PLAN_3.read_text())
    k.write_text('{"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6, "q6": 2.1e-6}')
    before = {path: path.read_bytes() for path in (study, plan, k)}
    named = {"STUDY": study, "PLAN": plan, "K": k, "DIR": tmp_path, "DIR/k.json": k}
    assert_one_line(
        edtk(*(named.get(word, word) for word in line.split())), "is read by this command"
    )
    assert {path: path.read_bytes() for path in before} == before


@pytest.mark.parametrize(
    "line",
    [
        "plan STUDY --size 3 --out SHEET",
        "relax STUDY --out SHEET",
        "compensate STUDY K PLAN --out SHEET",
        "bayes STUDY PLAN --export SHEET",
    ],
)
def test_measurements_are_never_overwritten(study: Path, tmp_path: Path, line: str) -> None:
    """A sheet that somebody has filled in is refused as an output, before any work, whatever the
    command.
    """
    sheet = tmp_path / "day1.csv"
    k = tmp_path / "k.json"
    k.write_text('{"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6, "q6": 2.1e-6}')
    assert edtk("template", study, PLAN_3, "--out", sheet).returncode == 0
    empty = sheet.read_text()
    sheet.write_text(empty.replace(",,", ",0.1,", 1))
    filled = sheet.read_text()
    assert filled != empty
    named = {"STUDY": study, "PLAN": PLAN_3, "K": k, "SHEET": sheet}
    assert_one_line(
        edtk(*(named.get(word, word) for word in line.split())), "day1.csv: has measurements in it"
    )
    assert sheet.read_text() == filled


def test_what_the_study_names_is_not_overwritten(study: Path, tmp_path: Path) -> None:
    """Plans and earlier calibrations that a study names are inputs too."""
    plan = tmp_path / "plan.csv"
    k = tmp_path / "k.json"
    plan.write_text(PLAN_3.read_text())
    k.write_text("{}")
    text = study.read_text()
    study.write_text(f'published = ["plan.csv"]\n{text}\n[prior]\nearlier_file = "k.json"\n')
    for line in (["relax", study, "--out", plan], ["identify", study, PLAN_3, "--out", tmp_path]):
        assert_one_line(edtk(*line), "is read by this command")
    assert (plan.read_text(), k.read_text()) == (PLAN_3.read_text(), "{}")


@pytest.mark.parametrize(
    "line", ["plan STUDY --size 3 --budget nan", "bayes STUDY PLAN --accuracy nan"]
)
def test_options_that_are_no_number(study: Path, line: str) -> None:
    """NaN is no number of seconds, and no accuracy."""
    named = {"STUDY": study, "PLAN": PLAN_3}
    assert_one_line(edtk(*(named.get(word, word) for word in line.split())), "nan", "range")
