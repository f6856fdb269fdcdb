"""Laws of a chain with geometric errors: derivatives, ranks, and what they may depend on."""

from collections.abc import Callable
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import (
    TITLES,
    Identifiable,
    Parameter,
    Place,
    all_parameters,
    identifiable,
)
from edtk.robots.joint import Joint, TiedJoint
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

Array = NDArray[np.float64]
AXES = dict(zip("xyz", np.eye(3), strict=True))


def arm(name: str, origins: list[tuple[float, ...]], axes: str, slides: str = "") -> Robot:
    """A chain along parallel frames; `slides` names the joints that are prismatic by number."""
    joints = []
    for i, (origin, axis) in enumerate(zip(origins, axes, strict=True), start=1):
        kind = "prismatic" if str(i) in slides else "revolute"
        limits = (-0.2, 0.2) if kind == "prismatic" else (-2.5, 2.5)
        joints.append(Joint(f"q{i}", transform(origin), AXES[axis], limits, kind))
    return Robot(name, tuple(joints), base=transform((0.1, 0.2, 0.3), (0.1, -0.2, 0.3)))


SIX = arm(
    "6R",
    [(0, 0, 0.29), (0, 0, 0), (0, 0, 0.27), (0, 0, 0.07), (0.302, 0, 0), (0, 0, 0)],
    "zyyxyx",
)
SCARA = arm("SCARA", [(0, 0, 0.3), (0.3, 0, 0), (0.25, 0, 0), (0, 0, 0)], "zzzz", slides="3")
SEVEN = arm(
    "7R",
    [(0, 0, 0.34), (0, 0, 0), (0, 0, 0.4), (0, 0, 0), (0, 0, 0.4), (0, 0, 0), (0, 0, 0.126)],
    "zyzyzyz",
)
GANTRY = arm("gantry", [(0, 0, 0), (0, 0, 0), (0, 0, 0.5), (0, 0, 0)], "xyzz", slides="123")
TIED = replace(
    SIX,
    name="6R with a tie",
    joints=SIX.joints[:4] + SIX.joints[5:],
    tied=(
        TiedJoint("q5", transform((0.302, 0, 0)), AXES["y"], "revolute", 4, (("q3", -1.0),), 0.1),
    ),
)


def model_of(robot: Robot, markers: int, rows: str = "position", **chosen: object) -> MeasuredModel:
    """A model with all parameters, or those chosen, and markers off all axes."""
    names = tuple("ABC"[:markers])
    offsets = np.random.default_rng(1).normal(0, 0.1, (markers, 3))
    parameters = all_parameters(robot, names, pose=rows == "pose", **chosen)
    start = transform((2, -1, 0.5), (0.4, 0.5, -0.6))
    return MeasuredModel(robot, offsets, names, parameters, start, rows)


def poses(robot: Robot, number: int, seed: int = 0) -> Array:
    """Poses anywhere between the limits."""
    return np.random.default_rng(seed).uniform(*robot.limits, (number, robot.n))


def told_apart(model: MeasuredModel, q: Array, **options: object) -> Identifiable:
    """What the poses tell apart, near the drawing."""
    columns = model.see(np.zeros(model.p), q).jacobian.reshape(-1, model.p)
    return identifiable(columns * model.scales, model.parameters, **options)


@pytest.mark.slow
@pytest.mark.parametrize("rows", ["position", "pose"])
@pytest.mark.parametrize("robot", [SIX, SCARA, TIED], ids=lambda robot: robot.name)
def test_columns_are_derivatives(robot: Robot, rows: str, derivative: Callable[..., Array]) -> None:
    """Positions and turns move with every parameter as the columns say, off the drawing too."""
    model = model_of(robot, 2, rows, compliance=robot.joint_names)
    rng = np.random.default_rng(2)
    theta = rng.normal(0, 0.05, model.p)
    q = poses(robot, 1)
    torque = rng.normal(0, 1, (1, robot.n))
    seen = model.see(theta, q, torque)

    def rows_at(x: Array) -> Array:
        there = model.see(x, q, torque, derivatives=False)
        turned = there.turns @ np.swapaxes(seen.turns, -1, -2)
        turns = Rotation.from_matrix(turned.reshape(-1, 3, 3)).as_rotvec().reshape(1, 2, 3)
        return np.concatenate([there.points, turns], axis=-1)[..., : model.row_count]

    assert np.abs(derivative(rows_at, theta) - seen.jacobian).max() < 1e-9


