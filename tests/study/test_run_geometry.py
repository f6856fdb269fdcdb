"""Whole runs of studies of geometry: files, certificates, what is resumed, and what a day costs."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from loaded_arm import STUDY

import edtk
from edtk.calibration.evaluate_geometry import GeometryDesigns
from edtk.cli import main
from edtk.design.relaxation import search_continuum
from edtk.report.comparison_report import comparison_report
from edtk.study.plan_study import RunOptions
from edtk.study.run_study import run_study
from edtk.study.study import Study
from edtk.study.study_run import StudyRun
from edtk.verbs.run import run

KEYS = {"sizes": [3, 4], "optimise": ["D"], "criteria": ["D", "rho0"], "starts": 3}


pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("shortest_searches")]


@pytest.fixture(scope="module", autouse=True)
def small_screen() -> Iterator[None]:
    """Two joints need no twenty thousand fresh poses to choose starts of ascents from."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search_continuum, "SCREEN", 3000)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a study and a published plan."""
    folder = tmp_path_factory.mktemp("run")
    rng = np.random.default_rng(0)
    q = np.round(np.rad2deg(rng.uniform(*STUDY.robot.limits, (4, 2))), 3)
    loads = np.array([0, -100, -100, 0])
    pd.DataFrame({"q1_deg": q[:, 0], "q2_deg": q[:, 1], "Fz_N": loads}).assign(
        Fx_N=0, Fy_N=0, Tx_Nm=0, Ty_Nm=0, Tz_Nm=0
    ).to_csv(folder / "ours.csv", index=False)
    study = STUDY.replace(**KEYS, published=["ours.csv"], folder=folder)
    study.to_toml(folder / "study.toml")
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> StudyRun:
    """The run of this study."""
    return run(folder / "study.toml", folder / "out", workers=1)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, with its bytes."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def test_the_files_are_those_of_other_runs(found: StudyRun) -> None:
    """Report, table, plans, certificates and cases have the names that they always have."""
    names = set(contents(found.folder))
    assert {"report.md", "results.csv", "comparison.png", "efficiency_m4.png"} <= names
    plans = {"optimised_D_m3", "optimised_D_m4", "distinct_D_m4_k3"}
    assert {f"plans/{name}.csv" for name in (*plans, "random_m3", "random_m4")} <= names
    assert {f"certificates/{name}.json" for name in (*plans, "relaxation_rho0")} <= names
    assert {f"cases/{name}.json" for name in (*plans, "relaxation_D")} <= names


def test_values_are_those_of_the_plans_as_they_are_written(found: StudyRun) -> None:
    """Each row of the table is what `edtk evaluate` says of the plan's file."""
    table = found.table.set_index("plan")
    assert list(table.index[:3]) == ["optimised_D_m3", "optimised_D_m4", "distinct_D_m4_k3"]
    for name in ("optimised_D_m4", "distinct_D_m4_k3", "random_m4"):
        scored = edtk.evaluate(found.study, found.folder / "plans" / f"{name}.csv")
        assert table.loc[name, "D"] == pytest.approx(scored.criteria["D"], rel=1e-7)
        assert table.loc[name, "error_test_pose"] == pytest.approx(scored.rho0, rel=1e-7)
    assert (table["efficiency_D"] <= 1 + 1e-9).all()
    assert table.loc["published_m4", "D"] < table.loc["optimised_D_m4", "D"]


def test_a_plan_of_fewer_visits_repeats_them(found: StudyRun) -> None:
    """Three different visits make four; nothing is gained by fewer."""
    table = found.table.set_index("plan")
    plan = found.plans["distinct_D_m4_k3"]
    assert len(plan.q) == 3
    assert plan.experiments == 4
    assert table.loc["distinct_D_m4_k3", "D"] <= table.loc["optimised_D_m4", "D"] * (1 + 1e-4)


def test_its_certificates_are_valid(found: StudyRun) -> None:
    """`edtk verify` agrees with a relaxation and with a plan of the run, beside the study."""
    for name in ("relaxation_D", "optimised_D_m4"):
        proved = edtk.verify(found.folder / "certificates" / f"{name}.json", found.study)
        assert proved.valid, proved.summary()


