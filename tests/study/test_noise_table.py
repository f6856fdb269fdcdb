"""The table [noise] of a study: what it means, and what it refuses."""

import numpy as np
import pytest
from arm import KEYS, arm

from edtk.report.views.study import study_text
from edtk.study.study import Study
from edtk.system.errors import UserError

TRACKER = {"tracker_position_mm": [4000, -3000, 1200], "along": [10, 5], "across": [15, 6]}
WITHOUT_SIGMA = {"rows": "position"}


def noisy(**noise) -> Study:
    """The arm with a tracker, and further keys of [noise]."""
    return arm(measurement=WITHOUT_SIGMA, noise=TRACKER | noise)


def test_units():
    """Micrometres, degrees and millimetres become metres and radians; an MPE its sigma."""
    noise = noisy(
        repeatability_deg=[0.002, 0.004], discrepancy_mm=0.1, discrepancy_within_deg=3
    ).noise
    np.testing.assert_allclose(noise.tracker.position, [4, -3, 1.2])
    np.testing.assert_allclose(noise.tracker.along, np.array([10e-6, 5e-6]) / np.sqrt(3))
    np.testing.assert_allclose(noise.tracker.across, np.array([15e-6, 6e-6]) / np.sqrt(3))
    np.testing.assert_allclose(noise.repeatability, np.deg2rad([0.002, 0.004]))
    np.testing.assert_allclose(noise.discrepancy, 1e-4)
    np.testing.assert_array_equal(noise.white, 0.0)
    assert noise.within == pytest.approx(np.deg2rad(3))
    assert (noise.tracked, noise.readings) == (((0, 0),), 2)
    stated = noisy(given_as="sigma").noise
    np.testing.assert_allclose(stated.tracker.along, [10e-6, 5e-6])


def test_white_noise_adds():
    """With a tracker sigma_mm is the noise of something else, and adds."""
    noise = arm(noise=TRACKER).noise
    np.testing.assert_allclose(noise.white, 1e-4)
    assert arm(noise={}).noise is None
    assert arm(noise={"repeatability_deg": 0}).noise is None
    assert arm(noise={"repeatability_deg": 0.01}).noise.tracker is None


def test_rows():
    """Rotations have sigma_deg, distances the noise of their own instrument; both follow joints."""
    study = arm(
        measurement={"rows": "pose", "sigma_deg": 0.01},
        marker=[{"position_mm": [0, 0, 0]}, {"position_mm": [0, 90, 0], "rows": "position"}],
        distance=[{"anchor_mm": [2000, 0, 0], "sigma_mm": 0.02}],
        noise=TRACKER | {"discrepancy_mm": 0.1},
    )
    assert study.noise.tracked == ((0, 0), (1, 6))
    turn = np.deg2rad(0.01)
    np.testing.assert_allclose(study.noise.white, [0, 0, 0, *[turn] * 3, 0, 0, 0, 2e-5])
    np.testing.assert_allclose(study.noise.discrepancy, [*[1e-4] * 3, 0, 0, 0, *[1e-4] * 3, 1e-4])


def test_model_error():
    """A share of the displacement is one of the springs that [simulation] or [prior] guesses."""
    noise = {"model_error_percent": 4}
    springs = {"compliance_rad_per_Nm": {"q1": 2e-6, "q2": 3e-6}}
    error = arm(noise=noise, simulation=springs).noise.error
    np.testing.assert_allclose(error.k, [2e-6, 3e-6])
    np.testing.assert_allclose([error.turn, error.anywhere], 0.04 / np.sqrt(2))
    medians = {
        name: {"kind": "log-normal", "median_rad_per_Nm": k, "factor": 2.0}
        for name, k in springs["compliance_rad_per_Nm"].items()
    }
    before = arm(noise=noise, prior={"joints": medians}).noise.error
    np.testing.assert_allclose(before.k, error.k)
    assert arm(noise={"model_error_percent": 0}).noise is None
    text = study_text(arm(noise=noise, simulation=springs))
    assert "model error 4 % of the displacement, shared by poses within 60 deg" in text
    with pytest.raises(UserError, match=r"noise\.model_error_percent: is a share of what the spr"):
        arm(noise=noise)


def test_one_reading():
    """Positions that are compared with the nominal robot are one reading each."""
    joints = [joint | {"mass_kg": 5, "center_m": [0.3, 0, 0]} for joint in KEYS["robot"]["joints"]]
    study = arm(
        robot=KEYS["robot"] | {"joints": joints},
        measurement={"reference": "nominal"},
        noise=TRACKER,
    )
    assert study.noise.readings == 1