def test_without_errors_it_is_the_robot() -> None:
    """All parameters zero: markers are where the robot of the drawing carries them."""
    model = model_of(TIED, 2)
    q = poses(TIED, 5)
    carried = model.start @ TIED.forward(q)
    expected = carried[:, None, :3, 3] + np.einsum("mij,kj->mki", carried[:, :3, :3], model.offsets)
    np.testing.assert_allclose(model.see(np.zeros(model.p), q).points, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("robot", "revolute", "prismatic"),
    [(SIX, 6, 0), (SCARA, 3, 1), (SEVEN, 7, 0), (GANTRY, 1, 3)],
    ids=["6R", "SCARA", "7R", "gantry"],
)
def test_ranks(robot: Robot, revolute: int, prismatic: int) -> None:
    """Full poses tell four a revolute joint, two a prismatic one and six (Everett et al. 1987); so
    27, 30 and 33 for one to three markers of a 6R arm. A marker tells three, as long as joints turn
    its tool about more than one direction.
    """
    full = 4 * revolute + 2 * prismatic + 6
    q = poses(robot, 60)
    assert told_apart(model_of(robot, 1, "pose"), q).rank == full
    if revolute > 1:
        ranks = [told_apart(model_of(robot, k), q).rank for k in (1, 2, 3)]
        assert ranks == [full - 3, full, full + 3]


def test_rank_is_that_of_singular_values() -> None:
    """The pivots find the rank that singular values show, in poses that leave directions open."""
    model = model_of(SIX, 3)
    for number in (2, 4, 8, 20):
        q = poses(SIX, number)
        q[:, 0] = 0.7
        columns = model.see(np.zeros(model.p), q).jacobian.reshape(-1, model.p) * model.scales
        values = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)
        assert told_apart(model, q).rank == (values > 1e-8).sum()


def test_redundant_directions_move_nothing() -> None:
    """A parameter that is not kept, less its shares of the kept ones, moves no marker."""
    model = model_of(SIX, 2)
    found = told_apart(model, poses(SIX, 40))
    elsewhere = model.see(np.zeros(model.p), poses(SIX, 10, seed=5)).jacobian
    scaled = elsewhere.reshape(-1, model.p) * model.scales
    left = scaled[:, found.left] - scaled[:, found.kept] @ found.shares
    assert np.abs(left).max() < 1e-12


def test_redundant_directions_have_words() -> None:
    """The sentence of each names what it is confused with; units do not change it."""
    model = model_of(SIX, 1)
    found = told_apart(model, poses(SIX, 40), stages=[range(9)])
    assert len(found.words) == model.p - 27
    assert "the zero of joint q1 cannot be told from the base's turn about z" in " ".join(
        word.split(" and ")[0] for word in found.words
    )
    assert any("marker A on the tool along x" in word for word in found.words)


def test_a_joint_is_not_called_a_joint_twice() -> None:
    """Names of URDF files often begin with the word."""
    parameter = Parameter("joint", "joint_a2", "ry", along=True)
    assert parameter.words == "the zero of joint_a2"
    assert replace(parameter, along=False).words == "the tilt about y before joint_a2"


def test_a_spring_that_no_load_turns_is_named() -> None:
    """A compliance without any torque moves no marker, and is said to do so."""
    model = model_of(SIX, 1, compliance=["q2"])
    words = told_apart(model, poses(SIX, 20)).words
    assert words[-1].startswith(
        "the compliance of joint q2 moves no marker in these poses: it needs"
    )


def test_stages_decide_what_is_kept() -> None:
    """Earlier stages are kept before later ones, and the rank is the same."""
    model = model_of(SIX, 2)
    q = poses(SIX, 30)
    last = tuple(reversed(range(model.p)))
    first = told_apart(model, q, stages=[range(12)])
    other = told_apart(model, q, stages=[last[:12]])
    assert first.rank == other.rank == 30
    assert set(range(12)) <= set(first.kept) != set(other.kept)


@pytest.mark.parametrize(
    ("geometry", "count"),
    [("all", 36), ("", None), (["zeros"], 6), (["q2", "q3.rx"], 7), (["lengths"], 18), ([], 0)],
)
def test_chosen_geometry(geometry: str | list[str], count: int | None) -> None:
    """Joints, kinds and single parameters can be chosen; errors list them."""
    if count is None:
        with pytest.raises(ValueError, match="expected 'all' or a list"):
            all_parameters(SIX, "A", geometry)
    else:
        assert len(all_parameters(SIX, "A", geometry, base=False, tool=False)) == count
    with pytest.raises(ValueError, match=r"zeros, lengths, tilts.*q1, q2"):
        all_parameters(SIX, "A", ["q9"])


def test_every_place_has_a_title() -> None:
    """A parameter of a place without one would be in no section of a report."""
    assert set(TITLES) == set(get_args(Place))
