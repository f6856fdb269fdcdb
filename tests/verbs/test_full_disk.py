"""On a full disk a command ends in one line and leaves all files as they were.

`studies/kills_and_full_disks.py` tries every command that writes.
"""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from forked import fill_disk, forked, free_disk

from edtk.cli import main

STUDY = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"
PLAN = STUDY.parent / "plans" / "table_4_3.csv"
K = {"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6, "q6": 2.1e-6}


def lines(answer):
    """Lines on standard error other than those that a progress bar overwrites."""
    said = answer.stderr.replace("\r", "\n").split("\n")
    return [line for line in said if line.startswith("edtk: ") or "Traceback" in line]


def content(folder):
    """All files below a folder, with their bytes."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.unix
@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("template STUDY PLAN --out sheet.csv", "sheet.csv"),
        ("compensate STUDY k.json PLAN --out new/commands.csv", "new/commands.csv"),
    ],
)
def test_full_disk(tmp_path, monkeypatch, line, named):
    """The line names the file that did not fit, not the study; standard output is empty."""
    monkeypatch.chdir(tmp_path)
    Path("k.json").write_text(json.dumps(K))
    before = content(tmp_path)
    places = {"STUDY": str(STUDY), "PLAN": str(PLAN)}

    def command():
        fill_disk(10)
        answer = CliRunner().invoke(main, [places.get(word, word) for word in line.split()])
        free_disk()
        assert answer.exit_code == 2, answer.stderr
        assert answer.stdout == ""
        assert lines(answer) == [f"edtk: {named}: File too large"]

    assert forked(command) == 0
    assert content(tmp_path) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["k.json"]
