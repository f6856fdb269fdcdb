"""What every candidate would be worth at a place of a plan, kept up to date from place to place."""

from abc import ABC, abstractmethod

import numpy as np

from criteria.linalg.inverse import EPS
from edtk.design.exact.counts.limits import Limits
from edtk.system.typing import Array, Indices, Mask

GAIN = 1e-10  # relative improvement that counts: less than this may be rounding
# Roundings that a cost may be wrong by, of a plan that is regular by its ridge alone.
ROUNDINGS = 64.0


def least_gain(ridge: float) -> float:
    """Relative improvement that counts beside a ridge, which may be all that a plan tells.

    Its condition number is then one over the ridge, and so much larger are roundings of its cost:
    exchanges that "improve" it by these go on for ever.
    """
    return max(GAIN, ROUNDINGS * EPS / ridge) if ridge else GAIN


def first_of_largest(values: Array, scale: Array, part: Array | float = GAIN) -> Indices:
    """The first (b,) of values (b, n) that is the largest but for what may be rounding.

    Symmetric candidates are worth the same. Which of them is taken shall not depend on last digits,
    which differ from one machine to another.

    Args:
        values: The values.
        scale: Sizes (b,) of the numbers whose rounding they have.
        part: Part of these sizes (b,) that may be rounding.
    """
    least = values.max(axis=1) - part * scale
    return np.asarray((values >= least[:, None]).argmax(axis=1))


def first_lowest(costs: Array, part: float = GAIN) -> int:
    """The first of costs (n,) that is the lowest but for a part of it that may be rounding."""
    return int(first_of_largest(-costs[None], np.abs(costs.min(keepdims=True)), part)[0])


def first_few_largest(values: Array, size: int, part: float = GAIN) -> Indices:
    """So many of values (b, n) that are the largest, of those alike but for rounding the first.

    Args:
        values: The values, of each row in parts of whose largest size the rounding is.
        size: How many, fewer than n.
        part: Part of these sizes that may be rounding.

    Returns:
        Where they are (b, size), ascending.
    """
    least = np.partition(values, -size, axis=1)[:, -size, None]
    finite = np.where(np.isfinite(values), np.abs(values), 0.0)
    rounding = part * finite.max(axis=1, keepdims=True)
    larger = values > least + rounding
    alike = values >= least - rounding
    alike &= ~larger
    room = size - larger.sum(axis=1, keepdims=True)
    chosen = larger | (alike & (alike.cumsum(axis=1) <= room))
    return np.asarray(chosen.nonzero()[1].reshape(len(values), size))


class Prices(ABC):
    """The best candidate for one place after another, of several plans at once.

    The object belongs to plans on their way: `replace` tells it what was exchanged.

    Attributes:
        part: Part of what each plan (b,), or any, is worth that may be rounding.
    """

    part: Array | float

    @abstractmethod
    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """Find the best candidate for a place of each plan.

        Args:
            place: The place.
            allowed: Candidates (b, n) that may take it; None for all.

        Returns:
            Candidates (b,), and how much each would improve its plan (b,): the relative decrease
            of the cost or of the determinant, whichever the criterion has.
        """

    @abstractmethod
    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Take over an exchange that `best` has found, right after it.

        Args:
            which: Plans (k,) in which the place was exchanged.
            place: The place.
            new: The candidates (k,) that took it.
        """


class Pricing(ABC):
    """Makes `Prices` of plans: the problem, the criterion and the limits, ready for use.

    Attributes:
        candidates: Number of candidates n, without the empty place.
        batch: Number of plans whose arrays stay in a core's cache.
        rounds: Numbers of candidates that are looked at, in turn; the last one is all of them.
        wave: Number of starts that are improved in step with each other.
        together: Number of plans that are kicked in step, where there are fewer starts.
        kicks: How often a search kicks each of its plans out of a local optimum.
        patience: Starts without an improvement that a search makes at least, time permitting.
        guide: Prices of a smooth criterion, under which every other wave of starts is improved
            first; None where that is no help.
    """

    candidates: int
    batch: int
    rounds: tuple[int, ...]
    wave: int = 64
    together: int = 96
    kicks: int
    patience: int
    guide: "Pricing | None" = None

    @abstractmethod
    def prices(self, places: Indices, ridge: float, size: int) -> Prices:
        """Prices of plans, computed anew.

        Args:
            places: Candidates (b, m) at the places of b plans.
            ridge: Part of the candidates' mean information, for each place, that is added to every
                plan: a singular plan then has prices too.
            size: One of `rounds`.
        """

    @abstractmethod
    def scores(self, places: Indices, ridge: float) -> Array:
        """Numbers (b,) that are the smaller, the better a plan (b, m) is, with the same ridge."""

    def search_from(
        self, rng: np.random.Generator, places: Indices, ridge: float
    ) -> Indices | None:
        """The plan (m,) that a search of its own makes of a start (m,).

        Returns:
            The plan; None where descents and kicks of many plans in step with each other do it.
        """
        return None

    def brief(self) -> "Pricing":
        """Prices for a search whose plans move afterwards: these, or quicker ones."""
        return self

    @abstractmethod
    def effort(self, limits: Limits) -> float:
        """About how many products a start takes, all its sweeps and kicks together."""
