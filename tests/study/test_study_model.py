"""What a study measures and what loads it: markers, distances, payloads, load points, links."""

import json

import numpy as np
import pytest
from kr270 import REQUIRED, TEST_POSE

import edtk
from edtk.certificate.certificate import certificate
from edtk.certificate.verify_certificate import verify_certificate
from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import robot_to_dict
from edtk.robots.weights import GRAVITY
from edtk.study.study import Study
from edtk.system.errors import UserError

KEYS = REQUIRED | {"candidates": 200}
MARKERS = [
    {"position_mm": [0, 100, 50]},
    {"name": "side", "position_mm": [50, -100, 50], "rows": "pose"},
    {"name": "elbow", "joint": "q3", "position_mm": [500, 0, 100]},
]
WIRE = {"anchor_mm": [3000, 1000, 0], "marker": "elbow", "sigma_mm": 0.01}
PAYLOAD = {"mass_kg": 250, "center_mm": [300, 0, -200]}


def with_links():
    """The built-in robot with a mass on each joint's body."""
    content = robot_to_dict(load_robot("kuka_kr270"))
    for i, joint in enumerate(content["joints"]):
        joint |= {"mass_kg": 300.0 - 40 * i, "center_m": [0.1, 0.02 * i, -0.05]}
    return content


def study(**keys):
    return Study(**(KEYS | keys))


def test_rows_stand_one_after_another():
    """Each instrument has its rows, their noise and a name; distances follow markers."""
    mixed = study(marker=MARKERS, distance=[WIRE], measurement={"sigma_mm": 0.03, "sigma_deg": 1})
    turn = np.deg2rad(1.0)
    expected = [3e-5] * 6 + [turn] * 3 + [3e-5] * 3 + [1e-5]
    np.testing.assert_allclose(mixed.sigma, expected)
    whole = mixed.model.whole_instruments
    assert [one.name for one in whole] == ["marker 1", "side", "elbow", "distance 1"]
    rows = [one.name for one in mixed.model.sensors]
    assert rows[2:8] == ["marker 1 z", "side x", "side y", "side z", "side rx", "side ry"]
    assert mixed.model.row_count == len(expected)


def test_distances_alone():
    """A study may measure distances only; without a place of its own one ends at the tool point."""
    wires = study(distance=[{"anchor_mm": [3000, 0, 0]}, {"anchor_mm": [0, 3000, 0]}])
    assert wires.model.row_count == 2
    plain = study().model.regressor(np.full(6, 0.3), KEYS["load"]["F_N"] + [0, 0, 0])
    point = wires.robot.forward(np.full(6, 0.3))[:3, 3]
    for row, anchor in enumerate(([3, 0, 0], [0, 3, 0])):
        wire = (point - anchor) / np.linalg.norm(point - anchor)
        got = wires.model.regressor(np.full(6, 0.3), KEYS["load"]["F_N"] + [0, 0, 0])[row]
        np.testing.assert_allclose(got, wire @ plain, rtol=1e-12)


def test_a_payload_needs_no_load_and_no_tool():
    """250 kg at the flange are the force of their weight at their centre of mass."""
    keys = {key: value for key, value in KEYS.items() if key not in ("load", "tool")}
    held = Study(**keys, payload=PAYLOAD)
    weight = [0, 0, -250 * GRAVITY]
    by_force = study(tool={"position_mm": PAYLOAD["center_mm"]}, load={"F_N": weight})
    q = np.array([0.1, -1.2, 0.4, 0.5, 0.6, 0.7])
    plan = held.space.plan(q[None], np.ones(1, dtype=int))
    np.testing.assert_allclose(plan.wrench, [[*weight, 0, 0, 0]])
    torque = held.model.torque_of(held.model.frames(q), plan.wrench[0])
    expected = by_force.model.torque_of(by_force.model.frames(q), plan.wrench[0])
    np.testing.assert_allclose(torque, expected, rtol=1e-12)
    np.testing.assert_array_equal(held.robot.tool, np.eye(4))


def test_a_load_and_a_payload_add_up():
    """A force at its own place and a payload load the joints together."""
    load = {"F_N": [100, 200, -300], "at_mm": [0, 0, 150]}
    q = np.array([0.1, -1.2, 0.4, 0.5, 0.6, 0.7])
    wrench = np.array([100, 200, -300, 0, 0, 0])
    torques = [
        one.model.torque_of(one.model.frames(q), W)
        for one, W in (
            (study(load=load, payload=PAYLOAD), wrench),
            (study(load=load), wrench),
            (study(load=None, payload=PAYLOAD), np.array([0, 0, -250 * GRAVITY, 0, 0, 0])),
        )
    ]
    np.testing.assert_allclose(torques[0], torques[1] + torques[2], rtol=1e-12)


def test_differences_do_not_see_the_links():
    """The weight of the links is nothing to a difference, and all of it to absolute positions."""
    same = study(robot=with_links())
    np.testing.assert_array_equal(same.model.regressor(Q, W), study().model.regressor(Q, W))
    nominal = study(
        robot=with_links(),
        measurement={"sigma_mm": 0.03, "reference": "nominal"},
        test_pose=TEST_POSE,
    )
    none = nominal.model.regressor(Q, np.zeros(6))
    assert np.abs(none).max() > 100
    np.testing.assert_allclose(nominal.model.regressor(Q, W), none + same.model.regressor(Q, W))
    assert np.abs(nominal.target - study(test_pose=TEST_POSE).target).max() > 10


