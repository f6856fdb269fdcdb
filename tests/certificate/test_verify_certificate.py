"""Certificates: a true one is confirmed by another way of computing it, a false one is not."""

import ast
import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_search import short_search

import criteria
from edtk.certificate.certificate import certificate
from edtk.certificate.recompute import values
from edtk.certificate.verify_certificate import verify_certificate
from edtk.study.plan_study import plan_study, relax_study
from edtk.study.study import Study, load_study

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
STUDY = load_study(ROOT / "studies" / "kr270_milling.toml")
NAMES = criteria.available()
PATHS = sorted((ROOT / "edtk" / "certificate" / "recompute").glob("*.py"))
Content = dict[str, Any]


def studied(text: str, folder: Path) -> Study:
    """The paper's study with another load."""
    given = (ROOT / "studies" / "kr270_milling.toml").read_text(encoding="utf-8")
    path = folder / "study.toml"
    path.write_text(given.replace("F_N = [0, 0, -2500]", text), encoding="utf-8")
    for plan in (ROOT / "studies" / "plans").glob("*.csv"):
        (folder / "plans").mkdir(exist_ok=True)
        (folder / "plans" / plan.name).write_bytes(plan.read_bytes())
    return load_study(path)


@pytest.fixture(scope="module")
def relaxed() -> Callable[[str], Content]:
    """Certificates of relaxations over 400 candidates, by criterion, made when first asked."""
    made: dict[str, Content] = {}

    def of(name: str) -> Content:
        if name not in made:
            found = relax_study(STUDY, name, candidates=400)
            made[name] = json.loads(json.dumps(certificate(STUDY, found)))
        return made[name]

    return of


@pytest.fixture(scope="module")
def searched() -> Content:
    """The certificate of a relaxation over all feasible poses."""
    found = relax_study(STUDY, "rho0", candidates=400, continuous=True)
    return json.loads(json.dumps(certificate(STUDY, found)))


@pytest.fixture(scope="module")
def planned() -> Content:
    """The certificate of an exact plan of three experiments, after a short search."""
    with short_search():
        found = plan_study(STUDY, 3, "rho0")
    return json.loads(json.dumps(certificate(STUDY, found)))


def failed(content: Content) -> set[str]:
    """Names of the claims that do not hold."""
    return {claim.claim for claim in verify_certificate(content).claims if not claim.holds}


@pytest.mark.cell("certificates, and `verify --study`", "springs")
@pytest.mark.parametrize("name", NAMES)
def test_a_true_certificate_is_valid(name: str, relaxed: Callable[[str], Content]) -> None:
    """Value, bound and gap of every criterion come out again, to a relative difference of 1e-8."""
    found = verify_certificate(relaxed(name))
    assert found.valid, found.claims
    claims = {"feasible", "loads", "weights", "value", "bound", "gap"}
    assert claims == {claim.claim for claim in found.claims}
    for claim in found.claims:
        assert claim.recomputed == pytest.approx(claim.stated, rel=1e-8, abs=1e-8)


@pytest.mark.cell("`lever_mm`, rotations of the tool", "springs")
@pytest.mark.cell("`robust_deg`, a neighbourhood of poses", "springs")
@pytest.mark.parametrize(
    "sizes", [{"robust_deg": 30}, {"lever_mm": 400}, {"robust_deg": 70, "lever_mm": 100}]
)
def test_a_neighbourhood_and_rotations_are_recomputed(sizes: dict[str, float]) -> None:
    """Value and bound of rho0 come out again from the size of the neighbourhood and the lever."""
    pose = STUDY.to_dict()["test_pose"]
    study = STUDY.replace(test_pose=pose | sizes)
    content = json.loads(json.dumps(certificate(study, relax_study(study, candidates=400))))
    assert failed(content) == set()
    name = "within" if "robust_deg" in sizes else "lever"
    content["setting"]["test_pose"][name] *= 1.01
    assert "value" in failed(content)
    content["setting"]["test_pose"][name] = -1.0
    with pytest.raises(ValueError, match="expected an angle within half a turn"):
        verify_certificate(content)


def test_searched_bounds_and_exact_plans_are_valid(searched: Content, planned: Content) -> None:
    """The bound over all poses is confirmed at the poses found; another search finds no better."""
    for content in (searched, planned):
        found = verify_certificate(content)
        assert found.valid, found.claims
        assert {"bound_searched", "search"} <= {claim.claim for claim in found.claims}
        assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["valid"] is True


@pytest.mark.cell("listed loads", "springs")
@pytest.mark.parametrize(
    "load",
    [
        "F_max_N = 2500\ndirection = [0, 0, -1]",
        "F_max_N = 2500",
        "list_F_N = [[0, 0, -2500], [900, 0, -900]]",
    ],
)
def test_designed_loads(load: str, tmp_path: Path) -> None:
    """Loads that are designed are drawn anew and confirmed too."""
    study = studied(load, tmp_path)
    assert verify_certificate(certificate(study, relax_study(study, "D", candidates=300))).valid


def test_a_plan_without_time_for_a_search() -> None:
    """A bound on the candidates and the plan's own poses is confirmed as what it is."""
    found = plan_study(STUDY.replace(candidates=100), 3, "rho0", budget=1e-6)
    content = certificate(STUDY, found)
    assert set(content["claims"]) == {"value", "bound"}
    assert verify_certificate(content).valid


