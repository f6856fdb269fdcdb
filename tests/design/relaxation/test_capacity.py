"""How many candidates a limit on memory allows."""

import pytest

from edtk.design.relaxation.relax_poses import KEPT, MemoryLimitError, capacity


def test_more_memory_holds_more():
    """More memory holds more candidates, and more parameters or variables leave room for fewer."""
    assert KEPT <= capacity(15, 6, 500) < capacity(15, 6, 1000) < capacity(15, 6, 2000)
    assert capacity(55, 6, 1000) < capacity(15, 6, 1000)
    assert capacity(15, 12, 1000) < capacity(15, 6, 1000)


@pytest.mark.parametrize("limit", [-1.0, 0.0, 100.0, float("nan")])
def test_too_small_a_limit(limit):
    """A limit too small says which one is enough, to a megabyte."""
    with pytest.raises(MemoryLimitError, match="too small, expected") as caught:
        capacity(15, 6, limit)
    least = caught.value.least_mb
    assert capacity(15, 6, least) >= KEPT
    with pytest.raises(MemoryLimitError):
        capacity(15, 6, least - 1)


def test_no_limit():
    """Without a limit the number is finite."""
    assert capacity(15, 6, float("inf")) > 10**15
