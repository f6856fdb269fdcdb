"""The work of a check is bounded before it begins: a small file cannot ask for much."""

import copy
import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import edtk
from edtk.certificate.certificate import certificate
from edtk.study.plan_study import relax_study

Content = dict[str, Any]
KR270 = {
    "robot": "kuka_kr270",
    "tool": {"position_mm": [611.5, 0, -460]},
    "load": {"F_N": [0, 0, -2500]},
    "measurement": {"rows": "position", "sigma_mm": 0.03},
    "joints": {"unknown": ["q2", "q3", "q4", "q5", "q6"], "fixed_deg": {"q1": 0}},
    "test_pose": {
        "q_deg": [0, -56.9, 89.3, 45.1, 76, 57.2],
        "tool": {"position_mm": [986, 0, 0]},
        "load": {"F_N": [0, 280, -180]},
    },
    "candidates": 50,
}
MOST_S = 3.0  # of the processor, for what is refused


def written(study: edtk.Study, criterion: str) -> Content:
    """The certificate of a relaxation, as a file holds it."""
    found = relax_study(study, criterion)
    return json.loads(json.dumps(certificate(study, found)))  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def honest() -> Content:
    """A true certificate of five compliances."""
    return written(edtk.Study(**KR270), "D")


def _many_rows(content: Content) -> None:
    sensor = {"kind": "pose", "offset": [0.1, 0, 0], "joint": None}
    point = {"offset": [0.1, 0, 0], "joint": None}
    physics = {"sensors": [sensor] * 100, "load_point": point, "weights": []}
    content["setting"].update(physics=physics, sigma=[1e-4] * 600)
    content["experiments"] = content["experiments"][:1] * 10_000


def _shared_errors(content: Content) -> None:
    noise = {"tracker": None, "repeatability": [1e-5] * 6, "discrepancy": [1e-5] * 3}
    content["setting"]["noise"] = {**noise, "within": 0.1, "readings": 1}
    content["experiments"] = content["experiments"][:1] * 20_000


def _near(content: Content) -> None:
    task = {**content["setting"]["test_pose"], "within": 0.5, "weight": 1.0}
    content["setting"]["test_pose"] = [task] * 10_000


def _excluded(content: Content) -> None:
    poses = np.random.default_rng(0).uniform(-1, 1, (1000, 6)).tolist()
    content["setting"]["excluded"] = [{"poses": poses, "distance": np.deg2rad(5.0)}]
    content["proof"]["support"] = content["proof"]["support"][:1] * 20_000


def _multipliers(content: Content) -> None:
    content["setting"]["robot"]["joints"] *= 16
    content["setting"].update(unknown=list(range(96)), fixed=[0.0] * 96, test_pose=None)
    content["setting"].update(free=list(range(96)), excluded=[])
    for row in content["experiments"]:
        row["q"] = row["q"] * 16
    content["proof"].update(support=[], multipliers=[np.eye(96).tolist()] * 100)
    content["criterion"] = "G"


HEAVY: dict[str, tuple[Callable[[Content], object], str]] = {
    "rows": (_many_rows, "have more rows than are computed here"),
    "shared errors": (_shared_errors, "20000 experiments take about"),
    "neighbourhoods": (_near, "10000 tasks have more rows"),
    "excluded poses": (_excluded, "the experiments of proof.support take about"),
    "multipliers": (_multipliers, "the multipliers and poses of its proof take about"),
}


@pytest.mark.parametrize("heavy", HEAVY)
def test_what_takes_too_long_is_refused_before(heavy: str, honest: Content) -> None:
    """One line says what is too much, and how long it would take."""
    content = copy.deepcopy(honest)
    change, said = HEAVY[heavy]
    change(content)
    since = time.process_time()
    with pytest.raises(edtk.UserError, match=said) as caught:
        edtk.verify(content)
    assert time.process_time() - since < MOST_S
    assert "\n" not in str(caught.value)


def test_candidates_that_take_too_long(honest: Content) -> None:
    """Their bound is not proved here, which is found without drawing one."""
    content = copy.deepcopy(honest)
    content["proof"]["candidates"] = 28_000_000
    since = time.process_time()
    found = edtk.verify(content)
    assert time.process_time() - since < MOST_S
    reasons = {claim.claim: claim.reason for claim in found.claims}
    assert "2.8e+07 candidates take longer than the 30 s" in reasons["bound"]


def test_numbers_of_a_million_digits(honest: Content, tmp_path: Any) -> None:
    """Reading one would take the square of its digits."""
    path = tmp_path / "c.json"
    path.write_text(json.dumps(honest).replace('"gap": ', f'"gap": 0.{"3" * 10**6}, "x": ', 1))
    since = time.process_time()
    with pytest.raises(edtk.UserError, match="has a number of 500 digits or more"):
        edtk.verify(path)
    assert time.process_time() - since < MOST_S


@pytest.mark.slow
def test_a_criterion_of_few_parameters_beside_many_rows(honest: Content) -> None:
    """Rows of 20,000 experiments are decomposed without a matrix of their square."""
    content = copy.deepcopy(honest)
    content["setting"]["interest"] = [[1], [0], [0], [0], [0]]
    content["experiments"] = content["experiments"][:1] * 20_000
    assert not edtk.verify(content).valid


@pytest.mark.slow
def test_an_arm_of_sixty_joints() -> None:
    """What `relax` certifies is not too large for `verify`."""
    joints = [
        {
            "name": f"q{i}",
            "axis": [[0, 0, 1], [0, 1, 0], [1, 0, 0]][i % 3],
            "origin_m": [0, 0, 0.2],
            "limits_deg": [-20, 20],
        }
        for i in range(60)
    ]
    study = edtk.Study(
        robot={"name": "snake", "source": "made", "joints": joints},
        tool={"position_mm": [100, 0, 0]},
        load={"F_N": [0, 0, -100]},
        measurement={"sigma_mm": 0.1},
        joints={"unknown": ["q1", "q11", "q21"]},
        candidates=100,
    )
    assert edtk.verify(written(study, "D"), study).valid


def test_blocks_of_experiments_have_the_same_rows(
    honest: Content, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many are computed at once."""
    whole = {claim.claim: claim.recomputed for claim in edtk.verify(honest).claims}
    monkeypatch.setattr("edtk.certificate.recompute.setting.BLOCK", 100)
    parts = {claim.claim: claim.recomputed for claim in edtk.verify(honest).claims}
    assert parts == pytest.approx(whole, rel=1e-12)
