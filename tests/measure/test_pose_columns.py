"""Headers of joints that cannot be taken for those of other columns."""

import numpy as np
import pytest

from edtk.calibration.calibrate import calibrate
from edtk.calibration.template import write_template
from edtk.design.plan import Plan
from edtk.findings.fitted_data import HowFitted
from edtk.fit.measurements import Measurements
from edtk.measure.pose_table import (
    DEFLECTION_COLUMNS,
    RESERVED,
    SHEET_COLUMNS,
    PoseFileError,
    pose_columns,
    with_own_headers,
)
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.verbs.template import template
from tests.support.arm import ROBOT, arm

# Headers that a joint could have; no joint has a unit like mm^2.
LIKE_JOINTS = tuple(column for column in RESERVED if column.endswith(("_mm", "_deg")))
ODD = ("repeats", "k", "joint:x", "joint:joint:x", "=1+1", "-a", "+b", "@c", "x.1", "a,b", 'a"b')


def joint(name, unit="mm"):
    kind = {"mm": "prismatic", "deg": "revolute"}[unit]
    return Joint(name, transform(), np.array([0, 0, 1]), (-9, 9), kind)


def robot(*names):
    return Robot("robot", tuple(joint(name) for name in names))


def test_every_other_column_has_a_header_of_its_own():
    """Joints with the name of another column are marked, and no two joints share a header."""
    words = [column.rpartition("_") for column in LIKE_JOINTS]
    joints = [joint(name, unit) for name, _, unit in words]
    joints += [joint(name) for name in ODD] + [joint("q1", "deg")]
    headers = pose_columns(Robot("robot", tuple(joints)))
    assert len(set(headers)) == len(headers)
    assert not set(headers) & set(RESERVED)
    assert not any(header.startswith(("=", "+", "-", "@")) for header in headers)
    assert headers[: len(words)] == tuple(f"joint:{column}" for column in LIKE_JOINTS)
    assert headers[-1] == "q1_deg"


@pytest.mark.slow
@pytest.mark.parametrize("positions", [False, True])
@pytest.mark.parametrize("markers", [0, 1])
def test_from_the_plan_to_the_result(tmp_path, positions, markers):
    """A robot whose joints have all reserved names is planned, measured and identified."""
    words = [column.rpartition("_") for column in LIKE_JOINTS]
    odd = [(name, "_", "mm") for name in ODD]
    more = [
        {
            "name": name,
            "axis": [0, 1, 0],
            **({"limits_deg": [-9, 9]} if unit == "deg" else {"limits_m": [-1, 1]}),
            "kind": "revolute" if unit == "deg" else "prismatic",
            "origin_m": [0, 0, 0],
        }
        for name, _, unit in words + odd
    ]
    keys = {"robot": ROBOT | {"joints": ROBOT["joints"] + more}, "measurement": {"sigma_mm": 1e-3}}
    study = arm(**keys)
    rng = np.random.default_rng(0)
    q = rng.uniform(*study.robot.limits, size=(4, study.robot.n))
    wrench = np.tile([0.0, 0, -100, 0, 0, 0], (4, 1))
    Plan(q, wrench, np.array([1, 2, 3, 1])).to_csv(tmp_path / "plan.csv", study.robot)
    plan = study.load_plan(tmp_path / "plan.csv")
    np.testing.assert_allclose(plan.q, q, rtol=1e-8)

    sheet = template(study, plan, positions=positions, markers=markers or None)
    write_template(sheet, tmp_path / "sheet.csv")
    k = np.array([1e-5, 2e-5])
    poses = sheet[list(pose_columns(study.robot))].to_numpy()
    assert np.isfinite(poses).all()
    planned = Plan.from_frame(sheet.filter(pose_columns(study.robot)), study.robot, {}, wrench[0])
    moved = 1e3 * study.model.regressor(planned.q, planned.wrench) @ k
    moved += 1e-3 * rng.normal(size=moved.shape)
    if positions:
        sheet[["x0_mm", "y0_mm", "z0_mm"]] = 250.0
        sheet[["x_mm", "y_mm", "z_mm"]] = 250.0 + moved
    else:
        sheet[["dx_mm", "dy_mm", "dz_mm"]] = moved
    if markers:
        sheet[["marker_x_mm", "marker_y_mm", "marker_z_mm"]] = 0.0
    sheet.to_csv(tmp_path / "sheet.csv", index=False)
    found = calibrate(study, tmp_path / "sheet.csv", HowFitted(plan=plan))
    np.testing.assert_allclose(found.fit.k, k, rtol=1e-2)
    assert found.data.sigma.max() == pytest.approx(1e-6)


@pytest.mark.parametrize(
    ("names", "header"),
    [
        (("x", "y", "z"), ("x_mm", "y_mm", "z_mm", *DEFLECTION_COLUMNS)),
        (("x",), ("x_mm", *DEFLECTION_COLUMNS)),
        (("marker_x",), ("marker_x_mm", *DEFLECTION_COLUMNS)),
        (("dx",), ("dx_mm", "x0_mm", "y0_mm", "z0_mm", "x_mm", "y_mm", "z_mm")),
    ],
)
def test_the_plain_form_in_a_sheet(names, header):
    """A plain header is the joint's where the sheet cannot have measured it."""
    chain = robot(*names)
    found = with_own_headers(header, chain, SHEET_COLUMNS)
    assert found == (*(f"joint:{name}_mm" for name in names), *header[len(names) :])


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("sigma", ("sigma_mm", *DEFLECTION_COLUMNS)),
        ("x", ("x0_mm", "y0_mm", "z0_mm", "x_mm", "y_mm", "z_mm")),
        ("marker_x", ("marker_x_mm", "marker_y_mm", "marker_z_mm", *DEFLECTION_COLUMNS)),
    ],
)
def test_a_plain_form_that_may_be_measured(tmp_path, name, header):
    """Such a column is not read as the joint's; the message names the header that is missing."""
    cells = ",".join("1" for _ in header)
    path = tmp_path / "sheet.csv"
    path.write_text(f"{','.join(header)}\n{cells}\n", encoding="utf-8")
    with pytest.raises(PoseFileError, match=rf"'joint:{name}_mm' is missing.*'{name}_mm'.*measure"):
        Measurements.from_csv(path, robot(name), {}, np.ones(6), np.ones(3))


def test_the_plain_form_in_a_plan(tmp_path):
    """A plan has no measurements: every plain header is the joint's; two for one are refused."""
    path = tmp_path / "plan.csv"
    chain = robot("x", "sigma")
    path.write_text("x_mm,sigma_mm\n1,250\n", encoding="utf-8")
    plan = Plan.from_csv(path, chain, {}, np.zeros(6))
    np.testing.assert_array_equal(plan.q, [[1e-3, 0.25]])
    path.write_text("joint:x_mm,sigma_mm,x_mm\n1,250,2\n", encoding="utf-8")
    with pytest.raises(PoseFileError, match="unknown column 'x_mm'; expected joint:x_mm"):
        Plan.from_csv(path, chain, {}, np.zeros(6))
