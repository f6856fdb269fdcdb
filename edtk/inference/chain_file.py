"""A chain on disk, in the layout of emcee's HDF backend, from which sampling goes on."""

from dataclasses import dataclass
from pathlib import Path

import emcee
import numpy as np

from edtk.system.atomic_file import atomic_path

GROUP, PROBLEM, GOAL, ACCURACY = "mcmc", "edtk_problem", "edtk_goal", "edtk_accuracy"


class ChainFileError(ValueError):
    """A chain that cannot be read, or belongs to another problem; the message names the file."""


@dataclass(frozen=True)
class ChainFile:
    """Where a chain is kept; `emcee.backends.HDFBackend(path)` reads it too, in whitened coordinates.

    emcee's own backend writes in place at every step, and a killed process leaves a file that nobody can read; here
    the file is always whole, being replaced after some blocks of steps.

    Attributes:
        path: The file.
        problem: Digest of all that the chain depends on, its start included.
    """

    path: Path
    problem: str

    def load(self, accuracy: float) -> tuple[emcee.backends.Backend, int] | None:
        """The chain so far with its random state, and the length at which it is judged; None where there is no file.

        Args:
            accuracy: What is asked now; where that is less than before, the chain is judged as it is.

        Raises:
            ChainFileError: h5py is missing, the file is no chain, or one of another problem.
        """
        try:
            import h5py  # type: ignore[import-untyped]
        except ModuleNotFoundError:
            raise ChainFileError(
                f"{self.path}: keeping a chain needs the extra edtk[posterior], which is not installed"
            ) from None
        if not self.path.exists():
            return None
        stored = emcee.backends.HDFBackend(str(self.path), name=GROUP, read_only=True)
        try:
            with h5py.File(self.path, "r") as file:
                problem, goal = file[GROUP].attrs.get(PROBLEM), int(file[GROUP].attrs.get(GOAL, 0))
                goal = goal if accuracy <= file[GROUP].attrs.get(ACCURACY, np.inf) else 0
            backend = emcee.backends.Backend()
            backend.reset(*stored.shape)
            backend.chain, backend.log_prob = stored.get_chain(), stored.get_log_prob()
            backend.accepted, backend.iteration = stored.accepted, int(stored.iteration)
            backend.random_state = stored.random_state
        except (OSError, KeyError, AttributeError, ValueError) as error:
            raise ChainFileError(f"{self.path}: not a chain of emcee's") from error
        if problem != self.problem:
            raise ChainFileError(
                f"{self.path}: the chain is of another study, plan, seed or prior; name another file"
            )
        return backend, goal

    def save(self, backend: emcee.backends.Backend, goal: int, accuracy: float) -> None:
        """Write the chain, and the length at which it is judged for what accuracy, atomically.

        Raises:
            OSError: It cannot be written.
        """
        n = backend.iteration
        with atomic_path(self.path) as temporary:
            temporary.unlink()  # HDF5 does not open an empty file
            stored = emcee.backends.HDFBackend(str(temporary), name=GROUP)
            stored.reset(*backend.shape)
            stored.grow(n, None)
            with stored.open("a") as file:
                group = file[GROUP]
                group["chain"][...], group["log_prob"][...] = (
                    backend.chain[:n],
                    backend.log_prob[:n],
                )
                group["accepted"][...] = backend.accepted
                group.attrs["iteration"], group.attrs[PROBLEM] = n, self.problem
                group.attrs[GOAL], group.attrs[ACCURACY] = goal, accuracy
                for i, element in enumerate(backend.random_state):
                    group.attrs[f"random_state_{i}"] = np.asarray(element) if i == 1 else element
