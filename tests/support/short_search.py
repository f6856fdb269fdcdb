"""Searches that end early on any machine, which seconds do not say."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def short_search() -> Iterator[None]:
    """One search over all poses for the bound, and one batch of starts for the plan."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.design.relaxation.relax_poses.ROUNDS", 1)
        patch.setattr("edtk.study.plan_study.STARTS", 16)
        yield
