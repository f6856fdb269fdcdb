"""Shares of sheets by place, kept in a file, so that some places can be run again."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from fault_shares import PLANS, Cell, Shares
from faults import FAULTS

from edtk.system.files import write_text

PATH = Path(__file__).with_suffix(".json")


def key(cell: Cell) -> str:
    """The place in words."""
    kind = PLANS[cell.poses is None]
    return f"{cell.robot}; {FAULTS[cell.fault].title}; {kind} {cell.size} x {cell.repeats}"


def read(path: Path = PATH) -> dict[str, Shares]:
    """All shares that are known, by place."""
    if not path.exists():
        return {}
    content = json.loads(path.read_text(encoding="utf-8"))
    # JSON has no number for a share of nothing.
    return {
        place: Shares(**{name: float("nan") if x is None else x for name, x in shares.items()})
        for place, shares in content.items()
    }


def write(found: Mapping[str, Shares], path: Path = PATH) -> None:
    """Write all shares, a line each."""
    lines = []
    for place, shares in found.items():
        # A number that is not one is not equal to itself.
        values = {name: x if x == x else None for name, x in asdict(shares).items()}
        lines.append(f"  {json.dumps(place)}: {json.dumps(values)}")
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")
