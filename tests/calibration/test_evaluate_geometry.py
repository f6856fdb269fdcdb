"""The worth of visits: rank, criteria and rho0 are those of the stacked rows, open ways named."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from loaded_arm import LOAD, STUDY

import edtk
from edtk.cli import main
from edtk.verbs.evaluate import evaluate

Q = np.deg2rad([[-80, -60], [10, 50], [60, -40], [-30, 90], [100, -100]])


def visits(loaded: list[bool]) -> edtk.Plan:
    """The first of some poses, each twice, with the load or without it."""
    wrench = np.array(LOAD, dtype=float) * np.array(loaded)[:, None]
    return edtk.Plan(Q[: len(loaded)], wrench, np.full(len(loaded), 2))


def test_covariance_criteria_and_rho0() -> None:
    """All follow from the weighted rows."""
    plan = visits([True, True, False, True, False])
    found = evaluate(STUDY, plan)
    question = found.question
    A = question.rows(plan.q, plan.wrench).reshape(-1, question.model.p) / 0.1
    cov = np.linalg.inv(2 * A.T @ A)
    assert found.rank == question.model.p == 6
    assert found.open == ()
    np.testing.assert_allclose(found.covariance, cov, rtol=1e-7)
    assert found.criteria["A"] == pytest.approx(np.trace(cov))
    assert found.criteria["O3"] == pytest.approx(np.sqrt(2) * np.linalg.svd(A)[1][-1])
    rows = question.rows(np.deg2rad([[10, -60]]), np.array([[0, 0, -50, 0, 0, 0]]))[0]
    rho0 = np.sqrt(np.trace(rows @ cov @ rows.T))
    assert 1e3 * found.criteria["rho0"] == pytest.approx(rho0)
    assert found.to_dict()["rho0_mm"] == pytest.approx(rho0)
    assert found.to_dict()["poses"][0]["unloaded"] == 2


def test_what_a_plan_leaves_open_is_said() -> None:
    """Without a load springs are open, in words; what they harm in the task has no number."""
    found = evaluate(STUDY, visits([False] * 5))
    assert found.rank == 4
    assert len(found.open) == 2
    assert found.rho0 is None
    assert found.criteria == {}
    text = found.summary()
    assert "4 parameters can be told apart of 6 that better poses would tell" in text
    assert "open: the compliance of joint q1 moves no marker in these poses" in text
    assert "no rho0: what is open moves the markers in the test pose" in text
    unloaded = STUDY.to_dict()["test_pose"] | {"load": {"F_N": [0, 0, 0]}}
    harmless = evaluate(STUDY.replace(test_pose=unloaded), visits([False] * 5))
    assert harmless.rho0 is not None


def test_the_rest_is_nuisance() -> None:
    """Criteria of springs, or of the tool, are those of their part of the whole covariance."""
    plan = visits([True, True, False, True, False])
    whole = evaluate(STUDY, plan)
    names = [one.name for one in whole.parameters]
    for groups, expected in (
        (["compliance"], ["k_q1", "k_q2"]),
        (["tool", "k_q2"], ["tool.marker.x", "tool.marker.y", "tool.marker.z", "k_q2"]),
        (["zeros"], ["q1.ry"]),
    ):
        found = evaluate(STUDY.replace(interest={"parameters": groups}), plan)
        part = [names.index(name) for name in expected]
        variance = np.trace(whole.covariance[np.ix_(part, part)])
        assert found.criteria["A"] == pytest.approx(variance, rel=1e-6)
        assert found.criteria["rho0"] == whole.criteria["rho0"]
        assert f"are about {' and '.join(groups)}; the rest is unknown too" in found.summary()


@pytest.mark.parametrize(
    ("interest", "message"),
    [
        ({"parameters": ["q9"]}, "no parameter 'q9' is asked for; expected"),
        ({"joints": ["q1"]}, "names what is of interest in"),
        ({"parameters": ["base"]}, "no parameter 'base'"),
    ],
)
def test_interest_that_is_none(interest: dict[str, list[str]], message: str) -> None:
    """One line names the key and what is there to choose from."""
    with pytest.raises(edtk.UserError, match=message):
        STUDY.replace(interest=interest)
    pose = STUDY.to_dict()["test_pose"] | {"tool": {"position_mm": [500, 0, 0]}}
    plain = STUDY.replace(parameters=None, joints={"unknown": ["q1", "q2"]}, test_pose=pose)
    with pytest.raises(edtk.UserError, match="is for studies with"):
        plain.replace(interest={"parameters": ["k_q1"]})


def test_what_cannot_be_told_is_of_no_interest() -> None:
    """A parameter that the minimal set leaves out is named, with those that it has."""
    study = STUDY.replace(interest={"parameters": ["q2.ry"]})
    with pytest.raises(edtk.UserError, match=r"'q2.ry' cannot be told from other parameters"):
        evaluate(study, visits([True] * 5))


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`edtk evaluate` reads a plan without wrenches as one of unloaded visits."""
    monkeypatch.chdir(tmp_path)
    STUDY.to_toml("study.toml")
    Path("plan.csv").write_text("q1_deg,q2_deg\n10,20\n30,-40\n-50,60\n")
    result = CliRunner().invoke(main, ["evaluate", "study.toml", "plan.csv", "--json"])
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert (found["rank"], found["possible_rank"], found["experiments"]) == (4, 6, 3)
    assert found["rho0_mm"] is None


def test_it_is_drawn_and_tabled_as_that_of_springs() -> None:
    """A bar and a row for each parameter, with its unit; model errors are said to count."""
    plan = visits([True, True, False, True, False])
    found = evaluate(STUDY, plan)
    axes = found.plot()
    assert len(axes.patches) == found.rank
    labels = [label.get_text() for label in axes.get_xticklabels()]
    assert labels == [f"{one.name}\n[{one.unit}]" for one in found.parameters]
    assert all(f"<td>{name}</td>" in found._repr_html_() for name in found.names)
    assert "error by the noise alone: " in found.summary()
    erring = evaluate(STUDY.replace(noise={"discrepancy_mm": 0.1}), plan)
    assert "error by noise and model errors of the visits: " in erring.summary()
