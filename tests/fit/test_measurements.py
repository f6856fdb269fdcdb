"""Measurement files, the regressor of a marker, and every way in which such a file can be wrong."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edtk.fit.least_squares import unidentified
from edtk.fit.measurements import Measurements
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.pose_table import PoseFileError
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.system.errors import Note

KR270 = load_robot("kuka_kr270").with_tool(transform([0.6115, 0.0, -0.460]))
MODEL = ElastostaticModel(KR270, (1, 2, 3, 4, 5))
WRENCH = np.array([0.0, 0.0, -2500.0, 0.0, 0.0, 0.0])
SIGMA = np.full(3, 0.03e-3)
POSE_SIGMA = np.r_[SIGMA, np.full(3, 1e-4)]
HEAD = "q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
GOOD = "-90,0,10,20,30"
D = "dx_mm,dy_mm,dz_mm"
S = "sigma_x_mm,sigma_y_mm,sigma_z_mm"
C = "cov_xx_mm2,cov_xy_mm2,cov_xz_mm2,cov_yy_mm2,cov_yz_mm2,cov_zz_mm2"


@pytest.fixture
def read(tmp_path):
    def from_text(text, sigma=SIGMA, wrench=WRENCH):
        path = tmp_path / "measured.csv"
        path.write_text(text, encoding="utf-8")
        return Measurements.from_csv(path, KR270, {0: 0.25}, wrench, sigma)

    return from_text


def test_displacements(read):
    """Displacements are in millimetres, in any order; pose, load and noise have defaults."""
    data = read(f"dz_mm,{HEAD},dx_mm,dy_mm\n-3,{GOOD},1,2\n-6,{GOOD},4,5\n")
    np.testing.assert_allclose(
        data.deflection, [[1e-3, 2e-3, -3e-3], [4e-3, 5e-3, -6e-3]], rtol=1e-15
    )
    np.testing.assert_allclose(
        data.q, np.tile(np.r_[0.25, np.deg2rad([-90, 0, 10, 20, 30])], (2, 1)), rtol=1e-15
    )
    np.testing.assert_array_equal(data.wrench, np.tile(WRENCH, (2, 1)))
    np.testing.assert_array_equal(data.sigma, np.tile(SIGMA, (2, 1)))
    assert not data.marker.any()
    assert len(data) == 2


def test_positions_are_subtracted(read):
    """Loaded minus unloaded position is the displacement."""
    data = read(f"{HEAD},x0_mm,y0_mm,z0_mm,x_mm,y_mm,z_mm\n{GOOD},100,200,300,101,202,297\n")
    np.testing.assert_allclose(data.deflection, [[1e-3, 2e-3, -3e-3]], rtol=1e-12)


def test_rotations_noise_and_marker(read):
    """Rotations are in degrees, markers in millimetres; sigma_mm is of the positions alone."""
    columns = "drx_deg,dry_deg,drz_deg,sigma_mm,marker_x_mm,marker_y_mm,marker_z_mm"
    data = read(f"{HEAD},{D},{columns}\n{GOOD},1,2,3,0.1,0.2,0.3,0.05,10,20,30\n", POSE_SIGMA)
    np.testing.assert_allclose(data.deflection[0, 3:], np.deg2rad([0.1, 0.2, 0.3]), rtol=1e-15)
    np.testing.assert_allclose(data.sigma, [[5e-5] * 3 + [1e-4] * 3], rtol=1e-15)
    np.testing.assert_allclose(data.marker, [[0.01, 0.02, 0.03]], rtol=1e-15)


def test_noise_of_each_axis(read):
    """Each axis may have a noise of its own; that of rotations stays the study's."""
    data = read(f"{HEAD},{D},drx_deg,dry_deg,drz_deg,{S}\n{GOOD},1,2,3,0,0,0,1,2,3\n", POSE_SIGMA)
    np.testing.assert_allclose(data.sigma, [[1e-3, 2e-3, 3e-3] + [1e-4] * 3], rtol=1e-15)


def test_covariance_of_each_row(read):
    """A tracker's file states the covariance of each displacement, its upper triangle by rows."""
    text = f"{HEAD},{D},drx_deg,dry_deg,drz_deg,{C}\n{GOOD},1,2,3,0,0,0,4,1,0.5,9,-2,16\n"
    data = read(text, POSE_SIGMA)
    np.testing.assert_allclose(data.sigma, [[2e-3, 3e-3, 4e-3] + [1e-4] * 3], rtol=1e-15)
    expected = np.zeros((6, 6))
    expected[:3, :3] = [[4e-6, 1e-6, 0.5e-6], [1e-6, 9e-6, -2e-6], [0.5e-6, -2e-6, 16e-6]]
    expected[3:, 3:] = 1e-8 * np.eye(3)
    np.testing.assert_allclose(data.noise.blocks[0].covariance[0], expected, rtol=1e-15)


def test_poses_are_counted_in_order_of_appearance(read):
    """Rows of one pose and load have one number; another load makes another pose."""
    data = read(
        f"{HEAD},{D},Fz_N\n{GOOD},1,2,3,-1\n-80,0,1,2,3,1,2,3,-1\n"
        f"{GOOD},4,5,6,-1\n{GOOD},1,2,3,-2\n"
    )
    assert data.pose.tolist() == [0, 1, 0, 2]


