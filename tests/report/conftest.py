"""Pages of this room have their pictures drawn."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def _drawn(drawn_pages: None) -> None:
    """As users have them."""
