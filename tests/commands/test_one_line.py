"""Every error of a user is one short line on standard error, and exit code 2."""

import errno
import os
import signal

import click
import pytest
from click.testing import CliRunner

from criteria import CriterionError
from edtk.cli import main
from edtk.commands.shared import OneLine
from edtk.system.errors import ArgumentError, UserError

LONG = "x\n" * 10**5


@click.command(cls=OneLine)
@click.option("--size", type=int)
@click.option("--kind", type=click.Choice(["flat", "normal"]))
@click.pass_obj
def command(error, size, kind):
    """Raise the error that the test gives."""
    raise error


@pytest.mark.parametrize(
    "error",
    [
        UserError(f"expected a number, not {LONG!r}"),
        ArgumentError(f"expected a number, not {LONG}", argument="size", given=LONG),
        CriterionError(f"unknown criterion {LONG}"),
        OSError(errno.ENOENT, "No such file", f"folder/{LONG}"),
        OSError(LONG),
        MemoryError(LONG),
        MemoryError(),
        ImportError(f"libx.so: failed to map segment from shared object {LONG}"),
        click.ClickException(LONG),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_is_one_short_line(error):
    """Whatever the error repeats, the line has at most 300 characters and no control character."""
    answer = CliRunner().invoke(command, [], obj=error)
    assert answer.exit_code == 2
    assert answer.stdout == ""
    line = answer.stderr.removesuffix("\n")
    assert line.isprintable()
    assert len(line) <= 300


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--size", LONG], "is not a valid integer"),
        (["--kind", LONG], "is not one of 'flat', 'normal'"),
        ([f"--{LONG}"], "No such option"),
        ([LONG], "Got unexpected extra argument"),
    ],
)
def test_a_wrong_option_is_one_short_line(arguments, expected):
    """The line says what was expected, and shows a part of what was given."""
    answer = CliRunner().invoke(command, arguments)
    assert answer.exit_code == 2
    line = answer.stderr.removesuffix("\n")
    assert line.isprintable()
    assert len(line) <= 300
    assert expected in line


@pytest.mark.unix
def test_sigterm_is_like_ctrl_c():
    """A program that is asked to end says so, with the exit code of Ctrl-C."""

    @click.command(cls=OneLine)
    def waiting():
        os.kill(os.getpid(), signal.SIGTERM)
        signal.pause()

    before = signal.getsignal(signal.SIGTERM)
    answer = CliRunner().invoke(waiting, [])
    assert answer.exit_code == 130
    assert answer.stderr.strip() == "edtk: interrupted"
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize(
    "words", [["run", "study.toml", "--out="], ["evaluate", "", "plan.csv"]], ids=" ".join
)
def test_an_empty_path_is_rejected(words, tmp_path, monkeypatch):
    """A path that is empty, as of a variable that is not set, is not the present folder."""
    monkeypatch.chdir(tmp_path)
    answer = CliRunner().invoke(main, words)
    assert answer.exit_code == 2
    assert answer.stderr.endswith("the path is empty.\n")
    assert list(tmp_path.iterdir()) == []
