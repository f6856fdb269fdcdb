"""A chain on disk, in the layout of emcee's HDF backend, from which sampling is resumed."""

import hashlib
import io
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.system.files import read_bytes, write_files
from edtk.system.typing import Array

if TYPE_CHECKING:
    import emcee

GROUP = "mcmc"  # emcee's own default
PROBLEM = "edtk_problem"
GOAL = "edtk_goal"
ACCURACY = "edtk_accuracy"
MOST_MB = 4000.0
# At the end of a file, before the SHA-256 of all bytes before it. HDF5 ignores what follows its own
# content. A file with a changed byte is refused before HDF5 sees it, which may crash on it.
SEAL = b"edtk:sha256:"
BLOCK = 1 << 20  # bytes by which a file in memory grows
FARTHEST = 1e9  # coordinate in whitened units, of order one, that no walker reaches


SEAL_LENGTH = len(SEAL) + hashlib.sha256().digest_size
# A file with a right seal and another content fails in as many ways as there are.
REFUSED = (
    OSError,
    LookupError,
    AttributeError,
    ValueError,
    TypeError,
    ArithmeticError,
    RuntimeError,
)


class ChainFileFault(Enum):
    """Why a chain cannot be resumed from a file."""

    NO_LIBRARY = "keeping a chain needs the extra edtk[posterior], which is not installed"
    NO_CHAIN = "not a chain that edtk has written, or damaged since; name another file"
    OTHER_PROBLEM = "the chain is of another study, plan, seed or prior; name another file"


class ChainFileError(ValueError):
    """A chain cannot be read, or belongs to another problem.

    Attributes:
        path: The file.
        fault: What is wrong with it.
    """

    def __init__(self, path: Path, fault: ChainFileFault) -> None:
        super().__init__(path, fault)
        self.path = path
        self.fault = fault

    def __str__(self) -> str:
        return f"{self.path}: {self.fault.value}"


@dataclass(frozen=True, eq=False)
class StoredChain:
    """A chain as it was when it was last written.

    Attributes:
        backend: All steps, and the random state after the last one.
        goal: Length at which it is next checked for convergence.
    """

    backend: "emcee.backends.Backend"
    goal: int


@dataclass(frozen=True)
class ChainFile:
    """Where a chain is kept; `emcee.backends.HDFBackend(path)` reads it too, in whitened units.

    emcee's own backend writes in place at every step, and a process that is killed leaves a file
    that nobody can read. This file is always whole: it is replaced after some blocks of steps. HDF5
    itself neither reads nor writes the disk: where that is full, HDF5 ends the whole process.

    Attributes:
        path: The file.
        problem: Digest of everything that the chain depends on, its start included.
    """

    path: Path
    problem: str

    @classmethod
    def of(cls, path: Path, numbers: Sequence[Array], words: str) -> "ChainFile":
        """The file at a path that is of one problem alone.

        Args:
            path: Where it lies.
            numbers: Every number that the chain depends on, its start and seed included.
            words: All else that it depends on.
        """
        digest = hashlib.sha256()
        for part in numbers:
            digest.update(np.ascontiguousarray(part).tobytes())
        digest.update(words.encode())
        return cls(path, digest.hexdigest())

    def load(self, accuracy: float, shape: tuple[int, int]) -> StoredChain | None:
        """Read the chain so far; None where the file does not exist.

        Args:
            accuracy: The accuracy asked for now. Where less is asked than before, the chain is
                checked at its present length.
            shape: Numbers of walkers and of coordinates.

        Raises:
            ChainFileError: h5py is missing, the file is no chain, or one of another problem.
            UserError: The file cannot be read.
        """
        try:
            import h5py  # type: ignore[import-untyped]
        except ModuleNotFoundError:
            raise ChainFileError(self.path, ChainFileFault.NO_LIBRARY) from None
        if not self.path.exists():
            return None
        content = read_bytes(self.path, MOST_MB)
        image = content[:-SEAL_LENGTH]
        if content[-SEAL_LENGTH:] != _seal(image):
            raise ChainFileError(self.path, ChainFileFault.NO_CHAIN)
        try:
            with h5py.File(io.BytesIO(image), "r") as file:
                group = file[GROUP]
                if group.attrs[PROBLEM] != self.problem:
                    raise ChainFileError(self.path, ChainFileFault.OTHER_PROBLEM)
                goal = int(group.attrs[GOAL])
                if accuracy > float(group.attrs[ACCURACY]):
                    goal = 0
                return StoredChain(_backend(group, shape, len(image)), goal)
        except ChainFileError:
            raise
        except REFUSED as error:
            raise ChainFileError(self.path, ChainFileFault.NO_CHAIN) from error

    def save(self, stored: StoredChain, accuracy: float) -> None:
        """Write the chain atomically, with the accuracy that it is to reach.

        Raises:
            OSError: It cannot be written.
        """
        attributes = {PROBLEM: self.problem, GOAL: stored.goal, ACCURACY: accuracy}
        image = _image(stored.backend, attributes)
        write_files({self.path: image + _seal(image)})


