"""Numbers of equal rows."""

import numpy as np

from edtk.system.typing import Array, Indices


def row_numbers(*columns: Array | Indices) -> Indices:
    """Numbers (m,) of rows, the same for equal ones, counted from 0 in order of appearance.

    Args:
        columns: Arrays (m, c), taken side by side.
    """
    import pandas as pd

    # Adding zero makes -0.0 equal to 0.0, whose bytes differ.
    keys = pd.util.hash_pandas_object(pd.DataFrame(np.hstack(columns) + 0.0), index=False)
    return np.asarray(pd.factorize(keys)[0])
