"""The page of options says of each kind of study what runs, and each cell of it is tested."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "options.md"
KINDS = ("springs", "parameters")
ROW = re.compile(r"^\| (?P<option>.+?) \| (?P<springs>.+?) \| (?P<parameters>.+?) \|$")
Cell = tuple[str, str]


def cells() -> dict[Cell, str]:
    """What the page says, by option and kind of study."""
    rows = [ROW.match(line) for line in PAGE.read_text(encoding="utf-8").splitlines()]
    found = [row for row in rows if row and row["option"] not in ("option", "---")]
    return {(row["option"], kind): row[kind] for row in found for kind in KINDS}


def marks() -> Iterator[tuple[Cell, str]]:
    """Tests with the cells that they are marked to prove: `@pytest.mark.cell(option, kind)`."""
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        text = path.read_text(encoding="utf-8")
        if "mark.cell(" not in text:
            continue
        for node in ast.parse(text).body:
            for mark in getattr(node, "decorator_list", ()):
                if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.cell":
                    option, *kinds = (ast.literal_eval(argument) for argument in mark.args)
                    for kind in kinds or KINDS:
                        yield (option, kind), f"{path.name}::{node.name}"  # type: ignore[attr-defined]


def test_every_cell_is_tested() -> None:
    """Each cell has a test that is marked with it, and no mark names another."""
    tests = defaultdict(list)
    for cell, name in marks():
        tests[cell].append(name)
    said = cells()
    assert len(said) > 60
    assert set(said) - set(tests) == set()
    assert set(tests) - set(said) == set()
