"""README and documentation say what is true: every snippet runs, every file and command exists."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import criteria
from edtk.cli import main
from edtk.model.robot_from_dict import robot_from_dict

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if "examples" not in page.parts]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)


def blocks(page: Path, *languages: str) -> list[tuple[str, str]]:
    """Language and text of the fenced blocks of a page."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(language, text) for language, text in found if language in languages]


def script(page: Path) -> str:
    """A page as a program: its Python as it stands, and calls of its commands in between."""
    lines = ["import subprocess as _subprocess, sys as _sys"]
    for language, text in blocks(page, "python", "sh"):
        if language == "python":
            lines.append(text)
            continue
        for line in text.splitlines():
            words = line.split("#")[0].split()
            if words[:1] == ["edtk"]:
                command = f"[_sys.executable, '-m', 'edtk', *{words[1:]!r}]"
                lines.append(f"_subprocess.run({command}, check=True)")
    return "\n".join(lines)


WITH_CODE = [page for page in PAGES if len(script(page).splitlines()) > 1]


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.stem)
def test_every_snippet_runs(page: Path, tmp_path: Path) -> None:
    """The Python and the commands of a page run from the top down, where the studies are."""
    shutil.copytree(ROOT / "studies", tmp_path / "studies")
    command = [sys.executable, "-W", "error", "-c", script(page)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    if page.stem == "linear_model":
        assert done.stdout.count("weight 0.3333  4 of 12") == 3


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


def test_commands_that_are_named_exist() -> None:
    """Every `edtk COMMAND` of the pages is a command of the program."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert set(re.findall(r"`edtk (\w+)", text)) <= set(main.commands), page


def test_robot_files_in_the_pages_are_robots() -> None:
    """A TOML block that describes a robot can be loaded."""
    texts = [text for page in PAGES for _, text in blocks(page, "toml") if "[[joints]]" in text]
    assert [robot_from_dict(tomllib.loads(text)).n for text in texts] == [3]
