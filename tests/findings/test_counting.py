"""How a sheet counts joints is told by all visits, also where a joint stands still in most."""

from dataclasses import replace

import numpy as np
import pytest
from geometry_sheets import OFFSETS, PLACE, STUDY

from edtk.findings.counting import find_counting
from edtk.fit.marker_positions import MarkerPositions
from edtk.study.study_geometry import StudyGeometry


@pytest.mark.parametrize("seed", [0, 3])
def test_three_visits_in_which_a_joint_moves_count(seed: int) -> None:
    """q1 stands still in 21 of 24 visits: a way that fits these alone leaves three sound ones."""
    rng = np.random.default_rng(seed)
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, 2.0, model.p) * model.scales
    q = rng.uniform(-1.2, 1.2, (24, 6))
    q[:, 0] = np.pi / 4
    q[20:23, 0] = np.deg2rad([35, 55, 30])
    x = model.see(theta, q, derivatives=False).points
    row = np.arange(24)[:, None] * np.ones(3, dtype=int)
    shown = q * np.array([-1, -1, 1, 1, 1, 1])
    data = MarkerPositions(shown, np.zeros((24, 6)), x, row, tuple("ABC"))
    found = find_counting(model.robot, data)
    assert found is not None
    assert found.words == "q1, q2 count the other way"
