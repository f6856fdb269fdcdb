"""`edtk template` and `edtk identify` as a user types them."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner, Result

from edtk.cli import main
from edtk.fit.fit_huber import SigmaTooSmallError
from edtk.fit.measurements import simulate
from edtk.study.study import load_study

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PAPER = ROOT / "studies/kr270_milling.toml"
PLAN = ROOT / "studies/plans/table_4_4.csv"
STUDY = load_study(PAPER)
D = ["dx_mm", "dy_mm", "dz_mm"]


def edtk(*args: object) -> Result:
    result = CliRunner().invoke(main, [*map(str, args)])
    if not isinstance(result.exception, SystemExit | None):
        raise result.exception
    return result


def assert_one_line(answer: Result, *words: str) -> None:
    """Exit code 2, nothing on standard output, and one line that says what is wrong."""
    assert answer.exit_code == 2, answer.stderr
    assert answer.stdout == ""
    assert answer.stderr.startswith("edtk: ")
    assert answer.stderr.count("\n") == 1, answer.stderr
    for word in words:
        assert word in answer.stderr


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """The sheet that `edtk template` writes, filled in by simulation."""
    path = tmp_path / "sheet.csv"
    assert edtk("template", PAPER, PLAN, "--out", path).exit_code == 0
    table = pd.read_csv(path)
    A = STUDY.model.regressor(np.deg2rad(table.iloc[:, :6]), table.iloc[:, 6:12])
    table[D] = 1e3 * simulate(A, STUDY.compliances, STUDY.sigma, np.random.default_rng(0))[0]
    table.to_csv(path, index=False)
    return path


def test_sheet_is_printed_or_written(tmp_path: Path) -> None:
    """Without --out the sheet is on standard output, the same as in the file."""
    answer = edtk("template", PAPER, PLAN)
    edtk("template", PAPER, PLAN, "--out", tmp_path / "sheet.csv")
    assert (tmp_path / "sheet.csv").read_text() == answer.stdout
    assert answer.stdout.split("\n")[0].endswith("Tz_Nm,dx_mm,dy_mm,dz_mm")
    assert "z0_mm,x_mm" in edtk("template", PAPER, PLAN, "--positions").stdout
    (tmp_path / "many.csv").write_text(
        "q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,repeats\n-81.1,64.9,-55.4,42.2,149.7,1e9\n"
    )
    assert_one_line(edtk("template", PAPER, tmp_path / "many.csv"), "1000000 at most")


def test_an_empty_sheet_is_refused(tmp_path: Path) -> None:
    """A sheet that was not filled in is refused with row and column, and nothing is written."""
    edtk("template", PAPER, PLAN, "--out", tmp_path / "sheet.csv")
    answer = edtk("identify", PAPER, tmp_path / "sheet.csv", "--out", tmp_path / "out")
    assert_one_line(answer, "sheet.csv: no row is filled in; expected measurements in dx_mm")
    assert not (tmp_path / "out").exists()


def test_identify(measured: Path, tmp_path: Path) -> None:
    """JSON is alone on standard output and equals k.json; the table names every compliance; both
    see the truth.
    """
    answer = edtk("identify", PAPER, measured, "--plan", PLAN, "--json", "--out", tmp_path / "out")
    assert (answer.exit_code, answer.stderr) == (0, "")
    found = json.loads(answer.stdout)
    assert found == json.loads((tmp_path / "out/k.json").read_text())
    for joint, true in zip(found["k"], STUDY.compliances, strict=True):
        assert abs(found["k"][joint] - true) < 4 * found["std"][joint]
    assert found["rho0"]["interval95"] == [found["rho0"]["value"]] * 2
    said = edtk("identify", PAPER, measured).stdout
    assert all(name in said for name in ("k2", "k6", "chi-square", "rho0", "leverage"))


@pytest.mark.cell("`identify --robust`", "springs")
@pytest.mark.cell("`identify --sigma-unknown`", "springs")
def test_options(measured: Path) -> None:
    """--sigma-unknown gives rho0 an interval, and --robust another estimate."""
    plain, unknown, robust = (
        json.loads(edtk("identify", PAPER, measured, "--json", *options).stdout)
        for options in ((), ("--sigma-unknown",), ("--robust", "--sigma-unknown"))
    )
    assert unknown["k"] == plain["k"] != robust["k"]
    assert (
        unknown["rho0"]["interval95"][0]
        < unknown["rho0"]["value"]
        < unknown["rho0"]["interval95"][1]
    )
    assert unknown["p_value"] is None


def test_a_far_too_small_sigma_names_the_option(measured: Path, monkeypatch) -> None:
    """Where no residual is as small as sigma says, the line names the option that estimates it."""

    def refuse(*args: object) -> None:
        raise SigmaTooSmallError("the smallest residual is 50 times sigma: expected a larger sigma")

    monkeypatch.setattr("edtk.fit.identify.fit_huber", refuse)
    answer = edtk("identify", PAPER, measured, "--robust")
    line = "the smallest residual is 50 times sigma: expected a larger sigma, or --sigma-unknown"
    assert_one_line(answer, f"{measured}: {line}\n")


def test_doubts_are_on_standard_error(measured: Path) -> None:
    """Metres for millimetres: the answer is given, with one line of warning that names the file."""
    table = pd.read_csv(measured)
    table[D] /= 1000
    table.to_csv(measured, index=False)
    answer = edtk("identify", PAPER, measured, "--json")
    assert answer.exit_code == 0
    json.loads(answer.stdout)
    assert answer.stderr.count("\n") == 1
    assert answer.stderr.startswith(f"edtk: {measured}: ")
    assert "in metres? expected millimetres" in answer.stderr


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop(columns="dz_mm"), ("'dz_mm' is missing",)),
        (lambda t: t.drop(columns="q3_deg"), ("'q3_deg' is missing",)),
        (lambda t: t.rename(columns={"q3_deg": "q3"}), ("unknown column 'q3'",)),
        (lambda t: t.assign(Fz_N=0), ("row 1", "wrench is zero")),
        (lambda t: t.assign(sigma_mm=[0.1, 0.1, 0, 0.1]), ("row 3", "sigma_mm")),
        (lambda t: t.assign(drx_deg=0), ("drx_deg", "positions only")),
        (lambda t: t[:0], ("no rows",)),
        (lambda t: t[:1], ("cannot identify all parameters", "along", "and --bayes would")),
    ],
)
def test_bad_measurements(measured: Path, tmp_path: Path, change, words: tuple[str, ...]) -> None:
    """Each mistake in the file is one line that names it, and nothing is written."""
    change(pd.read_csv(measured)).to_csv(measured, index=False)
    answer = edtk("identify", PAPER, measured, "--out", tmp_path / "out", "--json")
    assert_one_line(answer, "sheet.csv: ", *words)
    assert not (tmp_path / "out").exists()


def test_places_that_cannot_be_written(measured: Path, tmp_path: Path) -> None:
    """A folder that is a file, and a measurement file that is not there, are one line each."""
    (tmp_path / "file").write_text("")
    assert_one_line(edtk("identify", PAPER, measured, "--out", tmp_path / "file"), "file")
    assert_one_line(edtk("identify", PAPER, measured, "--out", tmp_path / "file" / "below"), "file")
    assert_one_line(edtk("identify", PAPER, tmp_path / "none.csv"), "none.csv: no such file")
    assert_one_line(
        edtk("template", PAPER, PLAN, "--out", tmp_path / "file" / "below.csv"), "below.csv"
    )
    (tmp_path / "out" / "k.json").mkdir(parents=True)
    assert_one_line(
        edtk("identify", PAPER, measured, "--out", tmp_path / "out"), "k.json", "is a folder"
    )
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["k.json"]


@pytest.mark.cell("`identify --bayes`", "springs")
def test_bayes(measured: Path, tmp_path: Path) -> None:
    """--bayes adds the posterior to JSON, table and report; chain and export are written; the same
    seed, the same.
    """
    files = ["--chain", tmp_path / "chain.h5", "--export", tmp_path / "posterior.nc"]
    answer = edtk(
        "identify",
        PAPER,
        measured,
        "--bayes",
        "--accuracy",
        0.2,
        "--json",
        "--out",
        tmp_path / "out",
        *files,
    )
    assert answer.exit_code == 0, answer.stderr
    found = json.loads(answer.stdout)
    assert found == json.loads((tmp_path / "out/k.json").read_text())
    rows = found["posterior"]["parameters"]
    assert [row["parameter"] for row in rows] == ["k2", "k3", "k4", "k5", "k6"]
    assert all(abs(row["ratio"] - 1) < 4 * row["ratio_error"] for row in rows)
    page = (tmp_path / "out/report.html").read_text()
    assert "What does the posterior say?" in page
    assert page.count("<figure") == 9
    assert (tmp_path / "chain.h5").exists()
    assert (tmp_path / "posterior.nc").exists()
    again = edtk("identify", PAPER, measured, "--bayes", "--accuracy", 0.2, "--json")
    assert json.loads(again.stdout)["posterior"] == found["posterior"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--seed", 3], ("--seed: expected --bayes",)),
        (
            ["--bayes", "--most", 600, "--accuracy", 0.001],
            ("did not converge in 600 steps", "--most"),
        ),
        (["--bayes", "--chain", ROOT / "README.md"], ("README.md: not a chain",)),
        (["--bayes", "--export", PAPER], ("kr270_milling.toml: is read by this command",)),
    ],
)
def test_bayes_mistakes(
    measured: Path, tmp_path: Path, options: list[object], words: tuple[str, ...]
) -> None:
    """An unconverged chain gives no interval, and each mistake is a line; nothing is written."""
    answer = edtk("identify", PAPER, measured, "--out", tmp_path / "out", *options)
    assert answer.exit_code == 2
    assert answer.stdout == ""
    assert all(word in answer.stderr.split("\n")[-2] for word in words), answer.stderr
    assert not list((tmp_path / "out").glob("*"))


def test_swapped_columns(measured: Path, tmp_path: Path) -> None:
    """Exchanged columns are one line that names them, and nothing is written."""
    table = pd.concat([pd.read_csv(measured)] * 2)
    table.iloc[4:, -3:] += 0.01
    table.rename(columns={"dx_mm": "dz_mm", "dz_mm": "dx_mm"}).to_csv(measured, index=False)
    answer = edtk("identify", PAPER, measured, "--out", tmp_path / "out")
    assert_one_line(answer, "columns dx_mm and dz_mm", "look swapped", "--as-is takes it as it is")
    assert not (tmp_path / "out").exists()
    answer = edtk("identify", PAPER, measured, "--as-is")
    assert answer.exit_code == 0
    assert "columns dx_mm and dz_mm" in answer.stderr
    assert answer.stdout.endswith("verdict: bad\n")


def test_a_program_reads_the_causes_of_a_sheet_that_is_refused(measured: Path) -> None:
    """With --json a misread sheet is an answer: verdict and causes, and no compliances."""
    table = pd.concat([pd.read_csv(measured)] * 2)
    table.iloc[4:, -3:] += 0.01
    table.rename(columns={"dx_mm": "dz_mm", "dz_mm": "dx_mm"}).to_csv(measured, index=False)
    answer = edtk("identify", PAPER, measured, "--json")
    assert answer.exit_code == 0
    said = json.loads(answer.stdout)
    assert said["verdict"] == "bad"
    assert [cause["cause"] for cause in said["causes"]] == ["columns"]
    assert set(said["k"].values()) == {None}
    assert said["budget_mm"] is None
    assert answer.stderr.count("\n") == 1
    assert "columns dx_mm and dz_mm" in answer.stderr
    as_is = json.loads(edtk("identify", PAPER, measured, "--json", "--as-is").stdout)
    assert said.keys() == as_is.keys()
    assert said["chi2"] == as_is["chi2"]


def test_a_copied_row_has_no_cause(measured: Path, tmp_path: Path) -> None:
    """What no reading explains is refused with --json, too; and no files are ever written."""
    table = pd.read_csv(measured)
    pd.concat([table, table]).to_csv(measured, index=False)
    assert_one_line(edtk("identify", PAPER, measured, "--json"), "row 5 is row 1")
    table = pd.read_csv(measured).iloc[:4]
    table.rename(columns={"dx_mm": "dz_mm", "dz_mm": "dx_mm"}).to_csv(measured, index=False)
    answer = edtk("identify", PAPER, measured, "--json", "--out", tmp_path / "out")
    assert_one_line(answer, "look swapped")
    assert not (tmp_path / "out").exists()


@pytest.mark.cell("`identify --plan`", "springs")
def test_poses_that_are_not_in_the_plan(measured: Path) -> None:
    """With --plan a row in another pose is refused, with its row and column."""
    table = pd.read_csv(measured)
    table.loc[2, "q3_deg"] += 1
    table.to_csv(measured, index=False)
    assert_one_line(
        edtk("identify", PAPER, measured, "--plan", PLAN), "row 3, column q3_deg", "not in the plan"
    )


def test_a_filled_sheet_stays(measured: Path) -> None:
    """`edtk template` does not overwrite measurements."""
    before = measured.read_bytes()
    assert_one_line(edtk("template", PAPER, PLAN, "--out", measured), "has measurements in it")
    assert measured.read_bytes() == before


def test_a_bad_calibration_is_said_again(measured: Path, tmp_path: Path) -> None:
    """`edtk compensate` warns if the calibration said not to use its compliances."""
    task = tmp_path / "task.csv"
    task.write_text("q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n-60,70,10,30,0\n")
    result = tmp_path / "out" / "k.json"
    assert edtk("identify", PAPER, measured, "--out", result.parent).exit_code == 0
    assert edtk("compensate", PAPER, result, task).stderr == ""
    table = pd.read_csv(measured)
    table[D] += np.random.default_rng(0).normal(size=(4, 3))
    table.to_csv(measured, index=False)
    answer = edtk("identify", PAPER, measured, "--json")
    assert json.loads(answer.stdout)["verdict"] == "bad"
    result.write_text(answer.stdout)
    answer = edtk("compensate", PAPER, result, task)
    assert answer.exit_code == 0
    assert "says not to use these compliances" in answer.stderr


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("dy_mm", "dx_mm"), ("'dx_mm' is there twice",)),
        (lambda text: text.replace(",dz_mm", ","), ("column 15 has no name",)),
        (lambda text: text.replace("-2500", "-2.5e200"), ("row 1, column Fz_N", "is larger than")),
        (lambda text: text.replace("-2500", "0,0", 1), ("row 1: 16 cells; expected 15",)),
    ],
)
def test_files_of_spreadsheets(measured: Path, change, words: tuple[str, ...]) -> None:
    """What spreadsheets make of a table is refused in words of the table."""
    measured.write_text(change(measured.read_text()))
    assert_one_line(edtk("identify", PAPER, measured), *words)


def test_a_european_spreadsheet(measured: Path) -> None:
    """Semicolons, decimal commas and UTF-16: the same result, and one line says what was read."""
    expected = json.loads(edtk("identify", PAPER, measured, "--json").stdout)
    text = measured.read_text().replace(",", ";").replace(".", ",")
    measured.write_bytes(f"{text};;\r\n".encode("utf-16"))
    answer = edtk("identify", PAPER, measured, "--json")
    assert json.loads(answer.stdout)["k"] == pytest.approx(expected["k"], rel=1e-12)
    assert answer.stderr.count("\n") == 1
    assert "read with semicolons between columns, decimal commas, 1 empty row" in answer.stderr


def test_no_displacement_at_all(measured: Path) -> None:
    """A sheet of zeros is no measurement."""
    table = pd.read_csv(measured)
    table[D] = 0
    table.to_csv(measured, index=False)
    assert_one_line(
        edtk("identify", PAPER, measured, "--sigma-unknown"), "all measured displacements are zero"
    )
