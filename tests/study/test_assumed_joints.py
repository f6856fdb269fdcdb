"""What is assumed of joints that nobody measures."""

import numpy as np
import pytest

from edtk.measure.expected_error import levers
from edtk.study.study import load_study
from edtk.study.study_geometry import StudyGeometry
from edtk.study.study_model import assumed_joints, likely_compliances
from edtk.system.errors import UserError

STUDY = load_study("studies/kr270_milling.toml")
JOINTS = STUDY.to_dict()["joints"]
K = STUDY.specification.simulation.compliance_rad_per_Nm


def with_joints(**changed):
    """The study with other tables."""
    return STUDY.replace(joints=JOINTS | changed)


def test_levers_put_joints_in_the_order_of_their_capacity():
    """Levers are the largest distances of the tool point from the axes; base joints come first."""
    lever = levers(STUDY.robot)
    assert lever[5] == pytest.approx(0.460, abs=1e-9)
    assert (np.diff(lever) < 1e-3).all()
    # From the axis of joint 1 all lengths beyond it, stretched; random poses come near.
    longest = 0.35 + 1.25 + np.hypot(1.1, 0.055) + np.hypot(0.6115, 0.46)
    assert 0.95 * longest < lever[0] < longest


def test_a_rigid_joint_is_as_its_neighbour():
    """Joint 1 is as joint 2; one between two others lies between them, whatever the median is."""
    (first,) = assumed_joints(STUDY)
    assert (first.name, first.index, first.compliance) == ("q1", 0, 0.0)
    assert first.std == pytest.approx(K["q2"])
    assert "q2" in first.source
    without = [name for name in JOINTS["unknown"] if name != "q3"]
    kept = {name: K[name] for name in without}
    other = with_joints(unknown=without).replace(simulation={"compliance_rad_per_Nm": kept})
    third = assumed_joints(other)[1]
    assert third.name == "q3"
    assert K["q2"] < third.std < K["q5"]
    assert "q2 and q5" in third.source or "q2 and q4" in third.source


def test_what_is_measured_counts_more_than_what_was_assumed():
    """Identified compliances take the place of those of the simulation; zeros say nothing."""
    k = np.array([*K.values()])
    assert assumed_joints(STUDY, 2 * k)[0].std == pytest.approx(2 * K["q2"])
    some = k * [0, 1, 1, 1, 1]
    assert assumed_joints(STUDY, some)[0].std == pytest.approx(K["q3"])


@pytest.mark.parametrize("key", ["simulation", "uncertainty"])
def test_what_the_study_says_counts_first(key):
    """A joint that [simulation] or [uncertainty] names has what stands there."""
    tables = {
        "simulation": {"compliance_rad_per_Nm": K | {"q1": 7e-8}},
        "uncertainty": {"rigid_rad_per_Nm": {"q1": 7e-8}},
    }
    (first,) = assumed_joints(STUDY.replace(**{key: tables[key]}))
    assert first.std == 7e-8
    assert first.source in ("[simulation]", "rigid_rad_per_Nm")


def test_without_any_neighbour_the_load_tells():
    """The largest load on it turns a gear by a milliradian: stiff at the base, soft at the tip."""
    bare = STUDY.replace(simulation=None)
    likely = [one.compliance for one in likely_compliances(bare).values()]
    np.testing.assert_allclose(np.multiply(likely, levers(STUDY.robot)) * 2500, 1e-3)
    light = {"load": {"F_N": [0, 0, -1e-3]}}
    task = bare.to_dict()["test_pose"]
    alone = bare.replace(**light, test_pose=task | light)
    assert {one.compliance for one in likely_compliances(alone).values()} == {1e-4}
    # The task counts as the calibration does: of both loads the larger one.
    by_task = [one.compliance for one in likely_compliances(bare.replace(**light)).values()]
    largest = np.minimum(1e-3 / levers(STUDY.robot) / np.hypot(280, 180), 1e-4)
    np.testing.assert_allclose(by_task, largest)


def test_a_wrist_through_the_tool_point_has_a_lever():
    """No tool is a point: a wrist holds its load at a tenth of the reach, and is no soft joint."""
    flange = STUDY.robot.with_tool(np.eye(4))
    assert levers(flange).min() == pytest.approx(0.1 * flange.reach)
    study = STUDY.replace(tool=None, simulation=None, payload={"mass_kg": 250}, load=None)
    likely = likely_compliances(study)["q6"].compliance
    assert 1e-7 < likely < 3e-6


def test_known_compliances_have_a_standard_deviation(tmp_path):
    """A number is known to 30 %, a table as it says; both survive a file."""
    known = {"q1": {"value": 3e-7, "std": 1e-7}}
    study = with_joints(known_rad_per_Nm=known)
    (first,) = assumed_joints(study)
    assert (first.compliance, first.std, first.rigid) == (3e-7, 1e-7, False)
    study.replace(published=None).to_toml(tmp_path / "study.toml")
    assert assumed_joints(load_study(tmp_path / "study.toml"))[0].std == 1e-7
    for given in (3e-7, {"value": 3e-7}):
        (first,) = assumed_joints(with_joints(known_rad_per_Nm={"q1": given}))
        assert first.std == pytest.approx(0.3 * 3e-7)
    assert "q1 3e-07 +- 1e-07 rad/(N m)" in study.summary()


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"std": 1e-7}, "joints.known_rad_per_Nm.q1.value: this key is required"),
        ({"value": 3e-7, "std": -1}, "joints.known_rad_per_Nm.q1.std: expected at least 0"),
        ({"value": 3e-7, "sd": 1}, "joints.known_rad_per_Nm.q1.sd: unknown key"),
    ],
)
def test_wrong_tables_are_one_line(given, expected):
    """A table of a known compliance is checked key by key."""
    with pytest.raises(UserError) as error:
        with_joints(known_rad_per_Nm={"q1": given})
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


def test_springs_of_geometry_have_the_likely_sizes():
    """A study of geometry says of its springs how large they may be, by [simulation] or by load."""
    keys = {
        "joints": {"unknown": ["q2", "q6"]},
        "parameters": {"geometry": ["zeros"]},
        "optimise": ["D"],
        "criteria": ["D"],
        "test_pose": None,
        "published": None,
        "workspace": None,
    }
    told = STUDY.replace(**keys, simulation={"compliance_rad_per_Nm": {"q2": 1e-7, "q6": 1e-4}})
    spread = [one.spread for one in StudyGeometry.of(told).model.parameters]
    assert spread[-2:] == pytest.approx([1.0, 1000.0])
    assert set(spread[:-2]) == {10.0}
    by_load = StudyGeometry.of(STUDY.replace(**keys, simulation=None)).model.parameters
    lever = levers(STUDY.robot)
    assert by_load[-1].likely == pytest.approx(1e-3 / (2500 * lever[5]))
