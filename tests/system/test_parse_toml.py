"""TOML that nobody is trusted to have written: read, or refused in one line and in little time."""

import time
from contextlib import suppress

import pytest

from edtk.system.errors import UserError
from edtk.system.parsing import parse_toml


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"a = {'9' * 5000}", "has too many digits"),
        (f"a = 0x{'f' * 5000}", "a: the integer has more than 64 bits"),
        ("b.c = [1, -9223372036854775809]", "b.c.1: the integer has more than 64 bits"),
        (f"a = {'[' * 5000}", "nested too deeply"),
        (f"a = {'{a=' * 5000}", "nested too deeply"),
        (f"\n{'a.' * 20_000}b = 1", "a key of more than 16 parts (at line 2)"),
        (f"[{'a . ' * 20_000}b]", "a key of more than 16 parts (at line 1)"),
        (f"""{'"a b".' * 20_000}b = 1""", "a key of more than 16 parts"),
        ("a = 1\na = 2", "Cannot overwrite a value"),
        ("a = \0", "Invalid value"),
    ],
)
def test_what_no_parser_should_read_is_one_line(text, expected):
    """Long integers, deep tables and long keys are refused before they cost memory or time."""
    begin = time.process_time()
    with pytest.raises(UserError) as caught:
        parse_toml(text, "study.toml")
    assert str(caught.value).startswith("study.toml: ")
    assert expected in str(caught.value)
    assert time.process_time() - begin < 1


def test_what_people_write_is_read():
    """Dots in strings, in comments and in long lists of numbers are no long keys."""
    text = f"""
    # {"1.5 " * 30}
    title = "{"A word. " * 30}{"..." * 30}"
    numbers = [{"1.5, " * 100}]
    a."b.c".'d' = 9223372036854775807
    """
    found = parse_toml(text)
    assert len(found["numbers"]) == 100
    assert found["a"] == {"b.c": {"d": 2**63 - 1}}


@pytest.mark.slow
def test_a_long_word_takes_no_time():
    """The search for long keys is linear in the length of the text."""
    begin = time.process_time()
    for text in (f'a = "{"x" * 10**6}"', "a" * 10**6, "' \"" * 10**5):
        with suppress(UserError):
            parse_toml(text)
    assert time.process_time() - begin < 2
