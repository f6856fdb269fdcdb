"""Rows of studies of geometry as polynomials in the joints, over whole boxes of poses."""

from dataclasses import replace

import numpy as np
import pytest
from loaded_arm import STUDY

from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.geometry_space import GeometrySpace
from edtk.design.enclosure.objective import Enclosed
from edtk.design.enclosure.polynomial import NotEnclosedError
from edtk.design.enclosure.robot_polynomials import polynomials_of
from edtk.measure.noise import Tracker
from edtk.system.typing import Array

WEIGHED = STUDY.replace(load=None, payload={"mass_kg": 20.0, "center_mm": [30, 0, -100]})
STUDIES = {
    "geometry alone": STUDY.replace(parameters={"geometry": ["zeros"], "base": False}),
    "with springs": STUDY,
    "under a free force": STUDY.replace(load={"F_max_N": 150}),
    "by a list of forces": STUDY.replace(load={"list_F_N": [[0, 40, -100], [0, 0, 50]]}),
    "under a payload": WEIGHED,
}


def sampled(space: GeometrySpace) -> tuple[Array, Enclosed, Array]:
    """A multiplier, what is enclosed of it, and places in the box."""
    rng = np.random.default_rng(3)
    x = space.draw(rng.random((100, len(space.drawn))))
    A = space.at(x).regressor
    R = rng.normal(size=(space.p, space.p)) / np.sqrt(np.einsum("mri,mri->i", A, A) / len(x))
    enclosed = polynomials_of(space).enclosed(R.T @ R)
    low, high = np.array([(axis.low, axis.high) for axis in enclosed.axes]).T
    return R.T @ R, enclosed, rng.uniform(low, high, size=(60, len(low)))


def sensitivities(space: GeometrySpace, Z: Array, x: Array) -> Array:
    """The sensitivity (m,) of experiments by their rows."""
    A = space.at(x).regressor
    return np.asarray(np.einsum("ij,mri,mrj->m", Z, A, A))


@pytest.mark.parametrize("name", STUDIES)
def test_polynomials_are_the_sums_of_squares_of_rows(name: str) -> None:
    """At any place a numerator is the sensitivity by the rows, to twelve digits, for each load."""
    space = GeometryQuestion.of(STUDIES[name]).space
    Z, enclosed, places = sampled(space)
    for k, objective in enumerate(enclosed.objectives):
        expected = sensitivities(space, Z, enclosed.experiments(places, k))
        off = np.abs(objective(places) - expected).max()
        assert off < 1e-12 * expected.max()
        assert off < objective.numerator.error < 1e-7 * expected.max()


def test_all_visits_are_below_the_largest_of_a_few_loads() -> None:
    """No force of any size and direction tells more than those that the enclosure looks at do."""
    space = GeometryQuestion.of(STUDIES["under a free force"]).space
    Z, enclosed, places = sampled(space)
    rng = np.random.default_rng(5)
    x = enclosed.experiments(places, 1)
    x[:, space.workspace.robot.n :] = space.load.draw(rng.random((len(x), 3)))
    angles = np.array([np.stack([e, a]) for e in np.linspace(-1.5, 1.5, 9) for a in np.arange(7)])
    every = np.array([np.column_stack([places[:, :2], np.tile(one, (60, 1))]) for one in angles])
    assert [axis.kind for axis in enclosed.axes] == ["angle"] * 4
    largest = np.max([enclosed.objectives[1](own) for own in every], axis=0)
    largest = np.maximum(largest, enclosed.objectives[0](places))
    assert (sensitivities(space, Z, x) < 1.1 * largest).all()


def test_errors_that_depend_on_the_pose_count_no_less() -> None:
    """With a tracker and joints that come back badly, the bound is above what visits tell."""
    space = GeometryQuestion.of(STUDY).space
    tracker = Tracker(np.array([4.0, 1.0, 0.5]), (1e-5, 5e-6), (2e-5, 8e-6))
    markers = range(len(space.geometry.markers))
    seen = tuple((i, 3 * i) for i in markers)
    joints = np.full(2, 0.05)
    noise = replace(space.noise, tracker=tracker, tracked=seen, repeatability=joints)
    space = replace(space, noise=noise)
    Z, enclosed, places = sampled(space)
    for k, objective in enumerate(enclosed.objectives):
        exact = sensitivities(space, Z, enclosed.experiments(places, k))
        assert (objective(places) > exact).all()
        assert (objective(places) < 30 * exact).all()


def test_rows_that_are_no_polynomials_say_why() -> None:
    """Springs of another law have no enclosure, which ends in one line."""
    springs = {"geometry": [], "springs": ["q1", "q2", "q2.cubic"], "base": False, "tool": False}
    study = STUDY.replace(parameters=springs, load={"list_F_N": [[0, 0, -100], [0, 0, -50]]})
    with pytest.raises(NotEnclosedError, match="springs of the law 'cubic' are no polynomials"):
        polynomials_of(GeometryQuestion.of(study).space)
