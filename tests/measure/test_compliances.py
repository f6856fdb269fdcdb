"""Files of compliances, and every way in which they can be wrong."""

import json

import numpy as np
import pytest

from edtk.measure.compliances import Compliances, load_compliances
from edtk.system.errors import UserError

NAMES = ("q1", "q2", "q3")
K = {"q3": 3e-6, "q2": 2e-6}


def read(folder, content):
    path = folder / "K.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return load_compliances(path, NAMES, ("q2", "q3"))


def test_order_is_that_of_the_file(tmp_path):
    """Joints, values and covariance follow the file's k; other keys are ignored."""
    cov = [[9e-16, 1e-16], [1e-16, 4e-16]]
    found = read(tmp_path, {"k": K, "covariance": cov, "experiments": 3})
    assert found.joints == ("q3", "q2")
    np.testing.assert_array_equal(found.k, [3e-6, 2e-6])
    np.testing.assert_array_equal(found.covariance, cov)


def test_standard_deviations_and_correlation(tmp_path):
    """Std by joint or as a list, with or without correlation, gives the covariance."""
    by_joint = read(
        tmp_path, {"k": K, "std": {"q2": 2e-8, "q3": 3e-8}, "correlation": [[1, 0.5], [0.5, 1]]}
    )
    np.testing.assert_allclose(by_joint.covariance, [[9e-16, 3e-16], [3e-16, 4e-16]])
    np.testing.assert_allclose(
        read(tmp_path, {"k": K, "std": [3e-8, 0]}).covariance, np.diag([9e-16, 0])
    )
    assert read(tmp_path, {"k": K}).covariance is None
    plain = read(tmp_path, K)
    assert (plain.joints, plain.covariance) == (("q3", "q2"), None)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not valid JSON"),
        ("[1, 2]", 'expected {"k"'),
        ("3", 'expected {"k"'),
        ({"k": [1, 2]}, "k: expected a value"),
        ({"k": {"q2": 1e-6}}, "k.q3: expected the compliance of joint 'q3'"),
        ({"k": {"q2": 1e-6}}, "remove the joint from joints.unknown, and give what is known of it"),
        ({"q3": 1e-6}, "json: q2: expected the compliance"),
        ({"k": {**K, "q7": 1e-6}}, "k.q7: no such joint; this robot has q1, q2, q3"),
        (
            {"k": {**K, "q2": -1e-6}},
            "k.q2: expected a number from 0 to 1000, got -1e-06",
        ),
        (
            {"k": {**K, "q2": float("nan")}},
            "k.q2: expected a finite number, got NaN",
        ),
        ({"k": {**K, "q2": float("inf")}}, "k.q2: expected a finite number"),
        ({"k": {**K, "q2": 10**400}}, "k.q2: expected a finite number"),
        ({"k": {**K, "q2": "1e-6"}}, "k.q2: expected a number from 0 to 1000"),
        ({"k": {**K, "q2": True}}, "k.q2: expected a number from 0 to 1000"),
        ({"k": K, "covariance": [[1, 0]]}, "covariance: expected 2 rows of 2"),
        ({"k": K, "covariance": [[1, 0], [0, None]]}, "covariance: expected 2 rows of 2"),
        ({"k": K, "covariance": [[1, 0], [0, 10**400]]}, "covariance.1.1: expected a finite"),
        ({"k": K, "covariance": [[1, 0], [0.5, 1]]}, "covariance: row 1, column 2: differs"),
        ({"k": K, "covariance": [[1, 2], [2, 1]]}, "covariance: expected a covariance"),
        ({"k": K, "covariance": [[-1, 0], [0, 1]]}, "covariance: expected a covariance"),
        ({"k": K, "std": [1]}, "std: expected 2 standard deviations"),
        ({"k": K, "std": {"q2": 1}}, "std.q3: expected a standard deviation"),
        ({"k": K, "std": [1, -1]}, "std.q2: expected a number from 0"),
        ({"k": K, "std": [1, 1], "correlation": [[2, 0], [0, 1]]}, "correlation: expected ones"),
        (
            {"k": K, "std": [1, 1], "correlation": [[1, 1.5], [1.5, 1]]},
            "correlation: expected a covariance",
        ),
    ],
)
def test_mistakes(tmp_path, content, message):
    """Every mistake is one line that names the file, the key and what was expected."""
    with pytest.raises(UserError) as error:
        read(tmp_path, content)
    assert message in str(error.value)
    assert "K.json" in str(error.value)


def test_files_that_are_not_there_or_not_text(tmp_path):
    """An absent file, a folder and bytes that are no text are named."""
    (tmp_path / "bytes").write_bytes(b"\xff\xfe\x00")
    for path, message in (
        ("none", "no such file"),
        (".", "is a folder"),
        ("bytes", "no text in UTF-8"),
    ):
        with pytest.raises(UserError, match=message):
            load_compliances(tmp_path / path, NAMES, ())


@pytest.mark.parametrize("dof", [0, 0.01, -1, 1e10, 1e300, "4", True])
def test_degrees_of_freedom_have_a_sensible_size(tmp_path, dof):
    """Bands have no finite quantile with next to none, and are those of a known sigma with many."""
    with pytest.raises(UserError, match=r"covariance_dof: expected a number from 0\.5 to 1e\+09"):
        read(tmp_path, {"k": K, "covariance_dof": dof})


@pytest.mark.parametrize("value", [1e4, 1e154, 1e300])
def test_numbers_that_cannot_be_squared_are_refused(tmp_path, value):
    """No compliance comes near them, and their squares would be infinite."""
    contents = [
        {"k": {**K, "q2": value}},
        {"k": K, "std": [value, 1]},
        {"k": K, "rho0_bias": value},
        {"k": K, "k_unbounded": {**K, "q3": -value}},
        {"k": K, "covariance": [[1e3 * value, 0], [0, 1]]},
    ]
    for content in contents:
        with pytest.raises(UserError, match=r": expected .* (up )?to 1"):
            read(tmp_path, content)


@pytest.mark.parametrize("content", [{"k": 1e-7, "q2": 2e-7}, {"k": {"k": 1e-7, "q2": 2e-7}}])
def test_a_joint_called_k(content):
    """Both forms are read for a robot that has a joint of the name of the table."""
    found = Compliances.from_dict(content, ("k", "q2"), ("k",))
    assert (found.joints, found.k.tolist()) == (("k", "q2"), [1e-7, 2e-7])
