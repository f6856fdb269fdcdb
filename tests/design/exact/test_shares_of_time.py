"""How a search of several sets of loads shares out its time, with a clock of its own."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from edtk.design.exact.day_search import DaySearch
from edtk.system import time_limit

LOADS = ((0, 1), (0,), (1,))


@dataclass
class Clock:
    """Seconds that pass where somebody says so."""

    now: float = 0.0

    def __call__(self):
        """The time."""
        return self.now


@dataclass(frozen=True)
class Trial:
    """What a set of loads has found in some seconds: a bound that rises to the best plan."""

    best: float
    seconds: float
    ended: str
    interrupted: bool = False

    @property
    def bound(self):
        """It rises to the best plan's cost."""
        return SimpleNamespace(cost=self.best * (1 - 0.5 / (1 + self.seconds)))

    @property
    def found(self):
        """A plan whose cost falls to the best."""
        return SimpleNamespace(cost=self.best * (1 + 0.5 / (1 + self.seconds)), ended=self.ended)

    def or_better(self, earlier):
        """The longer one of two."""
        return max(self, earlier or self, key=lambda one: one.seconds)


class Search(DaySearch):
    """A search whose sets need some seconds each."""

    def __init__(self, clock, needs, best):
        object.__setattr__(self, "clock", clock)
        object.__setattr__(self, "needs", needs)
        object.__setattr__(self, "best", best)
        object.__setattr__(self, "log", [])

    def _trial(self, loads, funds, least=float("inf")):
        seconds = min(self.needs[loads], time_limit.time_left())
        self.clock.now += seconds
        self.log.append((loads, seconds))
        ended = "starts" if seconds == self.needs[loads] else "budget"
        return Trial(self.best[loads], seconds, ended)


def searched(monkeypatch, seconds, needs=(9, 1, 1), best=(1.0, 1.1, 1.2)):
    """The log, the trials and the end of a search of so many seconds."""
    clock = Clock()
    monkeypatch.setattr(time_limit, "monotonic", clock)
    search = Search(
        clock, dict(zip(LOADS, needs, strict=True)), dict(zip(LOADS, best, strict=True))
    )
    trials = {loads: Trial(search.best[loads], 0.0, "budget") for loads in LOADS}
    with time_limit.time_limit(seconds):
        ended = search._search_all(dict.fromkeys(LOADS, 10.0), trials)
    return search.log, trials, ended


def test_time_that_others_leave_goes_to_the_set_that_needs_it(monkeypatch):
    """The first of three sets has a third of the time, and in a second turn all that is left."""
    log, trials, ended = searched(monkeypatch, 12.0)
    assert log == [((0, 1), 4.0), ((0,), 1.0), ((1,), 1.0), ((0, 1), 6.0)]
    assert ended == "budget"
    assert trials[(0, 1)].seconds == 6.0
    log, _, ended = searched(monkeypatch, 20.0)
    assert log[3:] == [((0, 1), 9.0)]
    assert ended == ""  # it came to its end
    assert len(searched(monkeypatch, 30.0)[0]) == 3


def test_a_turn_that_would_be_no_longer_is_left_out(monkeypatch):
    """Where two sets need more than there is, what is left is too little for either."""
    log, _, ended = searched(monkeypatch, 12.0, needs=(9, 9, 3))
    assert log == [((0, 1), 4.0), ((0,), 4.0), ((1,), 3.0)]
    assert ended == "budget"


def test_a_longer_search_of_the_same_sets_is_no_worse(monkeypatch):
    """The best plan improves with the time, whatever the sets need."""
    told = []
    for seconds in np.linspace(0.5, 40, 80):
        _, trials, _ = searched(monkeypatch, seconds, needs=(9, 4, 7), best=(1.0, 1.01, 1.02))
        told.append(min(one.found.cost for one in trials.values()))
    assert (np.diff(told) <= 1e-12).all()
