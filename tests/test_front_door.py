"""The front door: one import gives the verbs and nouns, costs nothing, and does what
commands do.
"""

import ast
import inspect
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import criteria
import edtk
from edtk.cli import main

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
PATH = ROOT / "studies" / "kr270_milling.toml"
PLAN = ROOT / "studies" / "plans" / "table_4_3.csv"
VERBS = {
    "controller",
    "new",
    "load_study",
    "robot",
    "plan",
    "relax",
    "run",
    "evaluate",
    "check",
    "show",
    "template",
    "timetable",
    "program",
    "identify",
    "predict",
    "bayes",
    "bias",
    "compensate",
    "verify",
}
HEAVY = ("numpy", "scipy", "pandas", "cvxpy", "matplotlib", "emcee", "pydantic", "click", "joblib")


def loaded_by(code: str) -> set[str]:
    """Modules that a new interpreter has loaded after some code."""
    command = f"{code}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", command], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_what_reads_sheets_and_results_loads_no_search() -> None:
    """Fits, reports and commands need neither searches for plans nor all of scipy.stats."""
    rooms = ("verbs.of_kinds", "report.calibration_report", "report.views.compensation")
    fits = ("calibrate", "calibrate_geometry", "calibrated_springs", "calibrated_geometry")
    names = [f"edtk.{room}" for room in rooms] + [f"edtk.calibration.{fit}" for fit in fits]
    loaded = loaded_by(f"import edtk; edtk.identify\nimport {', '.join(names)}")
    searches = {"edtk.study.plan_study", "edtk.design.exact.find_plan", "scipy.stats"}
    assert set(names) <= loaded
    assert not loaded & searches


def test_what_is_said_after_ctrl_c_loads_no_statistics() -> None:
    """The views of plans and relaxations: of 1.3 s of the processor they had taken 1.1 for that."""
    views = ("plan", "problem", "relaxation", "study")
    names = [f"edtk.report.views.{view}" for view in views]
    assert "scipy.stats" not in loaded_by(f"import {', '.join(names)}")


def printed(*words: object) -> dict[str, object]:
    """What a command prints as JSON."""
    answer = CliRunner().invoke(main, [*map(str, words), "--json"])
    assert answer.exit_code == 0, answer.output
    return json.loads(answer.stdout)


def test_import_loads_nothing_heavy() -> None:
    """`import edtk` alone loads none of the libraries that the verbs use."""
    assert not loaded_by("import edtk") & set(HEAVY)


@pytest.mark.parametrize(
    ("code", "allowed"),
    [
        ("import edtk; edtk.load_study", {"numpy", "scipy", "pydantic"}),
        ("import edtk.cli", {"click"}),
        (f"import edtk; edtk.load_study({str(PATH)!r}).target", {"numpy", "scipy", "pydantic"}),
    ],
    ids=["a verb's name", "the program", "a study"],
)
def test_slow_libraries_are_loaded_late(code: str, allowed: set[str]) -> None:
    """A study is read, and the program begins, without pandas, cvxpy, matplotlib and emcee."""
    assert loaded_by(code) & set(HEAVY) <= allowed


