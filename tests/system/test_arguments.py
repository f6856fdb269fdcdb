"""Arguments are held against the types that a signature names."""

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError


@checked
def call(
    study: Fraction | Path | str = "study.toml",
    size: int | None = None,
    out: Path | str | None = None,
    name: str | None = None,
    as_is: bool = False,
    share: float | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    home: Sequence[float] | None = None,
    progress: Callable[[str], object] = print,
    content: dict[str, Any] | str = "x",
    part: Fraction | bool = False,
    anything: "Unknown | None" = None,  # noqa: F821
) -> str:
    """Of each kind of argument one."""
    return "called"


@pytest.mark.parametrize(
    "given",
    [
        {"out": Path("a.csv"), "name": "a", "as_is": np.True_, "share": np.float32(1)},
        {"share": math.inf, "limits": {"q1": (-1, np.int64(1))}, "home": np.zeros(3)},
        {"limits": {"q1": [0, 1]}, "home": (), "part": Fraction(1), "content": {"a": object()}},
        {"out": None, "home": pd.Series([1.0, 2.0]), "progress": max, "anything": object()},
    ],
)
def test_what_fits_is_called(given):
    """Numbers of numpy, arrays as lists, and lists as pairs are as good as Python's."""
    assert call(**given) == "called"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"out": 3}, "out: expected a path, not int"),
        ({"name": b"x"}, "name: expected text, not bytes"),
        ({"as_is": 1}, "as_is: expected True or False, not int"),
        ({"as_is": pd.DataFrame()}, "as_is: expected True or False, not DataFrame"),
        ({"share": "x"}, "share: expected a number, not str"),
        ({"share": True}, "share: expected a number, not bool"),
        ({"share": math.nan}, "share: expected a number, not nan"),
        ({"share": 10**400}, "share: expected a number, not int"),
        ({"limits": [1]}, "limits: expected a table by name, not list"),
        ({"limits": {"q1": 3}}, "limits q1: expected a list, not int"),
        ({"limits": {"q1": (1, 2, 3)}}, "limits q1: expected 2 entries, not 3"),
        ({"limits": {"q1": (1, "x")}}, "limits q1 2: expected a number, not str"),
        ({"home": "123"}, "home: expected a list, not str"),
        ({"home": np.array(1.0)}, "home: expected a list, not ndarray"),
        ({"home": [0, None]}, "home 2: expected a number, not NoneType"),
        ({"progress": None}, "progress: expected a function, not NoneType"),
        ({"content": 3}, "content: expected a table by name, or text, not int"),
        ({"part": "x"}, "part: expected Fraction, or True or False, not str"),
    ],
)
def test_what_does_not_fit_is_one_line(given, said):
    """The line names the argument, what was expected, and what was given."""
    with pytest.raises(ArgumentError) as error:
        call(**given)
    assert str(error.value) == said


def test_arguments_are_checked_by_their_places_too():
    """The third one is the path."""
    with pytest.raises(ArgumentError, match=r"^out: expected a path, not int$"):
        call("study.toml", None, 3)


def test_what_the_call_reads_itself_is_left_to_it():
    """Whole numbers, and objects for which a file may stand, have words of their own elsewhere."""
    assert call(study=3, size="many") == "called"


def test_a_call_keeps_its_own_errors():
    """An argument that does not exist is Python's error."""
    with pytest.raises(TypeError, match="unexpected keyword argument 'nothing'"):
        call(nothing=3)
