"""Chains that are kept, and gone on with."""

import sys

import emcee
import numpy as np
import pytest
from inference.test_posterior import sample

from edtk.inference.chain_file import ChainFileError
from edtk.inference.prior import Prior
from edtk.inference.run_chain import Demand, UnconvergedError

FINE = Demand(accuracy=0.01)


@pytest.fixture
def stopped(tmp_path):
    """A chain that was stopped after 700 steps."""
    path = tmp_path / "chain.h5"
    with pytest.raises(UnconvergedError):
        sample(0, Demand(0.01, most=700), chain=path)
    return path


def test_resumed_chain_is_the_uninterrupted_one(stopped):
    """A chain that goes on after a stop is longer, begins with the same steps, and ends as if never stopped."""
    before = emcee.backends.HDFBackend(stopped, read_only=True).get_chain()
    assert len(before) == 700
    sample(0, FINE, chain=stopped)
    after = emcee.backends.HDFBackend(stopped, read_only=True).get_chain()
    assert len(after) > 700
    np.testing.assert_array_equal(after[:700], before)
    whole = stopped.parent / "whole.h5"
    sample(0, FINE, chain=whole)
    uninterrupted = emcee.backends.HDFBackend(whole, read_only=True).get_chain()
    np.testing.assert_array_equal(after, uninterrupted)


@pytest.mark.parametrize("most", [500, 501, 900, 1100])
def test_wherever_it_stopped(tmp_path, most):
    """A chain that ended at some limit is, gone on with, as long as one that never stopped."""
    path = tmp_path / "chain.h5"
    with pytest.raises(UnconvergedError):
        sample(0, Demand(0.01, most=most), chain=path)
    resumed, whole = (sample(0, FINE, chain=file) for file in (path, None))
    np.testing.assert_array_equal(resumed.samples, whole.samples)


def test_finished_chain_is_only_read(tmp_path):
    """A chain that is long enough is not sampled again, and gives the same samples."""
    path, steps = tmp_path / "chain.h5", []
    first = sample(0, FINE, chain=path)
    again = sample(0, FINE, chain=path, progress=steps.append)
    np.testing.assert_array_equal(again.samples, first.samples)
    assert steps == []
    assert [p.name for p in tmp_path.iterdir()] == ["chain.h5"]


def test_chain_of_another_problem(stopped):
    """A chain of another seed or prior is refused and left as it is."""
    content = stopped.read_bytes()
    for seed, options in ((1, {}), (0, {"prior": Prior.flat(2, positive=False)})):
        with pytest.raises(ChainFileError, match="another study, plan, seed or prior"):
            sample(seed, FINE, chain=stopped, **options)
    assert stopped.read_bytes() == content


@pytest.mark.parametrize("keep", [0, 100, 5000])
def test_broken_file(stopped, keep):
    """A file that is cut off is refused in words that name it."""
    stopped.write_bytes(stopped.read_bytes()[:keep])
    with pytest.raises(ChainFileError, match=r"chain\.h5: not a chain"):
        sample(0, FINE, chain=stopped)


def test_without_h5py(tmp_path, monkeypatch):
    """Without h5py the error names the extra to install."""
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ChainFileError, match=r"edtk\[posterior\]"):
        sample(0, FINE, chain=tmp_path / "chain.h5")


def test_less_accuracy_than_before(tmp_path):
    """A chain that was to be very long is judged as it is where less is asked."""
    path, steps = tmp_path / "chain.h5", []
    with pytest.raises(UnconvergedError):
        sample(0, Demand(0.002, most=3000), chain=path)
    sample(0, Demand(0.05), chain=path, progress=steps.append)
    assert steps == []
