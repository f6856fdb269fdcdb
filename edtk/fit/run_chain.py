"""The chain of a posterior: its file, and how it grows until answers are as accurate as asked."""

import hashlib
import io
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from edtk.system.files import read_bytes, write_files
from edtk.system.time_limit import no_progress
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
GROWS_BY = 1 << 20  # bytes by which a file in memory grows
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


@dataclass(frozen=True)
class Convergence:
    """When a chain is long enough, and by how much it grows before."""

    # Sokal's window: autocorrelations are summed up to the first lag beyond so many autocorrelation
    # times. A longer window adds noise, a shorter one leaves correlation out.
    window: float = 5.0
    # Least excess of the variance of squared deviations. Normal samples have 2; a chain that jumps
    # between two points has 0, which would make its error zero.
    least_excess: float = 1e-3
    # Steps between two reports of progress, and the least length that is checked for convergence.
    block: int = 500
    # Threshold of Vehtari et al. (2021).
    most_r_hat: float = 1.01
    # Autocorrelation times that are dropped from the head; walkers start near the posterior.
    burn: float = 10.0
    # Writing the chain to its file takes at most one part in so many of the time.
    save_share: int = 10
    # Where a chain is too short, its next length is the one predicted and a little more, for the
    # prediction scatters; but at least and at most so many times the present one.
    margin: float = 1.05
    least_growth: float = 1.2
    most_growth: int = 2


ENOUGH = Convergence()


NO_LIBRARY = "keeping a chain needs the extra edtk[posterior], which is not installed"
NO_CHAIN = "not a chain that edtk has written, or damaged since; name another file"
OTHER_PROBLEM = "the chain is of another study, plan, seed or prior; name another file"


class ChainFileError(ValueError):
    """A chain cannot be read, or belongs to another problem."""


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
            raise ChainFileError(f"{self.path}: {NO_LIBRARY}") from None
        if not self.path.exists():
            return None
        content = read_bytes(self.path, MOST_MB)
        image = content[:-SEAL_LENGTH]
        if content[-SEAL_LENGTH:] != _seal(image):
            raise ChainFileError(f"{self.path}: {NO_CHAIN}")
        try:
            with h5py.File(io.BytesIO(image), "r") as file:
                group = file[GROUP]
                if group.attrs[PROBLEM] != self.problem:
                    raise ChainFileError(f"{self.path}: {OTHER_PROBLEM}")
                goal = int(group.attrs[GOAL])
                if accuracy > float(group.attrs[ACCURACY]):
                    goal = 0
                return StoredChain(_backend(group, shape, len(image)), goal)
        except ChainFileError:
            raise
        except REFUSED as error:
            raise ChainFileError(f"{self.path}: {NO_CHAIN}") from error

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
    with h5py.File("chain", "w", driver="core", backing_store=False, block_size=GROWS_BY) as file:
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


