"""Chains that are kept, and resumed."""

import hashlib
import io
import pickle
import re
import sys
from shutil import copyfile

import emcee
import h5py
import numpy as np
import pytest
from fit.test_sample_posterior import sample
from forked import fill_disk, forked

from edtk.fit.prior import Prior
from edtk.fit.run_chain import (
    NO_CHAIN,
    SEAL,
    SEAL_LENGTH,
    ChainFile,
    ChainFileError,
    Demand,
    StoredChain,
    UnconvergedError,
)

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


@pytest.mark.parametrize("most", [500, 501, 1100])
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
    with pytest.raises(ChainFileError, match=re.escape(f"{stopped}: not a chain")) as caught:
        sample(0, FINE, chain=stopped)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.fixture
def loaded(stopped):
    """What reads the chain that was stopped."""
    with h5py.File(stopped) as file:
        attributes = dict(file["mcmc"].attrs)
    kept = ChainFile(stopped, attributes["edtk_problem"])
    shape = (attributes["nwalkers"], attributes["ndim"])
    assert kept.load(0.01, shape).backend.iteration == LIMIT
    return lambda: kept.load(0.01, shape)


def assert_no_chain(load):
    """A file is refused."""
    with pytest.raises(ChainFileError, match=NO_CHAIN):
        load()


def test_a_changed_byte_is_found_before_hdf5_sees_it(stopped, loaded, monkeypatch):
    """Wherever the byte is, HDF5 is not asked: some changed files crash it."""
    monkeypatch.setattr(h5py, "File", None)
    content = stopped.read_bytes()
    for position in np.linspace(0, len(content) - 1, 25).astype(int):
        changed = bytearray(content)
        changed[position] ^= 1 << position % 8
        stopped.write_bytes(changed)
        assert_no_chain(loaded)
    stopped.write_bytes(content + b"x")
    assert_no_chain(loaded)


def resized(group, name, shape):
    """Another dataset in place of one: of zeros, which take no place on the disk."""
    del group[name]
    group.create_dataset(name, shape, dtype=float, chunks=True)


FORGERIES = {
    "no group": lambda group: group.file.move("mcmc", "other"),
    "an array for a group": lambda group: resized(group.file, "mcmc", (3,)),
    "no chain": lambda group: group.pop("chain"),
    "a group for a chain": lambda group: (group.pop("chain"), group.create_group("chain")),
    "no iteration": lambda group: group.attrs.pop("iteration"),
    "no problem": lambda group: group.attrs.pop("edtk_problem"),
    "no goal": lambda group: group.attrs.pop("edtk_goal"),
    "a goal in words": lambda group: group.attrs.create("edtk_goal", "soon"),
    "a goal of several numbers": lambda group: group.attrs.create("edtk_goal", [1, 2]),
    "an infinite goal": lambda group: group.attrs.create("edtk_goal", np.inf),
    "accuracy in words": lambda group: group.attrs.create("edtk_accuracy", "fine"),
    "no steps": lambda group: group.attrs.create("iteration", 0),
    "negative steps": lambda group: group.attrs.create("iteration", -5),
    "fewer steps than stored": lambda group: group.attrs.create("iteration", 10),
    "endless steps": lambda group: group.attrs.create("iteration", 10**18),
    "other walkers": lambda group: resized(group, "chain", (LIMIT, 2, 2)),
    "a terabyte": lambda group: (
        group.attrs.create("iteration", 10**9),
        resized(group, "chain", (10**9, *group["chain"].shape[1:])),
        resized(group, "log_prob", (10**9, group["log_prob"].shape[1])),
    ),
    "a number that is none": lambda group: group["chain"].__setitem__((5, 3, 1), np.nan),
    "a walker far away": lambda group: group["chain"].__setitem__((5, 3, 0), 1e200),
    "infinite density": lambda group: group["log_prob"].__setitem__((5, 3), np.inf),
    "more accepted than made": lambda group: group["accepted"].__setitem__(0, 10**6),
    "fewer accepted than none": lambda group: group["accepted"].__setitem__(0, -1),
    "no random state": lambda group: group.attrs.pop("random_state_1"),
    "a short random state": lambda group: group.attrs.create("random_state_1", [1, 2]),
    "another generator": lambda group: group.attrs.create("random_state_0", "PCG64"),
    "a place beyond the state": lambda group: group.attrs.create("random_state_2", 10**6),
}


@pytest.mark.parametrize("forgery", FORGERIES.values(), ids=FORGERIES)
def test_a_forged_chain(stopped, loaded, forgery):
    """A file with a right seal and another content is no chain."""
    image = io.BytesIO(stopped.read_bytes()[:-SEAL_LENGTH])
    with h5py.File(image, "r+") as file:
        forgery(file["mcmc"])
    content = image.getvalue()
    stopped.write_bytes(content + SEAL + hashlib.sha256(content).digest())
    assert_no_chain(loaded)


@pytest.mark.unix
def test_a_full_disk(stopped, tmp_path, capfd):
    """HDF5 ended the process there; now an error names the file, which stays as it was."""
    content = stopped.read_bytes()
    rng = np.random.RandomState(0)
    backend = emcee.backends.Backend()
    backend.reset(8, 2)
    backend.chain = rng.normal(size=(1000, 8, 2))
    backend.log_prob = rng.normal(size=(1000, 8))
    backend.iteration = 1000
    backend.random_state = rng.get_state()

    def save():
        fill_disk(8192)
        ChainFile(stopped, "").save(StoredChain(backend, 0), 0.01)

    assert forked(save) == 1
    assert str(stopped) in capfd.readouterr().err.splitlines()[-1]
    assert stopped.read_bytes() == content
    assert list(tmp_path.iterdir()) == [stopped]


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
