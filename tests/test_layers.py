"""The direction of imports."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = ("criteria", "edtk.model", "edtk.design", "edtk.inference", "edtk.study", "edtk.commands", "edtk.cli")
ABOVE = {layer: set(LAYERS[i + 1 :]) | {"paper_figures", "studies"} for i, layer in enumerate(LAYERS)}
ABOVE["criteria"] |= {"edtk"}
FILES = sorted(p for folder in ("criteria", "edtk") for p in (ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_run_only_downwards(path: Path) -> None:
    """No module imports from a layer above its own."""
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    layer = next((name for name in LAYERS if module == name or module.startswith(f"{name}.")), None)
    forbidden = ABOVE[layer] if layer else {"paper_figures", "studies"}
    for node in ast.walk(ast.parse(path.read_text())):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        for name in names:
            assert not any(name == f or name.startswith(f"{f}.") for f in forbidden), f"{module} imports {name}"
