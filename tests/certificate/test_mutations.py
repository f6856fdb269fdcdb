"""Certificates that an enemy has changed: no traceback, no long wait, and never a false "valid"."""

import copy
import json
import math
import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from finite_algebra import require_finite
from short_search import short_search

from edtk.certificate.certificate import certificate
from edtk.certificate.verify_certificate import Verification
from edtk.robots.robot_file import robot_to_dict
from edtk.study.plan_study import plan_study, relax_study
from edtk.study.study import Study, load_study
from edtk.system.errors import UserError
from edtk.verbs.verify import verify

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PAPER = load_study(ROOT / "studies" / "kr270_milling.toml").replace(candidates=150)
CASES = 100
SEED = 3
Content = dict[str, Any]
Keys = tuple[str | int, ...]

RAIL = {"name": "rail", "kind": "prismatic", "origin_m": [0, 0, 0], "axis": [0, 1, 0]}


def on_a_rail() -> Study:
    """The paper's robot on a rail, without the constraints that depend on where it stands."""
    robot = robot_to_dict(PAPER.robot)
    robot["joints"] = [RAIL | {"limits_m": [-1.0, 2.0]}, *robot["joints"]]
    return PAPER.replace(
        robot=robot,
        test_pose=None,
        published=None,
        optimise=["A"],
        criteria=["A"],
        workspace={"tilt_max_deg": 30},
    )


def two_tasks() -> Study:
    """The paper's robot with a second test pose."""
    pose = PAPER.to_dict()["test_pose"]
    other = pose | {"q_deg": [0, -60, 90, 10, 45, 30], "load": {"F_N": [300, -200, 100]}}
    return PAPER.replace(test_pose=[pose, other], published=None)


STUDIES: dict[str, tuple[Callable[[], Study], str]] = {
    "test pose": (lambda: PAPER, "rho0"),
    "condition number": (lambda: PAPER, "O2"),
    "family": (lambda: PAPER, "O4"),
    "rotations": (
        lambda: PAPER.replace(measurement={"rows": "pose", "sigma_mm": 0.03, "sigma_deg": 0.01}),
        "G",
    ),
    "Sobol": (lambda: PAPER.replace(sampling="sobol"), "A"),
    "bounded load": (
        lambda: PAPER.replace(load={"F_max_N": 2500, "direction": [0, 0, -1]}),
        "D",
    ),
    "free load": (lambda: PAPER.replace(load={"F_max_N": 2500}), "E"),
    "listed load": (
        lambda: PAPER.replace(load={"list_F_N": [[0, 0, -2500], [900, 0, -900]]}),
        "O5",
    ),
    "prismatic joint": (on_a_rail, "A"),
    "worst of two tasks": (two_tasks, "rho_max"),
}


@pytest.fixture(scope="module")
def honest(whole_searches: None) -> dict[str, Content]:
    """One certificate of each sort, which rests on searches as users have them."""
    found = {
        name: certificate(study(), relax_study(study(), criterion, candidates=150))
        for name, (study, criterion) in STUDIES.items()
    }
    searched = relax_study(PAPER, "rho0", candidates=150, continuous=True)
    found["all poses"] = certificate(PAPER, searched)
    kept = PAPER.load_plan(ROOT / "studies" / "plans" / "table_4_3.csv")
    away = PAPER.excluding(kept)
    with short_search():
        found["kept"] = certificate(away, plan_study(away, 5, "A", kept=kept))
    return {name: json.loads(json.dumps(content)) for name, content in found.items()}


def places(node: Any, path: Keys = ()) -> Iterator[Keys]:
    """Paths of all entries of nested tables and lists."""
    if isinstance(node, dict | list):
        entries = node.items() if isinstance(node, dict) else enumerate(node)
        for key, part in entries:
            yield (*path, key)
            yield from places(part, (*path, key))


def changed(content: Content, path: Keys, change: str) -> Content:
    """A copy of a certificate with one change; the same content where the change does not fit."""
    copied = copy.deepcopy(content)
    holder: Any = copied
    for key in path[:-1]:
        holder = holder[key]
    last: Any = path[-1]
    old = holder[last]
    if change in FACTORS:
        if isinstance(old, int | float):
            holder[last] = old * FACTORS[change]
    elif change in VALUES:
        holder[last] = VALUES[change]
    elif change == "text":
        holder[last] = str(old)
    elif change == "removed":
        del holder[last]
    elif change == "twice" and isinstance(holder, list):
        holder.append(old)
    elif change == "shorter" and isinstance(old, list):
        holder[last] = old[:-1]
    elif change == "further" and isinstance(old, dict):
        old["more"] = 1
    return copied


