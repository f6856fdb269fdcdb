"""An arm whose optima are known in closed form: its lemma, and that they are found."""

from pathlib import Path

import numpy as np
import pytest

from edtk.design.candidate_source import CandidateSource
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.study.plan_study import relax_study
from edtk.study.study import load_study

pytestmark = pytest.mark.usefixtures("sharp_bounds")

STUDY = load_study(Path(__file__).parents[2] / "studies" / "spherical_arm.toml")
# One core does what the tests need within seconds.
ACCURACY = 1e-6


@pytest.fixture(scope="module")
def arm(script):
    return script("spherical_arm.py")


@pytest.fixture(scope="module")
def informations():
    """Information of 20,000 random poses and loads, in units of T."""
    return CandidateSource(STUDY.space, 0, workers=1).take(20_000).problem.blocks()


@pytest.mark.parametrize("beta", [1 / 3, 0.5, 0.6, 0.9, 1.0])
def test_no_pose_exceeds_the_lemma(arm, informations, beta):
    """Over random poses and loads Q_beta and M_22 stay below the bounds, and come near them."""
    M = informations / arm.unit(STUDY)
    pair = (M[:, 0, 0] + M[:, 2, 2] - 2 * beta * M[:, 0, 2]) / (1 + (1 - beta) ** 2 / (4 * beta))
    together = pair + M[:, 1, 1]
    assert 0.85 < together.max() <= 1 + 1e-12


def test_pairs_and_singles_have_the_information_that_the_page_says(arm):
    """Poses of equality: T (1 + s)/2 [[1, s], [s, 1]] of k1 and k3, and T of k2 alone."""
    T = arm.unit(STUDY)
    force = STUDY.specification.load.F_max_N
    for s in (1 / 2, 1 / 3):
        psi = np.arccos(s)
        q = np.array([[0, psi, np.pi / 2]])
        # The moment halves the angle of the axes; with r along y, F = m x r is at right angles.
        m = np.array([np.sin(psi / 2), 0, np.cos(psi / 2)])
        F = np.append(force * np.cross(m, [0, 1, 0]), np.zeros(3))[None]
        A = STUDY.model.regressor(q, F)[0] / STUDY.sigma[0]
        expected = T * (1 + s) / 2 * np.array([[1, 0, s], [0, 0, 0], [s, 0, 1]])
        np.testing.assert_allclose(A.T @ A, expected, atol=1e-12 * T)
    q = np.array([[0, 0.3, 0]])
    r = np.array([np.cos(0.3), 0, -np.sin(0.3)])
    F = np.append(force * np.cross([0, 1, 0], r), np.zeros(3))[None]
    A = STUDY.model.regressor(q, F)[0] / STUDY.sigma[0]
    np.testing.assert_allclose(A.T @ A, T * np.diag([0, 1, 0]), atol=1e-12 * T)


@pytest.mark.parametrize("joints", [("q1",), ("q2",)])
def test_search_over_all_poses_finds_a_single_compliance(arm, joints):
    """Bound and value of singular optima are 1/T; few candidates are enough to begin with."""
    study = arm.about(STUDY, joints)
    found = relax_study(study, "A", candidates=200, continuous=True, tolerance=1e-6)
    expected = arm.closed_form("A", joints, arm.unit(STUDY))
    assert found.value == pytest.approx(expected, rel=ACCURACY)
    assert found.best_bound.value == pytest.approx(expected, rel=ACCURACY)
    assert len(found.x) <= 3


@pytest.mark.slow
def test_d_optimum_is_found_as_weights_and_as_a_plan(arm):
    """Search over all poses, relaxation over the poses found, and exact plans of 3: T 16^(-1/3)."""
    found = relax_study(STUDY, "D", candidates=300, continuous=True, tolerance=5e-7)
    expected = arm.closed_form("D", (), arm.unit(STUDY))
    assert found.value == pytest.approx(expected, rel=ACCURACY)
    assert found.best_bound.value == pytest.approx(expected, rel=ACCURACY)
    assert found.gap <= ACCURACY
    plan = find_plan(found, 3, options=SearchOptions(starts=16))
    assert plan.value == pytest.approx(3 * expected, rel=ACCURACY)
    turn = np.abs(np.rad2deg(plan.plan.q[plan.plan.repeats.argmax(), 1]))
    assert min(abs(turn - 60), abs(turn - 120)) < 0.1


@pytest.mark.slow
def test_one_experiment_is_a_plan_for_one_compliance(arm):
    """In the right pose one experiment tells k1 and nothing else, which poses at random do not."""
    study = arm.about(STUDY, ("q1",))
    found = relax_study(study, "A", candidates=200, continuous=True, tolerance=1e-6)
    plan = find_plan(found, 1, options=SearchOptions(starts=16))
    assert plan.value == pytest.approx(1 / arm.unit(STUDY), rel=1e-4)  # the force is not refined
    np.testing.assert_allclose(np.abs(np.rad2deg(plan.plan.q[0, 1:])), 90, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "joints"), [("A", ()), ("D", ("q1", "q3"))])
def test_other_optima_are_found(arm, name, joints):
    """A-optimality of all, and D-optimality of a pair whose designs leave k2 open."""
    study = arm.about(STUDY, joints)
    found = relax_study(study, name, candidates=300, continuous=True, tolerance=1e-6)
    expected = arm.closed_form(name, joints, arm.unit(STUDY))
    assert found.value == pytest.approx(expected, rel=ACCURACY)
    assert found.best_bound.value == pytest.approx(expected, rel=ACCURACY)