def test_positions_far_apart(read):
    """Positions that were exchanged, or of two frames, are refused; micrometres are read."""
    columns = "x0_mm,y0_mm,z0_mm,x_mm,y_mm,z_mm,Fz_N"
    assert len(read(f"{HEAD},{columns}\n{GOOD},1500,-200,900,1500.1,-200.1,898.9,-1\n"))
    with pytest.raises(
        PoseFileError, match=r"row 1, columns x0_mm, .* moved by 2404 mm under load"
    ):
        read(f"{HEAD},{columns}\n{GOOD},-200,1500,900,1500.1,-200.1,898.9,-1\n")
    assert len(read(f"{HEAD},{columns}\n{GOOD},1500000,-200000,900000,1500100,-200100,898900,-1\n"))


def test_a_german_spreadsheet(read):
    """Semicolons between columns and decimal commas are read, and a note says so."""
    head = f"{HEAD},{D}".replace(",", ";")
    good = "-90,5;0,1;10,2;20,3;30,4;1,5;2,5;3,5"
    with pytest.warns(Note, match="semicolons between columns, decimal commas"):
        data = read(f"{head}\n{good}\n")
    np.testing.assert_allclose(data.deflection, [[1.5e-3, 2.5e-3, 3.5e-3]])
    np.testing.assert_allclose(np.rad2deg(data.q[0, 1:]), [-90.5, 0.1, 10.2, 20.3, 30.4])


def random_measurements(rows, marker, seed=0, m=20):
    rng = np.random.default_rng(seed)
    q = rng.uniform(*KR270.limits, size=(m, 6))
    W = rng.normal(size=(m, 6)) * [1e3] * 6
    return Measurements(
        q, W, np.zeros((m, rows)), np.ones((m, rows)), np.tile(marker, (m, 1)) * 1.0
    )


@pytest.mark.parametrize("rows", ["position", "pose"])
def test_marker_moves_with_the_joints(rows):
    """Turning each joint by a small multiple of k_j J_tool,j' W moves the marker by A k."""
    data = random_measurements(3 if rows == "position" else 6, [0.2, -0.3, 0.4])
    model = ElastostaticModel(KR270, (1, 2, 3, 4, 5), rows)
    k = np.array([0.3, 0.4, 2.8, 2.9, 2.1]) * 1e-6
    torque = np.einsum("mij,mi->mj", KR270.jacobian(data.q)[..., 1:], data.wrench)
    tip = transform([0.2, -0.3, 0.4])
    step = 1e-3
    dq = np.zeros_like(data.q)
    dq[:, 1:] = step * k * torque
    plus = KR270.forward(data.q + dq) @ tip
    minus = KR270.forward(data.q - dq) @ tip
    moved = (plus - minus)[:, :3, 3] / (2 * step)
    if rows == "pose":
        turned = Rotation.from_matrix(
            plus[:, :3, :3] @ np.swapaxes(minus[:, :3, :3], 1, 2)
        ).as_rotvec() / (2 * step)
        moved = np.hstack([moved, turned])
    np.testing.assert_allclose(data.regressor(model) @ k, moved, atol=1e-6 * np.abs(moved).max())