def _seal(image: bytes) -> bytes:
    return SEAL + hashlib.sha256(image).digest()


def _image(backend: "emcee.backends.Backend", attributes: dict[str, Any]) -> bytes:
    """The bytes of a file of emcee's HDF backend, with more attributes."""
    import emcee
    import h5py

    steps = backend.iteration
    with h5py.File("chain", "w", driver="core", backing_store=False, block_size=BLOCK) as file:
        target = emcee.backends.HDFBackend("chain", name=GROUP)
        target.open = lambda mode="r": nullcontext(file)
        target.reset(*backend.shape)
        target.grow(steps, None)
        group = file[GROUP]
        group["chain"][...] = backend.chain[:steps]
        group["log_prob"][...] = backend.log_prob[:steps]
        group["accepted"][...] = backend.accepted
        group.attrs["iteration"] = steps
        group.attrs.update(attributes)
        for i, element in enumerate(backend.random_state):
            # Of the Mersenne Twister's state, element 1 is the array; the rest are numbers.
            group.attrs[f"random_state_{i}"] = np.asarray(element) if i == 1 else element
        file.flush()
        return bytes(file.id.get_file_image())


def _backend(group: Any, shape: tuple[int, int], size: int) -> "emcee.backends.Backend":
    """The chain of a file's group, in memory.

    Args:
        group: The group of an open file.
        shape: Numbers of walkers and of coordinates that the chain must have.
        size: Bytes of the file, which no array can exceed.

    Raises:
        ValueError: The chain is none of that shape, or not one that a sampler leaves.
    """
    import emcee

    steps = int(group.attrs["iteration"])
    shapes = {"chain": (steps, *shape), "log_prob": (steps, shape[0]), "accepted": shape[:1]}
    arrays = {}
    for name, expected in shapes.items():
        stored = group[name]
        # Checked before reading: a small file can claim an array of any size.
        if stored.shape != expected or stored.dtype != float or stored.nbytes > size:
            raise ValueError(f"{name}: expected numbers of shape {expected}")
        arrays[name] = stored[...]
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name}: expected finite numbers")
    if np.abs(arrays["chain"]).max(initial=0.0) > FARTHEST:
        raise ValueError("chain: expected coordinates in whitened units")
    if steps < 1 or arrays["accepted"].min() < 0 or arrays["accepted"].max() > steps:
        raise ValueError("expected at least one step, and no more accepted ones than there are")
    backend = emcee.backends.Backend()
    backend.reset(*shape)
    backend.chain = arrays["chain"]
    backend.log_prob = arrays["log_prob"]
    backend.accepted = arrays["accepted"]
    backend.iteration = steps
    backend.random_state = [group.attrs[f"random_state_{i}"] for i in range(5)]
    np.random.RandomState().set_state(tuple(backend.random_state))  # refuses other arrays
    _, array, position, _, normal = backend.random_state
    if not (0 <= position <= len(array) and np.isfinite(normal)):
        raise ValueError("expected the state of a random generator")
    return backend
