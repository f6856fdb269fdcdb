"""Days of robots whose parts the model has."""

import numpy as np
import pytest


@pytest.mark.parametrize("name", ["compensator at q2", "cubic spring of q2"])
def test_day_gives_back_the_robot(script, name):
    """All parts are told, each within a few standard deviations, and the command is as promised."""
    module = script("extended_models.py")
    day = module.one_day(module.models()[name], 20, 0)
    assert day["open"] == 0
    assert max(map(abs, day["z"].values())) < 4
    assert 0.3 < day["chi2"] / day["dof"] < 2
    low, high = day["band_mm"]
    assert low < day["promise_mm"] < high
    assert day["real_mm"] < 3 * day["promise_mm"]
    (row,) = module.rows_of({f"{name}/20/0": day}, [f"{name}/20"])
    assert row[:3] == [name, "20", 1]
    assert np.isfinite(float(row[7]))
