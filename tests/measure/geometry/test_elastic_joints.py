"""Springs about and along any axis, their matrices and laws, against a robot simulated apart."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from chains import coupled_chain, mixed_chain, tied_chain
from numpy.typing import NDArray

from edtk.measure.equilibrium import Loads, loading_in
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.nominal_columns import NominalColumns
from edtk.measure.parameters import all_parameters, springs_asked
from edtk.measure.springs import elastic_joints, sprung
from edtk.robots.frames import BodyPoint, force_and_torque
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.weights import DeadWeights, torque_derivative

Array = NDArray[np.float64]
MOTIONS = {"x": "tx", "y": "ty", "z": "tz", "rx": "rx", "ry": "ry", "rz": "rz"}
SOFT = {"": 1e-4, "square": 1e-6, "cubic": 1e-8, "sign": 2e-5, "gap": 1e-3}
MASS, CENTER = 20.0, (0.1, -0.2, 0.3)
MARKERS = np.array([[0.1, 0.2, 0.3], [-0.2, 0.1, 0.0]])
LOAD_AT = np.array([0.3, -0.1, 0.2])


@dataclass(frozen=True, eq=False)
class Weighted:
    """A force beside the tool, and a weight on the body of the first joint."""

    robot: Robot
    weights: DeadWeights

    def __call__(self, q: Array, wrench: Array) -> Array:
        """Loads of all free joints."""
        frames = self.robot.frames(q, self.weights.bodies)
        F, T = force_and_torque(wrench, frames)
        point = BodyPoint(LOAD_AT)
        own = np.einsum("nc...,nc...->n...", point.linear(frames), F)
        own += np.einsum("nc...,nc...->n...", point.angular(frames), T)
        return frames.folded(own + self.weights.torque(frames)).T

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        """The same, and derivatives by these joints."""
        frames = self.robot.frames(q, self.weights.bodies)
        H = torque_derivative(frames, BodyPoint(LOAD_AT), wrench, (self.weights, 1.0))
        return self(q, wrench), H


def model_of(robot: Robot, springs: list[str]) -> tuple[MeasuredModel, Loads]:
    """A model of springs alone and its loads."""
    asked = springs_asked(robot, springs)
    own = [one.of for one in asked if one.place == "compliance"]
    others = tuple(one for one in asked if one.place == "spring")
    parameters = all_parameters(robot, (), (), own, base=False, tool=False, others=others)
    elastic = elastic_joints(robot, parameters)
    whole = sprung(robot, elastic)
    body = whole.body_names.index(robot.body_names[0])
    weights = DeadWeights((MASS,), (BodyPoint(np.array(CENTER), body),), len(whole.chain))
    model = MeasuredModel(robot, MARKERS, ("A", "B"), parameters, elastic=elastic)
    return model, Weighted(whole, weights)


def simulated(module: ModuleType, robot: Robot, model: MeasuredModel, theta: Array) -> object:
    """The same robot, simulated apart: its matrix of compliances and its laws, by names alone."""
    chain = robot.chain
    names = [*robot.joint_names, *(one.name for one in model.elastic)]
    C = np.zeros((len(names), len(names)))
    laws = []
    for one, size in zip(model.parameters, theta, strict=True):
        joint, *ends = one.name.removeprefix("k_").split(".")
        law = ends.pop() if ends and ends[-1] in SOFT else None
        # An axis that is no joint of its own is that of the joint, whose sign couplings feel.
        own = [f"{joint}.{end}" in names for end in ends]
        at = [
            names.index(f"{joint}.{end}" if is_own else joint)
            for end, is_own in zip(ends, own, strict=True)
        ] or [names.index(joint)]
        axis = chain[robot.body_names.index(joint)].axis.sum()
        size *= np.prod([1.0 if is_own else axis for is_own in own])
        if law:
            laws.append(module.Law(at[0], law, size))
        else:
            C[at[0], at[-1]] = C[at[-1], at[0]] = size
    ties = robot.ties
    return module.SimulatedArm(
        origins=np.array([joint.origin for joint in chain]),
        axes=np.array([joint.axis for joint in chain]),
        compliance=C,
        base=robot.base,
        tool=robot.tool,
        slides=tuple(joint.kind == "prismatic" for joint in chain),
        elastic=tuple(
            (robot.body_names.index(one.before), MOTIONS[one.name.split(".")[1]])
            for one in model.elastic
        ),
        coupling=None if ties is None else ties.matrix,
        offset=None if ties is None else ties.offset,
        masses=(module.Mass(MASS, module.Point(0, np.array(CENTER))),),
        at=module.Point(None, LOAD_AT),
        laws=tuple(laws),
    )


def sizes(model: MeasuredModel) -> Array:
    """Sizes that move an arm of a metre by millimetres."""
    rng = np.random.default_rng(5)
    soft = [SOFT[one.law] * (0.1 if len(one.ends) > 1 else 1.0) for one in model.parameters]
    return np.array(soft) * rng.uniform(0.5, 1.5, model.p)


def visits(robot: Robot) -> tuple[Array, Array]:
    """Poses and wrenches, with a torque in one of them."""
    rng = np.random.default_rng(8)
    q = rng.uniform(-1, 1, (3, robot.n))
    wrench = np.zeros((3, 6))
    wrench[:, :3] = rng.normal(0, 60, (3, 3))
    wrench[1, 3:] = [5.0, -8.0, 3.0]
    return q, wrench


@pytest.fixture(scope="module")
def module() -> ModuleType:
    """The robot simulated apart."""
    path = Path(__file__).parents[3] / "studies" / "simulated_arm.py"
    spec = spec_from_file_location("simulated_arm", path)
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


KINDS = {
    "lateral": (mixed_chain(4), ["q1", "q3.ry", "q3.z", "q4.lateral"]),
    "matrix": (mixed_chain(3), ["q1", "q2.all"]),
    "laws": (mixed_chain(3), ["q1", "q1.square", "q2.cubic", "q3.sign", "q3.rx", "q3.rx.gap"]),
    "tied": (tied_chain(), ["joints", "q2.rx", "q4.ry", "q5.rx.z"]),
    "coupled": (coupled_chain(), ["joints", "q3.rx", "q6.ry"]),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_rows_are_slopes_of_a_simulated_robot_at_rest(
    kind: str, module: ModuleType, derivative: Callable[..., Array]
) -> None:
    """Markers at rest are where the simulated robot has them, and move so with each spring."""
    robot, springs = KINDS[kind]
    model, loads = model_of(robot, springs)
    theta = sizes(model)
    q, wrench = visits(robot)
    points = [module.Point(None, offset) for offset in MARKERS]

    def at_rest(scale: Array) -> Array:
        arm = simulated(module, robot, model, theta * scale)
        return np.asarray(arm.points(q, points, arm.rest(q, wrench)))

    load = loading_in(model.bending(theta), q, wrench, loads, np.zeros(3, dtype=bool))
    seen = model.see(theta, q, load)
    still = model.see(0 * theta, q).points
    assert np.abs(seen.points - still).max() > 1e-3
    np.testing.assert_allclose(seen.points, at_rest(np.ones(model.p)), rtol=0, atol=1e-11)
    expected = derivative(at_rest, np.ones(model.p))
    found = seen.jacobian * theta
    size = np.abs(expected).max(axis=(0, 1, 2))
    assert (size > 0).all()
    np.testing.assert_allclose(found / size, expected / size, rtol=0, atol=1e-7)


def test_heavy_robot_with_all_matrices_rests_as_simulated(module: ModuleType) -> None:
    """A KR 270 with the 21 springs of each frame: equilibria agree to far below 1e-9 m."""
    robot = load_robot("kuka_kr270")
    model, loads = model_of(robot, ["all"])
    assert model.p == 6 * 21
    rng = np.random.default_rng(2)
    size = {
        one.name: 10.0 ** -(7 + sum(end[:1] != "r" for end in one.ends if end) / len(one.ends))
        for one in model.parameters
    }
    theta = np.array(
        [size[one.name] * (0.05 if "." in one.component else 1.0) for one in model.parameters]
    ) * rng.uniform(0.5, 1.5, model.p)
    q = rng.uniform(*robot.limits, (4, robot.n))
    wrench = np.zeros((4, 6))
    wrench[:, :3] = rng.normal(size=(4, 3)) * [1500, 1500, 2500]
    load = loading_in(model.bending(theta), q, wrench, loads, np.zeros(4, dtype=bool), False)
    arm = simulated(module, robot, model, theta)
    points = [module.Point(None, offset) for offset in MARKERS]
    expected = arm.points(q, points, arm.rest(q, wrench))
    np.testing.assert_allclose(model.see(theta, q, load).points, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_columns_about_the_drawing_are_those_of_the_model(kind: str) -> None:
    """What plans count with is the model at springs of size zero."""
    robot, springs = KINDS[kind]
    model, loads = model_of(robot, springs)
    q, wrench = visits(robot)
    torque = loads(q, wrench)
    seen = model.see(np.zeros(model.p), q, torque)
    found = NominalColumns(model).at(q).jacobian(model.springs.amplitudes(torque.T))
    found = np.moveaxis(found, (0, 3), (3, 0))
    size = np.abs(seen.jacobian).max(axis=(0, 1, 2))
    np.testing.assert_allclose(found / size, seen.jacobian / size, rtol=0, atol=1e-12)


def test_spring_about_the_own_axis_is_the_joint() -> None:
    """An axis of the frame that is the joint's own names the joint's compliance, either way on."""
    robot = load_robot("kuka_kr270")
    names = [one.name for one in springs_asked(robot, ["q2.ry", "q2.ry.square", "q3.rx.ry"])]
    assert names == ["k_q2", "k_q2.square", "k_q3.rx.ry"]
    asked = springs_asked(robot, "lateral")
    assert [one.name for one in asked][:6] == [f"k_q{j}" for j in range(1, 7)]
    assert len(asked) == 18
    assert "k_q2.rx" in [one.name for one in asked]


@pytest.mark.parametrize(
    ("springs", "message"),
    [
        (["q2", "q2"], "'q2' is listed twice"),
        (["q2", "q2.ry"], "'q2.ry' is listed twice, which is 'q2'"),
        (["q3.rx.z", "q3.z.rx"], "'q3.z.rx' is listed twice"),
        (["q9"], "no spring 'q9'; expected one of the joints q1"),
        (["q2.rw"], "no spring 'q2.rw'"),
        (["q2.rx.ry.rz"], "no spring"),
        (["q2.rx.rz.cubic"], "no spring"),
    ],
)
def test_wrong_lists_are_refused(springs: list[str], message: str) -> None:
    """A spring that is named twice, and one of no joint, axis or law, is one line."""
    with pytest.raises(ValueError, match=message):
        springs_asked(load_robot("kuka_kr270"), springs)


def test_joint_that_slides_has_its_own_axis_once() -> None:
    """Along the axis of a prismatic joint the spring is the joint's own, however it is named."""
    slide = Joint("q1", np.eye(4), np.array([0.0, 0.0, 1.0]), (0.0, 1.0), "prismatic")
    robot = Robot("slide", (slide,))
    assert [one.unit for one in springs_asked(robot, ["q1", "q1.rz", "q1.z.rz"])] == [
        "1e-6 m/N",
        "1e-6 rad/(N m)",
        "1e-6 rad/N",
    ]
    with pytest.raises(ValueError, match=r"'q1\.z' is listed twice, which is 'q1'"):
        springs_asked(robot, ["q1", "q1.z"])


def test_tied_joint_has_no_spring_of_its_own() -> None:
    """A joint that follows another one has springs across it alone."""
    robot = tied_chain()
    follower = robot.tied[0].name
    with pytest.raises(ValueError, match="follows another one and has no spring of its own"):
        springs_asked(robot, [follower])
    assert springs_asked(robot, [f"{follower}.rx"])
