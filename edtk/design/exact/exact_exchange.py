"""The best exchange of one experiment of a plan for any of many candidates, by cutting planes.

Every multiplier Z bounds the merit of the rest R of a plan with candidate i by
``<Z, R> + <Z, M_i>`` (see `Merits`), which is one product of matrices for all candidates. Those of
the largest bounds are evaluated, and bring multipliers that are sharp where they are; candidates
whose bound is no better than the best one so far are out (Kelley 1960). So the exchange is the best
of all, though few candidates are ever evaluated, and that also at a kink, where the most sensitive
ones are not the best.
"""

from dataclasses import dataclass

import numpy as np

from edtk.design.exact.exact_nodes import Merits
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

EVALUATED = 64  # candidates that are evaluated together
CUTS = 4  # of these, those that bring a multiplier
CUT_ROUNDS = 40  # at most: where bounds are no nearer than that, the best so far is good enough
GAIN_OF_EXCHANGE = 1e-9  # relative improvement that counts


@dataclass(frozen=True, eq=False)
class Exchanged:
    """A plan after exchanges.

    Attributes:
        places: Which candidate each of its experiments (k,) has become; -1 where it stays.
        merit: Its merit.
    """

    places: Indices
    merit: float


def exchanged(merits: Merits, features: Array, merit: float) -> Exchanged:
    """Exchange experiments of a plan, one after another, until no single exchange improves it.

    Args:
        merits: Merits of plans of the candidates that may join, without budgets or limits.
        features: The plan's experiments (k, q), as `Merits.F`; they need not be candidates.
        merit: The plan's merit.
    """
    features = features.copy()
    k = len(features)
    places = -np.ones(k, dtype=int)
    settled = 0
    place = 0
    while settled < k and not out_of_time():
        rest = merits.K + features.sum(axis=0) - features[place]
        best, reached = _best(merits, rest, features[place], merit * (1.0 + GAIN_OF_EXCHANGE))
        settled += 1
        if best >= 0:
            places[place] = best
            features[place] = merits.F[best]
            merit = reached
            settled = 1
        place = (place + 1) % k
    return Exchanged(places, merit)


def _best(merits: Merits, rest: Array, own: Array, least: float) -> tuple[int, float]:
    """The candidate that makes the best plan of a rest (q,), and its merit.

    It is -1 where none makes one of a merit above `least`. The first multiplier is that of the
    experiment (q,) that is there.
    """
    left = np.arange(len(merits.F))
    bound = np.full(len(left), np.inf)
    near = own[None]
    found = -1
    for _ in range(CUT_ROUNDS):
        Z = merits.multipliers(merits.unpacked((rest + near) / merits.twice))
        # All of them are there at first; a copy would take most of the time.
        F = merits.F if len(left) == len(merits.F) else merits.F[left]
        bound = np.minimum(bound, np.nan_to_num(F @ Z.T + Z @ rest, nan=np.inf).min(axis=1))
        better = bound > least
        left, bound = left[better], bound[better]
        if not len(left):
            break
        top = np.argpartition(-bound, min(EVALUATED, len(left)) - 1)[:EVALUATED]
        top = top[np.argsort(-bound[top], kind="stable")]
        near = merits.F[left[top]]
        reached = merits.of(merits.unpacked((rest + near) / merits.twice))
        most = int(reached.argmax())
        if reached[most] > least:
            least = float(reached[most])
            found = int(left[top[most]])
        near = near[:CUTS]
        left, bound = np.delete(left, top), np.delete(bound, top)
    return found, least
