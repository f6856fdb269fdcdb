"""README and documentation say what is true: every snippet runs, every file and command exists."""

import re
import shlex
import shutil
import tomllib
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from arm import arm
from click.testing import CliRunner
from pydantic import BaseModel

import criteria
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.cli import main
from edtk.findings.fitted_data import FittedData
from edtk.fit.measurements import Measurements
from edtk.robots.robot_file import RobotFile, robot_from_dict
from edtk.study.schema import Specification

pytestmark = pytest.mark.usefixtures("shortest_searches")

ROOT = Path(__file__).parents[1]
LOAD = {"F_N": [0, 0, -50]}
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if "examples" not in page.parts]
FILE = re.compile(r"# (\S+\.toml)\n")  # a block that is a file begins with its name
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)


def blocks(page: Path, *languages: str) -> list[tuple[str, str]]:
    """Language and text of the fenced blocks of a page."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(language, text) for language, text in found if language in languages]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_picture_is_there(page: Path) -> None:
    """A picture is a file beside the pages, and has a text for those who do not see it."""
    for text, name in re.findall(r"!\[(.*?)\]\((.*?)\)", page.read_text(encoding="utf-8")):
        assert text
        assert (page.parent / name).is_file()


def script(page: Path) -> str:
    """A page as a program: its Python as it stands, its files, and calls of its commands."""
    lines = []
    for language, text in blocks(page, "python", "sh", "toml"):
        if language == "python":
            lines.append(text)
            continue
        if language == "toml":
            named = FILE.match(text)
            if named:
                lines.append(f"Path({named[1]!r}).write_text({text!r}, encoding='utf-8')")
            continue
        for line in text.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words[:1] == ["edtk"]:
                lines.append(f"command({words[1:]!r})")
    return "\n".join(lines)


def command(words: list[str]) -> None:
    """A command of a page, which has to succeed; a search may take a second of its budget."""
    if "--budget" in words:
        words[words.index("--budget") + 1] = "1"
    result = CliRunner().invoke(main, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output


WITH_CODE = [page for page in PAGES if script(page)]


def copy_small_studies(folder: Path) -> None:
    """The studies, with fewer candidates: a page shows how, and not how good the plan is."""
    shutil.copytree(ROOT / "studies", folder / "studies")
    for path in folder.glob("studies/*.toml"):
        text = path.read_text(encoding="utf-8")
        small = re.sub(r"^candidates = \d+", "candidates = 200", text, flags=re.MULTILINE)
        path.write_text(small, encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.stem)
def test_every_snippet_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The Python and the commands of a page run from the top down, where the studies are."""
    copy_small_studies(tmp_path)
    monkeypatch.chdir(tmp_path)
    names = {"__name__": page.stem, "command": command, "Path": Path}
    exec(compile(script(page), str(page), "exec"), names)
    if page.stem == "linear_model":
        assert capsys.readouterr().out.count("weight 0.3333  4 of 12") == 3


def test_the_quick_tests_are_there() -> None:
    """Where one of these is gone, pytest runs nothing at all."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = re.search(r"^QUICK := ((?:.*\\\n)*.*)", makefile, re.MULTILINE)
    assert named is not None
    paths = re.findall(r"(?<!wildcard )\btests/[\w/]+(?:\.py)?", named[1])
    assert len(paths) > 10
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_readme_needs_ten_lines_of_python() -> None:
    """The example in README is short."""
    (_, text), *_ = blocks(ROOT / "README.md", "python")
    assert sum(1 for line in text.splitlines() if line and not line.startswith("#")) <= 10


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_make_targets_exist(page: Path) -> None:
    """Files that a page links to are there, and so are the targets of make that it names."""
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#:\s]+)\)", text):
        assert (page.parent / target).exists(), target
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^(\w+):", makefile, flags=re.MULTILINE))
    assert set(re.findall(r"^make (\w+)", text, flags=re.MULTILINE)) <= targets
    assert set(re.findall(r"`make (\w+)`", text)) <= targets


def test_every_criterion_is_explained() -> None:
    """The table of criteria has a row for each criterion, with its sense."""
    text = (ROOT / "docs/explanation/criteria.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\w+) \|.*\| (min|max) \|", text, flags=re.MULTILINE)
    described = [criteria.get(name).describe() for name in criteria.available()]
    assert rows == [(d["name"], d["sense"]) for d in described]
    families = re.findall(r"^\| `(\w+)` \|", text, flags=re.MULTILINE)
    assert families == list(criteria.families())


def test_commands_that_are_named_exist() -> None:
    """Every `edtk COMMAND` of the pages is a command of the program."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert set(re.findall(r"`edtk (\w+)", text)) <= set(main.commands), page


def test_robot_files_in_the_pages_are_robots() -> None:
    """A TOML block that describes a robot can be loaded."""
    texts = [text for page in PAGES for _, text in blocks(page, "toml") if "[[joints]]" in text]
    assert [robot_from_dict(tomllib.loads(text)).n for text in texts] == [3, 3]


def test_every_key_of_a_result_is_documented() -> None:
    """The table of k.json has the keys that a calibration writes, in their order."""
    study = arm(test_pose={"q_deg": [9, 40], "tool": {"position_mm": [400, 0, 0]}, "load": LOAD})
    q = np.array([[0.1, 0.5], [0.9, -0.6], [-1.2, 1.0]])
    wrench = np.tile([0, 0, -100.0, 0, 0, 0], (3, 1))
    moved = study.model.regressor(q, wrench) @ np.array([3e-6, 5e-6]) + 1e-5 * np.eye(3)
    data = Measurements(q, wrench, moved, np.full((3, 3), 1e-4), np.zeros((3, 3)))
    found = SpringCalibration(FittedData.of(study, data), findings=(), path=Path("day.csv"))
    text = (ROOT / "docs/reference/files.md").read_text(encoding="utf-8")
    section = text.partition("## Compliances")[2].partition("## Certificates")[0]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| (.*) \|$", section, flags=re.MULTILINE)
    assert [key for key, _, _ in rows] == list(found.to_dict())


def test_every_key_of_study_and_robot_is_explained() -> None:
    """Each key has a sentence, with its unit where its name has one."""
    missing = []
    for table in (Specification, RobotFile):
        tables = [table]
        for part in tables:
            for key, field in part.model_fields.items():
                tables += tables_of(field.annotation)
                unit = re.search(r"_(mm|m|deg|rad|N|Nm)$", key)
                if not field.description or (unit and "[" not in field.description):
                    missing.append(f"{part.__name__}.{key}")
    assert missing == []


def tables_of(annotation: object) -> list[type[BaseModel]]:
    """Tables among the types that a key may have."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for part in get_args(annotation) for table in tables_of(part)]
