"""The vector product of few vectors is numpy's."""

import numpy as np
import pytest

from edtk.robots.rotations import vector_product

SHAPES = [((3,), (3,)), ((3,), (4, 3)), ((2, 1, 3), (5, 3)), ((0, 3), (3,))]


@pytest.mark.parametrize("shapes", SHAPES)
def test_it_is_that_of_numpy_to_the_last_bit(shapes):
    """Vectors broadcast, and each product has the very bits of `np.cross`."""
    rng = np.random.default_rng(0)
    a, b = (rng.normal(size=shape) for shape in shapes)
    np.testing.assert_array_equal(vector_product(a, b), np.cross(a, b), strict=True)
