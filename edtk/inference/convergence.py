"""Measures of how far the chain of an ensemble of walkers can be trusted."""

import numpy as np

from edtk.system.typing import Array

# Sokal's window: autocorrelations are summed up to the first lag beyond so many autocorrelation
# times. A longer window adds noise, a shorter one leaves correlation out.
WINDOW = 5.0

# Least excess of the variance of squared deviations. Normal samples have 2; a chain that jumps
# between two points has 0, which would make its error zero.
LEAST_EXCESS = 1e-3


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
