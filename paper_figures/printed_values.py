"""The numbers that the paper prints, read from `printed/`."""

import re
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from edtk.system.typing import Array

FOLDER = Path(__file__).parent / "printed"

# "3.336", or "3.294 (<0.01%)" with the loss.
CELL = re.compile(r"(?P<rho0>[0-9.]+)(?: \((?P<loss><?[0-9.]+)%\))?")


@dataclass(frozen=True)
class Table6Cell:
    """One filled cell of Table 6.

    Attributes:
        experiments: Number of experiments m.
        configurations: Number of different configurations k.
        rho0: Printed accuracy [1e-3 mm].
        loss: Printed loss against the full-dimensional plan [%], as text ("<0.01" occurs); empty
            if none.
    """

    experiments: int
    configurations: int
    rho0: float
    loss: str


@dataclass(frozen=True)
class Figure7Line:
    """One expectation in the caption of Fig. 7.

    Attributes:
        plan: Number of the plan's dots, "1" or "2a" to "2e".
        line: Number of its line, "3" or "4a" to "4e".
        configurations: Poses of the plan of Table 4; None for the random plan.
        expectation: Printed mean error [1e-3 mm].
    """

    plan: str
    line: str
    configurations: int | None
    expectation: float


def table_5() -> pd.DataFrame:
    """Table 5 [1e-9 rad/(N m)]: a row per number of experiments, a column per parameter."""
    return pd.read_csv(FOLDER / "table_5.csv", index_col="experiments")


def table_6_cells() -> tuple[tuple[str, ...], ...]:
    """Table 6 as printed, a tuple of texts per row, empty cells and dashes included."""
    table = pd.read_csv(FOLDER / "table_6.csv", dtype=str, keep_default_na=False)
    return tuple(tuple(str(cell) for cell in row) for row in table.to_numpy())


def table_6() -> tuple[Table6Cell, ...]:
    """The filled cells of Table 6 in reading order."""
    columns = pd.read_csv(FOLDER / "table_6.csv", nrows=0).columns[1:]
    found = []
    for experiments, *cells in table_6_cells():
        for configurations, cell in zip(columns, cells, strict=True):
            match = CELL.fullmatch(cell)
            if match is None:  # a dash, or nothing
                continue
            rho0 = float(match["rho0"])
            loss = match["loss"] or ""
            found.append(Table6Cell(int(experiments), int(configurations), rho0, loss))
    return tuple(found)


def figure_7() -> tuple[Figure7Line, ...]:
    """The expectations in the caption of Fig. 7."""
    table = pd.read_csv(FOLDER / "figure_7.csv", dtype=str, keep_default_na=False)
    return tuple(
        Figure7Line(str(plan), str(line), int(k) if k else None, float(mean))
        for plan, line, k, mean in table.to_numpy()
    )


def equation_23() -> Array:
    """A0 (3, 5) as printed in Eq. (23) [m/(rad/(N m))]."""
    return pd.read_csv(FOLDER / "equation_23.csv").to_numpy(dtype=float)
