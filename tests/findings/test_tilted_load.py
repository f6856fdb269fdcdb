"""A tilted load turns joints that count as rigid, which the doubt of its direction counts."""

from dataclasses import replace

import numpy as np
from readings import STUDY, measured

from edtk.findings.fitted_data import FittedData
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.measure.task import all_compliances
from edtk.robots.rotations import rotation
from edtk.study.study_model import assumed_joints

TILT = 3.0  # [deg]


def test_the_doubt_of_a_direction_counts_joints_that_no_weight_turns() -> None:
    """A load three degrees off, and a first joint as is assumed: the doubt makes both likely."""
    data = measured()
    (first,) = assumed_joints(STUDY)
    turned = rotation(np.deg2rad([TILT, 0.0, 0.0]))
    wrench = np.hstack([data.wrench[:, :3] @ turned.T, data.wrench[:, 3:]])
    k = all_compliances(STUDY.model, STUDY.compliances)
    k[first.index] = first.std
    moved = equilibrium_deflection(STUDY.model, data.q, wrench, k)
    moved += STUDY.sigma * np.random.default_rng(0).standard_normal(moved.shape)
    doubting = STUDY.replace(uncertainty={"load_direction_deg": TILT})
    fitted = FittedData.of(doubting, replace(data, deflection=moved))
    assert fitted.fit.scale > 2
    assert fitted.as_doubted > 0.05
