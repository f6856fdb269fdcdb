"""The direction of imports."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = (
    "edtk.system",
    "criteria",
    "edtk.model",
    "edtk.tables",
    ("edtk.design", "edtk.inference"),
    "edtk.study",
    "edtk.calibration",
    "edtk.report",
    "edtk.commands",
    "edtk.cli",
)
ORDER = {
    name: i
    for i, layer in enumerate(LAYERS)
    for name in ([layer] if isinstance(layer, str) else layer)
}
FILES = sorted(p for folder in ("criteria", "edtk") for p in (ROOT / folder).rglob("*.py"))


def layer_of(module: str) -> int | None:
    """The number of a module's layer, from below."""
    return next(
        (i for name, i in ORDER.items() if module == name or module.startswith(f"{name}.")), None
    )


def imported(tree: ast.AST) -> set[str]:
    """All modules, and names that may be modules, that a file imports anywhere."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {node.module or ""} | {f"{node.module}.{a.name}" for a in node.names}
    return names


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_run_only_downwards(path: Path) -> None:
    """No module imports from a layer above its own, the criteria nothing of edtk's, and nothing from the scripts."""
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    own = layer_of(module)
    for name in imported(ast.parse(path.read_text())):
        other = layer_of(name)
        assert own is None or other is None or other <= own, f"{module} imports {name}"
        assert name.split(".")[0] not in ("paper_figures", "studies"), f"{module} imports {name}"
        assert not (module.startswith("criteria") and name.startswith("edtk")), (
            f"{module} imports {name}"
        )


def test_a_wrong_import_is_found() -> None:
    """A module of a higher layer is found whichever way it is imported."""
    for text in (
        "import edtk.calibration.posterior_check",
        "from edtk import study",
        "from edtk.study import bayes",
    ):
        assert max(layer_of(name) or 0 for name in imported(ast.parse(text))) == layer_of(
            "edtk.study"
        )
