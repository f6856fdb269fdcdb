"""Look-up of criteria by name, and criteria of third parties."""

import os
import subprocess
import sys

import numpy as np
import pytest

import criteria

pytestmark = pytest.mark.slow

BUILTINS = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0", "rho_max")


def run(code, site=None):
    """Run code in a fresh interpreter, with a site directory of plug-ins on its path."""
    environment = {**os.environ, "PYTHONPATH": str(site) if site else "", "PYTHONWARNINGS": "error"}
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment
    )


def site_with(folder, entry_points, module="", distribution="claimant"):
    """Make a site directory with one distribution by hand.

    It has the given entry points, and a module of the distribution's name.
    """
    info = folder / f"{distribution}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[edtk.criteria]\n{entry_points}\n")
    (folder / f"{distribution}.py").write_text(module)
    return folder


REPORT = """
import criteria
try:
    criteria.get({name!r})
except criteria.CriterionError as error:
    print(type(error).__name__, error)
"""


def test_the_eleven_names_in_order():
    """The built-ins come first, in the order of Table 1, and rho_max after rho0."""
    assert criteria.available()[:11] == BUILTINS
    for name in BUILTINS:
        assert criteria.get(name).name == name
        assert criteria.create(name, target=np.eye(2)).value(np.eye(2)) > 0


def test_unknown_name_lists_what_there_is():
    """The message for an unknown name is one line that lists every name."""
    with pytest.raises(criteria.UnknownCriterionError, match="unknown criterion 'B'") as caught:
        criteria.get("B")
    message = str(caught.value)
    assert f"available: {', '.join(criteria.available())}, and" in message
    assert message.endswith(f"with parameters {', '.join(criteria.families())}")
    assert "\n" not in message


def test_names_are_exact():
    """Look-up does not guess: another case is another name."""
    with pytest.raises(criteria.UnknownCriterionError):
        criteria.create("RHO0", target=np.eye(2))


def test_duplicate_is_refused_and_changes_nothing():
    """A second class under a taken name is rejected: the message names both, the first stays."""
    holder = criteria.get("A")
    impostor = type("Impostor", (holder,), {})
    with pytest.raises(
        criteria.DuplicateCriterionError, match=r"'A' of .*Impostor .* taken by .*AOptimality"
    ):
        criteria.register(impostor)
    assert criteria.get("A") is holder


def test_registering_the_same_class_twice_is_harmless():
    """A repeated registration of one class is no duplicate."""
    assert criteria.register(criteria.get("D")) is criteria.get("D")


def test_rho0_without_target_is_refused():
    """rho0 needs the test pose's regressor and says so."""
    with pytest.raises(criteria.CriterionError, match="'rho0' needs a target"):
        criteria.create("rho0")


@pytest.mark.parametrize("target", [np.zeros((3, 2)), [1.0, 2.0], [[np.nan, 1.0]], [[np.inf, 1.0]]])
def test_rho0_refuses_a_target_that_is_no_matrix(target):
    """A zero, flat or non-finite target is a ValueError."""
    with pytest.raises(ValueError, match="target A0 must be a finite, non-zero matrix"):
        criteria.create("rho0", target=target)


def test_target_is_a_frozen_copy():
    """A later change of the caller's array does not reach the criterion."""
    target = np.eye(2)
    criterion = criteria.create("rho0", target=target)
    target[:] = 7.0
    assert criterion.value(np.eye(2)) == pytest.approx(np.sqrt(2))
    with pytest.raises(ValueError, match="read-only"):
        criterion.target[0, 0] = 1.0


def test_package_stands_alone():
    """`criteria` and all its built-ins import neither edtk nor cvxpy, and raise no warning."""
    done = run(
        "import sys, criteria; criteria.available(); criteria.create('D').value([[1.0]])\n"
        "print(sorted(m for m in sys.modules if m.split('.')[0] in ('edtk', 'cvxpy')))"
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "[]", "")


def test_plugin_is_found_by_its_name(plugin_site):
    """A third party's distribution, built and installed by pip, adds a criterion.

    This one has no convex form.
    """
    done = run(
        "import criteria, numpy as np\n"
        "c = criteria.create('trace_M')\n"
        "print(criteria.available()[-1], type(c).__module__, float(c.value(np.diag([1.0, 2.0]))), "
        "float(c.cost(np.zeros((2, 2)))), isinstance(c, criteria.Relaxable))",
        plugin_site,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == ["trace_M", "my_criterion", "3.0", "inf", "False"]


def test_plugin_is_listed_without_being_imported(plugin_site):
    """Listing the names, or asking for another criterion, does not run third-party code."""
    done = run(
        "import sys, criteria; criteria.get('D')\n"
        "print(criteria.available(), 'my_criterion' in sys.modules)",
        plugin_site,
    )
    assert done.stdout.strip() == f"{(*BUILTINS, 'trace_M')} False"


def test_two_plugins_cannot_share_a_name(tmp_path):
    """Two entry points of one name and different value are rejected."""
    site_with(tmp_path, "twin = one:C", distribution="one")
    done = run(REPORT.format(name="twin"), site_with(tmp_path, "twin = two:C", distribution="two"))
    assert done.stdout.startswith("DuplicateCriterionError criterion name 'twin'")
    assert len(done.stdout.splitlines()) == 1


BARE = """
from criteria import Criterion

class C(Criterion):
    name = {name!r}

    def _cost(self, M, cov):
        pass
"""
WITHOUT_BASE = (
    BARE
    + """
    def _gradient(self, M, cov):
        pass

    def expression(self, M, T=None):
        pass
"""
)
# What is wrong with a plug-in: the attribute that its entry point names, the text of its module
# (None for no module), and what the message says.
BROKEN = {
    "no_attribute": ("Missing", "", "'{name}:Missing' does not load"),
    "no_module": ("C", None, "'{name}:C' does not load"),
    "raises": ("C", "1/0", "'{name}:C' does not load"),
    "syntax": ("C", "syntax error here", "'{name}:C' does not load"),
    "two_lines": ("C", "raise RuntimeError('first\\nsecond')", "'{name}:C' does not load"),
    "no_class": ("C", "C = 3", "must be a Criterion class whose name is '{name}'"),
    "no_criterion": (
        "C",
        "class C:\n    name = {name!r}",
        "must be a Criterion class whose name is '{name}'",
    ),
    "no_gradient": ("C", BARE, "criterion '{name}': {name}.C does not define _gradient"),
    "wrong_base": ("C", WITHOUT_BASE, "criteria.ConvexCriterion instead of criteria.Criterion"),
}


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    """What a look-up of each broken plug-in says, from one interpreter that has them all."""
    entries = "\n".join(f"{name} = {name}:{what[0]}" for name, what in BROKEN.items())
    site = site_with(tmp_path_factory.mktemp("broken"), entries)
    for name, (_, module, _) in BROKEN.items():
        if module is not None:
            (site / f"{name}.py").write_text(module.replace("{name!r}", repr(name)))
    code = "".join(REPORT.format(name=name) for name in BROKEN)
    done = run(code + "criteria.get('A')\ncriteria.available()", site)
    assert (done.returncode, done.stderr) == (0, "")
    return dict(zip(BROKEN, done.stdout.splitlines(), strict=True))


@pytest.mark.parametrize("name", BROKEN)
def test_plugin_that_does_not_load_is_one_line(messages, name):
    """A plug-in that does not load, or is no complete Criterion, is a CriterionError of one line.

    The other criteria still work.
    """
    assert messages[name].startswith("CriterionError criterion ")
    assert BROKEN[name][2].format(name=name) in messages[name]
