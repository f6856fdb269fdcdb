"""Has an ensemble's chain run for long enough?"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

Array = NDArray[np.float64]

WINDOW = (
    5.0  # Sokal's: sum autocorrelations up to the first lag beyond so many autocorrelation times
)


def autocorrelation_time(x: Array) -> Array:
    """Integrated autocorrelation time ``1 + 2 sum rho(t)`` in steps, summed over Sokal's automatic window.

    Autocovariances are about the mean of all walkers, so that walkers stuck in different places count as correlated
    for ever.

    Args:
        x: Chain (steps, walkers, d).

    Returns:
        One time per parameter (d,); inf for a parameter that never moves.
    """
    steps = len(x)
    y = x - x.mean(axis=(0, 1))
    spectrum = (np.abs(rfft(y, next_fast_len(2 * steps, real=True), axis=0)) ** 2).mean(axis=1)
    covariance = irfft(spectrum, next_fast_len(2 * steps, real=True), axis=0)[:steps]
    still = covariance[0] <= 0
    times = 2.0 * np.cumsum(covariance / np.where(still, 1.0, covariance[0]), axis=0) - 1.0
    beyond = np.arange(steps)[:, None] >= WINDOW * times
    last = np.where(beyond.any(axis=0), beyond.argmax(axis=0), steps - 1)
    return np.where(still, np.inf, np.maximum(times[last, np.arange(times.shape[1])], 1.0))


def split_r_hat(x: Array) -> Array:
    """Potential scale reduction of four parts: first and second half of the steps, of each half of the walkers.

    ``sqrt((W (n-1)/n + B) / W)`` with W the mean variance within the parts and B the variance of their means.

    Args:
        x: Chain (steps, walkers, d).

    Returns:
        One number per parameter (d,), near one where the parts agree; inf for a parameter that never moves.
    """
    n, w = len(x) // 2, x.shape[1] // 2
    parts = np.stack(
        [part[:, half] for part in (x[:n], x[-n:]) for half in (slice(None, w), slice(-w, None))]
    )
    flat = parts.reshape(4, n * w, x.shape[-1])
    within = flat.var(axis=1, ddof=1).mean(axis=0)
    between = flat.mean(axis=1).var(axis=0, ddof=1)
    still = within <= 0
    return np.where(
        still, np.inf, np.sqrt(1 - 1 / (n * w) + between / np.where(still, 1.0, within))
    )


def std_error(x: Array) -> Array:
    """Monte-Carlo standard error (d,) of the standard deviations of a chain (steps, walkers, d), relative to them.

    The variance of the mean of N squared deviations is ``2 std^4 tau/N`` for a near-normal parameter, with the
    autocorrelation time tau of the squared deviations themselves; for others the factor 2 is the measured
    ``E y^4/E^2 y^2 - 1``.
    """
    squares = (x - x.mean(axis=(0, 1))) ** 2
    mean = squares.mean(axis=(0, 1))
    excess = np.maximum(squares.var(axis=(0, 1)) / np.where(mean > 0, mean, 1.0) ** 2, 1e-3)
    return 0.5 * np.sqrt(excess * autocorrelation_time(squares) / np.prod(x.shape[:2]))
