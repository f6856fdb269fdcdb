"""What a command says while a user waits."""

import sys
import time

import pytest

from edtk.commands import shared as progress


def test_short_work_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """Steps that pass within the first second are not shown."""
    with progress.progress_line("first") as say:
        say("second")
    assert capsys.readouterr().err == ""


def on_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let standard error, which is caught, count as a terminal."""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)


def test_long_work_says_its_steps(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each step after the delay is shown at once, with the time since the beginning."""
    on_terminal(monkeypatch)
    monkeypatch.setattr(progress, "SHOWN_AFTER_S", 0.0)
    with progress.progress_line("first") as say:
        say("second")
        say("third")
    shown = capsys.readouterr().err
    assert all(f"{step} [00:00]" in shown for step in ("first", "second", "third"))


def test_a_first_step_that_takes_long_is_said_while_it_goes_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody need tell of a next step, and the line is ended as any other."""
    on_terminal(monkeypatch)
    monkeypatch.setattr(progress, "SHOWN_AFTER_S", 0.01)
    shown = ""
    with progress.progress_line("first"):
        while not shown:
            time.sleep(0.01)
            shown = capsys.readouterr().err
    assert "first [00:00]" in shown
    assert capsys.readouterr().err.endswith("first [00:00]\n")


def test_a_file_gets_few_lines(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where standard error is no terminal, each line comes after twice the time of the last."""
    now = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: now[0])
    with progress.progress_line("first") as say:
        for second in range(1, 3601):
            now[0] = float(second)
            say(f"step {second}")
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(" [")[0] for line in lines] == [f"step {2**k}" for k in range(12)]
    assert lines[-1] == "step 2048 [34:08]"


def test_a_file_is_told_of_a_first_step_that_takes_long(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody need tell of a next step."""
    monkeypatch.setattr(progress, "SHOWN_AFTER_S", 0.01)
    shown = ""
    until = time.monotonic() + 20.0
    with progress.progress_line("first"):
        while not shown and time.monotonic() < until:
            time.sleep(0.01)
            shown = capsys.readouterr().err
    assert shown == "first [00:00]\n"
