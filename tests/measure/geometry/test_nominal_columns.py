"""Columns at the geometry of the drawing: those of the model of any errors, and their slopes."""

from typing import Literal

import numpy as np
import pytest
from chains import mixed_chain, tied_chain
from numpy.typing import NDArray

from edtk.measure.geometric_model import GeometricModel
from edtk.measure.nominal_columns import NominalColumns
from edtk.measure.parameters import all_parameters
from edtk.robots.robot import Robot

Array = NDArray[np.float64]
RNG = np.random.default_rng(3)
CHAINS = {"mixed": mixed_chain(6), "tied": tied_chain()}


def model_of(robot: Robot, rows: Literal["position", "pose"]) -> GeometricModel:
    """All parameters of a chain with two markers, springs in every free joint."""
    names = ("A", "B")
    parameters = all_parameters(robot, names, "all", robot.joint_names, pose=rows == "pose")
    return GeometricModel(robot, RNG.normal(size=(2, 3)), names, parameters, rows=rows)


def jacobian(model: GeometricModel, q: Array, torque: Array | None) -> Array:
    """Columns by the class under test, as `GeometricModel.see` has them (m, k, 3, p)."""
    found = NominalColumns(model).at(q).jacobian(None if torque is None else torque.T)
    return np.moveaxis(found, (0, 3), (3, 0))


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("rows", ["position", "pose"])
def test_columns_are_those_of_the_model(
    name: str, loaded: bool, rows: Literal["position", "pose"]
) -> None:
    """Both kinds of joint, joints that follow others, base, tools and springs agree with `see`."""
    model = model_of(CHAINS[name], rows)
    q = RNG.uniform(-1, 1, (4, model.robot.n))
    torque = RNG.normal(size=q.shape) if loaded else None
    seen = model.see(np.zeros(model.p), q, torque)
    np.testing.assert_allclose(jacobian(model, q, torque), seen.jacobian, atol=1e-12)
    by_joints = np.moveaxis(NominalColumns(model).at(q).by_joints, (0, 3), (3, 0))
    np.testing.assert_allclose(by_joints, seen.by_joints, atol=1e-12)


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("rows", ["position", "pose"])
def test_slopes_are_those_of_differences(name: str, rows: Literal["position", "pose"]) -> None:
    """Derivatives by every joint agree with central differences, and weights of loads with 1."""
    model = model_of(CHAINS[name], rows)
    q = RNG.uniform(-1, 1, (3, model.robot.n))
    torque = RNG.normal(size=q.shape)
    B = RNG.normal(size=(3, 2, model.row_count, model.p))
    weights = np.ascontiguousarray(np.moveaxis(B, (3, 0), (0, 3)))
    slope, by_torque = NominalColumns(model).at(q).slope(weights, torque.T)
    step = 1e-5
    for j in range(model.robot.n):
        d = np.zeros(model.robot.n)
        d[j] = step
        change = jacobian(model, q + d, torque) - jacobian(model, q - d, torque)
        expected = (B * change).sum(axis=(1, 2, 3)) / (2 * step)
        np.testing.assert_allclose(slope[j], expected, atol=1e-7)
        change = jacobian(model, q, torque + d / step) - jacobian(model, q, torque)
        np.testing.assert_allclose(by_torque[j], (B * change).sum(axis=(1, 2, 3)), atol=1e-9)
