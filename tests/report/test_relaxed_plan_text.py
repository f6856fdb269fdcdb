"""What is printed of weights over poses."""

from pathlib import Path

import edtk

STUDY = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"


def test_of_thousands_of_weights_the_heaviest_are_printed() -> None:
    """A search that is cut off leaves a weight on nearly every candidate."""
    found = edtk.relax(STUDY, "D", candidates=2000, budget=1e-3)
    assert len(found.weights) > 60
    *_, header, first, last, more = [found.summary().splitlines()[i] for i in (0, -62, -61, -2, -1)]
    assert header.startswith("weight")
    assert float(first.split()[0]) >= float(last.split()[0])
    assert more.startswith(f"... and {len(found.weights) - 60} more, 0.")
    assert more.endswith(" together, in --json or --out")
