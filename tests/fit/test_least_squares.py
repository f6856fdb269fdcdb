"""The least-squares estimate, its covariance, and the error of plans that cannot identify."""

import numpy as np
import pytest

from edtk.fit.least_squares import SingularPlanError, Whitened, covariance, estimate, unidentified
from edtk.fit.measurements import simulate
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

K0 = np.array([0.302, 0.406, 3.002, 3.303, 2.365]) * 1e-6
SIGMA = 0.03e-3
WRENCH = np.array([0.0, 0.0, -2500.0, 0.0, 0.0, 0.0])
NAMES = ("k2", "k3", "k4", "k5", "k6")


def model_of(unknown=(1, 2, 3, 4, 5), tool=(0.6115, 0.0, -0.460), rows="position"):
    return ElastostaticModel(load_robot("kuka_kr270").with_tool(transform(tool)), unknown, rows)


def poses(m, seed=0):
    return np.random.default_rng(seed).uniform(*load_robot("kuka_kr270").limits, size=(m, 6))


@pytest.fixture
def A():
    return model_of().regressor(poses(8), WRENCH)


@pytest.mark.parametrize("sigma", [SIGMA, [0.01e-3, 0.03e-3, 0.1e-3]], ids=["one", "per row"])
def test_exact_without_noise(A, sigma):
    """Noise-free measurements give the truth back, to rounding times the regressor's condition."""
    k = estimate(A, A @ K0, sigma, NAMES).k
    condition = np.linalg.cond(A.reshape(-1, 5))
    np.testing.assert_allclose(k, K0, rtol=0, atol=1e3 * np.finfo(float).eps * condition * K0.max())


def test_batch_of_measurements_equals_loop(A):
    """Measurements of any batch shape share one factorisation and give what each gives alone."""
    measured = simulate(A, K0, SIGMA, np.random.default_rng(1), runs=6).reshape(2, 3, *A.shape[:2])
    together = estimate(A, measured, SIGMA, NAMES)
    assert together.k.shape == (2, 3, 5)
    assert together.covariance.shape == (5, 5)
    for i in np.ndindex(2, 3):
        np.testing.assert_allclose(
            together.k[i], estimate(A, measured[i], SIGMA, NAMES).k, rtol=1e-11
        )


def test_estimate_solves_the_weighted_normal_equations(A):
    """Eq. (9): the residual, weighted by row, is orthogonal to every regressor column."""
    sigma = np.array([0.01e-3, 0.03e-3, 0.1e-3])
    measured = simulate(A, K0, sigma, np.random.default_rng(2))[0]
    weighted = (A / sigma[:, None]).reshape(-1, 5)
    residual = (measured / sigma).reshape(-1) - weighted @ estimate(A, measured, sigma, NAMES).k
    orthogonal = weighted.T @ residual / np.linalg.norm(weighted, axis=0) / np.linalg.norm(residual)
    np.testing.assert_allclose(orthogonal, 0.0, atol=1e-12)


@pytest.mark.parametrize("sigma", [SIGMA, [0.01e-3, 0.03e-3, 0.1e-3]], ids=["one", "per row"])
def test_covariance_is_that_of_repeated_experiments(A, sigma):
    """The estimates' scatter over 20000 runs is Eq. (13): unbiased, and whitened to the identity.

    Whitened by Eq. (13) the runs are standard normal, so that the mean has standard deviation
    1/sqrt(N), the second moments sqrt(2/N) on the diagonal and 1/sqrt(N) off it; each must lie
    within five of these.
    """
    N = 20_000
    result = estimate(A, simulate(A, K0, sigma, np.random.default_rng(3), runs=N), sigma, NAMES)
    z = np.linalg.solve(np.linalg.cholesky(result.covariance), (result.k - K0).T)
    assert np.abs(z.mean(axis=1)).max() < 5 / np.sqrt(N)
    moments = z @ z.T / N - np.eye(5)
    assert np.abs(np.diag(moments)).max() < 5 * np.sqrt(2 / N)
    assert np.abs(moments - np.diag(np.diag(moments))).max() < 5 / np.sqrt(N)


def test_covariance_is_equation_13(A):
    """The covariance is the inverse of the sum of A_i'A_i / sigma^2."""
    M = sum(a.T @ a for a in A) / SIGMA**2
    result = estimate(A, A @ K0, SIGMA, NAMES).covariance
    np.testing.assert_allclose(result @ M, np.eye(5), atol=1e-10)
    np.testing.assert_allclose(covariance(M, NAMES), result, rtol=1e-10, atol=1e-12 * result.max())


