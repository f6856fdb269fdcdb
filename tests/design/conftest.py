"""Searches and bounds are what the tests of this room are about."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def _sharp(sharp_bounds: None) -> None:
    """Bounds are as sharp as users have them."""
