"""The house in numbers: how many files, how long, how tangled.

    python tests/house.py            the table
    python tests/house.py --ways     also the files through which a plan and a calibration go

Counts are of `edtk` and `criteria`. `tests/test_house.py` holds them below limits, so that the
house cannot grow back unseen.
"""

import ast
import inspect
import sys
import threading
from collections import defaultdict
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
ROOMS = ("criteria", "edtk")
QUESTIONS = ("parameters is None", "parameters is not None")
# Folders of plug-ins, of which each has a file of its own, however short.
PLUG_INS = ("criteria", "edtk/commands", "edtk/robots/constraints", "edtk/robots/loads")


@dataclass(frozen=True)
class House:
    """What there is to count.

    Attributes:
        files: Files of Python.
        statements: Statements, docstrings and imports not counted.
        one_function: Files whose only definition is one function, plug-ins not counted [%].
        circles: Imports under TYPE_CHECKING of a module that imports the importer in turn.
        questions: Places that ask whether `parameters is None`.
        constants: Numeric constants at module level, for 1000 lines.
        ambiguous: Names of such constants that have several values in one room.
    """

    files: int
    statements: int
    one_function: float
    circles: int
    questions: int
    constants: float
    ambiguous: int


@cache
def house() -> House:
    """Count everything."""
    paths = [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]
    texts = {path: path.read_text(encoding="utf-8") for path in paths}
    trees = {path: ast.parse(text) for path, text in texts.items()}
    lines = sum(text.count("\n") for text in texts.values())
    alone = [path for path, tree in trees.items() if _is_one_function(tree) and not _plugged(path)]
    numbers = sum(_is_number(node) for tree in trees.values() for node in tree.body)
    return House(
        len(paths),
        sum(_statements(tree) for tree in trees.values()),
        100 * len(alone) / len(paths),
        _circles({_module(path): tree for path, tree in trees.items()}),
        sum(text.count(question) for text in texts.values() for question in QUESTIONS),
        1000 * numbers / lines,
        _ambiguous({_module(path): tree for path, tree in trees.items()}),
    )


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def _plugged(path: Path) -> bool:
    return str(path.parent.relative_to(ROOT)) in PLUG_INS


def _is_one_function(tree: ast.Module) -> bool:
    defined = [one for one in tree.body if isinstance(one, ast.FunctionDef | ast.ClassDef)]
    return len(defined) == 1 and isinstance(defined[0], ast.FunctionDef)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _statements(tree: ast.Module) -> int:
    no_work = ast.Import | ast.ImportFrom
    nodes = (node for node in ast.walk(tree) if isinstance(node, ast.stmt))
    return sum(not isinstance(node, no_work) and not _is_text(node) for node in nodes)


def _is_number(node: ast.stmt) -> bool:
    value = node.value if isinstance(node, ast.Assign) else None
    plain = isinstance(value, ast.Constant) and isinstance(value.value, int | float)
    return plain and not isinstance(value.value, bool)  # type: ignore[union-attr]


def _ambiguous(trees: dict[str, ast.Module]) -> int:
    """Names of constants that have several values in one room."""
    values: dict[tuple[str, str], set[float]] = defaultdict(set)
    for module, tree in trees.items():
        first, *rest = module.split(".")
        room = ".".join([first, *rest[:1]]) if first == "edtk" else first
        for node in tree.body:
            if _is_number(node):
                values[room, ast.unparse(node.targets[0])].add(node.value.value)
    return sum(len(own) > 1 for own in values.values())


def _circles(trees: dict[str, ast.Module]) -> int:
    """Pairs of modules that name each other, one of them under TYPE_CHECKING."""
    runs: dict[str, set[str]] = defaultdict(set)
    checked: dict[str, set[str]] = defaultdict(set)
    for module, tree in trees.items():
        for node in tree.body:
            if isinstance(node, ast.ImportFrom):
                runs[module] |= _imported(node, trees)
            elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                for inner in node.body:
                    if isinstance(inner, ast.ImportFrom):
                        checked[module] |= _imported(inner, trees)
    front = "edtk"  # names everything for type checkers, and loads it when it is used
    pairs = ((one, other) for one, others in checked.items() for other in others if one != front)
    return sum(one in _reached(other, runs) for one, other in pairs)


def _imported(node: ast.ImportFrom, trees: dict[str, ast.Module]) -> set[str]:
    names = {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in names if name in trees} or {str(node.module)}


def _reached(module: str, runs: dict[str, set[str]]) -> set[str]:
    seen: set[str] = set()
    waiting = [module]
    while waiting:
        for other in runs.get(waiting.pop(), set()) - seen:
            seen.add(other)
            waiting.append(other)
    return seen


def ways() -> dict[str, int]:
    """Files of which some function is called, by a plan and by a calibration of the KR 270."""
    import numpy as np

    import edtk

    study = edtk.load_study(ROOT / "studies" / "kr270_milling.toml")
    found: dict[str, int] = {}
    with TemporaryDirectory() as folder, _calls() as called:
        plan = edtk.plan(study, size=4, seed=1, workers=1)
        plan.summary()
        found["plan"] = len(called)
        sheet = edtk.template(study, plan.plan)
        rows = study.model.regressor(plan.plan.q, plan.plan.wrench) @ study.compliances
        noise = np.random.default_rng(1).normal(size=rows.shape) * 3e-5
        measured = 1e3 * np.repeat(rows + noise, plan.plan.repeats, axis=0)
        sheet[["dx_mm", "dy_mm", "dz_mm"]] = measured
        path = Path(folder) / "day.csv"
        sheet.to_csv(path, index=False)
        called.clear()
        edtk.identify(study, path).summary()
        found["identify"] = len(called)
    return found


class _calls:
    """The files of the house of which some function is called meanwhile."""

    def __enter__(self) -> set[str]:
        self.files: set[str] = set()
        homes = tuple(str(ROOT / room) for room in ROOMS)

        def note(frame: object, event: str, argument: object) -> None:
            code = frame.f_code  # type: ignore[attr-defined]
            file = code.co_filename
            # Bodies of modules and classes, which an import runs, are no functions.
            is_function = code.co_flags & inspect.CO_OPTIMIZED
            if event == "call" and is_function and file.startswith(homes):
                self.files.add(file)

        sys.setprofile(note)
        threading.setprofile(note)
        return self.files

    def __exit__(self, *error: object) -> None:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]


if __name__ == "__main__":
    for name, number in asdict(house()).items():
        print(f"{name:14s}{number:10.5g}")
    if "--ways" in sys.argv:
        for name, number in ways().items():
            print(f"{name + ', files':14s}{number:10d}")
