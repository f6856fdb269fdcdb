"""Where to put the tracker: the place that `edtk plan --place-tracker` finds, beside random ones.

For each of three cells the tracker may stand in a box. The place and the plan that are chosen
together are compared with 200 random places of the box. The best weights on the candidates rank
these; at the best of them the plan of whole experiments is searched. The page placed_tracker.md has
the table.

    python studies/placed_tracker.py [number of places]
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import edtk
from edtk.report.tables import markdown_table
from edtk.study.place_tracker import Setup
from edtk.study.study import Study
from edtk.system.errors import UserError

HERE = Path(__file__).parent
PAGE = Path(__file__).with_suffix(".md")
PLACES = 200
SEARCHED = 12  # of these, the best by weights
SEED = 1
# Data sheet of a laser tracker with an absolute distance meter: largest permissible errors.
TRACKER = {"along": [10, 0.4], "across": [15, 6]}
HEADER = (
    "cell",
    "m",
    "place [mm]",
    "value",
    "best of 200",
    "better by [%]",
    "12th by [%]",
    "median by [%]",
    "worst by [%]",
    "seconds",
)


def cells() -> Iterator[tuple[str, int, Study]]:
    """Name, size and study of each cell; its tracker stands in a corner of its box."""
    kr270 = edtk.load_study(HERE / "kr270_milling.toml")
    yield "KR 270, milling", 12, _boxed(kr270, [[2500, -3000, 300], [5000, 3000, 2500]])
    palletiser = edtk.load_study(HERE / "palletiser.toml")
    yield "palletiser, three loads", 8, _boxed(palletiser, [[-1000, 3200, 200], [4000, 6000, 2500]])
    wrist = edtk.load_study(HERE / "kr270_six_compliances.toml")
    placed = _boxed(wrist, [[3500, -4000, 300], [8000, 4000, 2500]])
    geometry: dict[str, Any] = {
        "joints": {"unknown": ["q2", "q3"]},
        "parameters": {"geometry": ["zeros"], "compliance": ["q2", "q3"], "base": False},
        "optimise": ["A"],
        "criteria": ["A"],
    }
    yield "KR 270, zeros and two springs", 16, placed.replace(**geometry)


def _boxed(study: Study, box: list[list[float]]) -> Study:
    """The study with a tracker that may stand in a box [mm]."""
    noise = TRACKER | {"tracker_position_mm": box[1], "tracker_box_mm": box}
    return study.replace(noise=noise)


@dataclass(frozen=True)
class Compared:
    """A placed plan beside random places.

    Attributes:
        name: The cell.
        size: Number of experiments.
        placed: The plan with its place.
        plans: Costs of the best plans at those of the random places that were searched.
        weights: Costs of the best weights on the candidates at each of them, of as many
            experiments.
        seconds: Time of a processor for the placed plan.
    """

    name: str
    size: int
    placed: edtk.ExactPlan
    plans: np.ndarray[Any, Any]
    weights: np.ndarray[Any, Any]
    seconds: float

    def cells(self) -> tuple[str, ...]:
        """A line of the table."""
        assert self.placed.placement is not None
        factor, unit = self.placed.relaxed.criterion.shown
        sense = self.placed.relaxed.criterion.sense
        best = self.plans.min()
        both = [x if sense == "min" else 1 / x for x in (self.placed.cost, best)]
        values = [f"{factor * x:.6g} {unit}".rstrip() for x in both]
        # Weights and plans differ by the same few percent everywhere: the best has its plan.
        spread = best * np.quantile(self.weights, [0.5, 1]) / self.weights.min()
        worse = 100 * (np.array([best, self.plans.max(), *spread]) / self.placed.cost - 1)
        place = ", ".join(f"{1e3 * x:.0f}" for x in self.placed.placement.position)
        return (
            self.name,
            f"{self.size}",
            place,
            *values,
            *(f"{x:.2f}" for x in worse),
            f"{self.seconds:.0f}",
        )


def compared(name: str, size: int, study: Study, places: int) -> Compared:
    """Place the tracker, and look at random places."""
    since = process_time()
    placed = edtk.plan(study, size, place_tracker=True, workers=1)
    seconds = process_time() - since
    studies = list(_at_random(study, places))
    weights = np.array([edtk.relax(one, workers=1).cost for one in studies]) / size
    first = np.argsort(weights)[:SEARCHED]
    plans = np.array([edtk.plan(studies[i], size, workers=1).cost for i in first])
    return Compared(name, size, placed, plans, weights, seconds)


def _at_random(study: Study, places: int) -> Iterator[Study]:
    """The study with its tracker at random places of the box, where one can stand."""
    assert study.specification.noise is not None
    box = np.array(study.specification.noise.tracker_box_mm) / 1e3
    rng = np.random.default_rng(SEED)
    while places:
        try:
            yield Setup(rng.uniform(*box), {}).of(study)
        except UserError:
            continue
        places -= 1


def page(rows: list[Compared], places: int) -> str:
    """The page of all cells."""
    return f"""\
# Where to put the tracker

`python studies/placed_tracker.py` wrote this file. In three cells a laser tracker may stand in a
box; its errors grow with the distance, along the beam and across it. `edtk plan --place-tracker`
chooses place and poses together. Beside it stand {places} random places of the box, ranked by the
best weights on the study's candidates. At the {SEARCHED} best of them the plan of whole experiments
is searched as `edtk plan` does; "best of 200" is the best of these plans. "Better by" says how much
more it costs than the chosen place and plan, "12th by" the worst of these {SEARCHED} plans;
"median by" and "worst by" say it of all random places, by their weights. Seconds are of a
processor, for the chosen place and plan.

{markdown_table(HEADER, [row.cells() for row in rows])}
"""


def main(arguments: Sequence[str]) -> int:
    """Compare all cells, and write the page."""
    places = int(arguments[0]) if arguments else PLACES
    rows = []
    with threadpool_limits(1):
        for name, size, study in cells():
            rows.append(compared(name, size, study, places))
            print(*rows[-1].cells(), sep=" | ", flush=True)
    PAGE.write_text(page(rows, places), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
