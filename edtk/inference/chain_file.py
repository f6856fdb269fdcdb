"""A chain on disk, in the layout of emcee's HDF backend, from which sampling is resumed."""

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from edtk.system.atomic_file import atomic_path

if TYPE_CHECKING:
    import emcee

GROUP = "mcmc"  # emcee's own default
PROBLEM = "edtk_problem"
GOAL = "edtk_goal"
ACCURACY = "edtk_accuracy"


class ChainFileFault(Enum):
    """Why a chain cannot be resumed from a file."""

    NO_LIBRARY = "keeping a chain needs the extra edtk[posterior], which is not installed"
    NO_CHAIN = "not a chain of emcee's"
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
    that nobody can read. This file is always whole: it is replaced after some blocks of steps.

    Attributes:
        path: The file.
        problem: Digest of everything that the chain depends on, its start included.
    """

    path: Path
    problem: str

    def load(self, accuracy: float) -> StoredChain | None:
        """Read the chain so far; None where the file does not exist.

        Args:
            accuracy: The accuracy asked for now. Where less is asked than before, the chain is
                checked at its present length.

        Raises:
            ChainFileError: h5py is missing, the file is no chain, or one of another problem.
        """
        try:
            import h5py  # type: ignore[import-untyped]  # noqa: F401
        except ModuleNotFoundError:
            raise ChainFileError(self.path, ChainFileFault.NO_LIBRARY) from None
        if not self.path.exists():
            return None
        try:
            problem, stored = self._read(accuracy)
        except (OSError, KeyError, AttributeError, ValueError) as error:
            # A file that was cut off fails in as many ways as there are places to cut.
            raise ChainFileError(self.path, ChainFileFault.NO_CHAIN) from error
        if problem != self.problem:
            raise ChainFileError(self.path, ChainFileFault.OTHER_PROBLEM)
        return stored

    def _read(self, accuracy: float) -> tuple[str, StoredChain]:
        """The problem's digest and the chain, in memory."""
        import emcee
        import h5py

        with h5py.File(self.path, "r") as file:
            attributes = file[GROUP].attrs
            problem = attributes.get(PROBLEM)
            goal = int(attributes.get(GOAL, 0))
            if accuracy > attributes.get(ACCURACY, np.inf):
                goal = 0
        stored = emcee.backends.HDFBackend(str(self.path), name=GROUP, read_only=True)
        backend = emcee.backends.Backend()
        backend.reset(*stored.shape)
        backend.chain = stored.get_chain()
        backend.log_prob = stored.get_log_prob()
        backend.accepted = stored.accepted
        backend.iteration = int(stored.iteration)
        backend.random_state = stored.random_state
        return problem, StoredChain(backend, goal)

    def save(self, stored: StoredChain, accuracy: float) -> None:
        """Write the chain atomically, with the accuracy that it is to reach.

        Raises:
            OSError: It cannot be written.
        """
        import emcee

        backend = stored.backend
        steps = backend.iteration
        with atomic_path(self.path) as temporary:
            temporary.unlink()  # HDF5 does not open an empty file
            target = emcee.backends.HDFBackend(str(temporary), name=GROUP)
            target.reset(*backend.shape)
            target.grow(steps, None)
            with target.open("a") as file:
                group = file[GROUP]
                group["chain"][...] = backend.chain[:steps]
                group["log_prob"][...] = backend.log_prob[:steps]
                group["accepted"][...] = backend.accepted
                group.attrs["iteration"] = steps
                group.attrs[PROBLEM] = self.problem
                group.attrs[GOAL] = stored.goal
                group.attrs[ACCURACY] = accuracy
                for i, element in enumerate(backend.random_state):
                    # Of the Mersenne Twister's state, element 1 is the array; the rest are numbers.
                    group.attrs[f"random_state_{i}"] = np.asarray(element) if i == 1 else element