def test_round_trip():
    """A study with noise is written and read as the same study, with the same information."""
    study = noisy(repeatability_deg=[0.002, 0.004], discrepancy_mm=0.1)
    again = Study(**study.to_dict())
    assert again.to_toml() == study.to_toml()
    x = study.space.draw(np.full((1, 2), 0.3))
    np.testing.assert_array_equal(again.space.at(x).packed, study.space.at(x).packed)


def test_in_words():
    """The text of a study says what the noise is."""
    text = study_text(noisy(repeatability_deg=0.002, discrepancy_mm=0.1))
    assert (
        "tracker at (4000, -3000, 1200) mm with MPE 10 um + 5 um/m along and 15 um + 6 um/m across "
        "its beam, joints repeat within 0.002 deg, discrepancy 0.1 mm, shared by poses within 5 deg"
    ) in text


def test_white_studies_stay_white():
    """Where a path knows white noise alone, it says so in one line."""
    with pytest.raises(UserError, match="noise: white noise alone can be taken into account here"):
        _ = noisy().sigma


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        ({"along": None}, "noise: expected along too, as a tracker is given"),
        ({"tracker_position_mm": None}, "noise: expected tracker_position_mm too"),
        ({"along": [-1, 5]}, "noise.along.0: expected at least 0"),
        ({"across": [1]}, "noise.across"),
        ({"given_as": "MPE"}, "noise.given_as: Input should be 'mpe' or 'sigma'"),
        ({"repeatability_deg": -1}, "noise.repeatability_deg: expected a number from 0 to 10"),
        ({"repeatability_deg": [1, 2, 3]}, "has 3 entries, expected 2, one per joint"),
        ({"repeatability_deg": "a"}, "noise.repeatability_deg: expected a number"),
        ({"repeatability_deg": float("nan")}, "noise.repeatability_deg: expected a number"),
        ({"discrepancy_mm": -0.1}, "noise.discrepancy_mm: expected at least 0"),
        ({"model_error_percent": -1}, "noise.model_error_percent: expected at least 0"),
        ({"model_error_percent": 101}, "noise.model_error_percent: expected at most 100"),
        ({"discrepancy_within_deg": 0}, "noise.discrepancy_within_deg: expected at least"),
        ({"discrepency_mm": 1}, "unknown key"),
        ({"tracker_position_mm": [300, 100, 1000]}, "inside the arm's reach"),
        ({"tracker_position_mm": [1200, 400, 1000]}, "inside the arm's reach"),
        ({"tracker_position_mm": [0, 0, 0]}, "inside the arm's reach"),
        ({"tracker_position_mm": [0.04, -0.03, 0.02]}, "is it given in metres?"),
        ({"along": [0, 0], "across": [0, 0]}, "noise: some combination of the measured rows"),
        (
            {"across": [0, 0], "repeatability_deg": 0.1, "discrepancy_mm": 0.1},
            "noise: some combination of the measured rows",
        ),
    ],
)
def test_refused(noise, message):
    """What cannot be meant is refused in one line that names the key."""
    given = {key: value for key, value in (TRACKER | noise).items() if value is not None}
    with pytest.raises(UserError) as caught:
        arm(measurement=WITHOUT_SIGMA, noise=given)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_sigma_is_needed():
    """Without a tracker measurement.sigma_mm is required, as it always was."""
    for noise in (None, {"repeatability_deg": 0.1}):
        with pytest.raises(UserError, match=r"measurement\.sigma_mm: this key is required"):
            arm(measurement=WITHOUT_SIGMA, noise=noise)
    with pytest.raises(UserError, match=r"distance.0.sigma_mm: expected, since the tracker"):
        arm(measurement=WITHOUT_SIGMA, noise=TRACKER, distance=[{"anchor_mm": [2000, 0, 0]}])


def test_beside_the_arm():
    """A tracker beside an arm that stays in its plane may stand nearer than the arm is long."""
    assert noisy(tracker_position_mm=[500, -700, 1000]).noise is not None


def test_base_far_away():
    """What counts is where the arm is, not how far from the world's origin."""
    from edtk.robots.robot_file import robot_from_dict
    from edtk.robots.rotations import transform

    robot = robot_from_dict(KEYS["robot"])
    away = type(robot)(robot.name, robot.joints, transform([20.0, 0, 0], [0, 0, 0]), robot.tool)
    near_origin = TRACKER | {"tracker_position_mm": [15000, 0, 1000]}
    assert arm(robot=away, measurement=WITHOUT_SIGMA, noise=near_origin).noise is not None
