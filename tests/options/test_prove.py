"""Bounds that are proved for all poses, of both kinds of study."""

from pathlib import Path

import pytest
from click.testing import CliRunner
from kr270 import REQUIRED
from test_prior_options import PLANAR

import edtk
from edtk.cli import main
from edtk.study.study import Study
from edtk.system.errors import UserError

PLANE = {"joints": {"unknown": ["q2", "q3"], "fixed_deg": {"q1": 0, "q4": 0, "q5": 0, "q6": 0}}}


@pytest.mark.cell("`relax --prove`", "springs")
def test_a_bound_over_all_poses_of_springs() -> None:
    """Two joints move: no pose of a fine grid is more sensitive than the covering says."""
    study = Study(**REQUIRED | PLANE | {"candidates": 100})
    found = edtk.relax(study, "D", prove=1e-4)
    assert found.continuum_bound.gap <= 1e-4
    assert found.continuum_bound.efficiency(found.cost) <= 1
    exact = edtk.relax(study, "D", continuous=True)
    assert found.cost == pytest.approx(exact.cost, rel=1e-4)


@pytest.mark.cell("`relax --prove`", "parameters")
def test_a_bound_over_all_poses_of_parameters() -> None:
    """The geometry of a planar arm, without and with a load."""
    found = edtk.relax(Study(**PLANAR), "D", prove=0.01)
    assert found.continuum_bound.gap <= 0.01
    assert found.continuum_bound.cost <= found.cost


def test_a_gap_is_a_number_between_zero_and_one() -> None:
    """Anything else is one line."""
    with pytest.raises(UserError, match="expected a relative gap between 0 and 1"):
        edtk.relax(Study(**REQUIRED), prove=1.5)


def test_what_cannot_be_enclosed_ends_with_one_line(tmp_path: Path) -> None:
    """A gear of no whole ratio makes no polynomials; the line says so, with exit code 2."""
    text = Path("studies/kr270_milling.toml").read_text()
    study = tmp_path / "study.toml"
    study.write_text(text.replace('robot = "kuka_kr270"', 'robot = "kuka_kr270"') + COUPLED)
    result = CliRunner().invoke(main, ["relax", str(study), "--prove", "0.1"])
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
