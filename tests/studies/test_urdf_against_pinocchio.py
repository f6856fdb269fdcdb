"""Robots from URDF files move as another library says."""

import importlib.metadata
from pathlib import Path

import pytest

DATA = Path(__file__).parents[1] / "data"


def test_the_comparison_runs_on_a_small_file(script):
    """One chain of the KR 150-2, in some poses."""
    pytest.importorskip("pinocchio", reason="pinocchio is not importable here")
    module = script("urdf_against_pinocchio.py")
    found = module.compare(DATA / "kr150_2.urdf", 20)
    assert (found.chains, found.joints, found.tied, found.refused) == (1, [6], 0, {})
    assert 0 < max(found.pose, found.jacobian) < 1e-14


@pytest.mark.zoo
def test_every_chain_of_two_packages(script):
    """All leaf chains of example-robot-data and rtb-data, to 1e-12 of the reach."""
    module = script("urdf_against_pinocchio.py")
    for package in module.PACKAGES:
        assert importlib.metadata.version(package)
    chains = 0
    for path in module.files([]):
        try:
            found = module.compare(path, 50)
        except module.RobotFileError:
            continue
        assert max(found.pose, found.jacobian) <= module.ALLOWED, path
        chains += found.chains
    assert chains > 500
