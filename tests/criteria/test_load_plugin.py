"""A third party's criterion that fails is named and left out, and does no harm to the others."""

import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from click.testing import CliRunner

import criteria
from criteria import registry
from edtk.cli import main
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate
from edtk.verbs.inputs import load_study

FILE = "studies/kr270_milling.toml"
GOOD = """
import numpy as np
from criteria import Criterion


class C(Criterion):
    name = "mine"
    title = "Somebody else's"
    formula = "trace(cov)"
    sense = "min"
    degree = 1.0

    def _cost(self, M, cov):
        return np.trace(cov, axis1=-2, axis2=-1)

    def _gradient(self, M, cov):
        return -cov @ cov
"""
COST = "return np.trace(cov, axis1=-2, axis2=-1)"
# What fails: the text that replaces a part of the good module, and what the line says.
AT_LOADING = {
    "raises": (GOOD, "1/0", "does not load: ZeroDivisionError: division by zero"),
    "exits": (GOOD, "import sys; sys.exit(3)", "does not load: SystemExit: 3"),
    "syntax": (GOOD, "no python", "does not load: SyntaxError"),
    "two lines": (GOOD, "raise OSError('a\\nb')", "does not load: OSError: a b"),
    "no criterion": (GOOD, "C = 3", "must be a Criterion class whose name is 'mine'"),
    "another name": ('"mine"', '"yours"', "must be a Criterion class whose name is 'mine'"),
    "no sense": ('sense = "min"', 'sense = "best"', "declares no valid sense"),
    "no title": ("title =", "other =", "declares no valid title"),
    "degree": ("degree = 1.0", "degree = 'one'", "declares no valid degree"),
    "unit": ("degree = 1.0", "degree = 1.0; shown = 1e3", "declares no valid shown"),
    "abstract": ("def _gradient", "def gradient_", "does not define _gradient"),
}
AT_WORK = {
    "raises": (COST, "raise KeyError('x')", "its _cost fails: KeyError: 'x'"),
    "exits": (COST, "raise SystemExit", "its _cost fails: SystemExit"),
    "shape": (COST, "return np.ones(7)", "its _cost has shape (7,) for M of shape (5, 5)"),
    "nothing": (COST, "return None", "its _cost is of type object, expected numbers"),
    "words": (COST, "return 'good'", "its _cost is of type <U4, expected numbers"),
    "construction": ("def _cost", "def __init__(self): 1/0\n    def _cost", "__init__ fails"),
}


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    """Install a module as the plug-in "mine", or under the names that are given."""

    def install(text, names=("mine",)):
        (tmp_path / "foreign.py").write_text(text)
        points = tuple(EntryPoint(name, "foreign:C", registry.GROUP) for name in names)
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.setattr(registry, "_entry_points", lambda path: points)
        monkeypatch.setattr(registry, "_registered", dict(registry._registered))

    criteria.available()  # the built-ins are registered before the register is copied
    yield install
    sys.modules.pop("foreign", None)


@pytest.mark.parametrize("case", AT_LOADING)
def test_what_does_not_load_is_left_out(plugin, case, capsys):
    """The line names the entry point or class, and why; the built-ins are all there."""
    old, new, message = AT_LOADING[case]
    plugin(GOOD.replace(old, f"print('noise')\n{new}" if old is GOOD else new))
    loaded = criteria.load_all()
    assert tuple(loaded.classes) == registry.BUILTINS
    assert message in loaded.problems["mine"]
    assert "foreign" in loaded.problems["mine"]
    assert "\n" not in loaded.problems["mine"]
    with pytest.raises(criteria.CriterionError, match="mine"):
        criteria.get("mine")
    assert capsys.readouterr().out == ""


def test_a_built_in_name_stays_with_the_built_in(plugin):
    """A plug-in that claims "A" is named, is not imported, and changes no result."""
    plugin("1/0", ("A",))
    loaded = criteria.load_all()
    assert tuple(loaded.classes) == registry.BUILTINS
    assert loaded.problems["A"].startswith("criterion name 'A' of entry point 'foreign:C' is al")
    assert "foreign" not in sys.modules
    assert criteria.create("A").value(np.eye(2)) == 2


@pytest.fixture(scope="module")
def study():
    """A study with a plan."""
    return load_study(FILE)


@pytest.mark.parametrize("case", AT_WORK)
def test_evaluate_leaves_out_what_fails(plugin, study, case):
    """All other values are there; only a study that asks for the criterion ends in an error."""
    old, new, message = AT_WORK[case]
    plugin(GOOD.replace(old, new))
    plan = study.published_plans()["table_4_12"]
    found = evaluate(study, plan)
    assert tuple(found.criteria) == registry.BUILTINS
    assert message in found.skipped["mine"]
    with pytest.raises(UserError, match="criterion 'mine'"):
        evaluate(study.replace(criteria=["mine", "A"]), plan)


def test_one_that_works_is_evaluated(plugin, study):
    """A sound plug-in stands behind the built-ins, and nothing is said."""
    plugin(GOOD)
    found = evaluate(study, study.published_plans()["table_4_12"])
    assert found.criteria["mine"] == pytest.approx(found.criteria["A"])
    assert found.skipped == {}


def test_a_study_that_asks_for_it_ends_in_one_line(plugin, study):
    """The line names the study and the key."""
    plugin("raise SystemExit(0)")
    with pytest.raises(UserError, match=r"^Study: criteria: criterion 'mine': plug-in"):
        study.replace(criteria=["mine", "A"])
    assert isinstance(study.replace(criteria=["A"]), Study)


def test_commands_warn_once(plugin):
    """`criteria` and `evaluate` print their answer, exit with 0, and warn in one line."""
    plugin("print('noise'); raise SystemExit(0)")
    for words in (["criteria"], ["evaluate", FILE, "studies/plans/table_4_12.csv"]):
        answer = CliRunner().invoke(main, [*words, "--json"])
        assert answer.exit_code == 0
        assert answer.stdout[0] in "[{"
        (line,) = [text for text in answer.stderr.splitlines() if text != "noise"]
        assert line.startswith("edtk: left out: criterion 'mine': plug-in 'foreign:C' does not")
