"""A person names parameters; a criterion has arrays."""

import numpy as np
import pytest

import edtk
from criteria import CriterionError, as_criterion
from criteria.named_interest import named_parameters

NAMES = ("a", "b", "c")
X = np.vander(np.linspace(-1, 1, 21), 3, increasing=True)
PROBLEM = edtk.Problem(X[:, None, :], parameters=NAMES)


def test_names_become_columns_and_numbers() -> None:
    """A list of names is a column for each, numbers by name a vector; parts of criteria alike."""
    Ds = {"name": "Ds", "interest": ["c", "a"]}
    found = named_parameters({"name": "compound", "criteria": [Ds, "A"]}, NAMES)
    assert found["criteria"][0]["interest"].tolist() == [[0, 1], [0, 0], [1, 0]]
    assert found["criteria"][1] == "A"
    assert named_parameters({"c": {"b": 2}}, NAMES)["c"] == [0, 2, 0]
    assert named_parameters({"q": 2, "interest": np.eye(3)}, NAMES)["q"] == 2


def test_a_problem_is_asked_by_the_names_of_its_parameters() -> None:
    """Names and arrays are the same question, of weights and of plans."""
    by_name = edtk.relax(PROBLEM, {"name": "Ds", "interest": ["c"]})
    by_array = edtk.relax(PROBLEM, {"name": "Ds", "interest": [0, 0, 1]})
    assert by_name.value == by_array.value
    plan = edtk.plan(PROBLEM, size=4, criterion={"name": "c", "c": {"c": 1}}, starts=2)
    assert plan.value == pytest.approx(1.0)  # 4 / 4: a quarter, a half and a quarter


def test_unknown_names() -> None:
    """A name that the model does not have is one line that lists those it has."""
    with pytest.raises(CriterionError, match="'z' is no parameter; expected a, b, c"):
        edtk.relax(PROBLEM, {"name": "Ds", "interest": ["z"]})
    with pytest.raises(CriterionError, match="'z' is no parameter"):
        as_criterion({"name": "c", "c": {"z": 1}}, NAMES)
