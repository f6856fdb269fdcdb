"""JSON that nobody is trusted to have written: strict, or refused in one line."""

import pytest

from edtk.system.errors import UserError
from edtk.system.parsing import parse_json


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[" * 100_000, "nested too deeply"),
        ('{"a":' * 100_000, "nested too deeply"),
        ("9" * 5000, "k.json: has a number of 500 digits or more"),
        (f'{{"a": [0, -{"9" * 400}]}}', "k.json: a.1: expected a finite number"),
        ("[1e999]", "k.json: 0: expected a finite number, got an infinite one"),
        ('{"a": {"b": NaN}}', "k.json: a.b: expected a finite number, got NaN"),
        ("[-Infinity]", "k.json: 0: expected a finite number"),
        ('{"a": 1, "a": 2}', "a key occurs twice in one table"),
        ("", "Expecting value"),
        ("{'a': 1}", "Expecting property name"),
    ],
)
def test_what_is_not_strict_is_one_line(text, expected):
    """What other programs would read otherwise, or not at all, is refused."""
    with pytest.raises(UserError, match=r"^k\.json: ") as caught:
        parse_json(text, "k.json")
    assert expected in str(caught.value)


def test_strict_json_is_read():
    """Numbers come back as they are."""
    found = parse_json('{"a": [1, 2.5e-7, null, true, "NaN"]}')
    assert found == {"a": [1, 2.5e-7, None, True, "NaN"]}
