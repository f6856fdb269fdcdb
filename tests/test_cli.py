"""The commands as a user types them, and every mistake that a user can make."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import criteria

ROOT = Path(__file__).parents[1]
STUDY = (ROOT / "studies/kr270_milling.toml").read_text()
HEADER = "q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
POSE = "-93.5,125.0,-118.7,-62.4,-168.9"
PLAN_3 = ROOT / "studies/plans/table_4_3.csv"


def edtk(*args: object, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "edtk", *map(str, args)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, **(env or {})})


def assert_one_line(answer: subprocess.CompletedProcess[str], *words: str) -> None:
    """Exit code 2, nothing on standard output, and a last line that says what is wrong."""
    assert answer.returncode == 2, answer.stderr
    assert answer.stdout == ""
    assert "Traceback" not in answer.stderr
    lines = [line for line in answer.stderr.replace("\r", "\n").split("\n") if line.startswith("edtk: ")]
    assert len(lines) == 1, answer.stderr
    for word in words:
        assert word in lines[0], lines[0]


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A small copy of the paper's study, without published plans."""
    text = STUDY[: STUDY.index("published = [")] + STUDY[STUDY.index("[tool]") :]
    text = text.replace("candidates = 2000", "candidates = 300").replace("sizes = [2, 3, 4, 6, 12]", "sizes = [3]")
    text = text.replace("starts = 6", "starts = 1").replace('["rho0", "A", "D", "E"]', '["rho0", "D"]')
    path = tmp_path / "study.toml"
    path.write_text(text)
    return path


