"""A fitted geometry comes back from its numbers, and numbers that cannot be are refused."""

from contextlib import suppress
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from edtk.calibration.result_file import geometry_of_dict, geometry_to_dict
from edtk.findings.counting import Counting
from edtk.fit.fitted_geometry import FittedGeometry
from edtk.measure.position_noise import BlockVariances, PositionNoise
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

JOINT = {"origin_m": [0.3, 0, 0.2], "limits_deg": [-130, 130]}
ROBOT = {
    "name": "a short arm",
    "source": "tests",
    "joints": [
        JOINT | {"name": "q1", "axis": [0, 0, 1]},
        JOINT | {"name": "q2", "axis": [0, 1, 0]},
    ],
}
STUDY = Study(
    robot=ROBOT,
    measurement={"sigma_mm": 0.02},
    parameters={"compliance": [], "geometry": [], "base": True, "tool": True},
    marker=[{"name": "A"}],
)


def written() -> dict[str, Any]:
    """A made-up fit as plain numbers."""
    setting = StudyGeometry.of(STUDY)
    model = setting.model
    root = np.random.default_rng(0).normal(size=(model.p, model.p))
    covariance = root @ root.T
    found = BlockVariances(np.array([1e-4, 0.0]), np.eye(2), 1.0)
    noise = PositionNoise(0.02, np.zeros(2), 0.01, np.zeros(2), found, 0)
    fitted = FittedGeometry(
        model,
        0.1 * model.scales,
        0.5 * (covariance + covariance.T),
        (),
        np.zeros((model.p, 0)),
        noise,
        np.zeros((1, 3)),
    )
    return geometry_to_dict(fitted, Counting(np.eye(2), ""))


def test_a_result_from_before_took_the_size_of_a_change_as_known() -> None:
    """It has no variance of a change: that counts as known, as it did."""
    given = written()
    given["noise"]["model_change"] = [0.03, 0.0]
    setting = StudyGeometry.of(STUDY)
    fitted, counting = geometry_of_dict(given, setting)
    told = fitted.noise.model_fit
    assert told is not None
    assert told.variances.tolist() == [1e-4, 0, 0.03**2]
    assert told.covariance.tolist() == np.diag([1.0, 1, 0]).tolist()
    again = geometry_to_dict(fitted, counting)
    back = geometry_of_dict(again, setting)[0].noise.model_fit
    assert back is not None
    assert back.variances == pytest.approx(told.variances, rel=1e-12)


def test_there_and_back() -> None:
    """What is written and read again is the same."""
    given = written()
    fitted, counting = geometry_of_dict(given, StudyGeometry.of(STUDY))
    assert geometry_to_dict(fitted, counting) == given


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (("covariance", 0, 0), -1.0, "covariance: expected a covariance"),
        (("covariance", 0, 1), 0.1, "covariance: expected a covariance"),
        (("covariance", 0, 0), 1e300, "covariance: expected numbers up to"),
        (("values", 0), float("nan"), "values: expected"),
        (("base", 0, 0), 2.0, "base: expected a pose"),
        (("base", 3, 3), 2.0, "base: expected a pose"),
        (("noise", "reading_mm"), -0.1, "reading_mm: expected numbers that are not negative"),
        (("noise", "variances", 0), -0.1, "variances: expected numbers that are not negative"),
        (("noise", "variances_covariance", 0, 0), -0.1, "variances_covariance: expected a cov"),
        (("names", 0), "q9.x", "names: the study has no parameter 'q9.x'"),
        (("names", 0), "base.y", "names: expected each once"),
        (("open",), ["base.x"], "names: expected each once"),
        (("markers", 0), "B", "markers: expected A"),
        (("robot",), "0", "robot: the result is of another robot"),
    ],
)
def test_numbers_that_cannot_be(keys: tuple[Any, ...], value: object, said: str) -> None:
    """A file that was changed is refused by the name of its key."""
    given = deepcopy(written())
    table: Any = given
    for key in keys[:-1]:
        table = table[key]
    table[keys[-1]] = value
    with pytest.raises(ValueError, match=said):
        geometry_of_dict(given, StudyGeometry.of(STUDY))


@pytest.mark.parametrize("value", [None, True, 1, "x", [], {}, [[]], [{}], [["x"]], "huge"])
def test_values_of_any_kind(value: object) -> None:
    """Whatever stands in whatever place is read, or refused by the name of its key."""
    setting = StudyGeometry.of(STUDY)
    value = 10**400 if value == "huge" else value
    for table in ("", "noise"):
        for key in written()[table] if table else written():
            given = written()
            place = given[table] if table else given
            place[key] = value
            with suppress(ValueError):
                fitted, _ = geometry_of_dict(given, setting)
                assert np.isfinite(fitted.values).all()
