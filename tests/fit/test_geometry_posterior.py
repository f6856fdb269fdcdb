"""The posterior of geometry: its density is the model's, and the check finds what is wrong."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import STUDY, by_pose, truth

import edtk
from edtk.fit.geometry_posterior import (
    GeometryDensity,
    geometry_posterior,
    many_seen,
)
from edtk.fit.posterior import EMCEE, LAPLACE, SamplingOptions
from edtk.fit.prior import Flat, LogNormal, Prior
from edtk.fit.run_chain import Demand

OPTIONS = SamplingOptions(Demand(0.1, length=10.0))


@pytest.fixture(scope="module")
def density(tmp_path_factory: pytest.TempPathFactory) -> GeometryDensity:
    """Of all parameters that twelve poses tell."""
    sheet = by_pose(tmp_path_factory.mktemp("day") / "day.csv", *truth(12))
    return GeometryDensity.of(edtk.identify(STUDY, sheet).fit, None, robust=False)


@pytest.mark.slow
def test_many_sets_of_parameters_are_seen_at_once(density: GeometryDensity) -> None:
    """Positions are those of the model, one set of parameters after the other."""
    model = density.model
    rng = np.random.default_rng(0)
    theta = rng.normal(0, 5, (3, model.p)) * model.scales
    q = density.means.q[:4]
    expected = [model.see(one, q, derivatives=False).points for one in theta]
    np.testing.assert_allclose(many_seen(model, theta, q).points, expected, atol=1e-12)


@pytest.mark.slow
def test_the_density_is_largest_at_its_mode_with_unit_curvature(density: GeometryDensity) -> None:
    """Steps of one and of two standard deviations lower its logarithm by a half and by two."""
    x = np.eye(density.model.p)[:6]
    at = density.log_density(np.zeros((1, density.model.p)))
    np.testing.assert_allclose(at - density.log_density(x), 0.5, rtol=1e-2)
    np.testing.assert_allclose(at - density.log_density(-2 * x), 2.0, rtol=1e-2)


@pytest.mark.slow
def test_the_check_tells_a_good_approximation_from_a_bad_one(density: GeometryDensity) -> None:
    """Nearly all draws are effective, but few where the normal density is a third as wide."""
    good = geometry_posterior(density, np.random.default_rng(1), OPTIONS)
    assert (good.method, good.trusted) == (LAPLACE, True)
    assert good.effective_share > 0.95
    assert_normal(good.std, density, good.std_error)
    np.testing.assert_allclose(good.interval()[1] - good.mean, 1.96 * good.std, rtol=0.15)
    narrow = replace(density, root=density.root / 3)
    bad = geometry_posterior(narrow, np.random.default_rng(1), OPTIONS)
    assert not bad.trusted
    assert "too few to trust it" in bad.quality


def assert_normal(std: np.ndarray, density: GeometryDensity, error: np.ndarray) -> None:
    """Standard deviations are those of the normal approximation, within the draws' errors."""
    normal = np.linalg.norm(density.root, axis=1)
    assert (np.abs(std - normal) < 4 * error).all()


@pytest.mark.slow
def test_walkers_start_where_there_is_a_density(density: GeometryDensity) -> None:
    """A prior of positive numbers has none below zero; and its factor tells a density apart."""
    flat = (Flat(),) * (density.model.p - 1)
    scale = density.model.scales[0]
    mode = density.mode.copy()
    mode[0] = np.linalg.norm(density.root[0])  # one standard deviation above zero
    known, other = (
        replace(
            density,
            mode=mode,
            prior=Prior((LogNormal(scale * mode[0], factor), *flat), None, False),
        )
        for factor in (1.5, 2.0)
    )
    start = known.start(np.random.default_rng(0), 100)
    assert np.isfinite(known.log_density(start)).all()
    assert (start.std(axis=0)[1:] > 0.3).all()
    assert known.content[1] != other.content[1]
    free = density.start(np.random.default_rng(0), 4)
    np.testing.assert_array_equal(free, np.random.default_rng(0).standard_normal(free.shape))


@pytest.mark.cell("`identify --bayes`", "parameters")
@pytest.mark.slow
def test_few_parameters_are_sampled(tmp_path: Path) -> None:
    """A chain of base and zeros has the deviations of the normal approximation."""
    study = STUDY.replace(parameters={"geometry": ["q2.ry", "q3.ry"], "tool": False})
    q, x = truth(8)
    fit = edtk.identify(study, by_pose(tmp_path / "day.csv", q, x), as_is=True).fit
    density = GeometryDensity.of(fit, None, robust=False)
    options = SamplingOptions(Demand(0.1, length=20.0))
    found = geometry_posterior(density, np.random.default_rng(2), options)
    assert found.method == EMCEE
    assert len(found.parameters) == 8
    assert_normal(found.std, density, found.std_error)
