"""Errors carry where, which key and what, and say it in one line."""

import pickle
import time
from pathlib import Path

import pytest

from edtk.system.errors import ArgumentError, UserError, shortened


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (UserError("no such file"), "no such file"),
        (UserError("expected a number", key="seed"), "seed: expected a number"),
        (UserError("no such file", where=Path("a.toml")), "a.toml: no such file"),
        (UserError("is negative", where="a.toml", key="seed"), "a.toml: seed: is negative"),
    ],
)
def test_the_text_is_made_of_the_data(error, text):
    """Where, key and message are joined by colons, and nothing is said of what is not given."""
    assert str(error) == text


def test_an_error_travels_between_processes():
    """Text and data are the same after a journey to another process and back."""
    sent = UserError("is negative", where="a.toml", key="seed")
    received = pickle.loads(pickle.dumps(sent))
    assert str(received) == str(sent)
    assert vars(received) == vars(sent)


@pytest.mark.parametrize(
    ("error", "text", "flag"),
    [
        (ArgumentError("too few", argument="size"), "size: too few", "--size: too few"),
        (
            ArgumentError("too few", argument="size", given=3),
            "size 3: too few",
            "--size 3: too few",
        ),
        (
            ArgumentError("too few", argument="size", where="a.toml"),
            "a.toml: size: too few",
            "a.toml: --size: too few",
        ),
    ],
)
def test_an_argument_has_the_callers_name(error, text, flag):
    """The message names the argument and its value; a command line names its own flag."""
    assert str(error) == text
    assert str(error.naming(f"--{error.argument}")) == flag
    received = pickle.loads(pickle.dumps(error))
    assert str(received) == text
    assert vars(received) == vars(error)


MEGABYTE = 10**6


@pytest.mark.parametrize(
    "error",
    [
        UserError(f"expected a number, not {'x' * MEGABYTE!r}", where="a.csv", key="row 3"),
        UserError(f"expected a number (got {'a ' * MEGABYTE!r})", where="a.csv", key="row 3"),
        UserError(f"no joint {'x' * 400!r}; expected a number", where="a.csv", key="row 3"),
        UserError("expected a number", where=f"{'folder/' * 99}a.csv", key="row 3"),
        UserError("expected a number", where="a.csv", key=f"row 3, column {'x' * MEGABYTE}"),
        UserError(f"expected a number: {'x' * MEGABYTE}", where="x/" * 99 + "a.csv", key="row 3"),
        ArgumentError(f"row 3: expected a number, not {'1' * 999!r}", argument="a.csv"),
    ],
)
def test_a_message_is_short_whatever_it_repeats(error):
    """A line has at most 290 characters, and still says which file, which key and what is wrong."""
    assert len(str(error)) <= 290
    assert "..." in str(error)
    for part in ("a.csv", "row 3", "expected a number"):
        assert part in str(error)


def test_what_is_expected_outlives_a_long_quotation():
    """Only the quotation loses its middle, so that the end of the sentence can still be read."""
    text = str(UserError(f"the joint's name {'x' * 900!r} is not among q1, q2 and q3", key="k"))
    assert text.startswith("k: the joint's name 'xxxxxx")
    assert text.endswith("xxx' is not among q1, q2 and q3")
    assert len(text) < 130


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("a\nb\r\tc", "a\\nb\\r\\tc"),
        ("\x1b[31mred\x00", "\\x1b[31mred\\x00"),
        ("a\u2028b\u202ec", "a\\u2028b\\u202ec"),
        ("\udcff", "\\udcff"),
        ("Grad °, Größe, 関節", "Grad °, Größe, 関節"),
    ],
)
def test_control_characters_are_shown(written, shown):
    """Nothing that a file holds can break the line, move the cursor or hide behind the text."""
    assert shortened(written) == shown
    error = UserError(written, where=written, key=written)
    assert str(error) == f"{shown}: {shown}: {shown}"
    assert error.message == written


def test_shortening_takes_no_time():
    """Quotes that are opened a million times are not searched for their ends a million times."""
    hostile = " 'a" * MEGABYTE
    begin = time.process_time()
    assert len(shortened(hostile)) <= 300
    assert time.process_time() - begin < 1