FACTORS = {"slightly more": 1 + 1e-6, "double": 2, "negative": -1, "zero": 0}
VALUES: dict[str, Any] = {
    "nan": math.nan,
    "infinite": math.inf,
    "huge": 1e300,
    "very huge": 10**400,
    "billion": 10**9,
    "one": 1,
    "none": None,
    "true": True,
    "junk": [[[{"a": []}]]],
    "table": {"x": 1},
}
CHANGES = (*FACTORS, *VALUES, "text", "removed", "twice", "shorter", "further")

# Changes after which all claims may still be true, by the path of what is changed.
HARMLESS = (
    r"(title|edtk|study_sha256).*",  # decoration
    r"setting\.robot\.joints\.\d+\.name",
    r"setting\.robot\.joints\.\d+\.(axis|limits|kind).*",  # of a joint that is fixed, see below
    r"setting\.robot\.name",
    r"setting\.fixed\.\d+",  # of a joint that is designed
    r"setting\.load\.T_Nm.*",  # zero, and so it is when left out
    r"setting\.workspace.*",  # a constraint that excludes no candidate and no best pose
    r"setting\.excluded.*",
    r"proof\.(support|searched).*",  # the experiments themselves count, and the second search
    r"claims\.gap",  # 1e-10, which may as well be -1e-10
)


def is_harmless(content: Content, path: Keys, change: str) -> bool:
    """Whether a changed certificate may be valid."""
    place = ".".join(map(str, path))
    if any(re.fullmatch(pattern, place) for pattern in HARMLESS):
        fixed = set(range(len(content["setting"]["fixed"]))) - set(content["setting"]["free"])
        parts = re.fullmatch(HARMLESS[2], place)
        return parts is None or path[3] in fixed
    if place.startswith("setting.test_pose"):
        return bool(content["criterion"] != "rho0")
    if place.startswith("proof.task_weights"):
        return True  # any weights prove a bound; that it is the stated one is checked
    if "bound_searched" in content["claims"] and re.match(r"proof\.(seed|candidates)", place):
        return content["kind"] == "plan"  # its bound rests on the poses that the search has found
    if place.startswith("proof.multipliers"):
        return change in ("twice", "slightly more")
    if place.startswith("proof.seed"):
        return change == "twice"  # numpy ends seeds with zeros, so that another zero is the same
    # Near the best design, the value hardly depends on a pose or a weight.
    return place.startswith("experiments") and change == "slightly more"


def checked(content: Content) -> Verification | str:
    """The result of checking a certificate, or the message that rejects it."""
    try:
        return verify(content)
    except UserError as error:
        return str(error)


def test_no_change_that_matters_stays_valid(honest: dict[str, Content]) -> None:
    """Certificates are rejected, or read and not valid, or the change was harmless."""
    for name, content in honest.items():
        assert verify(content).valid, name
    rng = random.Random(SEED)
    for number in range(CASES):
        name = rng.choice(list(honest))
        content = honest[name]
        part = rng.choice(list(content))  # else most changes would hit one of the many numbers
        path = rng.choice([path for path in places(content) if path[0] == part])
        change = rng.choice(CHANGES)
        enemy = changed(content, path, change)
        if enemy == content:
            continue
        found = checked(enemy)
        if isinstance(found, str):
            assert "\n" not in found
            continue
        json.dumps(found.to_dict(), allow_nan=False)
        assert found.summary().splitlines()[-1].startswith("valid" if found.valid else "NOT")
        assert not found.valid or is_harmless(content, path, change), (number, name, path, change)


@pytest.mark.parametrize(
    ("path", "number"),
    [
        (("setting", "sigma", 0), 5e-324),
        (("setting", "test_pose", "tool", 2, 3), 1e154),
        (("setting", "robot", "joints", 1, "origin", 2, 3), 1e308),
        (("experiments", 0, "wrench", 2), 1e308),
        (("proof", "multipliers", 0, 0, 0), 1e308),
        (("proof", "multipliers", 0, 0, 0), 5e-324),
    ],
)
def test_libraries_meet_no_number_that_is_none(
    honest: dict[str, Content], path: Keys, number: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What overflows fails in words of ours, before any matrix is taken apart."""
    require_finite(monkeypatch)
    content = copy.deepcopy(honest["test pose"])
    holder: Any = content
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = number
    found = checked(content)
    if isinstance(found, str):
        assert "so large or so small" in found
    else:
        assert not found.valid
