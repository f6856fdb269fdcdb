"""Where arms come to rest: one search for springs of all kinds."""

from typing import Any

import numpy as np
import pytest
from arm import ROBOT
from numpy.typing import NDArray

from edtk.measure.equilibrium import Rest, no_rest, resting_load
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

Array = NDArray[np.float64]
SOFT = 3e-4  # [rad/(N m)]: joints turn by some degrees
Q = np.random.default_rng(0).uniform(-1.5, 1.5, (20, 2))
WRENCH = np.tile([60.0, 0, -100, 0, 5, 0], (20, 1)) * np.tile([1, 0], 10)[:, None]


def setting_of(springs: list[str], **keys: Any) -> StudyGeometry:
    """A plane arm with heavy links and a payload, whose load hangs beside its tool."""
    heavy = [{**one, "mass_kg": 7, "center_m": [0.2, 0.05, 0.1]} for one in ROBOT["joints"]]
    given: dict[str, Any] = {
        "robot": ROBOT | {"joints": heavy},
        "tool": {"position_mm": [500, 0, 0]},
        "load": {"list_F_N": [[0, 0, -100], [60, 80, -60]], "at_mm": [30, 200, 0]},
        "marker": [{"name": "A", "position_mm": [0, 30, 10]}],
        "measurement": {"sigma_mm": 0.01, "reference": "instrument"},
        "parameters": {"geometry": [], "springs": springs, "base": False, "tool": False},
    }
    return StudyGeometry.of(Study(**(given | keys)))


@pytest.mark.parametrize("springs", [["joints"], ["joints", "q1.rx", "q2.z"]])
@pytest.mark.parametrize("payload", [None, {"mass_kg": 3, "center_mm": [20, 0, 40]}])
def test_derivatives_of_the_loads_are_difference_quotients(
    springs: list[str], payload: dict[str, object] | None
) -> None:
    """Elastic joints, links and a payload that is there with the load: all follow the joints."""
    setting = setting_of(springs, payload=payload)
    assert setting.loads is not None
    width = setting.model.springs.width
    q = np.random.default_rng(1).uniform(-1, 1, (len(Q), width))
    torque, H = setting.loads.with_derivative(q, WRENCH)
    np.testing.assert_array_equal(torque, setting.loads(q, WRENCH))
    h = 1e-6
    for j, e in enumerate(h * np.eye(width)):
        ahead, behind = (setting.loads(q + s * e, WRENCH) for s in (1, -1))
        np.testing.assert_allclose(H[:, :, j], (ahead - behind) / (2 * h), atol=1e-5)


def test_springs_of_both_kinds_of_studies_rest_in_the_same_place() -> None:
    """Joints with compliances, and parameters that are these, turn by the same."""
    setting = setting_of(["joints"])
    bending = setting.model.bending(np.full(2, SOFT))
    load = resting_load(bending, Q, WRENCH, setting.loads)
    assert load is not None
    assert load.near is not None
    rest = Rest.of(setting.study.model, Q, WRENCH, np.full(2, SOFT))
    assert np.abs(rest.end - Q).max() > 0.05
    np.testing.assert_allclose(load.near, rest.end, atol=1e-12)
    assert not no_rest(bending, Q, WRENCH, setting.loads).any()


@pytest.mark.slow
def test_a_soft_arm_is_followed_to_where_it_hangs() -> None:
    """Springs that become soft step by step end where all at once they do, on the same branch."""
    setting = setting_of(["joints"])
    assert setting.loads is not None
    soft = setting.model.bending(np.full(2, 20 * SOFT))
    load = resting_load(soft, Q, WRENCH, setting.loads)
    assert load is not None
    assert load.near is not None
    turn = np.zeros_like(Q)
    for part in np.linspace(0, 1, 401)[1:]:
        softer = soft.scaled(float(part))
        for _ in range(3):
            torque, H = setting.loads.with_derivative(Q + turn, WRENCH)
            slope = np.eye(2) - softer.turned_by(torque, H)
            apart = softer.turn(torque) - turn
            turn = turn + np.linalg.solve(slope, apart[..., None])[..., 0]
    assert np.abs(turn).max() > 0.5
    rests = ~no_rest(soft, Q, WRENCH, setting.loads)
    assert rests.sum() > 15
    np.testing.assert_allclose(load.near[rests], (Q + turn)[rests], atol=1e-9)
