"""Causes of some rows are those of the same rows among all."""

import numpy as np

from edtk.findings.causes.family import Cause
from edtk.findings.causes.find_causes import FoundCauses


def test_rows_are_numbered_among_all():
    """The second of rows 3, 5 and 8 is row 5, in causes and in outliers alike."""
    pose = Cause("pose", 10.0, "deg", None, 1e-9, rows=(0, 1))
    drift = Cause("drift", 0.05, "mm", 0.01, 1e-9)
    found = FoundCauses((pose, drift), (2,)).in_rows(np.array([3, 5, 8]))
    assert [one.rows for one in found.named] == [(3, 5), ()]
    assert found.outliers == (8,)
