"""Libraries compute in one thread where they are told to, and as before after it."""

import sys
from types import ModuleType

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from edtk.system.workers import _libraries, one_thread


def threads() -> list[int]:
    """Numbers of threads of the libraries that are loaded."""
    return [library["num_threads"] for library in threadpool_info()]


def test_one_thread_within_and_as_many_as_before_after() -> None:
    """Nested, repeated, and where the work fails."""
    np.linalg.inv(np.eye(2))
    with threadpool_limits(2):
        before = threads()
        for _ in range(2):
            with one_thread(), one_thread():
                assert set(threads()) == {1}
            assert threads() == before
        with pytest.raises(KeyError), one_thread():
            raise KeyError
        assert threads() == before


def test_libraries_are_looked_for_after_imports(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are known as long as nothing is imported, and looked for again after that."""
    with one_thread():
        known = _libraries(len(sys.modules))
    with one_thread():
        assert _libraries(len(sys.modules)) is known
    monkeypatch.setitem(sys.modules, "a_module_with_a_library", ModuleType("a_module"))
    assert _libraries(len(sys.modules)) is not known
