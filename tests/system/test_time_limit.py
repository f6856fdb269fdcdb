"""How long a call may take."""

from threading import Thread

import numpy as np
import pytest

from edtk.system.time_limit import out_of_time, time_left, time_limit


def test_without_a_limit_there_is_time() -> None:
    """Nobody is out of time whom nobody limits."""
    assert time_left() == np.inf
    assert not out_of_time()


def test_the_tighter_of_two_limits_holds() -> None:
    """A limit within another one cannot give more time, and ends with its block."""
    with time_limit(100.0):
        with time_limit(1e9):
            assert 99.0 < time_left() <= 100.0
        with time_limit(0.0):
            assert out_of_time()
        assert not out_of_time()
    assert time_left() == np.inf


def test_a_limit_ends_with_an_error() -> None:
    """An error within leaves no limit behind."""
    with pytest.raises(KeyboardInterrupt), time_limit(0.0):
        raise KeyboardInterrupt
    assert not out_of_time()


def test_a_limit_is_of_one_thread() -> None:
    """Two calls in two threads do not share their limits."""
    left = []
    with time_limit(0.0):
        thread = Thread(target=lambda: left.append(time_left()))
        thread.start()
        thread.join()
    assert left == [np.inf]


def test_who_was_told_that_time_is_over_is_cut() -> None:
    """A limit knows of it, and those around it do; a first answer that was asked for is whole."""
    with time_limit(100.0) as whole:
        with time_limit(0.0) as first:
            assert out_of_time()
        assert first.cut
        assert not whole.cut
        with time_limit(1e-9) as share:
            assert out_of_time()
        assert share.cut
        assert whole.cut
    with time_limit(100.0) as unhurried:
        assert not out_of_time()
    assert not unhurried.cut
