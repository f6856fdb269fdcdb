"""Arguments are held against the types that a signature names."""

import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import edtk
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError

ROOT = Path(edtk.__file__).parents[1]


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
        ({"limits": {"q1": (1, 2, 3)}}, "limits q1: expected 2 numbers, not 3"),
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


LINE = np.stack([np.ones(5), np.linspace(-1, 1, 5)], axis=-1)[:, None, :]
CALLS: dict[str, tuple[Callable[..., object], dict[str, Any]]] = {
    "apportion": (edtk.apportion, {"weights": [0.5, 0.5], "m": 4}),
    "exchange": (
        edtk.exchange,
        {
            "problem": edtk.Problem(LINE),
            "criterion": edtk.criteria.create("D"),
            "start": [1, 2],
            "repeats": None,
            "shortlists": (16, 64),
            "thorough": True,
        },
    ),
    "Problem": (edtk.Problem, {"blocks": LINE, "sigma": 1.0, "parameters": None, "prior": None}),
    "of_information": (edtk.Problem.of_information, {"packed": edtk.Problem(LINE).packed}),
    "from_frame": (
        edtk.Problem.from_frame,
        {"frame": pd.DataFrame({"x": [0.0, 1.0, 2.0]}), "formula": "x", "experiment": None},
    ),
    "of_model": (
        edtk.Problem.of_model,
        {"f": "a * x + b", "theta": {"a": 1.0, "b": 2.0}, "candidates": [0.0, 0.5, 1.0]},
    ),
    "Region": (edtk.Region, {"rows": lambda x: x[:, None, :], "low": -1.0, "high": 1.0}),
    "Plan": (
        edtk.Plan,
        {"q": np.zeros((2, 3)), "wrench": np.zeros((2, 6)), "repeats": np.ones(2, dtype=int)},
    ),
    "several_models": (edtk.several_models, {"problems": [edtk.Problem(LINE)]}),
    "strata": (edtk.Errors.strata, {"groups": {"day": 2}, "variance": 1.0}),
    "trend": (edtk.Errors.trend, {"order": 1, "variance": 1.0, "series": 1}),
    "create": (edtk.criteria.create, {"name": "D"}),
}
ODD = [
    None, -1, 2.5, math.nan, "text", b"x", [], [1, 2], [[1], [2, 3]], {"a": 1}, object(), True,
    np.zeros(3), np.zeros((2, 2)), np.zeros((0, 2, 2)), np.array(["a", "b"]), np.array([object()]),
    pd.DataFrame({"x": [1.0, 2.0]}), int, 10**400, np.full((3, 1, 2), np.nan), [None, 1], 1e308,
]  # fmt: skip


def refusal(call, arguments):
    """The error that refuses arguments, in one of the ways of the house; None if they are taken."""
    try:
        call(**arguments)
    except (ValueError, edtk.criteria.CriterionError) as error:
        return error
    return None


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.filterwarnings("ignore")
def test_no_argument_of_a_public_call_is_left_to_a_library(name):
    """Whatever is given is taken, or refused by a line of ours that says what was expected."""
    call, good = CALLS[name]
    for argument in good:
        for given in ODD:
            error = refusal(call, good | {argument: given})
            if error is not None:
                frames = traceback.extract_tb(error.__traceback__)
                ours = Path(frames[-1].filename).is_relative_to(ROOT)
                assert ours, (argument, given, error)
                assert "\n" not in str(error)
