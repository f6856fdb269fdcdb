"""A robot with a joint that follows another one, all the way from a study to its verification."""

import json

import numpy as np
import pytest
from arm import KEYS, ROBOT

import edtk
from edtk.study.study import Study
from edtk.system.errors import Note, UserError

# The fork of the wrist follows the shoulder backwards: a parallelogram keeps it level.
FORK = {
    "name": "fork",
    "origin_m": [0.6, 0, 0],
    "axis": [0, 1, 0],
    "mimic": {"joint": "q1", "factor": -1.0, "offset_deg": 10},
}
JOINTS = [ROBOT["joints"][0], FORK, ROBOT["joints"][1]]


def tied(**keys):
    """The plane arm with the fork between its joints, and a test pose."""
    pose = {"q_deg": [-40, 50], "tool": KEYS["tool"], "load": {"F_N": [50, 0, -80]}}
    return Study(**(KEYS | {"robot": ROBOT | {"joints": JOINTS}, "test_pose": pose} | keys))


def test_what_follows_is_no_column_and_no_parameter():
    """Plans, sheets and parameters know the free joints only."""
    study = tied()
    assert study.robot.body_names == ("q1", "fork", "q2")
    assert study.model.parameters == ("k1", "k2")
    with pytest.raises(UserError, match="joint 'fork' follows 'q1' and has no spring of its own"):
        tied(joints={"unknown": ["fork"]})
    assert tied(marker=[{"joint": "fork", "position_mm": [0, 0, 50]}]).model.row_count == 3


@pytest.mark.parametrize("marked", [False, True])
def test_a_plan_is_verified_by_the_second_implementation(tmp_path, marked):
    """The certificate carries the tie, and both implementations agree on value and bound."""
    markers = [{"position_mm": [0, 30, 0]}, {"joint": "fork", "position_mm": [0, 0, 50]}]
    study = tied(marker=markers) if marked else tied()
    path = tmp_path / "certificate.json"
    plan = edtk.relax(study, certificate=path)
    assert edtk.verify(path).valid
    frame = plan.to_frame()
    assert [name for name in frame.columns if name.endswith("_deg")] == ["q1_deg", "q2_deg"]
    content = json.loads(path.read_text())
    content["setting"]["robot"]["joints"][1]["follows"]["factor"] = -0.9
    path.write_text(json.dumps(content))
    assert not edtk.verify(path).valid


@pytest.mark.parametrize("factor", [-1.0, 2.0])
def test_a_bound_over_every_pose_is_verified_where_a_joint_follows(tmp_path, factor):
    """A joint that turns twice counts twice; the boxes of one arm are not those of another."""
    fork = FORK | {"mimic": FORK["mimic"] | {"factor": factor}}
    study = tied(robot=ROBOT | {"joints": [JOINTS[0], fork, JOINTS[2]]})
    path = tmp_path / "certificate.json"
    edtk.relax(study, "D", prove=1e-2, certificate=path)
    assert "bound_proved" in {one.claim for one in edtk.verify(path).claims}
    assert edtk.verify(path).valid
    content = json.loads(path.read_text())
    content["setting"]["robot"]["joints"][1]["follows"]["factor"] = -factor
    path.write_text(json.dumps(content))
    assert "bound_proved" in edtk.verify(path).failed


def test_boxes_are_not_checked_where_a_joint_follows_by_half_turns(tmp_path):
    """The certificate has no bound over all poses then, and says why."""
    fork = FORK | {"mimic": FORK["mimic"] | {"factor": 0.5}}
    study = tied(robot=ROBOT | {"joints": [JOINTS[0], fork, JOINTS[2]]})
    path = tmp_path / "certificate.json"
    with pytest.warns(Note, match="by another ratio than one of whole turns"):
        edtk.relax(study, "D", prove=1e-2, certificate=path)
    assert "bound_proved" not in {one.claim for one in edtk.verify(path).claims}


def test_compliances_come_back_from_a_filled_sheet(tmp_path):
    """Deflections of the tied arm, as another program would compute them, give k back."""
    study = tied()
    k = np.array([2e-5, 3e-5])
    q = np.deg2rad([[-30, 20], [-60, 70], [-90, 40], [-45, 100]])
    deflection = study.model.deflection(q, [0, 0, -100, 0, 0, 0], k)
    sheet = tmp_path / "sheet.csv"
    rows = np.column_stack([np.rad2deg(q), 1e3 * deflection])
    header = "q1_deg,q2_deg,dx_mm,dy_mm,dz_mm"
    lines = [",".join(f"{number:.12g}" for number in row) for row in rows]
    sheet.write_text("\n".join([header, *lines]) + "\n")
    found = edtk.identify(study, sheet, as_is=True)
    np.testing.assert_allclose(list(found.k.values()), k, rtol=1e-6)
