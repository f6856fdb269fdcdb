"""Numbers of equal rows."""

import numpy as np

from edtk.system.typing import Array, Indices

MANY = 2000  # rows, beyond which pandas is quicker


def row_numbers(*columns: Array | Indices) -> Indices:
    """Numbers (m,) of rows, the same for equal ones, counted from 0 in order of appearance.

    Args:
        columns: Arrays (m, c), taken side by side.
    """
    # Adding zero makes -0.0 equal to 0.0, whose bytes differ.
    rows = np.hstack(columns) + 0.0
    if len(rows) < MANY:
        # pandas takes half a millisecond to begin, and a calibration asks many times.
        number: dict[bytes, int] = {}
        found = [number.setdefault(row.tobytes(), len(number)) for row in rows]
        return np.array(found, dtype=np.intp)
    import pandas as pd

    return np.asarray(pd.factorize(pd.util.hash_pandas_object(pd.DataFrame(rows), index=False))[0])