def autocorrelation_time(x: Array) -> Array:
    """Steps between independent samples: ``1 + 2 sum rho(t)``, summed over Sokal's window.

    Autocovariances are about the mean of all walkers, so that walkers stuck in different places
    count as correlated for ever.

    Args:
        x: Chain (steps, walkers, d).

    Returns:
        One time a parameter (d,), in steps; inf for a parameter that never moves.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    steps = len(x)
    y = x - x.mean(axis=(0, 1))
    # Twice the length: else the transform would wrap the end of the chain around to its head.
    length = next_fast_len(2 * steps, real=True)
    spectrum = (np.abs(rfft(y, length, axis=0)) ** 2).mean(axis=1)
    covariance = irfft(spectrum, length, axis=0)[:steps]
    still = covariance[0] <= 0
    times = 2.0 * np.cumsum(covariance / np.where(still, 1.0, covariance[0]), axis=0) - 1.0
    beyond = np.arange(steps)[:, None] >= ENOUGH.window * times
    last = np.where(beyond.any(axis=0), beyond.argmax(axis=0), steps - 1)
    return np.where(still, np.inf, np.maximum(times[last, np.arange(times.shape[1])], 1.0))


def split_r_hat(x: Array) -> Array:
    """Potential scale reduction: whether parts of a chain agree.

    ``sqrt((W (n-1)/n + B) / W)`` with W the mean variance within the parts and B the variance of
    their means. The four parts are the first and second half of the steps, of each half of the
    walkers.

    Args:
        x: Chain (steps, walkers, d).

    Returns:
        One number a parameter (d,), near one where the parts agree; inf for a parameter that never
        moves.
    """
    n = len(x) // 2
    w = x.shape[1] // 2
    halves = (slice(None, w), slice(-w, None))
    parts = np.stack([part[:, half] for part in (x[:n], x[-n:]) for half in halves])
    flat = parts.reshape(4, n * w, x.shape[-1])
    within = flat.var(axis=1, ddof=1).mean(axis=0)
    between = flat.mean(axis=1).var(axis=0, ddof=1)
    still = within <= 0
    ratio = np.sqrt(1 - 1 / (n * w) + between / np.where(still, 1.0, within))
    return np.where(still, np.inf, ratio)


def std_error(x: Array) -> Array:
    """Monte-Carlo standard error of a chain's standard deviations, relative to them.

    The variance of the mean of N squared deviations y^2 is ``2 std^4 tau/N`` for a near-normal
    parameter, with the autocorrelation time tau of the squared deviations themselves; for others
    the factor 2 is the measured ``E y^4/E^2 y^2 - 1``.

    Args:
        x: Chain (steps, walkers, d).

    Returns:
        One number a parameter (d,).
    """
    squares = (x - x.mean(axis=(0, 1))) ** 2
    mean = squares.mean(axis=(0, 1))
    relative = squares.var(axis=(0, 1)) / np.where(mean > 0, mean, 1.0) ** 2
    excess = np.maximum(relative, ENOUGH.least_excess)
    return 0.5 * np.sqrt(excess * autocorrelation_time(squares) / np.prod(x.shape[:2]))


class UnconvergedError(RuntimeError):
    """The chain did not become as long as its autocorrelation time and the accuracy ask for."""


@dataclass(frozen=True)
class Demand:
    """When a chain is long enough.

    Attributes:
        accuracy: Monte-Carlo standard error of every standard deviation, relative to it, at most.
        length: Autocorrelation times, at least.
        most: Limit on the number of steps.
    """

    accuracy: float = 0.01
    length: float = 50.0
    most: int = 60_000


class Density(Protocol):
    """What is sampled, in coordinates that suit the sampler."""

    def log_density(self, x: Array) -> Array:
        """Logarithm (n,) of the density of coordinates (n, d), up to a constant."""

    def parameters(self, x: Array) -> Array:
        """Parameters (..., d) at coordinates (..., d)."""


@dataclass(frozen=True, eq=False)
class Chain:
    """A converged chain.

    Attributes:
        samples: Parameters (steps, walkers, d), burn-in removed.
        tau: Integrated autocorrelation times (d,), in steps.
        r_hat: Split-chain potential scale reductions (d,).
        steps: Length of the whole chain.
    """

    samples: Array
    tau: Array
    r_hat: Array
    steps: int


def run_chain(
    density: Density,
    start: Array,
    seed: int,
    demand: Demand,
    *,
    file: ChainFile | None = None,
    progress: Callable[[int], object] = no_progress,
) -> Chain:
    """Sample a density with emcee until the chain is long enough.

    A chain that was killed, or ended at the limit, is resumed up to the length at which it was to
    be checked next, so that it ends as if it had never stopped.

    Args:
        density: What is sampled; convergence is that of its parameters, not of its coordinates.
        start: Coordinates of the walkers (walkers, d), walkers even and at least 2 d.
        seed: Of the random numbers.
        demand: When the chain is long enough.
        file: Where the chain is kept; a chain that it holds already is resumed.
        progress: Called with the number of steps so far.

    Raises:
        UnconvergedError: The limit was reached first; a chain that is kept can be resumed.
        ChainFileError: The file cannot be resumed from.
        OSError: The file cannot be written.
    """
    stored = None if file is None else file.load(demand.accuracy, (start.shape[0], start.shape[1]))
    sampler, state = _begin(density, start, seed, stored)
    goal = max(0 if stored is None else stored.goal, sampler.iteration, ENOUGH.block)
    run = _Run(sampler, file, demand.accuracy, progress)
    while True:
        state = run.advance(state, goal, demand.most)
        found = _assess(density, sampler, demand)
        if isinstance(found, Chain):
            return found
        if sampler.iteration >= demand.most:
            message = f"the chain did not converge in {sampler.iteration} steps; allow more steps"
            raise UnconvergedError(message)
        goal = found


def _begin(
    density: Density, start: Array, seed: int, stored: StoredChain | None
) -> tuple["emcee.EnsembleSampler", "emcee.State | None"]:
    """A sampler, and the state from which it starts; None where it resumes a stored chain."""
    import emcee

    sampler = emcee.EnsembleSampler(
        *start.shape,
        density.log_density,
        # For the near-normal posteriors of calibrations, differential evolution decorrelates three
        # times as fast as the stretch move, at the same cost, and is as indifferent to scales and
        # correlations.
        moves=emcee.moves.DEMove(sigma=0.1),
        # All walkers at once: measured to be 12 times as fast as emcee's pool of processes, two of
        # which mostly wait.
        vectorize=True,
        backend=None if stored is None else stored.backend,
    )
    # emcee's own wrapper prints a traceback on standard output where a user interrupts it.
    sampler.log_prob_fn = density.log_density
    if stored is not None:
        return sampler, None
    sampler.random_state = np.random.RandomState(seed).get_state()
    return sampler, emcee.State(start, random_state=sampler.random_state)


@dataclass(eq=False)
class _Run:
    """A sampler that reports its progress, and writes its chain as often as that costs little."""

    sampler: "emcee.EnsembleSampler"
    file: ChainFile | None
    accuracy: float
    progress: Callable[[int], object]
    last_save: float = field(default_factory=monotonic)
    save_duration: float = 0.0

    def advance(self, state: "emcee.State | None", goal: int, most: int) -> "emcee.State | None":
        """Sample up to the goal, or the limit where that comes first; returns the last state."""
        end = min(goal, most)
        while self.sampler.iteration < end:
            steps = min(ENOUGH.block, end - self.sampler.iteration)
            state = self.sampler.run_mcmc(state, steps, skip_initial_state_check=True)
            self.progress(self.sampler.iteration)
            waited = monotonic() - self.last_save
            if self.sampler.iteration >= end or waited > ENOUGH.save_share * self.save_duration:
                self._save(goal)
        return state

    def _save(self, goal: int) -> None:
        if self.file is None:
            return
        before = monotonic()
        self.file.save(StoredChain(self.sampler.backend, goal), self.accuracy)
        self.last_save = monotonic()
        self.save_duration = self.last_save - before


def _assess(density: Density, sampler: "emcee.EnsembleSampler", demand: Demand) -> Chain | int:
    """The chain if it is long enough, and else the length that it should have."""
    n = sampler.iteration
    if n < ENOUGH.block:
        return ENOUGH.block
    x = density.parameters(sampler.get_chain())
    tau = autocorrelation_time(x)
    longest = tau.max()
    # A chain so short that ten times tau is most of it keeps its second half.
    burn = int(np.ceil(min(ENOUGH.burn * longest, n / 2)))
    kept = x[burn:]
    error = std_error(kept).max()
    r_hat = split_r_hat(kept)
    if n > demand.length * longest and error <= demand.accuracy and r_hat.max() < ENOUGH.most_r_hat:
        return Chain(kept, tau, r_hat, n)
    # The error falls with the root of the number of steps that are kept.
    for_accuracy = burn + (n - burn) * (error / demand.accuracy) ** 2
    need = max(for_accuracy, demand.length * longest)
    return int(np.clip(ENOUGH.margin * need, ENOUGH.least_growth * n, ENOUGH.most_growth * n))
