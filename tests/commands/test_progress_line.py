"""What a command says while a user waits."""

import pytest

from edtk.commands import progress_line as progress


def test_short_work_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """Steps that pass within the first second are not shown."""
    with progress.progress_line("first") as say:
        say("second")
    assert capsys.readouterr().err == ""


def test_long_work_says_its_steps(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each step after the delay is shown at once, with the time since the beginning."""
    monkeypatch.setattr(progress, "SHOWN_AFTER_S", 0.0)
    with progress.progress_line("first") as say:
        say("second")
        say("third")
    shown = capsys.readouterr().err
    assert all(f"{step} [00:00]" in shown for step in ("first", "second", "third"))
