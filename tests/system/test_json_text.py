"""JSON that is written can be read by every program."""

import json
import math

import numpy as np

from edtk.system.parsing import json_text


def test_numbers_that_are_not_finite_are_null():
    """NaN and Infinity, which Python writes and JSON does not know, stand as null."""
    content = {"a": [1.5, math.nan, -math.inf, (np.float64("inf"),)], "b": {"c": "inf", "d": 3}}
    found = json.loads(json_text(content))
    assert found == {"a": [1.5, None, None, [None]], "b": {"c": "inf", "d": 3}}


def test_finite_data_are_written_as_they_are():
    """The text is that of Python, so that results stay the same to the last byte."""
    content = {"k": {"q1": 1e-7}, "covariance": [[0.1, 2]], "none": None}
    assert json_text(content) == json.dumps(content, indent=2)