def test_every_name_is_there_and_typed() -> None:
    """Public names can be loaded, are listed by dir, and are the same for a type checker."""
    assert sorted(edtk.__all__) == dir(edtk)
    assert set(dir(edtk)) >= VERBS
    for name in edtk.__all__:
        assert getattr(edtk, name) is not None
    assert edtk.criteria is criteria
    tree = ast.parse((ROOT / "edtk" / "__init__.py").read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    typed = {
        alias.asname: f"{node.module}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed == {**edtk._HOME, "candidates": "edtk"}
    with pytest.raises(AttributeError, match="no attribute 'none_such'"):
        _ = edtk.none_such


def test_every_command_is_a_verb() -> None:
    """What the command line can do, one call can do, under the same name."""
    assert set(main.commands) - {"criteria"} <= VERBS


def test_evaluate_is_the_command() -> None:
    """The call gives the numbers that the command prints, from paths and from objects."""
    study = edtk.load_study(PATH)
    plan = study.load_plan(PLAN)
    shown = printed("evaluate", PATH, PLAN)
    assert edtk.evaluate(PATH, PLAN).to_dict() == shown
    assert edtk.evaluate(study, plan).to_dict() == shown


def test_relax_is_the_command(tmp_path: Path) -> None:
    """Weights, value, bound and gap are those of the command; files are written by the call too."""
    out = tmp_path / "weights.csv"
    proof = tmp_path / "proof.json"
    found = edtk.relax(PATH, "D", candidates=300, out=out, certificate=proof)
    shown = printed("relax", PATH, "--criterion", "D", "--candidates", 300)
    assert found.value == shown["value"]
    assert found.bound == shown["bound"]
    assert found.gap == shown["gap"]
    assert np.isclose(found.weights.sum(), 1)
    assert out.is_file()
    assert edtk.verify(proof).valid


def test_relax_takes_problems_of_arrays() -> None:
    """A problem without a robot is relaxed by the same verb, with a criterion by name or as an
    object.
    """
    x = np.linspace(-1, 1, 51)
    problem = edtk.Problem(np.stack([np.ones_like(x), x, x**2], axis=-1)[:, None, :])
    for criterion in ("D", criteria.create("D")):
        design = edtk.relax(problem, criterion)
        assert np.allclose(design.weights[[0, 25, 50]], 1 / 3, atol=1e-4)
        assert design.value == pytest.approx(design.bound)
        assert design.gap < 1e-6


def test_plan_is_the_command(tmp_path: Path) -> None:
    """The call finds the plan of the command, and writes plan and certificate."""
    text = PATH.read_text(encoding="utf-8").replace("candidates = 2000", "candidates = 200")
    study = tmp_path / "study.toml"
    study.write_text(text.split("published = [")[0] + text.split("]\n\n", 1)[1], encoding="utf-8")
    out = tmp_path / "plan.csv"
    proof = tmp_path / "plan.json"
    found = edtk.plan(study, size=3, criterion="D", seed=1, workers=1, out=out, certificate=proof)
    shown = printed("plan", study, "--size", 3, "--criterion", "D", "--seed", 1, "--workers", 1)
    assert found.value == shown["value"]
    assert found.bound == shown["bound"]
    assert found.efficiency == shown["efficiency"]
    assert found.plan.experiments == 3
    assert out.is_file()
    assert edtk.verify(proof).valid


def test_a_day_in_python(tmp_path: Path) -> None:
    """Template, identify, compensate and bias work on objects and paths, and results
    are by name.
    """
    study = edtk.load_study(PATH)
    sheet = edtk.template(study, PLAN)
    q = np.deg2rad(sheet.iloc[:, :6].to_numpy())
    deflection = study.model.regressor(q, sheet.iloc[:, 6:12].to_numpy()) @ study.compliances
    noise = 3e-5 * np.random.default_rng(0).standard_normal(deflection.shape)
    sheet[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * (deflection + noise)
    day = tmp_path / "day1.csv"
    sheet.to_csv(day, index=False)
    found = edtk.identify(study, day, plan=PLAN, out=tmp_path / "out")
    assert found.to_dict() == printed("identify", PATH, day, "--plan", PLAN)
    assert list(found.k) == list(found.std) == ["q2", "q3", "q4", "q5", "q6"]
    for name, true in zip(found.k, study.compliances, strict=True):
        assert abs(found.k[name] - true) < 5 * found.std[name]
    task = tmp_path / "task.csv"
    task.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,-56.9,89.3,45.1,76,57.2\n")
    written = tmp_path / "out" / "k.json"
    commands = edtk.compensate(study, found, task)
    assert commands.to_dict() == edtk.compensate(study, written, task).to_dict()
    assert commands.to_dict() == printed("compensate", PATH, written, task)
    assert edtk.bias(study, PLAN).to_dict() == printed("bias", PATH, PLAN)


def test_results_show_themselves_in_one_line() -> None:
    """The repr of results is one line of at most 100 characters, and notebooks get a table."""
    study = edtk.load_study(PATH)
    results = [study, edtk.evaluate(study, PLAN), edtk.relax(study, "D", candidates=300)]
    results += [edtk.bias(study, PLAN), study.load_plan(PLAN), study.robot]
    for result in results:
        text = repr(result)
        assert "\n" not in text
        assert len(text) <= 100
        assert result._repr_html_().startswith("<")


X = np.linspace(-1.0, 1.0, 11)
PARABOLA = edtk.Problem(np.vander(X, 3)[:, None, :])
FRAME = edtk.candidates.full_factorial({"a": 3, "b": 3})
FACTORS = {"a": (0, 1), "b": (0, 1), "c": (0, 1)}
ENZYME = {"f": "V*x/(K+x)", "theta": {"V": 1, "K": 1}}
RIVALS = {"rival": "c*x", "rival_theta": {"c": (-2, 2)}}
# Calls about arrays, each with arguments that it answers.
CALLS = {
    edtk.apportion: {"weights": [0.5, 0.5], "m": 4},
    edtk.exchange: {"problem": PARABOLA, "criterion": criteria.create("D"), "start": [0, 5, 10]},
    edtk.Problem: {"blocks": np.ones((4, 1, 1))},
    edtk.Problem.of_information: {"packed": np.ones((1, 4))},
    edtk.Problem.from_frame: {"frame": FRAME, "formula": "a + b"},
    edtk.Problem.of_model: {**ENZYME, "candidates": X + 2},
    edtk.Problem.of_rivals: {**ENZYME, **RIVALS, "candidates": X + 2},
    edtk.Region: {"rows": lambda x: np.vander(x[:, 0], 2), "low": -1, "high": 1},
    edtk.Region.of_model: {**ENZYME, "box": (0, 4)},
    edtk.several_models: {"problems": [PARABOLA, PARABOLA]},
    edtk.relax: {"question": PARABOLA},
    edtk.plan: {"study": PARABOLA, "size": 4, "starts": 1},
    edtk.next: {"problem": PARABOLA, "keep": [0, 5, 10]},
    edtk.compare: {"designs": [[0, 5, 10]], "model": PARABOLA},
    edtk.Errors.split_plot: {"hard": ["a"], "whole_plots": 4},
    edtk.Errors.autoregressive: {"correlation": 0.5},
    edtk.Errors.trend: {},
    edtk.Errors.spatial: {"positions": np.eye(3), "length": 1.0},
    edtk.candidates.full_factorial: {"factors": {"a": 3}},
    edtk.candidates.fractional_factorial: {"factors": 3, "generators": "C=AB"},
    edtk.candidates.central_composite: {"factors": 3},
    edtk.candidates.box_behnken: {"factors": 3},
    edtk.candidates.plackett_burman: {"factors": 3},
    edtk.candidates.simplex_lattice: {"components": 3, "degree": 2},
    edtk.candidates.extreme_vertices: {"components": FACTORS},
    edtk.candidates.n_choose_k: {"frame": FRAME, "columns": ["a", "b"], "most": 1},
    edtk.candidates.latin_hypercube: {"factors": FACTORS, "n": 4},
    edtk.candidates.sobol: {"factors": FACTORS, "n": 4},
}
WRONG = (-1, 0, np.nan, 2.5, "many", [1, 2], [[1.0]], np.full(3, np.nan), True, {"a": -1}, [])
WRONG = (*WRONG, np.zeros(11), np.ones((2, 2, 2)), 10**400, object(), 1j)
OF_FILES = ("out", "certificate", "workers", "dask")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.__qualname__)
def test_a_wrong_argument_is_one_line_or_no_mistake(call: Callable[..., object]) -> None:
    """Whatever is given for one argument of a call about arrays, it answers, or says on one line
    what is wrong.
    """
    good = CALLS[call]
    call(**good)
    said = []
    for argument in inspect.signature(call).parameters.keys() - set(OF_FILES):
        for wrong in WRONG:
            try:
                call(**{**good, argument: wrong})
            except (edtk.UserError, criteria.CriterionError) as error:
                said.append(str(error))
    assert said
    assert not [line for line in said if "\n" in line or len(line) > 300]


@pytest.mark.parametrize(
    "content", ["", "{", "[]", "{}", '{"proof": 1}', '{"proof": {}, "kind": 3}']
)
def test_what_is_no_certificate_is_one_line(content: str, tmp_path: Path) -> None:
    """A file that is no certificate ends with exit code 2 and one line, and a bad one
    with code 1.
    """
    path = tmp_path / "file.json"
    path.write_text(content, encoding="utf-8")
    answer = CliRunner().invoke(main, ["verify", str(path)])
    assert answer.exit_code == 2
    assert answer.stdout == ""
    assert answer.stderr.startswith(f"edtk: {path}: not ")
    assert answer.stderr.count("\n") == 1


def test_verify_ends_with_one_for_a_false_claim(tmp_path: Path) -> None:
    """The exit code is 0 for a valid certificate and 1 after tampering; JSON lists the claims."""
    path = tmp_path / "proof.json"
    edtk.relax(PATH, "D", candidates=200, certificate=path)
    assert printed("verify", path)["valid"] is True
    content = json.loads(path.read_text(encoding="utf-8"))
    content["claims"]["value"] *= 1.01
    path.write_text(json.dumps(content), encoding="utf-8")
    answer = CliRunner().invoke(main, ["verify", str(path), "--json"])
    assert answer.exit_code == 1
    shown = json.loads(answer.stdout)
    assert shown["valid"] is False
    assert {"claim", "holds", "stated", "recomputed"} <= set(shown["claims"][0])
    assert [c["claim"] for c in shown["claims"] if not c["holds"]] == ["value"]
