"""`edtk relax`: what it prints follows from the study's model, and its bound from the
candidates.
"""

import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from edtk.cli import main
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.relax_poses import capacity
from edtk.design.relaxation.restricted_master import SOLVERS_IN_TURN
from edtk.study.study import load_study

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PATH = ROOT / "studies" / "kr270_milling.toml"
STUDY = load_study(PATH)
SIGMA = 0.03e-3
WRENCH = np.array([0, 0, -2500.0, 0, 0, 0])
COLUMNS = ["q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg"]
ROUNDING = 1e-11  # eps times the condition number of M, here below 1e4, and a factor of five
DEFINITIONS = {
    "A": ("min", lambda s, cov: np.trace(cov)),
    "D": ("max", lambda s, cov: np.prod(s ** (2 / 5))),
    "E": ("max", lambda s, cov: s[-1] ** 2),
    "G": ("min", lambda s, cov: cov.diagonal().max()),
    "O1": ("max", lambda s, cov: np.prod(s ** (1 / 5))),
    "O2": ("min", lambda s, cov: s[0] / s[-1]),
    "O3": ("max", lambda s, cov: s[-1]),
    "O4": ("max", lambda s, cov: s[-1] ** 2 / s[0]),
    "O5": ("min", lambda s, cov: (1 / s).sum()),
    "rho0": ("min", lambda s, cov: np.sqrt(np.trace(STUDY.target @ cov @ STUDY.target.T))),
}


@cache
def relax(*options, study=PATH, name="rho0", n=500):
    """Standard output of the command, which has to succeed; of the same options only once."""
    command = ["relax", study, "--criterion", name, "--candidates", n, *options]
    result = CliRunner().invoke(main, [*map(str, command)], catch_exceptions=False)
    assert result.exit_code == 0, result.stderr
    return result.stdout


def relaxed(*options, **given):
    """The same as JSON."""
    return json.loads(relax("--json", *options, **given))


def support(answer):
    """Poses [rad] and weights."""
    q = np.deg2rad([s["q_deg"] for s in answer["support"]])
    return q, np.array([s["weight"] for s in answer["support"]])


def blocks(q):
    """Regressors A/sigma of poses."""
    return STUDY.model.regressor(q, WRENCH) / SIGMA


def spectrum(answer):
    """Singular values of the weighted stacked A/sigma, and cov."""
    q, weights = support(answer)
    A = (np.sqrt(weights)[:, None, None] * blocks(q)).reshape(-1, 5)
    return np.linalg.svd(A, compute_uv=False), np.linalg.inv(A.T @ A)


def untimed(answer):
    """All but the seconds."""
    return {key: value for key, value in answer.items() if key != "seconds"}


@pytest.mark.parametrize("name", DEFINITIONS)
def test_json(name):
    """Keys, weights, value, side of the bound and a gap of 1e-6: the promise, for every
    criterion.
    """
    answer = relaxed(name=name)
    keys = ["criterion", "value", "bound", "gap", "bound_searched", "bounds", "candidates"]
    keys += ["support", "multipliers", "seed", "sampling", "solver", "iterations"]
    assert list(answer) == [*keys, "seconds", "exact"]
    assert list(answer["seconds"]) == ["candidates", "solve", "continuous"]
    assert all(list(s) == ["q_deg", "wrench", "weight"] for s in answer["support"])
    assert all(s["wrench"] == WRENCH.tolist() for s in answer["support"])
    assert (answer["criterion"], answer["candidates"], answer["bound_searched"]) == (
        name,
        500,
        None,
    )
    assert answer["solver"] in SOLVERS_IN_TURN
    assert answer["iterations"] >= 1
    assert answer["seconds"]["solve"] > 0 == answer["seconds"]["continuous"]
    weights = support(answer)[1]
    assert (weights > 0).all()
    assert (np.diff(weights) <= 0).all()
    assert weights.sum() == pytest.approx(1, abs=1e-14)  # eps times the number of summands
    sense, definition = DEFINITIONS[name]
    value = answer["value"]
    bound = answer["bound"]
    assert value == pytest.approx(definition(*spectrum(answer)), rel=ROUNDING)
    better, worse = (bound, value) if sense == "min" else (value, bound)
    assert better <= worse * (1 + ROUNDING)
    assert answer["gap"] == pytest.approx(1 - better / worse, abs=ROUNDING)
    assert answer["gap"] <= 1e-6


