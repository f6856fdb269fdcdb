"""The verifier with balls of arb, which needs the extra `proof`: it confirms and refuses."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from three_joints import THREE

import edtk
from edtk.study.study import Study

pytest.importorskip("flint", reason="python-flint is an extra")
SCRIPT = Path(__file__).parents[2] / "studies" / "arb_verifier.py"


@pytest.fixture(scope="module")
def arb() -> ModuleType:
    """The script."""
    spec = importlib.util.spec_from_file_location("arb_verifier", SCRIPT)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A certificate of a small arm."""
    path = tmp_path_factory.mktemp("arb") / "certificate.json"
    edtk.relax(Study(**THREE), "D", prove=0.05, certificate=path)
    return json.loads(path.read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def test_boxes_hold_in_ball_arithmetic(arb: ModuleType, content: dict[str, Any]) -> None:
    """All boxes are closed, in joint and link angles; at a lower limit, or with another sum, some
    are open, and a missing leaf is an error.
    """
    proof = content["proof"]["continuum"]
    Z = arb.arb_mat(proof["multipliers"][0])
    covering = proof["coverings"][0]
    assert len(covering["links"]) == 1
    assert arb.check(content["setting"], covering, Z) == 0
    assert arb.check(content["setting"], covering | {"limit": 0.9 * covering["limit"]}, Z) > 0
    with pytest.raises(AssertionError, match="a leaf is missing"):
        arb.check(content["setting"], covering | {"tree": covering["tree"][:-1]}, Z)
    narrow = [covering["low"][0] + 0.01, *covering["low"][1:]]
    with pytest.raises(AssertionError):
        arb.check(content["setting"], covering | {"low": narrow}, Z)
    other = [[*covering["links"][0][:2], -covering["links"][0][2]]]
    with pytest.raises(AssertionError):
        assert arb.check(content["setting"], covering | {"links": other}, Z) == 0