def test_the_report_speaks_of_geometry(found: StudyRun) -> None:
    """What is unknown, which visits are loaded, in whose units; and no SI where there is none."""
    report = (found.folder / "report.md").read_text()
    assert "unknown geometry (zeros), tool, compliances of q1, q2: 6 parameters" in report
    assert "without a load, or with load F = (0, 0, -100) N" in report
    assert "| plan             | poses | without a load | loaded |" in report
    assert "D [own units], and the bound" in report
    assert "for parameters in mm, mrad and 1e-6 rad/(N m)" in report
    assert "SI" not in report
    assert "by the noise of the measurements alone [um]" in report


def test_a_run_that_was_killed_goes_on(
    found: StudyRun, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was finished stays as it is, and all files are the same to the last byte."""

    class Killed(BaseException):
        """The end of the process."""

    out = folder / "killed"
    searched = GeometryDesigns.search
    calls = []

    def dying(self: GeometryDesigns, *args: object) -> object:
        calls.append(args)
        if len(calls) == 2:
            raise Killed
        return searched(self, *args)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(GeometryDesigns, "search", dying)
        with pytest.raises(Killed):
            run(found.study, out, workers=1)
    left = {path: path.stat().st_mtime_ns for path in (out / "cases").glob("*.json")}
    assert len(left) == 3  # two relaxations and one plan
    assert not (out / "results.csv").exists()
    run(found.study, out, workers=1)
    assert {path: path.stat().st_mtime_ns for path in left} == left
    assert contents(out) == contents(found.folder)


def priced(**costs: object) -> Study:
    """The study with what a day costs."""
    return STUDY.replace(**KEYS | {"sizes": [4, 40]}, costs={"load_change": 8, "visit": 2} | costs)


def test_a_budget_limits_the_plans(tmp_path: Path) -> None:
    """Plans cost what a day may cost at most; a size that it does not pay for has a reason.

    Of several test poses each has its error, which adds up to rho0.
    """
    pose = STUDY.to_dict()["test_pose"]
    study = priced(budget=20).replace(test_pose=[pose, {**pose, "q_deg": [50, 20]}])
    found = run_study(study, tmp_path, options=RunOptions(), designs_of=GeometryDesigns.of)
    tasks = found.accuracies["optimised for D"]
    assert len(tasks.error) == 2
    rho0 = found.table.set_index("plan").loc["optimised_D_m4", "rho0"]
    assert tasks.mean == pytest.approx(rho0, rel=1e-9)
    report = comparison_report(found, [])
    assert "The error of the markers after compensation is" in report
    assert "| load changes | costs |" in report
    table = found.table.set_index("plan")
    assert "distinct" not in set(table["kind"])
    assert table.loc["optimised_D_m4", "reason"] == ""
    assert len(np.unique(found.plans["optimised_D_m4"].wrench, axis=0)) == 1
    assert "40 visits cost 80 or more" in table.loc["optimised_D_m40", "reason"]


@pytest.mark.cell("`run`", "parameters")
def test_the_command(folder: Path) -> None:
    """`edtk run` of a geometry study ends with code 0; one that it cannot answer is refused."""
    out = folder / "out"
    words = ["run", str(folder / "study.toml"), "--out", str(out), "--workers", "1"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    assert "wrote" in result.stderr
    costs = {"load_change": 1, "budget": 20}  # each pose would have a load of its own
    free = STUDY.replace(load={"F_max_N": 100}, costs=costs)
    free.to_toml(folder / "free.toml")
    refused = CliRunner().invoke(main, ["run", str(folder / "free.toml"), "--out", str(out / "x")])
    assert refused.exit_code == 2
    assert "no set of loads whose changes a budget could count" in refused.stderr


def test_a_run_as_json(found: StudyRun) -> None:
    """The table, the plans and the relaxations are plain numbers."""
    data = json.loads(json.dumps(found.to_dict()))
    assert {row["plan"] for row in data["table"]} >= {"optimised_D_m4", "published_m4"}
    assert set(data["relaxations"]) == {"D", "rho0"}
