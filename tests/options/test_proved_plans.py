"""`plan --prove-bound`: the efficiency beside all plans in any poses, with its certificate."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from loaded_arm import STUDY as ARM
from short_search import short_search
from three_joints import THREE

import edtk
from edtk.cli import main
from edtk.design.bound import BoundKind
from edtk.study.study import Study
from edtk.system.errors import Note, UserError


@pytest.mark.cell("`plan --prove-bound`", "springs")
def test_a_plan_beside_all_poses_is_proved_and_verified(tmp_path: Path) -> None:
    """The bound is near the searched one and below; its certificate holds for this study."""
    study = Study(**THREE)
    path = tmp_path / "certificate.json"
    with short_search():
        searched = edtk.plan(study, 4, "D", seed=1, workers=1)
        found = edtk.plan(study, 4, "D", seed=1, workers=1, prove_bound=1e-3, certificate=path)
    assert found.kind is BoundKind.PROVED
    assert found.cost == searched.cost
    assert 0.998 * searched.efficiency < found.efficiency <= searched.efficiency * (1 + 1e-9)
    assert "proved for all poses" in found.summary()
    told = found.to_dict()
    assert told["bound_proved"]
    assert not told["bound_searched"]
    checked = edtk.verify(path, study)
    assert checked.valid, checked.claims
    assert "in any poses, is proved" in checked.proved
    content = json.loads(path.read_text(encoding="utf-8"))
    covering = content["proof"]["continuum"]["coverings"][0]
    covering["tree"] = covering["tree"][:-1]
    path.write_text(json.dumps(content), encoding="utf-8")
    assert edtk.verify(path).failed == ("bound_proved", "efficiency")


@pytest.mark.cell("`plan --prove-bound`", "parameters")
def test_a_plan_of_geometry_is_proved_beside_all_poses(tmp_path: Path) -> None:
    """The bound is proved; a certificate, whose check does not know it, has the searched one."""
    path = tmp_path / "certificate.json"
    with short_search(), pytest.warns(Note, match="no bound over all poses"):
        found = edtk.plan(ARM, size=6, seed=1, workers=1, prove_bound=1e-3, certificate=path)
    assert found.kind is BoundKind.PROVED
    assert 0.9 < found.efficiency <= 1
    checked = edtk.verify(path)
    assert checked.valid, checked.claims
    assert "searched over all poses, not proved" in checked.proved


def test_a_budget_of_costs_has_no_bound_over_all_poses() -> None:
    """It is refused before the search."""
    study = Study(**THREE)
    with pytest.raises(UserError, match="plans within a budget of costs have no bound over all"):
        edtk.plan(study, criterion="D", cost_budget=5.0, prove_bound=1e-3)


def test_the_command_tells_of_the_proof(tmp_path: Path) -> None:
    """`edtk plan --prove-bound --json` says that the bound is proved."""
    path = tmp_path / "study.toml"
    lines = [f"{key} = {value}" for key, value in _flat(THREE).items()]
    path.write_text("\n".join(lines), encoding="utf-8")
    arguments = ["plan", str(path), "--size", "3", "--criterion", "D", "--workers", "1", "--json"]
    with short_search():
        result = CliRunner().invoke(main, [*arguments, "--prove-bound"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["bound_proved"] is True


def _flat(tables: dict[str, object]) -> dict[str, str]:
    """Keys of TOML with dots, and values as JSON, but for tables in lists."""
    found: dict[str, str] = {}
    for key, value in tables.items():
        if isinstance(value, dict):
            found |= {f"{key}.{name}": one for name, one in _flat(value).items()}
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            inner = (", ".join(f"{k} = {v}" for k, v in _flat(one).items()) for one in value)
            found[key] = "[" + ", ".join(f"{{ {one} }}" for one in inner) + "]"
        else:
            found[key] = json.dumps(value)
    return found