def test_marker_at_the_tool_point_is_the_plain_model():
    """Without an offset, and with one of no length beside another, the regressor is the model's."""
    data = random_measurements(3, [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(data.regressor(MODEL), MODEL.regressor(data.q, data.wrench))
    mixed = random_measurements(3, [0.0, 0.0, 0.0])
    mixed.marker[0] = 0.1
    np.testing.assert_allclose(
        mixed.regressor(MODEL)[1:], MODEL.regressor(data.q, data.wrench)[1:], rtol=1e-12
    )


def test_marker_on_the_last_axis_tells_nothing_of_joint_6():
    """Where the axis of joint 6 runs through the marker, not the tool point, k6 is named."""
    data = random_measurements(
        3, [-0.3, 0.0, 0.460]
    )  # axis 6 is the tool frame's x-axis through its wrist
    A = data.regressor(MODEL).reshape(-1, 5)
    assert np.abs(MODEL.regressor(data.q, data.wrench)[..., 4]).max() > 1e-3
    assert unidentified(A.T @ A, MODEL.parameters) == ("k6",)


def test_marker_beside_a_prismatic_joint():
    """A sliding joint moves every marker alike."""
    slide = Joint("slide", transform(), np.array([1.0, 0, 0]), (0, 2), "prismatic")
    model = ElastostaticModel(Robot("slide", (slide,)))
    one = Measurements(
        np.ones((1, 1)), np.ones((1, 6)), np.zeros((1, 3)), np.ones((1, 3)), np.ones((1, 3))
    )
    np.testing.assert_allclose(one.regressor(model), model.regressor([[1.0]], np.ones(6)))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (f"{HEAD},{D}\n{GOOD},1,2,3\n{GOOD},1,NaN,3\n", ["row 2", "dy_mm", "empty or NaN"]),
        (f"{HEAD},{D}\n{GOOD},1,2,3\n{GOOD},1,,3\n", ["row 2", "dy_mm", "empty or NaN"]),
        (f"{HEAD},{D}\n{GOOD},1,two,3\n", ["row 1", "dy_mm", "'two'"]),
        (f"{HEAD},{D}\n{GOOD},1,True,3\n", ["row 1", "dy_mm", "'True'"]),
        (f"{HEAD},{D}\n{GOOD},1,inf,3\n", ["row 1", "dy_mm", "'inf'"]),
        (f"{HEAD},dx_mm,dy_mm\n{GOOD},1,2\n", ["'dz_mm' is missing", "dx_mm, dy_mm, dz_mm"]),
        (f"{HEAD}\n{GOOD}\n", ["'dx_mm' is missing", "x0_mm"]),
        (f"{HEAD},x_mm,y_mm,z_mm\n{GOOD},1,2,3\n", ["'x0_mm' is missing"]),
        (f"{HEAD},{D},x_mm\n{GOOD},1,2,3,4\n", ["'dx_mm' and 'x_mm'", "not both"]),
        (f"{HEAD},dx,dy,dz\n{GOOD},1,2,3\n", ["unknown column 'dx'", "dx_mm"]),
        (f"{HEAD},{D},drx_deg\n{GOOD},1,2,3,4\n", ["drx_deg", "positions only"]),
        (f"{HEAD},q7_deg,{D}\n{GOOD},5,1,2,3\n", ["unknown column 'q7_deg'"]),
        (f"q2_deg,q3_deg,{D}\n1,2,1,2,3\n", ["'q4_deg' is missing"]),
        (f"{HEAD},{D},Fz_N\n{GOOD},1,2,3,5\n{GOOD},1,2,3,0\n", ["row 2", "Fx_N", "wrench is zero"]),
        (f"{HEAD},{D},sigma_mm\n{GOOD},1,2,3,1\n{GOOD},1,2,3,0\n", ["row 2", "sigma_mm: 0 is not"]),
        (f"{HEAD},{D},sigma_mm\n{GOOD},1,2,3,-1\n", ["row 1", "sigma_mm", "-1"]),
        (f"{HEAD},{D},{S}\n{GOOD},1,2,3,1,1,0\n", ["row 1", "sigma_z_mm: 0 is not"]),
        (f"{HEAD},{D},sigma_x_mm\n{GOOD},1,2,3,1\n", ["'sigma_y_mm' is missing"]),
        (f"{HEAD},{D},{S},sigma_mm\n{GOOD},1,2,3,1,1,1,1\n", ["sigma_mm", "not both"]),
        (f"{HEAD},{D},{C}\n{GOOD},1,2,3,1,0,0,1,0,1\n{GOOD},1,2,3,1,2,0,1,0,1\n",
         ["row 2, columns cov_xx_mm2 to cov_zz_mm2", "not positive definite"]),
        (f"{HEAD},{D},{C}\n{GOOD},1,2,3,1,0,0,0,0,1\n", ["row 1, column cov_yy_mm2: 0 is not"]),
        (f"{HEAD},{D},cov_xx_mm2\n{GOOD},1,2,3,1\n", ["'cov_xy_mm2' is missing"]),
        (f"{HEAD},{D},{C},sigma_mm\n{GOOD},1,2,3,1,0,0,1,0,1,1\n", ["cov_xx_mm2", "not both"]),
        (f"{HEAD},{D},marker_x_mm\n{GOOD},1,2,3,4\n", ["'marker_y_mm' is missing", "marker_z_mm"]),
        (f"{HEAD},{D}\n{GOOD},1,2,3,4\n", ["row 1", "9 cells; expected 8"]),
        (f"{HEAD},{D}\n", ["measurement file has no rows"]),
        ("", ["no CSV table"]),
    ],
    ids=[
        "NaN", "empty", "text", "true", "inf", "missing", "no deflection", "only loaded", "both",
        "units missing", "rotation", "joint too many", "joints missing", "no load", "sigma 0",
        "sigma -1", "sigma of z 0", "sigma of y missing", "two sigmas",
        "no covariance", "variance 0", "cov_xy missing", "sigma and covariance",
        "marker", "long row", "no rows", "empty file",
    ],
)  # fmt: skip
def test_wrong_file(read, tmp_path, text, named):
    """A wrong file is refused in a single line that names the file and the row or column."""
    with pytest.raises(PoseFileError) as caught:
        read(text)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'measured.csv'}: ")
    assert "\n" not in message
    for word in named:
        assert word in message


def test_a_load_that_the_study_leaves_open_must_be_in_the_file(read):
    """Without a default load its columns are required, as are rotations where they are measured."""
    with pytest.raises(PoseFileError, match="'Fx_N' is missing"):
        read(f"{HEAD},{D}\n{GOOD},1,2,3\n", wrench=None)
    with pytest.raises(PoseFileError, match="'drx_deg' is missing"):
        read(f"{HEAD},{D}\n{GOOD},1,2,3\n", POSE_SIGMA)