def test_condition_number_of_rounding():
    """The information matrices of these designs have condition numbers below 1e4, as ROUNDING takes
    for granted.
    """
    for name in ("A", "D", "E", "G", "rho0"):
        s = spectrum(relaxed(name=name))[0]
        assert (s[0] / s[-1]) ** 2 < 1e4


@pytest.mark.parametrize("name", ["A", "D", "rho0"])
def test_bound_can_be_rechecked(name):
    """The printed bound lies between the value and what Kiefer and Wolfowitz's theorem proves at
    the printed weights.

    Weights that are 1e-6 from the optimum in value are 1e-3 from it in gradient, and so is the
    theorem's bound.
    """
    answer = relaxed(name=name)
    A = blocks(CandidateSource(STUDY.space, (STUDY.specification.seed, 0)).take(500).x)
    cov = spectrum(answer)[1]
    W = {"A": np.eye(5), "D": np.linalg.inv(cov), "rho0": STUDY.target.T @ STUDY.target}[name]
    dearest = np.einsum("kri,ij,krj->k", A, cov @ W @ cov, A).max() / np.trace(W @ cov)
    degree = {"A": 1.0, "D": 1.0, "rho0": 0.5}[name]
    sign = 1 if DEFINITIONS[name][0] == "min" else -1
    cost = answer["value"] ** sign
    bound = answer["bound"] ** sign
    proved = cost * dearest**-degree
    assert proved <= bound * (1 + ROUNDING) <= cost * (1 + 2 * ROUNDING)
    assert 1 - proved / cost <= 1e-3


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_support_is_of_the_candidates(tmp_path, sampling):
    """Every pose is one of the first N feasible poses that seed and sampling name, and obeys the
    workspace.
    """
    path = tmp_path / "study.toml"
    path.write_text(
        PATH.read_text().replace("seed = 2026", f'seed = 2026\nsampling = "{sampling}"')
    )
    q = support(relaxed("--seed", 5, study=path))[0]
    candidates = CandidateSource(STUDY.space, (5, 0), sampling).take(500).x
    distance = np.abs(q[:, None] - candidates).max(axis=-1)
    assert distance.min(axis=1).max() < 1e-14  # radians to degrees and back
    assert STUDY.space.workspace.contains(candidates).all()


def test_same_seed_same_answer():
    """Twice the same, but for the seconds; the study's seed is the default; another seed has other
    poses.
    """
    first = relaxed()
    other = relaxed("--seed", 3)
    relax.cache_clear()
    again = relaxed()
    named = relaxed("--seed", STUDY.specification.seed)
    assert untimed(first) == untimed(again) == untimed(named)
    assert other["support"] != first["support"]


def test_out_is_the_support(tmp_path):
    """--out writes the poses of the JSON in degrees and their weights, the heaviest first, and
    nothing else.
    """
    out = tmp_path / "new" / "plan.csv"
    answer = relaxed("--out", out)
    table = pd.read_csv(out)
    assert list(table) == [*COLUMNS, "weight"]
    degrees = np.array([s["q_deg"] for s in answer["support"]])
    np.testing.assert_allclose(
        table[COLUMNS].to_numpy(), degrees, rtol=1e-9
    )  # written to ten digits
    np.testing.assert_allclose(table["weight"], support(answer)[1], rtol=1e-9)
    assert list(out.parent.iterdir()) == [out]


def test_json_is_alone_on_standard_output(tmp_path):
    """As a user starts it: one JSON document, no warning, no file; defaults are the study's."""
    study = tmp_path / "study.toml"
    text = PATH.read_text(encoding="utf-8").replace("candidates = 2000", "candidates = 321")
    study.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "edtk", "relax", str(study), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    answer = json.loads(done.stdout)
    assert answer["criterion"] == STUDY.specification.optimise[0]
    assert answer["candidates"] == 321
    assert "edtk:" not in done.stderr
    assert list(tmp_path.iterdir()) == [study]


