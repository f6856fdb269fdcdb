"""Error budgets and causes of distances, mixes, payloads beside loads and absolute positions."""

from dataclasses import replace

import numpy as np
import pytest
from kr270 import REQUIRED, TEST_POSE
from scipy.spatial.transform import Rotation

from edtk.calibration.planned import SpringDesigns, planned_measurements
from edtk.design.plan import Plan
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.fit.least_squares import Whitened
from edtk.report.views.calibration import error_budget as text
from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import robot_to_dict
from edtk.study.study import Study

K = np.array([0.3, 0.4, 2.8, 2.9, 2.1]) * 1e-6
UNKNOWN = REQUIRED["joints"]["unknown"]
ASKED = REQUIRED | {
    "joints": {"unknown": UNKNOWN},
    "load": {"F_N": [300, -200, -2500]},
    "test_pose": TEST_POSE,
    "simulation": {"compliance_rad_per_Nm": dict(zip(UNKNOWN, K.tolist(), strict=True))},
    "uncertainty": {
        "load_percent": 1,
        "load_direction_deg": 1,
        "tool_mm": 1,
        "drift_mm": 0.05,
        "repeatability_mm": 0.02,
    },
}
SIDE = {"name": "side", "position_mm": [50, -100, 50]}
WIRES = [
    {"anchor_mm": [3000, 0, 0]},
    {"anchor_mm": [0, 3000, 500], "position_mm": [0, 100, 50]},
    {"anchor_mm": [1000, 500, 4000], "name": "wire"},
]
PAYLOAD = {"mass_kg": 250.0, "center_mm": [300.0, 40.0, -200.0]}
POSES = {"sigma_mm": 0.03, "sigma_deg": 0.002}


def with_links():
    """The robot with a mass on each joint's body."""
    content = robot_to_dict(load_robot("kuka_kr270"))
    for i, joint in enumerate(content["joints"]):
        joint |= {"mass_kg": 300.0 - 40 * i, "center_m": [0.1, 0.02 * i, -0.05]}
    return content


CASES = {
    "distances": {"distance": WIRES},
    "mix": {
        "marker": [SIDE | {"rows": "pose"}, {"joint": "q4", "position_mm": [-300, 50, 100]}],
        "distance": [WIRES[2]],
        "measurement": POSES,
    },
    "payload beside a load": {"payload": PAYLOAD, "marker": [SIDE]},
    "nominal": {"robot": with_links(), "measurement": {"sigma_mm": 0.03, "reference": "nominal"}},
    "nominal mix": {
        "robot": with_links(),
        "payload": PAYLOAD,
        "marker": [SIDE | {"rows": "pose"}],
        "distance": [WIRES[1]],
        "measurement": POSES | {"reference": "nominal"},
    },
}


class Calibrations:
    """Calibrations of a robot whose circumstances are not those of the study.

    Each part takes numbers of standard deviations, and gives the readings.
    """

    def __init__(self, keys):
        self.study = Study(**(ASKED | keys))
        rng = np.random.default_rng(3)
        q = self.study.space.draw(rng.random((10, 6)))[:, :6]
        wrench = np.tile(self.study.space.load.always, (10, 1))
        self.plan = Plan(q, wrench, np.ones(10, dtype=int))
        self.data = planned_measurements(self.study, self.plan)
        self.model = self.study.model
        self.fit = Whitened.of(
            self.data.regressor(self.model), self.data.sigma, self.model.parameters
        )
        self.parts = {
            "load": (self.load, 4),
            "tool": (self.tool, 3),
            "drift": (self.drift, 3),
            "repeatability": (self.repeatability, self.data.sigma.size),
        }

    def shown(self, model, wrench=None):
        """What the instruments show of a robot that bends by the linear model."""
        wrench = self.data.wrench if wrench is None else wrench
        bent = replace(self.data, wrench=wrench).regressor(model) @ K
        if not self.study.is_absolute:
            return bent
        return bent + self.places(model) - self.places(self.model)

    def places(self, model, moved=(0.0, 0.0, 0.0)):
        """Lengths that the instruments show of the rigid robot, whose base may stand elsewhere."""
        base = model.robot.base.copy()
        base[:3, 3] += moved
        frames = replace(model.robot, base=base).frames(self.data.q, model.bodies)
        found = np.zeros_like(self.data.sigma)
        for rows, sensor in self.data.instruments(model):
            if sensor.lengths.any():
                found[rows, : min(3, found.shape[1])] = sensor.place(frames[rows]).T
        return found

    def load(self, u):
        """A load of another size and direction, and a payload of another mass."""
        across = np.linalg.svd(self.data.wrench[:1, :3])[2][1:]
        wrench = self.data.wrench * (1 + 0.01 * u[0])
        wrench[:, :3] = Rotation.from_rotvec(np.deg2rad(1) * u[1:3] @ across).apply(wrench[:, :3])
        model = self.model
        if self.study.specification.payload is not None:
            first, *others = model.weights.masses
            weights = replace(model.weights, masses=(first * (1 + 0.01 * u[3]), *others))
            model = replace(model, weights=weights)
        return self.shown(model, wrench)

    def tool(self, u):
        """The tool point elsewhere."""
        where = self.model.robot.tool.copy()
        where[:3, 3] += where[:3, :3] @ (1e-3 * u)
        return self.shown(replace(self.model, robot=replace(self.model.robot, tool=where)))

    def drift(self, u):
        """The robot's base moves between two readings."""
        return self.shown(self.model) + self.places(self.model, 5e-5 * u) - self.places(self.model)

    def repeatability(self, u):
        """Each length is off by a shift of its own."""
        shift = 2e-5 * u.reshape(self.data.sigma.shape)
        return self.shown(self.model) + np.where(self.data.lengths, shift, 0.0)

    def error(self, part):
        """Root mean square error in the test pose, to the first order."""
        read, count = self.parts[part]
        step = 0.01 * np.eye(count)
        change = np.stack([(read(u) - read(-u)) / 0.02 for u in step])
        return np.linalg.norm(self.fit.solve(change) @ self.study.target.T)


