"""The text of a TOML file: what is written is what is read."""

import json
import math
import tomllib

import pytest

from edtk.study.study_toml import toml_text


@pytest.mark.parametrize(
    "content",
    [
        {},
        {"a": 1, "b": -2.5, "c": True, "d": False, "e": "text"},
        {"huge": 1e308, "tiny": 5e-324, "third": 1 / 3, "zero": -0.0, "inf": math.inf, "n": -1e-7},
        {"text": 'quote " backslash \\ tab \t line \n bell \x07 delete \x7f umlaut ü, 中'},
        {"key with space": 1, "ümlaut": 2, "a.b": 3, "": 4, '"': 5, "bare-key_1": 6},
        {"empty": [], "nested": [[1, 2], [3.5], []], "mixed": [1, "a", {"b": [2]}]},
        {"long": ["a string of some length"] * 10, "matrix": [[1 / 3] * 5] * 5},
        {"table": {}, "outer": {"inner": {"x": 1}}, "both": {"x": 1, "inner": {"y": 2}}},
        {"rows": [{"x": 1}, {"x": 2, "inner": {"y": [1.5]}}, {}], "after": "plain"},
        {"outer": {"rows": [{"x": 1}, {"inner": [{"z": 1}]}], "plain": 1}, "last": 2},
    ],
)
def test_every_value_is_read_as_it_was_written(content):
    """Numbers come back bit by bit, strings letter by letter, tables with all their keys."""
    found = tomllib.loads(toml_text(content))
    assert found == content
    assert json.dumps(found, sort_keys=True) == json.dumps(content, sort_keys=True)  # -0.0, 2.0


def test_tuples_are_lists():
    """Tuples are written as lists, also of tables."""
    text = toml_text({"vector": (1.0, 2.0), "rows": ({"x": (1,)},)})
    assert tomllib.loads(text) == {"vector": [1.0, 2.0], "rows": [{"x": [1]}]}


def test_tables_follow_plain_keys():
    """A plain key never ends up in a table that was written before it."""
    assert toml_text({"t": {"x": 1}, "a": 2}) == "a = 2\n\n[t]\nx = 1\n"


@pytest.mark.parametrize("value", [None, object(), {1, 2}, b"bytes"])
def test_what_toml_cannot_hold_is_rejected(value):
    """A value that TOML has no form for is an error, and no text that says something else."""
    with pytest.raises(TypeError, match="TOML has no form for"):
        toml_text({"key": value})
