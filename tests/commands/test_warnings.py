"""Commands that read a study say on standard error what is hard to believe in it."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from edtk.cli import main
from edtk.commands.shared import warn_in_full
from edtk.study.study import load_study
from edtk.system.errors import LONGEST

ROOT = Path(__file__).parents[2]
PLAN = ROOT / "studies" / "plans" / "table_4_3.csv"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The paper's study with a tool of the task in metres."""
    given = load_study(ROOT / "studies" / "kr270_milling.toml")
    pose = given.to_dict()["test_pose"] | {"tool": {"position_mm": [0.986, 0, 0]}}
    path = tmp_path_factory.mktemp("study") / "study.toml"
    given.replace(test_pose=pose, published=None).to_toml(path)
    return path


@pytest.mark.parametrize("command", ["evaluate", "template"])
def test_a_finding_is_one_line_on_standard_error(study, command):
    """The answer is given, and the key is named beside it."""
    result = CliRunner().invoke(main, [command, str(study), str(PLAN)])
    assert result.exit_code == 0, result.stderr
    assert "metres" not in result.stdout
    lines = [line for line in result.stderr.splitlines() if "is it given in metres?" in line]
    assert len(lines) == 1
    assert lines[0].startswith(f"edtk: {study}: test_pose.tool.position_mm: ")


@pytest.mark.parametrize("to_file", [True, False])
def test_a_sheet_is_not_written_where_the_study_cannot_be_judged(tmp_path, to_file):
    """Excluded poses that cannot be read end the command before anything is written."""
    excluded, study, sheet = (tmp_path / name for name in ("bad.csv", "study.toml", "sheet.csv"))
    excluded.write_text("q1_deg,elsewhere\n1,2\n")
    given = load_study(ROOT / "studies" / "kr270_milling.toml")
    workspace = given.to_dict()["workspace"] | {"excluded": [str(excluded)]}
    given.replace(workspace=workspace, published=None).to_toml(study)
    options = ["--out", str(sheet)] if to_file else []
    result = CliRunner().invoke(main, ["template", str(study), str(PLAN), *options])
    assert result.exit_code == 2
    assert "bad.csv: unknown column 'elsewhere'" in result.stderr
    assert result.stdout == ""
    assert not sheet.exists()


def test_a_long_finding_is_told_to_its_end(capsys):
    """Each word of it stands on some line, each line is short, and the first names the file."""
    sentence = " ".join(f"word{i}" for i in range(100))
    warn_in_full(sentence, Path("sheet.csv"))
    lines = capsys.readouterr().err.splitlines()
    assert all(line.startswith("edtk: ") and len(line) <= LONGEST for line in lines)
    assert lines[0].startswith("edtk: sheet.csv: word0 ")
    assert " ".join(lines).replace("edtk:", " ").split()[1:] == sentence.split()