def edit(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


def test_criteria_lists_the_registry() -> None:
    """`edtk criteria --json` is the registry as JSON, and the table names every criterion."""
    listed = json.loads(edtk("criteria", "--json").stdout)
    assert [row["name"] for row in listed] == list(criteria.available())
    table = edtk("criteria").stdout
    assert all(row["title"] in table for row in listed)


def test_evaluate_json_is_alone_on_standard_output_and_in_si() -> None:
    """`edtk evaluate --json` prints one JSON document with the promised keys; rho0 is in metres."""
    answer = edtk("evaluate", "studies/kr270_milling.toml", PLAN_3, "--json")
    result = json.loads(answer.stdout)
    keys = {"criteria", "observability_unscaled", "std", "covariance", "parameters", "experiments"}
    assert set(result) == keys
    assert result["criteria"]["rho0"] == pytest.approx(6.588e-6, rel=2e-4)
    assert result["experiments"] == 3
    assert result["std"]["q2"] == pytest.approx(np.sqrt(result["covariance"][0][0]))
    sigma = 0.03e-3
    for name in ("O1", "O3", "O4"):
        assert result["observability_unscaled"][name] == pytest.approx(result["criteria"][name] * sigma)


def test_evaluate_counts_repeats_and_takes_a_wrench(tmp_path: Path) -> None:
    """Repeating every pose k times divides the covariance by k; doubling the force divides it by four."""
    plain = json.loads(edtk("evaluate", "studies/kr270_milling.toml", PLAN_3, "--json").stdout)
    rows = PLAN_3.read_text().split()
    path = tmp_path / "plan.csv"
    path.write_text("\n".join([rows[0] + ",repeats,Fz_N", *(r + ",3,-5000" for r in rows[1:])]))
    more = json.loads(edtk("evaluate", "studies/kr270_milling.toml", path, "--json").stdout)
    assert more["experiments"] == 9
    assert np.array(more["covariance"]) == pytest.approx(np.array(plain["covariance"]) / 12)


def test_run_writes_results_plans_and_report(study: Path, tmp_path: Path) -> None:
    """`edtk run` ends with a table, plans that can be evaluated, and a report with its figure."""
    out = tmp_path / "out"
    answer = edtk("run", study, "--out", out)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == ""
    assert {p.name for p in out.iterdir()} == {"results.csv", "report.md", "comparison.png", "plans"}
    assert "comparison.png" in (out / "report.md").read_text()
    result = edtk("evaluate", study, out / "plans/optimised_rho0_m3.csv", "--json")
    assert 5e-6 < json.loads(result.stdout)["criteria"]["rho0"] < 7e-6


def test_bayes_prints_the_ratio_with_its_error() -> None:
    """`edtk bayes --json` gives, per parameter, a ratio that is one within three Monte-Carlo errors."""
    answer = edtk("bayes", "studies/kr270_milling.toml", ROOT / "studies/plans/table_4_12.csv", "--json")
    rows = json.loads(answer.stdout)
    assert [r["parameter"] for r in rows] == ["k2", "k3", "k4", "k5", "k6"]
    assert all(abs(r["ratio"] - 1) <= 3 * r["ratio_error"] for r in rows)


def test_a_plug_in_criterion_is_found_by_name_in_a_study(study: Path, plugin_site: Path, tmp_path: Path) -> None:
    """A criterion of another distribution can be named in a study, and its values are in the results."""
    env = {"PYTHONPATH": str(plugin_site)}
    name = next(r["name"] for r in json.loads(edtk("criteria", "--json", env=env).stdout)[10:])
    edit(study, '"O5", "rho0"]', f'"O5", "rho0", "{name}"]')
    answer = edtk("run", study, "--out", tmp_path / "out", env=env)
    assert answer.returncode == 0, answer.stderr
    assert name in (tmp_path / "out/results.csv").read_text().split("\n")[0].split(",")
    assert_one_line(edtk("run", study), name, "available: A, D")


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
def test_bad_plan(study: Path, tmp_path: Path, command: str, content: str, words: tuple[str, ...]) -> None:
    """Each mistake in a plan is one line that names the file, and the row or column where there is one."""
    path = tmp_path / "plan.csv"
    path.write_text(content)
    assert_one_line(edtk(command, study, path), "plan.csv", *words)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("seed = 2026", "sead = 2026", ("sead", "unknown key")),
        ('robot = "kuka_kr270"', 'robot = "kuka_kr271"', ("robot", "kuka_kr271", "kuka_kr270")),
        ('"O5", "rho0"]', '"O6"]', ("criteria", "'O6'", "available: A, D")),
        ('optimise = ["rho0", "D"]', 'optimise = ["O4"]', ("optimise", "'O4'", "no convex form to optimise")),
        ("sigma_mm = 0.03 ", "sigma_mm = -0.03 ", ("measurement.sigma_mm", "greater than 0")),
        ("sigma_mm = 0.03 ", "sigma_mm = nan ", ("measurement.sigma_mm",)),
        ("height_min_mm = 800", "height_min_mm = 9000", ("workspace", "no feasible pose", "height")),
        ("q_deg = [0, -56.9,", "q_deg = [-56.9,", ("test_pose.q_deg", "5 entries, expected 6")),
        ('unknown = ["q2",', 'unknown = ["q9",', ("joints.unknown", "'q9'", "q1, q2")),
        ('unknown = ["q2",', 'unknown = ["q1", "q2",', ("joints.unknown", "k1")),
        ("sizes = [3]", "sizes = [0]", ("sizes", "greater than or equal to 1")),
        ("seed = 2026", "seed = ", ("not valid TOML",)),
        ("candidates = 300", 'published = ["nowhere.csv"]', ("nowhere.csv", "no such file")),
    ],
)
def test_bad_study(study: Path, tmp_path: Path, old: str, new: str, words: tuple[str, ...]) -> None:
    """Each mistake in a study is one line that names the file and the key, and nothing is written."""
    out = tmp_path / "out"
    assert_one_line(edtk("run", edit(study, old, new), "--out", out), *words)
    assert not out.exists()


def test_missing_files_and_wrong_usage(study: Path) -> None:
    """A study or plan that is not there, an unknown option and an unknown command are one line each."""
    assert_one_line(edtk("run", "nowhere.toml"), "nowhere.toml", "no such study file")
    assert_one_line(edtk("evaluate", study, "nowhere.csv"), "nowhere.csv", "no such file")
    assert_one_line(edtk("run", study, "--color"), "--color")
    assert_one_line(edtk("walk"), "walk")