@pytest.mark.parametrize("keys", CASES.values(), ids=CASES)
def test_parts_are_what_other_circumstances_show(keys):
    """Each part is the error that readings in other circumstances make, computed by another way."""
    calibrations = Calibrations(keys)
    budget = SpringDesigns(calibrations.study).error_budget(calibrations.plan)
    for part in calibrations.parts:
        assert budget.parts[part] == pytest.approx(calibrations.error(part), rel=1e-5), part
        assert budget.parts[part] > 1e-7


def test_absolute_positions_see_the_tool_at_once():
    """A wrong tool point is nearly all of the error, and what is left out is said."""
    nominal = Calibrations(CASES["nominal"])
    budget = SpringDesigns(nominal.study).error_budget(nominal.plan)
    assert "not in it: errors of the robot's geometry" in text(budget)
    plain = Calibrations({})
    differences = SpringDesigns(plain.study).error_budget(plain.plan)
    assert differences.tool < 0.1 * budget.tool
    assert "not in it" not in text(differences)


def test_a_long_wire_is_a_coordinate():
    """Three wires along the axes, with anchors far away, have the budget of a position.

    Of an exact model: its errors in any direction are those of a position, or of each wire.
    """
    exact = {"noise": {"model_error_percent": 0}}
    wires = [{"anchor_mm": (-1e6 * axis).tolist()} for axis in np.eye(3)]
    positions = Calibrations(exact)
    by_wire = SpringDesigns(Calibrations(exact | {"distance": wires}).study).error_budget(
        positions.plan
    )
    for name, value in SpringDesigns(positions.study).error_budget(positions.plan).parts.items():
        assert by_wire.parts[name] == pytest.approx(value, rel=0.01), name


@pytest.mark.parametrize(
    ("part", "size", "axis", "cause"),
    [
        ("tool", 0.5, 0, "tool_x"),
        ("tool", 0.5, 1, "tool_y"),
        ("tool", 0.5, 2, "tool_z"),
        ("drift", 2.0, 0, "drift"),
    ],
)
def test_absolute_positions_name_what_shifts_them(part, size, axis, cause):
    """Half a millimetre at the tool point, or a tenth at the base, is named beside the noise."""
    second = {"name": "second", "position_mm": [0, 120, -40]}
    calibrations = Calibrations(CASES["nominal"] | {"marker": [SIDE, second]})
    data = calibrations.data
    noise = data.sigma * np.random.default_rng(0).standard_normal(data.sigma.shape)
    read = calibrations.parts[part][0]
    for share, causes in ((0.0, ()), (1.0, (cause,))):
        measured = replace(data, deflection=read(share * size * np.eye(3)[axis]) + noise)
        fitted = FittedData.of(calibrations.study, measured, HowFitted(linear=True))
        assert tuple(one.cause for one in fitted.causes) == causes


@pytest.mark.parametrize("keys", [CASES["distances"], CASES["mix"]], ids=["distances", "mix"])
def test_single_rows_name_causes(keys):
    """Distances and single coordinates show what turns the load, shifts the tool, or drifts."""
    calibrations = Calibrations(keys)
    data = calibrations.data
    noise = data.sigma * np.random.default_rng(1).standard_normal(data.sigma.shape)
    faults = {
        (): calibrations.drift(np.zeros(3)),
        ("drift",): calibrations.drift(np.array([0, 4.0, 0])),
        ("tool_z",): calibrations.tool(np.array([0, 0, 15.0])),
        ("load_direction",): calibrations.load(np.array([0, 6.0, -4.0, 0])),
    }
    for causes, shown in faults.items():
        measured = replace(data, deflection=shown + noise)
        fitted = FittedData.of(calibrations.study, measured, HowFitted(linear=True))
        assert tuple(one.cause for one in fitted.causes) == causes


def test_a_pose_of_distances_is_off_by_a_joint_value():
    """A joint value that was mistyped explains all distances of its pose."""
    calibrations = Calibrations(CASES["distances"])
    data = calibrations.data
    noise = data.sigma * np.random.default_rng(1).standard_normal(data.sigma.shape)
    q = data.q.copy()
    q[data.pose == 4, 2] += np.deg2rad(10)
    measured = replace(data, q=q, deflection=calibrations.shown(calibrations.model) + noise)
    (found,) = FittedData.of(calibrations.study, measured, HowFitted(linear=True)).causes
    assert (found.cause, found.joint) == ("pose", "q3")
    assert found.size == pytest.approx(-10, abs=1)
    assert found.rows == tuple(np.flatnonzero(data.pose == 4))