def test_text_says_what_json_says():
    """Without --json a person reads value and bound in millimetres, and one line per pose."""
    answer = relaxed()
    lines = relax().splitlines()
    assert (
        lines[0] == "rho0, Test-pose accuracy, for a single experiment's worth of weight; minimised"
    )
    assert float(lines[1].split()[-2]) == pytest.approx(
        1e3 * answer["value"], rel=5e-7
    )  # seven digits
    assert "proved on 500 candidates" in lines[2]
    assert f"{1e3 * answer['bound']:.7g} mm" in lines[2]
    head = next(i for i, line in enumerate(lines) if line.startswith("weight"))
    assert lines[head].split() == ["weight", *COLUMNS]
    rows = np.array([line.split() for line in lines[head + 1 :]], dtype=float)
    np.testing.assert_allclose(rows[:, 0], support(answer)[1], atol=5.1e-6)
    np.testing.assert_allclose(rows[:, 1:], [s["q_deg"] for s in answer["support"]], atol=5.1e-4)


def test_more_candidates_than_memory_holds():
    """With 360 MB, 60,000 candidates do not fit; the answer is that of the memory that holds them,
    within the gaps.
    """
    assert capacity(15, 6, 360) < 60_000 < capacity(15, 6, 1000)
    small, large = (relaxed("--memory", m, name="A", n=60_000) for m in (360, 1000))
    assert small["candidates"] == large["candidates"] == 60_000
    for one, other in ((small, large), (large, small)):
        assert one["gap"] <= 1e-6
        assert one["bound"] <= other["value"] * (1 + ROUNDING)


@pytest.mark.usefixtures("sharp_bounds")
@pytest.mark.parametrize("seed", [1, 2])
def test_continuous_finds_the_best_of_all_poses(seed):
    """From any seed rho0 is the paper's problem's 9.645e-3 mm, in feasible poses; published plans
    obey the bound.
    """
    answer = relaxed("--continuous", "--seed", seed)
    value = answer["value"]
    searched = answer["bound_searched"]
    assert value == pytest.approx(9.645e-6, rel=1e-4)
    assert value == pytest.approx(DEFINITIONS["rho0"][1](*spectrum(answer)), rel=ROUNDING)
    assert searched <= answer["bound"] <= value
    assert 1 - searched / value <= 1e-5  # at which the search ends
    assert answer["seconds"]["continuous"] > 0
    q = support(answer)[0]
    assert (
        STUDY.space.workspace.slack(q) >= -1e-12
    ).all()  # metres and radians, after degrees and back
    assert (q[:, 0] == 0).all()
    for plan in STUDY.published_plans().values():
        rho0 = STUDY.criterion("rho0").value(STUDY.space.information(plan))
        assert rho0 * plan.experiments**0.5 >= searched


def test_long_work_says_how_near_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Progress is on standard error, with the gap that is proved so far."""
    monkeypatch.setattr("edtk.commands.shared.SHOWN_AFTER_S", 0.0)
    words = ["relax", str(PATH), "--json", "--candidates", "321"]
    answer = CliRunner().invoke(main, words)
    assert answer.exit_code == 0
    assert json.loads(answer.stdout)["candidates"] == 321
    assert "gap" in answer.stderr


def test_a_budget_ends_the_search_and_says_so():
    """The best weights so far come with their bound, and a line says what ended the search."""
    command = ["relax", str(PATH), "--continuous", "--candidates", "500", "--budget", "1e-3"]
    result = CliRunner().invoke(main, [*command, "--json"], catch_exceptions=False)
    assert result.exit_code == 0
    answer = json.loads(result.stdout)
    assert answer["ended"] == "budget"
    assert 0 <= answer["gap"] < 1
    assert "the budget ended the search" in result.stderr
    assert "ended" not in relaxed()
