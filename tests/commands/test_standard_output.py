"""Files that are written to standard output, and what becomes of the result."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from edtk.cli import main

STUDY = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"
PLAN = STUDY.parent / "plans" / "table_4_3.csv"
K = {"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6, "q6": 2.1e-6}


def edtk(*arguments):
    """The answer of a command."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_a_template_may_be_named_like_standard_output(tmp_path, monkeypatch):
    """`--out -` prints the bytes that a file would have, and makes no file."""
    monkeypatch.chdir(tmp_path)
    printed = edtk("template", STUDY, PLAN)
    assert edtk("template", STUDY, PLAN, "--out", "-").stdout_bytes == printed.stdout_bytes
    assert list(tmp_path.iterdir()) == []
    edtk("template", STUDY, PLAN, "--out", "sheet.csv")
    assert Path("sheet.csv").read_bytes() == printed.stdout_bytes


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_the_result_makes_way(tmp_path, options):
    """A table on standard output is alone there: text or JSON goes to standard error."""
    k = tmp_path / "k.json"
    k.write_text(json.dumps(K))
    usual = edtk("compensate", STUDY, k, PLAN, "--out", tmp_path / "a.csv", *options)
    answer = edtk("compensate", STUDY, k, PLAN, "--out", "-", *options)
    assert answer.exit_code == 0
    assert answer.stdout == (tmp_path / "a.csv").read_text()
    assert answer.stderr == usual.stdout + usual.stderr


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("plan STUDY --size 3 --out - --certificate -", "--certificate -: another output"),
        ("relax STUDY --out x.csv --certificate ./x.csv", "--certificate x.csv: another output"),
        ("run STUDY --out -", "-: is standard output; expected a folder"),
        ("bayes STUDY PLAN --chain -", "-: is standard output; expected a file"),
        ("plan STUDY --size 3 --workers 2 --dask tcp://127.0.0.1:9", "--workers 2: a cluster's"),
    ],
)
def test_what_does_not_go_together(tmp_path, monkeypatch, line, words):
    """One line before any work, and no file."""
    monkeypatch.chdir(tmp_path)
    places = {"STUDY": STUDY, "PLAN": PLAN}
    answer = edtk(*(places.get(word, word) for word in line.split()))
    assert answer.exit_code == 2
    assert answer.stdout == ""
    assert f"edtk: {words}" in answer.stderr
    assert list(tmp_path.iterdir()) == []
