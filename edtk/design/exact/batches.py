"""Batches of a search for exact plans, whose descents are done side by side."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edtk.design.exact.batch import Batch
from edtk.design.exact.descent import Answer, Descent
from edtk.design.exact.kicks import Kicks
from edtk.design.exact.plans import Plans
from edtk.design.exact.refine import refine
from edtk.system.one_thread import one_thread
from edtk.system.time_limit import time_limit


@dataclass(frozen=True, eq=False)
class Batches:
    """A piece of work whose answer depends on its batches alone, wherever it is done.

    A step of a descent is some hundred array operations, which take as long for a few small plans
    as for many. The batches therefore take their steps together. What a plan comes to does not
    depend on its company: no operation mixes plans.

    Attributes:
        batches: The batches, or the kicks that end a search, of one design space and criterion,
            with plans of one shape.
        seconds: Time [s] from the call after which the best plans so far are returned.
    """

    batches: tuple[Batch | Kicks, ...]
    seconds: float = np.inf

    def __call__(self) -> list[Answer]:
        """The answer of each batch: costs (e,) of plans, the best first, and the plans."""
        # The rounding of a product may depend on the number of threads, and so would the plan.
        with one_thread(), time_limit(self.seconds):
            return self._run()

    def _run(self) -> list[Answer]:
        """Do the descents that the batches ask for, until each has its answer."""
        searches = [batch.search() for batch in self.batches]
        answers: dict[int, Answer] = {}
        asked: dict[int, Descent] = {}

        def go_on(i: int, end: Answer | None) -> None:
            try:
                # A generator begins where None is sent.
                asked[i] = searches[i].send(end)  # type: ignore[arg-type]
            except StopIteration as done:
                answers[i] = done.value

        for i in range(len(searches)):
            go_on(i, None)
        while asked:
            # Batches go through the same stages, so that this is all of them most of the time.
            effort = next(iter(asked.values())).effort
            now = [i for i, descent in asked.items() if descent.effort == effort]
            ends = self._refined([asked.pop(i) for i in now])
            for i, end in zip(now, ends, strict=True):
                go_on(i, end)
        return [answers[i] for i in range(len(searches))]

    def _refined(self, descents: Sequence[Descent]) -> list[Answer]:
        """Costs and plans after descents of the same effort."""
        first = self.batches[0]
        x = np.concatenate([descent.plans.x for descent in descents])
        repeats = np.concatenate([descent.plans.repeats for descent in descents])
        effort = descents[0].effort
        x, costs = refine(
            first.space, first.criterion, x, repeats, effort.iterations, effort.sharpness
        )
        ends = np.cumsum([len(descent.plans.x) for descent in descents])[:-1]
        parts = zip(np.split(costs, ends), np.split(x, ends), np.split(repeats, ends), strict=True)
        return [(own, Plans(places, times)) for own, places, times in parts]