def test_covariance_halves_with_twice_the_measurements(A):
    """Repeating a plan halves the covariance and leaves the noise-free estimate."""
    once = estimate(A, A @ K0, SIGMA, NAMES)
    twice = estimate(np.tile(A, (2, 1, 1)), np.tile(A @ K0, (2, 1)), SIGMA, NAMES)
    np.testing.assert_allclose(
        twice.covariance, once.covariance / 2, rtol=1e-10, atol=1e-12 * once.covariance.max()
    )
    np.testing.assert_allclose(twice.k, once.k, rtol=1e-9)


def information(A):
    stacked = A.reshape(-1, A.shape[-1]) / SIGMA
    return stacked.T @ stacked


def test_a_regular_plan_leaves_nothing_open(A):
    """No parameter is named where all are identified."""
    assert unidentified(information(A), NAMES) == ()


def test_vertical_force_leaves_joint_1_open():
    """Under vertical forces exactly k1 is named, in one line."""
    model = model_of(unknown=None)
    A = model.regressor(poses(8), WRENCH)
    assert unidentified(information(A), model.parameters) == ("k1",)
    with pytest.raises(
        SingularPlanError, match=r"cannot identify all parameters: k1 cannot"
    ) as caught:
        estimate(A, A @ np.r_[1e-6, K0], SIGMA, model.parameters)
    assert "\n" not in str(caught.value)


def test_tool_on_the_last_axis_leaves_joint_6_open():
    """With a force at a tool point on axis 6 exactly k6 is named, in spite of rounding."""
    model = model_of(tool=(0.986, 0.0, 0.0))
    A = model.regressor(poses(8), WRENCH)
    assert unidentified(information(A), model.parameters) == ("k6",)
    with pytest.raises(SingularPlanError, match=r"parameters: k6 cannot"):
        estimate(A, A @ K0, SIGMA, model.parameters)


def test_force_along_a_tilted_first_axis_leaves_joint_1_open():
    """On a tilted base exactly k1 is named when the force is along its axis, despite rounding."""
    kuka = load_robot("kuka_kr270")
    base = transform([0.1, 0.2, 0.3], [0.3, -0.4, 0.5])
    model = ElastostaticModel(Robot("tilted", kuka.joints, base, transform([0.6115, 0.0, -0.460])))
    A = model.regressor(poses(8), np.r_[-2500.0 * base[:3, 2], 0, 0, 0])
    assert unidentified(information(A), model.parameters) == ("k1",)


def test_parallel_columns_are_both_named():
    """Two parameters that only act together are named, the third is not, in whatever units."""
    rng = np.random.default_rng(4)
    a, b = rng.normal(size=(2, 5, 3))
    for unit in (1.0, 1e-9, 1e9):
        A = np.stack([a, b, 2 * unit * a], axis=-1)
        assert unidentified(information(A), ("u", "v", "w")) == ("u", "w")
        with pytest.raises(SingularPlanError, match=r"parameters: u, w cannot .* along \("):
            estimate(A, A @ np.ones(3), SIGMA, ("u", "v", "w"))


def test_too_few_measurements_leave_something_open(A):
    """One pose with three rows cannot identify five parameters."""
    assert unidentified(information(A[:1]), NAMES)
    with pytest.raises(SingularPlanError, match="cannot identify all parameters"):
        estimate(A[:1], A[:1] @ K0, SIGMA, NAMES)


def test_no_information_leaves_everything_open():
    """Zero information names every parameter."""
    assert unidentified(np.zeros((5, 5)), NAMES) == NAMES
    with pytest.raises(SingularPlanError, match="k2, k3, k4, k5, k6"):
        covariance(np.zeros((5, 5)), NAMES)


def test_simulated_measurements_are_seeded_and_shaped(A):
    """Equal seeds give equal measurements of shape (runs, m, rows), with the given noise."""
    one, two = (
        simulate(A, K0, [0.0, SIGMA, 2 * SIGMA], np.random.default_rng(5), runs=4) for _ in range(2)
    )
    assert one.shape == (4, *A.shape[:2])
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(one[..., 0], np.broadcast_to((A @ K0)[:, 0], (4, 8)))


def test_residual_is_what_no_compliances_explain(A):
    """The residual is that of the fit in units of the noise, and zero of what the model makes."""
    whitened = Whitened.of(A, [0.01e-3, 0.03e-3, 0.1e-3], NAMES)
    measured = simulate(A, K0, SIGMA, np.random.default_rng(2))[0]
    expected = (measured - A @ whitened.solve(measured)) * whitened.weight
    np.testing.assert_allclose(whitened.residual(measured), expected, atol=1e-9)
    explained = np.abs(A @ K0 * whitened.weight).max()
    np.testing.assert_allclose(whitened.residual(A @ K0), 0.0, atol=1e-13 * explained)
