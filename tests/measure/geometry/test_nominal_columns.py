"""Columns at the geometry of the drawing: those of the model of any errors, and their slopes."""

from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest
from chains import coupled_chain, mixed_chain, tied_chain
from numpy.typing import NDArray

from edtk.measure.measured_model import Load, LoadsOfReadings, MeasuredModel
from edtk.measure.nominal_columns import NominalColumns
from edtk.measure.parameters import all_parameters
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation_vectors

Array = NDArray[np.float64]
RNG = np.random.default_rng(3)
CHAINS = {"mixed": mixed_chain(6), "tied": tied_chain(), "coupled": coupled_chain()}


Rows = Literal["position", "pose", "mixed"]


def model_of(robot: Robot, rows: Rows) -> MeasuredModel:
    """All parameters of a chain with springs in every free joint, and two markers on its tool.

    The mixed one has them on the tool and on a link, one with its orientation, and two wires.
    """
    names = ("A", "B")
    parameters = all_parameters(robot, names, "all", robot.joint_names, pose=rows != "position")
    offsets = RNG.normal(size=(2, 3))
    if rows != "mixed":
        return MeasuredModel(robot, offsets, names, parameters, rows=rows)
    return MeasuredModel(
        robot,
        np.concatenate([offsets, offsets[[1]], RNG.normal(size=(1, 3))]),
        (*names, "wire", "other"),
        parameters,
        bodies=(None, 2, 2, 3),
        kinds=("position", "pose", "distance", "distance"),
        anchors=RNG.normal(0, 3, (4, 3)),
        places=(0, 1, 1, 3),
    )


def jacobian(model: MeasuredModel, q: Array, torque: Array | None) -> Array:
    """Columns by the class under test, as `MeasuredModel.see` has them (m, k, 3, p)."""
    found = NominalColumns(model).at(q).jacobian(None if torque is None else torque.T)
    return np.moveaxis(found, (0, 3), (3, 0))


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("rows", ["position", "pose", "mixed"])
def test_columns_are_those_of_the_model(name: str, loaded: bool, rows: Rows) -> None:
    """Both kinds of joint, joints that follow others, base, tools and springs agree with `see`."""
    model = model_of(CHAINS[name], rows)
    q = RNG.uniform(-1, 1, (4, model.robot.n))
    torque = RNG.normal(size=q.shape) if loaded else None
    seen = model.see(np.zeros(model.p), q, torque)
    np.testing.assert_allclose(jacobian(model, q, torque), seen.jacobian, atol=1e-12)
    by_joints = np.moveaxis(NominalColumns(model).at(q).by_joints, (0, 3), (3, 0))
    np.testing.assert_allclose(by_joints, seen.by_joints, atol=1e-12)


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("rows", ["position", "pose", "mixed"])
def test_slopes_are_those_of_differences(name: str, rows: Rows) -> None:
    """Derivatives by every joint agree with central differences, and weights of loads with 1."""
    model = model_of(CHAINS[name], rows)
    q = RNG.uniform(-1, 1, (3, model.robot.n))
    torque = RNG.normal(size=q.shape)
    B = RNG.normal(size=(3, *model.present.shape, model.p))
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


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("rows", ["position", "pose", "mixed"])
def test_slopes_of_motions_are_those_of_differences(name: str, rows: Rows) -> None:
    """What joints that do not come back add to the errors changes with the pose as it says."""
    model = model_of(CHAINS[name], rows)
    q = RNG.uniform(-1, 1, (3, model.robot.n))
    C = RNG.normal(size=(model.robot.n, *model.present.shape, 3))
    columns = NominalColumns(model)
    slope = columns.at(q).motion_slope(C)
    step = 1e-5
    for j in range(model.robot.n):
        d = np.zeros(model.robot.n)
        d[j] = step
        change = columns.at(q + d).by_joints - columns.at(q - d).by_joints
        expected = (C * change).sum(axis=(0, 1, 2)) / (2 * step)
        np.testing.assert_allclose(slope[j], expected, atol=1e-7)


@pytest.mark.parametrize("rows", ["position", "pose", "mixed"])
def test_differences_see_the_difference_of_the_loads_alone(rows: Rows) -> None:
    """At the drawing, a reading less the one before has columns of springs and no others."""
    model = model_of(CHAINS["mixed"], rows)
    q = RNG.uniform(-1, 1, (4, model.robot.n))
    torque, before = RNG.normal(size=(2, *q.shape))
    differs = np.array([True, False, True, True])
    loading = LoadsOfReadings(Load(torque), differs, Load(before[differs]))
    seen = model.see(np.zeros(model.p), q, loading)
    change = torque - differs[:, None] * before
    found = NominalColumns(model).at(q).jacobian(change.T, differs)
    np.testing.assert_allclose(np.moveaxis(found, (0, 3), (3, 0)), seen.jacobian, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("rows", ["position", "pose", "mixed"])
def test_columns_of_differences_are_those_of_what_is_seen(
    rows: Rows, derivative: Callable[..., Array]
) -> None:
    """Off the drawing too, what two readings differ by moves with every parameter as it says."""
    model = model_of(CHAINS["mixed"], rows)
    q = RNG.uniform(-1, 1, (2, model.robot.n))
    differs = np.array([True, False])
    loading = LoadsOfReadings(
        Load(RNG.normal(size=q.shape)), differs, Load(RNG.normal(size=(1, q.shape[1])))
    )
    theta = RNG.normal(0, 0.05, model.p)
    seen = model.see(theta, q, loading)

    def rows_at(x: Array) -> Array:
        there = model.see(x, q, loading, derivatives=False)
        turned = rotation_vectors(there.turns @ np.swapaxes(seen.turns, -1, -2))
        rows = np.concatenate([there.points, turned], axis=-1)[..., : model.row_count]
        return np.where(model.present, rows, 0.0)

    assert np.abs(derivative(rows_at, theta) - seen.jacobian).max() < 1e-8