Q = np.array([0.1, -1.2, 0.4, 0.5, 0.6, 0.7])
W = np.array([0, 0, -2500.0, 0, 0, 0])


def test_slope_of_experiments(derivative):
    """Derivatives by joints and loads are those of differences, with all that a study can have."""
    space = study(
        robot=with_links(),
        payload=PAYLOAD,
        load={"F_max_N": 2000, "at_mm": [10, 20, 30]},
        marker=MARKERS,
        distance=[WIRE],
        measurement={"sigma_mm": 0.03, "sigma_deg": 1, "reference": "nominal"},
    ).space
    x = np.r_[Q, 0.7, 0.4, -0.9]
    B = np.random.default_rng(0).normal(size=(space.model.row_count, space.model.p))
    numeric = derivative(lambda y: (B * space.at(y).regressor).sum(), x)
    np.testing.assert_allclose(space.at(x).slope(B), numeric, atol=1e-8 * np.abs(numeric).max())


@pytest.mark.parametrize(
    ("keys", "key", "message"),
    [
        ({"load": None}, "load", "this key is required: Loads that"),
        ({"tool": None}, "tool", "this key is required: Calibration tool"),
        ({"marker": [MARKERS[2], MARKERS[2]]}, "marker.1.name", "'elbow' is named twice"),
        (
            {"marker": [MARKERS[2]], "distance": [WIRE | {"name": "elbow"}]},
            "distance.0.name",
            "'elbow' is named twice",
        ),
        ({"marker": [{"joint": "q9", "position_mm": [0, 0, 0]}]}, "marker.0.joint", "no joint"),
        ({"distance": [WIRE]}, "distance.0.marker", "no marker 'elbow'; this study has none"),
        ({"marker": [{"name": "a"}]}, "marker.0.position_mm", "this key is required"),
        ({"marker": [{"position_mm": [1, 2]}]}, "marker.0.position_mm", "has 2 entries; expected"),
        (
            {"marker": [{"position_mm": [1, 2, 3, 4]}]},
            "marker.0.position_mm",
            "has 4 entries; expected 3 at most",
        ),
        ({"marker": [{"position_mm": 5}]}, "marker.0.position_mm", "expected a list (got 5)"),
        ({"marker": [MARKERS[1]]}, "measurement.sigma_deg", "expected, since rows = 'pose'"),
        (
            {"measurement": {"sigma_mm": 0.03, "reference": "nominal"}},
            "measurement.reference",
            "the robot file gives no masses",
        ),
        ({"payload": {"mass_kg": 0}}, "payload.mass_kg", "expected at least"),
        (
            {"distance": [WIRE | {"position_mm": [0, 0, 1]}], "marker": [MARKERS[2]]},
            "distance.0",
            "expected marker, or a position_mm of its own",
        ),
    ],
)  # fmt: skip
def test_wrong_tables(keys, key, message):
    """A wrong table is one line that names the key."""
    with pytest.raises(UserError) as caught:
        study(**keys)
    assert caught.value.key == key
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_study_of_everything_is_written_and_read(tmp_path):
    """All tables survive the way to a file and back."""
    mixed = study(
        robot=with_links(),
        payload=PAYLOAD,
        load={"F_N": [0, 0, -10], "at_mm": [1, 2, 3]},
        marker=MARKERS,
        distance=[WIRE],
        measurement={"sigma_mm": 0.03, "sigma_deg": 1, "reference": "nominal"},
    )
    mixed.to_toml(tmp_path / "study.toml")
    again = edtk.load_study(tmp_path / "study.toml")
    np.testing.assert_array_equal(again.model.regressor(Q, W), mixed.model.regressor(Q, W))


@pytest.mark.parametrize(
    "keys",
    [
        {"marker": [MARKERS[0], MARKERS[2]], "distance": [WIRE]},
        {"load": None, "payload": PAYLOAD},
        {
            "robot": with_links(),
            "load": {"F_max_N": 2000, "at_mm": [10, 20, 30]},
            "payload": PAYLOAD,
            "measurement": {"sigma_mm": 0.03, "sigma_deg": 1, "reference": "nominal"},
            "marker": [MARKERS[1]],
        },
    ],
    ids=["markers", "payload", "everything"],
)
def test_certificates_know_what_is_measured(keys):
    """A second implementation confirms value and bound, and a mass that was changed is found."""
    asked = study(**keys, test_pose=TEST_POSE)
    found = edtk.relax(asked)
    content = json.loads(json.dumps(certificate(asked, found)))
    assert verify_certificate(content).valid
    physics = content["setting"]["physics"]
    physics["sensors"][0]["offset"][0] += 0.02
    assert not verify_certificate(content).valid
    physics["sensors"][0]["joint"] = 6
    with pytest.raises(ValueError, match=r"sensors\[0\].joint: expected a whole number"):
        verify_certificate(content)
