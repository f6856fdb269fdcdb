"""How far a step may go."""

import numpy as np
import pytest

from edtk.design.relaxation.master_equations import step_length


@pytest.mark.parametrize(
    ("dx", "length"), [([-4.0, 1.0], 0.225), ([-0.1, -0.2], 1.0), ([1.0, 2.0], 1.0)]
)
def test_step_length(dx, length):
    """A step goes nine tenths of the way to the first zero, and at most all of its own length."""
    assert step_length(np.array([1.0, 2.0]), np.array(dx), 0.9) == pytest.approx(length)
