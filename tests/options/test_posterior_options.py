"""Posteriors of both kinds of study: chains are kept and taken up, and exported as they are."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_sheets import STUDY as GEOMETRY
from geometry_sheets import TEST_POSE, by_pose, run, truth
from readings import PLAN, readings_of
from readings import STUDY as SPRINGS

import edtk
from edtk.design.plan import Plan

pytestmark = pytest.mark.slow

ROUGH = edtk.Sampling(accuracy=0.3, seed=1)
KINDS = ("springs", "geometry", "many")
FEW = GEOMETRY.replace(parameters={"geometry": ["q2.ry", "q3.ry"], "tool": False})


@pytest.fixture(scope="module", params=KINDS)
def question(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path]:
    """Study and sheet: of springs, of some parameters of geometry, and of more than a dozen."""
    folder = tmp_path_factory.mktemp("question")
    study, sheet = folder / "study.toml", folder / "day.csv"
    if request.param == "springs":
        SPRINGS.replace(published=None).to_toml(study)
        table = edtk.template(SPRINGS, PLAN)
        known = [name for name in table if name.endswith(("_deg", "_N", "_Nm"))]
        visits = Plan.from_csv(table[known], SPRINGS.robot, SPRINGS.fixed, PLAN.wrench[0])
        moved = readings_of(visits.q, visits.wrench).deflection
        table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * moved
        table.to_csv(sheet, index=False)
    else:
        (FEW if request.param == "geometry" else GEOMETRY).to_toml(study)
        by_pose(sheet, *truth(6 if request.param == "geometry" else 12))
    return study, sheet


def identified(question: tuple[Path, Path], **sampling: Any) -> dict[str, Any]:
    """The posterior of a calibration, as JSON has it."""
    how = edtk.Sampling(**{"accuracy": 0.3, "seed": 1, **sampling})
    told = edtk.identify(*question, as_is=True, bayes=how).to_dict()["posterior"]
    return dict(json.loads(json.dumps(told)))


@pytest.mark.cell("`--chain`, kept and taken up")
@pytest.mark.parametrize("question", KINDS[:2], indirect=True)
def test_a_chain_is_taken_up(question: tuple[Path, Path], tmp_path: Path) -> None:
    """A chain that was stopped becomes, byte for byte, the one that never was; also its export."""
    paths = [str(path) for path in question]
    words = ["identify", *paths, "--as-is", "--bayes", "--accuracy", "0.3", "--seed", "1", "--json"]
    files = {}
    for name, first in (("whole", ()), ("stopped", ("--most", "300"))):
        chain, export = tmp_path / f"{name}.h5", tmp_path / f"{name}.nc"
        kept = [*words, "--chain", str(chain), "--export", str(export)]
        if first:
            code, _, err = run(*kept, *first)
            assert (code, "did not converge in 300 steps" in err) == (2, True)
            assert not export.exists()
        code, out, _ = run(*kept)
        assert code == 0
        files[name] = (chain.read_bytes(), export.read_bytes(), out)
    assert files["whole"] == files["stopped"]
    told = json.loads(files["whole"][2])["posterior"]
    assert (told["method"], told["trusted"]) == ("emcee", True)
    code, out, err = run(*words, "--seed", "2", "--chain", tmp_path / "whole.h5")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "the chain is of another study, plan, seed or prior" in err


@pytest.mark.cell("`--export` to NetCDF")
@pytest.mark.parametrize("question", ["springs", "many"], indirect=True)
def test_the_export_has_the_numbers_of_the_json(
    question: tuple[Path, Path], tmp_path: Path
) -> None:
    """Means and deviations of the draws, units, and what was measured in rows with names."""
    path = tmp_path / "posterior.nc"
    told = identified(question, export=path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import arviz

        data = arviz.from_netcdf(str(path))
    assert data.posterior.attrs["sampler"] == told["method"]
    assert "created_at" not in data.posterior.attrs
    equal = np.full(data.posterior.sizes["draw"] * data.posterior.sizes["chain"], 1.0)
    weights = data.sample_stats["weight"].values if told["method"] == "Laplace" else equal
    for one in told["parameters"]:
        drawn = data.posterior[one["parameter"]]
        assert drawn.attrs["units"] == one["unit"]
        mean = np.average(drawn.values.ravel(), weights=weights.ravel())
        variance = np.average((drawn.values.ravel() - mean) ** 2, weights=weights.ravel())
        assert mean == pytest.approx(one["mean"], rel=1e-9)
        assert np.sqrt(variance) == pytest.approx(one["std_posterior"], rel=1e-9)
    names = [one["parameter"] for one in told["parameters"]]
    constant = data.constant_data
    assert constant["regressor"].coords[constant["regressor"].dims[2]].values.tolist() == names
    (measured,) = data.observed_data.data_vars
    assert data.observed_data[measured].dims == ("experiment", "row")
    off = data.observed_data[measured].values - (
        constant["by_fit"].values
        if "by_fit" in constant
        else constant["regressor"].values @ [one["reference"] for one in told["parameters"]]
    )
    # The fit leaves errors as large as those that are stated.
    assert 0.2 < np.sqrt(np.nanmean((off / constant["sigma"].values) ** 2)) < 2


@pytest.mark.usefixtures("drawn_pages")
@pytest.mark.parametrize("question", ["many"], indirect=True)
def test_the_report_shows_the_posterior(question: tuple[Path, Path], tmp_path: Path) -> None:
    """A row for each parameter, and of weighted draws two pictures: they have no trace."""
    told = edtk.identify(*question, as_is=True, bayes=ROUGH, out=tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    part = text[text.index("What does the posterior say?") :]
    part = part[: part.index("</section>")]
    for name in told.check.table["parameter"]:
        assert f"<td>{name}</td>" in part
    assert part.count('<svg role="img"') == 2


def test_the_error_in_the_task_by_the_posterior(tmp_path: Path) -> None:
    """It is the posterior's scatter about the estimate; the fit's own is that of its covariance."""
    study = GEOMETRY.replace(test_pose=TEST_POSE)
    found = edtk.identify(study, by_pose(tmp_path / "day.csv", *truth(12)), bayes=ROUGH)
    pose = found.check.pose
    assert 1e3 * pose.rho0_fit == pytest.approx(found.rho0_mm)
    posterior = found.posterior
    T = found.in_tasks.target
    off = T @ (posterior.mean - found.fit.fitted.values)
    expected = np.sqrt(np.trace(T @ posterior.covariance @ T.T) + off @ off)
    assert abs(pose.rho0 - expected) < 4 * pose.rho0_error < 0.1 * expected
    assert pose.displacement is None
    assert "displacement" not in found.to_dict()["posterior"]["test_pose"]
    assert "error after compensation below" in found.summary()
