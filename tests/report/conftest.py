"""Pages of this room have their pictures drawn."""

from collections.abc import Iterator

import pytest

from edtk.report.page import svg


@pytest.fixture(scope="module", autouse=True)
def _drawn() -> Iterator[None]:
    """As users have them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.report.page.svg", svg)
        yield
