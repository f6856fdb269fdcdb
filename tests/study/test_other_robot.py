"""Another robot than the paper's: a gantry arm with a prismatic joint, measured in all six rows."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from gantry import ROBOT, STUDY

from edtk.cli import main
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.relax import relax

pytestmark = pytest.mark.slow

EXPRESSION = """
import cvxpy as cp
import numpy as np

from criteria import ConvexCriterion


class Total(ConvexCriterion):
    name, title, formula, sense, degree = "total", "Total variance", "trace(cov)", "min", 1.0

    def expression(self, M, T=None):
        return cp.matrix_frac(np.eye(M.shape[0]) if T is None else T.T, M)
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    (tmp_path / "gantry.toml").write_text(ROBOT)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path / "study.toml"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A directory for PYTHONPATH with a third party's criterion, which is only an expression."""
    info = tmp_path / "site" / "total-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: total\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[edtk.criteria]\ntotal = total:Total\n")
    (info.parent / "total.py").write_text(EXPRESSION)
    return info.parent


def edtk(*args: object) -> str:
    """Standard output of a command, which has to succeed."""
    result = CliRunner().invoke(main, [*map(str, args)], catch_exceptions=False)
    assert result.exit_code == 0, result.stderr
    return result.stdout


@pytest.mark.usefixtures("whole_searches")
def test_the_whole_way_from_study_to_posterior(study: Path) -> None:
    """`run`, `evaluate` and `bayes` serve a robot with a prismatic joint, in millimetres."""
    out = study.parent / "out"
    edtk("run", study, "--out", out)
    plan = out / "plans/optimised_rho0_m3.csv"
    table = pd.read_csv(plan)
    assert list(table)[:4] == ["slide_mm", "shoulder_deg", "elbow_deg", "wrist_deg"]
    assert (table["slide_mm"] == 250).all()
    results = pd.read_csv(out / "results.csv").set_index("plan")
    answer = json.loads(edtk("evaluate", study, plan, "--json"))
    assert answer["parameters"] == ["k_shoulder", "k_elbow", "k_wrist"]
    assert answer["criteria"]["rho0"] == pytest.approx(
        results.loc["optimised_rho0_m3", "rho0"], rel=1e-6
    )
    assert results.loc["optimised_rho0_m3", "rho0"] == pytest.approx(
        results["rho0"].min(), rel=1e-6
    )
    assert {"efficiency_rho0", "efficiency_G"} <= set(results)
    # The best plan for rho0 may leave a compliance to the bound k > 0; that for A does not.
    edtk("plan", study, "--size", 3, "--criterion", "A", "--workers", 1, "--out", out / "A.csv")
    rows = json.loads(edtk("bayes", study, out / "A.csv", "--json", "--accuracy", 0.3))[
        "parameters"
    ]
    assert [row["parameter"] for row in rows] == ["k_shoulder", "k_elbow", "k_wrist"]
    assert all(abs(row["ratio"] - 1) < 4 * row["ratio_error"] for row in rows)


def test_relaxation_has_its_slide_in_millimetres(study: Path) -> None:
    """`relax` prints the prismatic joint in millimetres, and the value of the printed poses."""
    out = study.parent / "plan.csv"
    answer = json.loads(edtk("relax", study, "--json", "--out", out))
    loaded = load_study(study)
    q = np.array([s["q_deg"] for s in answer["support"]]) * [1e-3, *[np.pi / 180] * 3]
    assert q[:, 0] == pytest.approx(0.25)
    weights = [s["weight"] for s in answer["support"]]
    A = loaded.model.regressor(q, [100, -200, -300, 10, 0, 5]) / loaded.sigma[:, None]
    cov = np.linalg.inv(np.einsum("k,kri,krj->ij", weights, A, A))
    rho0 = np.sqrt(np.trace(loaded.target @ cov @ loaded.target.T))
    assert answer["value"] == pytest.approx(rho0, rel=1e-11)  # eps times a condition number of 1e3
    table = pd.read_csv(out)
    assert list(table) == ["slide_mm", "shoulder_deg", "elbow_deg", "wrist_deg", "weight"]
    assert (table["slide_mm"] == 250).all()


def test_same_seed_same_answer_on_the_continuum(study: Path) -> None:
    """The search over all poses gives the same answer twice, and ends at a gap of 1e-5."""
    options = ["relax", study, "--criterion", "G", "--candidates", 200, "--continuous", "--json"]
    first, again = (json.loads(edtk(*options)) for _ in range(2))
    del first["seconds"], again["seconds"]
    assert first == again
    assert first["bound_searched"] <= first["bound"] <= first["value"]
    assert first["value"] - first["bound_searched"] <= 1e-5 * first["value"]


@pytest.mark.parametrize(
    ("continuous", "key", "gap"), [(False, "bound", 1e-6), (True, "bound_searched", 1e-5)]
)
def test_an_expression_is_all_that_a_third_party_writes(
    study: Path,
    site: Path,
    plug_in: Callable[[Path], None],
    continuous: bool,
    key: str,
    gap: float,
) -> None:
    """A criterion that is only the cvxpy expression of A is relaxed and bounded as A itself is."""
    plug_in(site)
    theirs, ours = (
        relax(study, name, 100, continuous=continuous).to_dict() for name in ("total", "A")
    )
    # Values agree up to eps times a condition number of 1e3.
    assert theirs["value"] * (1 - gap) <= theirs[key] <= ours["value"] * (1 + 1e-11)
    assert ours["value"] * (1 - gap) <= ours[key] <= theirs["value"] * (1 + 1e-11)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "fixed_mm = { slide = 250 }",
            "fixed_deg = { slide = 2 }",
            ("joints.fixed_deg.slide", "prismatic", "fixed_mm"),
        ),
        ("slide = 250", "slide = 2500", ("joints.fixed_mm.slide", "outside the joint's limits")),
        ("sigma_deg = 0.01", "", ("measurement.sigma_deg", "rotations")),
    ],
)
def test_units_that_do_not_fit_the_joint_are_refused(
    study: Path, old: str, new: str, words: tuple[str, ...]
) -> None:
    """A prismatic joint is fixed in millimetres, within limits; rotations need their own sigma."""
    study.write_text(STUDY.replace(old, new))
    with pytest.raises(UserError) as caught:
        load_study(study)
    for word in ("study.toml", *words):
        assert word in str(caught.value)
