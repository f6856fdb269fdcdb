"""Runs emcee's ensemble until its answers are as accurate as asked, or refuses."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import monotonic
from typing import TYPE_CHECKING, Protocol

import numpy as np

from edtk.fit.chain_file import ChainFile, StoredChain
from edtk.system.time_limit import no_progress
from edtk.system.typing import Array

if TYPE_CHECKING:
    import emcee

# Sokal's window: autocorrelations are summed up to the first lag beyond so many autocorrelation
# times. A longer window adds noise, a shorter one leaves correlation out.
WINDOW = 5.0
# Least excess of the variance of squared deviations. Normal samples have 2; a chain that jumps
# between two points has 0, which would make its error zero.
LEAST_EXCESS = 1e-3
# Steps between two reports of progress, and the least length that is checked for convergence.
BLOCK = 500
# Threshold of Vehtari et al. (2021).
MOST_R_HAT = 1.01
# Autocorrelation times that are dropped from the head; walkers start near the posterior.
BURN = 10.0
# Writing the chain to its file takes at most one part in so many of the time.
SAVE_SHARE = 10
# Where a chain is too short, its next length is the one predicted and a little more, for the
# prediction scatters; but at least and at most so many times the present one.
MARGIN = 1.05
LEAST_GROWTH = 1.2
MOST_GROWTH = 2


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
    beyond = np.arange(steps)[:, None] >= WINDOW * times
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
    excess = np.maximum(relative, LEAST_EXCESS)
    return 0.5 * np.sqrt(excess * autocorrelation_time(squares) / np.prod(x.shape[:2]))


class UnconvergedError(RuntimeError):
    """The chain did not become as long as its autocorrelation time and the accuracy ask for.

    Attributes:
        steps: Its length, the limit.
    """

    def __init__(self, steps: int) -> None:
        super().__init__(steps)
        self.steps = steps

    def __str__(self) -> str:
        return f"the chain did not converge in {self.steps} steps; allow more steps"


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
    goal = max(0 if stored is None else stored.goal, sampler.iteration, BLOCK)
    run = _Run(sampler, file, demand.accuracy, progress)
    while True:
        state = run.advance(state, goal, demand.most)
        found = _assess(density, sampler, demand)
        if isinstance(found, Chain):
            return found
        if sampler.iteration >= demand.most:
            raise UnconvergedError(sampler.iteration)
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
            steps = min(BLOCK, end - self.sampler.iteration)
            state = self.sampler.run_mcmc(state, steps, skip_initial_state_check=True)
            self.progress(self.sampler.iteration)
            waited = monotonic() - self.last_save
            if self.sampler.iteration >= end or waited > SAVE_SHARE * self.save_duration:
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
    if n < BLOCK:
        return BLOCK
    x = density.parameters(sampler.get_chain())
    tau = autocorrelation_time(x)
    longest = tau.max()
    # A chain so short that ten times tau is most of it keeps its second half.
    burn = int(np.ceil(min(BURN * longest, n / 2)))
    kept = x[burn:]
    error = std_error(kept).max()
    r_hat = split_r_hat(kept)
    if n > demand.length * longest and error <= demand.accuracy and r_hat.max() < MOST_R_HAT:
        return Chain(kept, tau, r_hat, n)
    # The error falls with the root of the number of steps that are kept.
    for_accuracy = burn + (n - burn) * (error / demand.accuracy) ** 2
    need = max(for_accuracy, demand.length * longest)
    return int(np.clip(MARGIN * need, LEAST_GROWTH * n, MOST_GROWTH * n))
