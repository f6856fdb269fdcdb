"""The noise that a measurement sheet states, row by row."""

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise, NotPositiveDefiniteError
from edtk.system.typing import Array, Mask
from edtk.tables.pose_table import PoseTable
from edtk.tables.sheet_columns import AXIS_SIGMA_COLUMNS, COVARIANCE_COLUMNS, SIGMA_COLUMN

# A standard deviation that anybody can mean; the square of a smaller one underflows.
LEAST_SIGMA_MM = 1e-9

# Places of the upper triangle in the order of the columns, and those of the variances.
ROWS = (0, 0, 0, 1, 1, 2)
COLUMNS = (0, 1, 2, 1, 2, 2)
VARIANCES = tuple(COVARIANCE_COLUMNS[i] for i in (0, 3, 5))

NOISE_COLUMNS = ((SIGMA_COLUMN,), AXIS_SIGMA_COLUMNS, COVARIANCE_COLUMNS)


def sheet_noise(
    table: PoseTable, sigma: Array, turn: Mask | None = None
) -> tuple[Array, CorrelatedNoise | None]:
    """Read the noise of displacements: one of all axes, one of each, or a covariance.

    Args:
        table: The sheet.
        sigma: Noise (rows,) of each measured row of the study, or that of each row of the sheet
            (m, rows) [m, rad], which the sheet overrides for positions.
        turn: Whether each row (m,) is a single rotation; None where none is.

    Returns:
        Standard deviations (m, rows) [m, rad]; and the noise where its errors are correlated, else
        None.

    Raises:
        PoseFileError: Names the row and column of a noise that is none, or of two kinds of them.
    """
    # Row by row: a copy in the broadcast's order would change the order of sums, and last digits.
    noise = np.array(np.broadcast_to(sigma, (len(table), np.shape(sigma)[-1])), order="C")
    given = [[column for column in kind if column in table] for kind in NOISE_COLUMNS]
    kinds = [columns for columns in given if columns]
    if len(kinds) > 1:
        raise table.error(
            f"columns {kinds[0][0]!r} and {kinds[1][0]!r}: expected one noise of all axes, or "
            f"{', '.join(AXIS_SIGMA_COLUMNS)}, or {', '.join(COVARIANCE_COLUMNS)}, not both"
        )
    of_all, of_axes, covariance = given
    if noise.shape[1] == 1 and (of_axes or covariance):
        raise table.error(
            f"column {(of_axes or covariance)[0]!r}: a distance has one noise; "
            f"expected {SIGMA_COLUMN}"
        )
    if covariance:
        return _covariance(table, noise)
    if of_all:
        lengths = table if turn is None else table.of_rows(~turn)
        _require_noise(lengths, SIGMA_COLUMN, LEAST_SIGMA_MM)
        stated = lengths.numbers(SIGMA_COLUMN)[:, None] / 1e3
        noise[:, :3] = stated if turn is None else np.where(turn[:, None], noise[:, :3], stated)
    elif of_axes:
        noise[:, :3] = table.vectors(AXIS_SIGMA_COLUMNS) / 1e3
        for column in AXIS_SIGMA_COLUMNS:
            _require_noise(table, column, LEAST_SIGMA_MM)
    return noise, None


def _covariance(table: PoseTable, noise: Array) -> tuple[Array, CorrelatedNoise]:
    """Covariances of displacements, beside the stated noise of rotations."""
    triangle = table.vectors(COVARIANCE_COLUMNS) / 1e6
    for column in VARIANCES:
        _require_noise(table, column, LEAST_SIGMA_MM**2)
    rows = noise.shape[1]
    covariance = noise[:, :, None] * np.eye(rows) * noise[:, None]
    covariance[:, ROWS, COLUMNS] = triangle
    covariance[:, COLUMNS, ROWS] = triangle
    try:
        found = CorrelatedNoise.by_row(covariance)
    except NotPositiveDefiniteError as error:
        raise table.error(
            "the covariance is not positive definite (least eigenvalue of the correlations "
            f"{error.eigenvalue:.2g}); expected errors that vary in every direction",
            f"row {error.row + 1}, columns {COVARIANCE_COLUMNS[0]} to {COVARIANCE_COLUMNS[-1]}",
        ) from error
    return found.std, found


def _require_noise(table: PoseTable, column: str, least: float) -> None:
    """Refuse standard deviations or variances that are not positive."""
    values = table.numbers(column)
    bad = np.flatnonzero((values < least) & (True if table.only is None else table.only))
    if len(bad):
        raise table.error(
            f"row {bad[0] + 1}, column {column}: {values[bad[0]]:g} is not a positive "
            f"number of at least {least:g}"
        )
