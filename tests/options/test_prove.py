"""Bounds that are proved for all poses, of both kinds of study."""

from pathlib import Path

import pytest
from click.testing import CliRunner
from kr270 import REQUIRED
from test_prior_options import PLANAR

import edtk
from edtk.cli import main
from edtk.design.enclosure import prove_continuum
from edtk.design.enclosure.polynomial import NotEnclosedError
from edtk.study.study import Study
from edtk.system.errors import UserError

STUDY = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"
PLANE = {"joints": {"unknown": ["q2", "q3"], "fixed_deg": {"q1": 0, "q4": 0, "q5": 0, "q6": 0}}}


@pytest.mark.cell("`relax --prove`", "springs")
def test_a_bound_over_all_poses_of_springs() -> None:
    """Two joints move: the bound is proved within the gap, and the design is as good as ever."""
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


def test_what_cannot_be_enclosed_ends_with_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """The line says why there are no polynomials, with exit code 2."""

    def none(space: object) -> None:
        raise NotEnclosedError("q3 slides, and a joint turns with it: no polynomial")

    monkeypatch.setattr(prove_continuum, "polynomials_of", none)
    result = CliRunner().invoke(main, ["relax", str(STUDY), "--prove", "0.1"])
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1].endswith("a joint turns with it: no polynomial")
    assert result.stdout == ""
