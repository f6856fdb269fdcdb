"""Causes are weighed beside errors that like poses have in common."""

from dataclasses import replace

import numpy as np
import pytest
from geometry_sheets import OFFSETS, PLACE, STUDY

from edtk.findings.fit_rows import FitRows, SizedColumns
from edtk.findings.like_poses import SIZES, LikePoses
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.marker_positions import MarkerPositions
from edtk.study.study_geometry import StudyGeometry

POSES = 12
DAYS = 40


@pytest.fixture(scope="module")
def rows() -> FitRows:
    """A day in two regions of the arm."""
    rng = np.random.default_rng(0)
    setting = StudyGeometry.of(STUDY)
    model = replace(setting.model, offsets=OFFSETS, start=PLACE)
    q = np.repeat(rng.uniform(-1, 1, (2, 6)), POSES // 2, axis=0) + rng.normal(0, 0.3, (POSES, 6))
    turned = q + rng.normal(0, 1e-4, q.shape)
    x = model.see(np.zeros(model.p), turned, derivatives=False).points
    x = x + rng.normal(0, 2e-5, x.shape)
    row = np.arange(POSES)[:, None] * np.ones(3, dtype=int)
    data = MarkerPositions(q, np.zeros((POSES, 6)), x, row, tuple("ABC"))
    return FitRows.of(fit_geometry(setting.model, data, setting.noise))


def step(rows: FitRows, log_tries: float = 0.0) -> SizedColumns:
    """A motion of the frame between the regions."""
    late = (np.arange(POSES) >= POSES // 2)[:, None, None]
    return SizedColumns(rows.frame * late, 0.5, log_tries)


def test_days_that_err_as_is_assumed_hardly_speak_for_a_cause(rows: FitRows) -> None:
    """A factor of ten comes at most one time in ten (Markov), whatever the sizes are."""
    day = LikePoses.of(rows)
    rng = np.random.default_rng(1)
    likelier = []
    for _ in range(DAYS):
        sizes = day.unit * rng.choice(SIZES, 2)
        V = day.reading + day.model + np.tensordot(sizes**2, day.alike, axes=1)
        z = np.linalg.cholesky(V) @ rng.normal(size=len(V))
        found = replace(day, z=z)
        likelier.append(float(found.likelier([step(rows)])[0]))
    assert (np.array(likelier) > np.log(10)).mean() <= 0.1


def test_a_step_that_errors_of_like_poses_cannot_make_is_told(rows: FitRows) -> None:
    """It is the likelier the larger it is, and as often tried the less likely."""
    day = LikePoses.of(rows)
    basis = day.basis.reshape(POSES, -1, day.basis.shape[-1])
    moved = (step(rows).columns @ np.array([1.0, -1, 1, 0, 0, 0]))[..., None]
    along = (np.swapaxes(basis, 1, 2) @ moved).ravel()
    found = [
        replace(day, z=day.z + size * along).likelier([step(rows), step(rows, np.log(7.0))])
        for size in (0.0, 0.5, 5.0)
    ]
    first = [float(one[0]) for one in found]
    assert first[0] < first[1] < first[2]
    assert first[2] > np.log(300)
    assert all(one[0] - one[1] == pytest.approx(np.log(7.0)) for one in found)
