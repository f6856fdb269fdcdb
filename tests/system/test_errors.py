"""Errors carry where, which key and what, and say it in one line."""

import pickle
from pathlib import Path

import pytest

from edtk.system.errors import ArgumentError, UserError


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
