"""The command `python -m paper_figures`."""

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from paper_figures import figure_7
from paper_figures.__main__ import main
from paper_figures.example import load_example

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
FILES = {f"{n}.{e}" for n, es in (("table_5", "csv md"), ("table_6", "csv md")) for e in es.split()}
FILES |= {f"figure_7.{e}" for e in ("png", "svg", "csv", "md")}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder of the program without names, and what it said."""
    out = tmp_path_factory.mktemp("default") / "deep" / "out"
    command = [sys.executable, "-m", "paper_figures", "--out", str(out)]
    return out, subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)


def test_default_writes_everything(written):
    """Without names all tables and the figure are written, and nothing else; stdout stays empty."""
    out, done = written
    assert {p.name for p in out.iterdir()} == FILES
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == len(FILES)


def test_the_figure_is_repeatable(written, tmp_path):
    """Another process simulates and draws the same bytes, as PNG and as SVG."""
    for again in figure_7.write(load_example(), tmp_path):
        assert again.read_bytes() == (written[0] / again.name).read_bytes()
    assert (tmp_path / "figure_7.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (tmp_path / "figure_7.svg").read_bytes()


def test_a_name_writes_that_one(tmp_path):
    """A name restricts the run to it."""
    result = CliRunner().invoke(main, ["table_5", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert {p.name for p in tmp_path.iterdir()} == {"table_5.csv", "table_5.md"}


def test_unknown_name_is_one_line_and_exit_code_2(tmp_path):
    """An unknown name writes nothing and ends in one line that lists the names."""
    result = CliRunner().invoke(main, ["table_5", "table_9", "--out", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert "'table_9'" in result.stderr
    assert "figure_7" in result.stderr
    assert not (tmp_path / "out").exists()


def test_out_that_is_a_file_is_one_line(tmp_path):
    """A file given as --out, or above it, ends in one line and exit code 2."""
    (tmp_path / "file").write_text("", encoding="utf-8")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        result = CliRunner().invoke(main, ["table_5", "--out", str(out)])
        assert result.exit_code == 2
        assert len(result.stderr.splitlines()) == 1
