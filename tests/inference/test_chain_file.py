"""Chains that are kept, and resumed."""

import pickle
import sys
from shutil import copyfile

import emcee
import numpy as np
import pytest
from inference.test_sample_posterior import sample

from edtk.inference.chain_file import ChainFileError, ChainFileFault
from edtk.inference.prior import Prior
from edtk.inference.run_chain import Demand, UnconvergedError

pytestmark = pytest.mark.slow

FINE = Demand(accuracy=0.01)
LIMIT = 700


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Two chains: one that was stopped after 700 steps, and one that never was."""
    folder = tmp_path_factory.mktemp("kept")
    with pytest.raises(UnconvergedError):
        sample(0, Demand(0.01, most=LIMIT), chain=folder / "stopped.h5")
    whole = sample(0, FINE, chain=folder / "whole.h5")
    return folder, whole


@pytest.fixture
def stopped(kept, tmp_path):
    """A file of its own of the chain that was stopped."""
    return copyfile(kept[0] / "stopped.h5", tmp_path / "chain.h5")


@pytest.fixture
def whole(kept):
    """The posterior of the chain that was never stopped."""
    return kept[1]


def steps_in(path):
    """All steps (steps, walkers, d) of a file, as emcee reads them."""
    return emcee.backends.HDFBackend(path, read_only=True).get_chain()


def test_resumed_chain_is_the_uninterrupted_one(stopped, kept):
    """A resumed chain begins with the same steps, is longer, and ends as if never stopped."""
    before = steps_in(stopped)
    assert len(before) == LIMIT
    sample(0, FINE, chain=stopped)
    after = steps_in(stopped)
    assert len(after) > LIMIT
    np.testing.assert_array_equal(after[:LIMIT], before)
    np.testing.assert_array_equal(after, steps_in(kept[0] / "whole.h5"))


@pytest.mark.parametrize("most", [500, 501, 900, 1100])
def test_wherever_it_stopped(tmp_path, most, whole):
    """A chain that ended at some limit becomes, resumed, as long as one that never stopped."""
    path = tmp_path / "chain.h5"
    with pytest.raises(UnconvergedError):
        sample(0, Demand(0.01, most=most), chain=path)
    np.testing.assert_array_equal(sample(0, FINE, chain=path).samples, whole.samples)


def test_a_file_changes_nothing(whole):
    """A chain that is not kept has the same samples."""
    np.testing.assert_array_equal(sample(0, FINE).samples, whole.samples)


def test_finished_chain_is_only_read(kept, tmp_path):
    """A chain that is long enough is not sampled again, and gives the same samples."""
    path = copyfile(kept[0] / "whole.h5", tmp_path / "chain.h5")
    steps = []
    again = sample(0, FINE, chain=path, progress=steps.append)
    np.testing.assert_array_equal(again.samples, kept[1].samples)
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
    with pytest.raises(ChainFileError, match=r"chain\.h5: not a chain") as caught:
        sample(0, FINE, chain=stopped)
    assert caught.value.path == stopped
    assert caught.value.fault is ChainFileFault.NO_CHAIN
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_without_h5py(tmp_path, monkeypatch):
    """Without h5py the error names the extra to install."""
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ChainFileError, match=r"edtk\[posterior\]"):
        sample(0, FINE, chain=tmp_path / "chain.h5")


def test_less_accuracy_than_before(stopped):
    """A chain that was to be long is not lengthened where less is asked."""
    steps = []
    found = sample(0, Demand(0.05), chain=stopped, progress=steps.append)
    assert steps == []
    assert found.steps == LIMIT
