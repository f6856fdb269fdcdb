"""The plan of the house: in which direction rooms import."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# From the ground up.
FLOORS = (
    ("edtk.version",),
    ("edtk.system",),
    ("edtk.findings.finding",),
    ("edtk.certificate.recompute",),
    ("criteria.linalg",),
    ("criteria",),
    ("edtk.robots",),
    ("edtk.cell",),
    ("edtk.programs",),
    ("edtk.measure",),
    ("edtk.design", "edtk.fit"),
    ("edtk.design.interior_point",),
    ("edtk.design.relaxation",),
    ("edtk.design.exact",),
    ("edtk.design.enclosure",),
    ("edtk.study",),
    ("edtk.findings",),
    ("edtk.certificate",),
    ("edtk.calibration",),
    ("edtk.report",),
    ("edtk.verbs",),
    ("edtk.commands",),
    ("edtk.cli",),
)
LEVELS = {room: level for level, rooms in enumerate(FLOORS) for room in rooms}
SIBLINGS = ("edtk.design", "edtk.fit")  # with their wings, neither imports the other
FILES = sorted(path for folder in ("criteria", "edtk") for path in (ROOT / folder).rglob("*.py"))


def module_of(path: Path) -> str:
    """The dotted name of a file; a package's is that of its folder."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def is_in(name: str, room: str) -> bool:
    """Whether a dotted name is a room, or inside it."""
    return name == room or name.startswith(f"{room}.")


def room_of(module: str) -> str | None:
    """The innermost room that a module belongs to; None for the front door and foreign modules."""
    parts = module.split(".")
    outwards = (".".join(parts[:length]) for length in range(len(parts), 0, -1))
    return next((name for name in outwards if name in LEVELS), None)


def imported(tree: ast.AST) -> set[str]:
    """All modules, and names that may be modules, that a file imports anywhere."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def may_import(module: str, name: str) -> bool:
    """Whether a module may import a name: of its own room, or of one on a floor below."""
    own = room_of(module)
    other = room_of(name)
    if own is None or other is None:
        return True
    between = {sibling for sibling in SIBLINGS for room in (own, other) if is_in(room, sibling)}
    if len(between) == 2:
        return False
    return own == other or LEVELS[other] < LEVELS[own]


@pytest.fixture(scope="module")
def trees() -> dict[Path, ast.Module]:
    """Every module, parsed once."""
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in FILES}


@pytest.mark.slow
def test_imports_run_only_downwards(trees: dict[Path, ast.Module]) -> None:
    """No module imports from a floor above, from a sibling room, or from the scripts; criteria know
    nothing of edtk.
    """
    wrong = []
    for path, tree in trees.items():
        module = module_of(path)
        foreign = {"paper_figures", "studies"}
        if module.startswith("criteria"):
            foreign.add("edtk")
        for name in imported(tree):
            if not may_import(module, name) or name.split(".")[0] in foreign:
                wrong.append(f"{module} imports {name}")
    assert wrong == []


def test_no_two_files_of_tests_have_one_name() -> None:
    """Pytest imports them without packages, and stops at the second one of a name."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))


@pytest.mark.parametrize(
    ("module", "statement", "allowed"),
    [
        ("edtk.design.problem", "import edtk.calibration.posterior_check", False),
        ("edtk.robots.robot", "from edtk import study", False),
        ("edtk.design.problem", "from edtk.study.study import Study", False),
        ("edtk.design.problem", "from edtk.design.exact.refine import refine", False),
        ("edtk.design.relaxation.relax", "from edtk.design import exact", False),
        ("edtk.design.exact.refine", "from edtk.fit.fit_huber import fit_huber", False),
        ("edtk.fit.identify", "from edtk.design.plan import Plan", False),
        ("edtk.verbs.plan", "from edtk.commands.plan import command", False),
        ("edtk.design.exact.refine", "from edtk.design import relaxation", True),
        ("edtk.design.exact.refine", "from edtk.design.plan import Plan", True),
        ("edtk.commands.plan", "from edtk.verbs import plan", True),
        ("edtk.system.workers", "from edtk.version import __version__", True),
        ("edtk.design.problem", "from criteria.linalg import triangle", True),
    ],
)
def test_a_wrong_import_is_found(module: str, statement: str, allowed: bool) -> None:
    """An import from above or from a sibling is found however it is written, inside design too."""
    names = imported(ast.parse(statement))
    assert all(may_import(module, name) for name in names) == allowed
