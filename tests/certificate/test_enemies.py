"""Certificates that an enemy has made consistent, so that one check alone can find them out."""

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from edtk.certificate.certificate import certificate
from edtk.certificate.verify_certificate import verify_certificate
from edtk.cli import main
from edtk.study.plan_study import relax_study
from edtk.study.study import load_study

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
STUDY = ROOT / "studies" / "kr270_milling.toml"
Content = dict[str, Any]


def written(criterion: str) -> Content:
    """A certificate of a relaxation over few candidates, as a file holds it."""
    study = load_study(STUDY)
    found = relax_study(study, criterion, candidates=100)
    return json.loads(json.dumps(certificate(study, found)))  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def honest() -> dict[str, Content]:
    """True certificates by criterion."""
    return {name: written(name) for name in ("D", "O2", "O4")}


def consistent(content: Content) -> Content:
    """The same certificate, with all its claims as they are recomputed."""
    for claim in verify_certificate(content).claims:
        if claim.claim in content["claims"]:
            content["claims"][claim.claim] = claim.recomputed
    return content


def failed(content: Content) -> set[str]:
    """Names of the claims that do not hold."""
    return {claim.claim for claim in verify_certificate(content).claims if not claim.holds}


def test_loads_that_nobody_may_apply(honest: dict[str, Content]) -> None:
    """Twice the load gives a better value, which is not that of the stated setting."""
    content = copy.deepcopy(honest["D"])
    for row in content["experiments"]:
        row["wrench"][2] *= 2
    assert failed(consistent(content)) == {"loads"}


def test_a_fixed_joint_that_moves(honest: dict[str, Content]) -> None:
    """A joint that the study fixes must stay where it is in every experiment."""
    content = copy.deepcopy(honest["D"])
    content["experiments"][0]["q"][0] = 0.5
    assert failed(consistent(content)) == {"feasible"}


@pytest.mark.parametrize("claim", ["value", "bound", "gap"])
def test_claims_that_are_left_out(claim: str, honest: dict[str, Content]) -> None:
    """A relaxation has to state its value, its bound and its gap."""
    content = copy.deepcopy(honest["D"])
    del content["claims"][claim]
    assert claim in failed(content)


def test_bounds_say_on_how_many_candidates_they_are_proved(honest: dict[str, Content]) -> None:
    """A bound over one candidate may be true, and is never read as one over many."""
    content = copy.deepcopy(honest["D"])
    content["proof"]["candidates"] = 1
    found = verify_certificate(consistent(content))
    assert [claim.candidates for claim in found.claims if claim.claim == "bound"] == [1]
    assert "proved on 1 candidate:" in found.summary()


@pytest.mark.parametrize("name", ["O2", "O4"])
@pytest.mark.parametrize("size", [0.0, 1e-16, 1e-13, 1e-10])
def test_rounding_proves_nothing(name: str, size: float, honest: dict[str, Content]) -> None:
    """Multipliers whose sensitivities cancel to rounding give no bound above the true optimum."""
    content = copy.deepcopy(honest[name])
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((20, 5, 5))
    Z = np.eye(5) + size * (noise + np.swapaxes(noise, 1, 2))
    content["proof"]["multipliers"] = Z.tolist()
    found = {claim.claim: claim for claim in verify_certificate(content).claims}["bound"]
    assert found.recomputed is not None
    if name == "O2":  # minimised: a bound lies below
        assert found.recomputed <= honest["O2"]["claims"]["bound"] * (1 + 1e-9)
    else:
        assert found.recomputed >= honest["O4"]["claims"]["bound"] * (1 - 1e-9)


@pytest.mark.parametrize("length", [1e-322, 1e-310, 1e-200, 1e250])
@pytest.mark.parametrize("name", ["D", "O2", "O4"])
def test_multipliers_of_any_length_prove_the_same(
    name: str, length: float, honest: dict[str, Content]
) -> None:
    """Multipliers that are almost nothing, or huge, do not profit from the ends of the doubles."""
    content = copy.deepcopy(honest[name])
    Z = np.array(content["proof"]["multipliers"])
    Z = Z / np.abs(Z).max(axis=(1, 2), keepdims=True) * length
    content["proof"]["multipliers"] = Z.tolist()
    bounds = [
        claim.recomputed
        for one in (honest[name], content)
        for claim in verify_certificate(one).claims
        if claim.claim == "bound"
    ]
    if bounds[1] is None:  # what is left of the digits is not even semidefinite
        return
    better = bounds[1] - bounds[0] if name == "O2" else bounds[0] - bounds[1]
    assert better <= 1e-9 * abs(bounds[0])
    if length > 1e-300:
        assert bounds[1] == pytest.approx(bounds[0], rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("", "", 0),
        ('"criterion": "D"', '"criterion": "my plug-in"', 1),
        ('"gap": ', '"gap": NaN, "more": ', 2),
        ('"gap": ', '"gap": 0.5, "gap": ', 2),
        ('"tilt_max_deg"', '"tilt_most_deg"', 2),
        ("{", "[" * 100_000, 2),
    ],
    ids=["true", "plug-in", "NaN", "key twice", "unknown key", "nested"],
)
def test_exit_codes(
    old: str, new: str, code: int, honest: dict[str, Content], tmp_path: Path
) -> None:
    """The command ends with 0, 1 or 2, and after 2 it has printed one line."""
    text = json.dumps(honest["D"]).replace(old, new, 1)
    path = tmp_path / "certificate.json"
    path.write_text(text, encoding="utf-8")
    answer = CliRunner().invoke(main, ["verify", str(path)])
    assert answer.exit_code == code
    assert (answer.stderr.count("\n") == 1) == (code == 2)


def test_a_setting_of_another_study(tmp_path: Path) -> None:
    """With --study, a certificate whose limits were widened is found out, whatever it claims."""
    wide = load_study(STUDY).replace(workspace={"height_min_mm": 100})
    path = tmp_path / "certificate.json"
    content = certificate(wide, relax_study(wide, "D", candidates=100))
    path.write_text(json.dumps(content), encoding="utf-8")
    assert CliRunner().invoke(main, ["verify", str(path)]).exit_code == 0
    answer = CliRunner().invoke(main, ["verify", str(path), "--study", str(STUDY)])
    assert answer.exit_code == 1
    assert "another workspace" in answer.stdout