def test_kept_experiments_and_excluded_poses(tmp_path: Path) -> None:
    """Prior information and forbidden poses are part of what is recomputed."""
    kept = STUDY.load_plan(ROOT / "studies" / "plans" / "table_4_3.csv")
    study = STUDY.excluding(kept)
    with short_search():
        found = plan_study(study, 5, "A", kept=kept)
    content = certificate(study, found)
    assert verify_certificate(content).valid
    without = content | {"kept": []}
    assert {"value", "bound_searched", "efficiency"} <= failed(without)
    moved = copy.deepcopy(content)
    moved["experiments"][0]["q"] = kept.q[0].tolist()
    assert "feasible" in failed(moved)


TAMPERED: dict[str, tuple[Callable[[Content], object], str]] = {
    "a better value": (lambda c: c["claims"].update(value=0.99 * c["claims"]["value"]), "value"),
    "a higher bound": (lambda c: c["claims"].update(bound=1.001 * c["claims"]["bound"]), "bound"),
    "a lower bound": (lambda c: c["claims"].update(bound=0.999 * c["claims"]["bound"]), "bound"),
    "no gap": (lambda c: c["claims"].update(gap=-1e-3), "gap"),
    "a value that is no number": (lambda c: c["claims"].update(value=float("nan")), "value"),
    "a smaller multiplier": (
        lambda c: c["proof"].update(
            multipliers=(np.array(c["proof"]["multipliers"]) * np.diag([0.5, 1, 1, 1, 1])).tolist()
        ),
        "bound",
    ),
    "an indefinite multiplier": (
        lambda c: c["proof"].update(multipliers=(-np.array(c["proof"]["multipliers"])).tolist()),
        "bound",
    ),
    "a multiplier that is not symmetric": (
        lambda c: c["proof"]["multipliers"][0][0].__setitem__(1, 1e-3),
        "bound",
    ),
    "a multiplier of another shape": (
        lambda c: c["proof"].update(multipliers=c["proof"]["multipliers"][0]),
        "bound",
    ),
    "no multiplier": (lambda c: c["proof"].update(multipliers=[]), "bound"),
    "another seed": (lambda c: c["proof"].update(seed=[99]), "bound"),
    "another pose": (lambda c: c["experiments"][0]["q"].__setitem__(2, 0.3), "value"),
    "a pose beyond a limit": (lambda c: c["experiments"][0]["q"].__setitem__(1, 9.0), "feasible"),
    "more weight": (lambda c: c["experiments"][0].update(weight=0.9), "weights"),
    "a larger load": (lambda c: c["experiments"][0].update(wrench=[0, 0, -9e3, 0, 0, 0]), "value"),
    "less noise": (lambda c: c["setting"].update(sigma=[1e-5] * 3), "value"),
    "another robot": (
        lambda c: c["setting"]["robot"]["joints"][2]["origin"][0].__setitem__(3, 2.0),
        "value",
    ),
    "another criterion": (lambda c: c.update(criterion="A"), "value"),
    "an unknown criterion": (lambda c: c.update(criterion="none such"), "value"),
}


@pytest.mark.parametrize("how", TAMPERED)
def test_a_tampered_certificate_is_rejected(how: str, relaxed: Callable[[str], Content]) -> None:
    """Whatever is changed, the claim that rests on it does not hold any more."""
    change, claim = TAMPERED[how]
    content = copy.deepcopy(relaxed("rho0"))
    change(content)
    assert claim in failed(content)


def test_a_searched_bound_cannot_be_raised(searched: Content) -> None:
    """A higher bound is rejected, also if the poses that the search has found are left out."""
    for part in ("stated", "left out"):
        content = copy.deepcopy(searched)
        content["claims"]["bound_searched"] *= 1.001
        if part == "left out":
            content["proof"]["searched"] = []
        assert "bound_searched" in failed(content)


def test_a_search_that_missed_the_best_poses_is_found_out(
    relaxed: Callable[[str], Content],
) -> None:
    """A bound over few candidates, passed off as one over all poses, fails the second search."""
    content = copy.deepcopy(relaxed("rho0"))
    content["claims"]["bound_searched"] = content["claims"]["bound"]
    assert "search" in failed(content)


def test_exact_plan_tampered(planned: Content) -> None:
    """Repetitions, efficiency and value of an exact plan are checked."""
    for key, claim in (("value", "value"), ("efficiency", "efficiency")):
        content = copy.deepcopy(planned)
        content["claims"][key] *= 1.0001
        assert claim in failed(content)
    content = copy.deepcopy(planned)
    content["experiments"][0]["repeats"] += 1
    assert {"value", "bound_searched"} <= failed(content)
    content["experiments"][0]["repeats"] = 1.5
    assert "repeats" in failed(content)


@pytest.mark.parametrize("name", NAMES)
def test_values_are_those_of_the_registry(name: str) -> None:
    """The second way from rows to a criterion's value agrees with the first on random rows."""
    rng = np.random.default_rng(1)
    target = rng.standard_normal((3, 4))
    for size in (4, 9, 40):
        rows = rng.standard_normal((size, 4)) * 10.0 ** rng.uniform(-2, 2, 4)
        found = values.value(name, rows, [target])
        assert found == pytest.approx(
            float(criteria.create(name, target).value(rows.T @ rows)), rel=1e-7
        )
    assert not np.isfinite(values.cost(name, values.value(name, rows[:2], [target])))


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_the_check_shares_no_code_with_what_it_checks(path: Path) -> None:
    """The second implementation imports numpy, scipy, the standard library and array types."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        for name in names:
            if name.split(".")[0] in ("edtk", "criteria"):
                assert name.startswith("edtk.certificate.recompute") or name == "edtk.system.typing"
