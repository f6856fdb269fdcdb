"""Runs emcee's ensemble until its answers are as accurate as asked, or refuses."""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import emcee
import numpy as np
from numpy.typing import NDArray

from edtk.inference.chain_file import ChainFile
from edtk.inference.convergence import autocorrelation_time, split_r_hat, std_error

Array = NDArray[np.float64]

BLOCK = 500  # steps between two looks at the clock
MOST_R_HAT = 1.01
BURN = 10.0  # autocorrelation times that are dropped from the head


class UnconvergedError(RuntimeError):
    """The chain did not reach the length that its autocorrelation time and the accuracy ask for."""


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
    log_density: Callable[[Array], Array],
    view: Callable[[Array], Array],
    start: Array,
    seed: int,
    demand: Demand,
    file: ChainFile | None = None,
    progress: Callable[[int], object] = lambda steps: None,
) -> Chain:
    """Sample a density with emcee's differential-evolution move.

    For the near-normal posteriors of calibrations that move decorrelates three times as fast as the stretch move,
    at the same price, and it is as indifferent to scales and correlations. The density is evaluated for all walkers at
    once: that was measured to be 12 times as fast as emcee's pool of processes, two of which mostly wait.

    A chain that was killed, or ended at the limit, goes on to the length it was to have when it is next judged, so that
    it ends as if it had never stopped.

    Args:
        log_density: Logarithm (n,) of the density of coordinates (n, d).
        view: Parameters (..., d) of coordinates (..., d); convergence is judged by parameters.
        start: Coordinates of the walkers (walkers, d), walkers even and at least 2 d.
        seed: Of the random numbers.
        demand: When it is long enough.
        file: Where the chain is kept; what is there already is gone on from.
        progress: Called with the number of steps so far.

    Raises:
        UnconvergedError: The limit was reached first; a chain that is kept can be gone on with.
        ChainFileError: The file cannot be gone on from.
        OSError: The file cannot be written.
    """
    kept = file.load(demand.accuracy) if file is not None else None
    backend, goal = (None, 0) if kept is None else kept
    move = emcee.moves.DEMove(sigma=0.1)
    sampler = emcee.EnsembleSampler(
        *start.shape, log_density, moves=move, vectorize=True, backend=backend
    )
    state = None
    if backend is None:
        sampler.random_state = np.random.RandomState(seed).get_state()
        state = emcee.State(start, random_state=sampler.random_state)
    goal, saved, price = max(goal, sampler.iteration, BLOCK), monotonic(), 0.0
    while True:
        end = min(goal, demand.most)
        while sampler.iteration < end:
            state = sampler.run_mcmc(
                state, min(BLOCK, end - sampler.iteration), skip_initial_state_check=True
            )
            progress(sampler.iteration)
            if file is not None and (sampler.iteration >= end or monotonic() - saved > 10 * price):
                before = monotonic()
                file.save(sampler.backend, goal, demand.accuracy)
                saved = monotonic()
                price = saved - before
        found, longer = _judge(view, sampler, demand)
        if found is not None:
            return found
        if sampler.iteration >= demand.most:
            raise UnconvergedError(
                f"the chain did not converge in {sampler.iteration} steps; allow more steps"
            )
        goal = longer


def _judge(
    view: Callable[[Array], Array], sampler: emcee.EnsembleSampler, demand: Demand
) -> tuple[Chain | None, int]:
    """The chain if it is long enough, and else how long it should become."""
    n = sampler.iteration
    if n < BLOCK:
        return None, BLOCK
    x = view(sampler.get_chain())
    tau = autocorrelation_time(x)
    burn = int(np.ceil(min(BURN * tau.max(), n / 2)))
    kept = x[burn:]
    error, r_hat = std_error(kept).max(), split_r_hat(kept)
    if n > demand.length * tau.max() and error <= demand.accuracy and r_hat.max() < MOST_R_HAT:
        return Chain(kept, tau, r_hat, n), n
    need = max(burn + (n - burn) * (error / demand.accuracy) ** 2, demand.length * tau.max())
    return None, int(np.clip(1.05 * need, 1.2 * n, 2 * n))
