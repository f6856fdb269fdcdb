"""`edtk bias`: a plan's bias as a person and a program read it, and mistakes."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from edtk.calibration.planned import plan_bias
from edtk.cli import main
from edtk.design.plan import Plan
from edtk.fit.equilibrium import linearisation_bias
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.bayes import bayes
from edtk.verbs.template import template

ROOT = Path(__file__).parents[2]
PATH = ROOT / "studies" / "kr270_milling.toml"
PLAN = ROOT / "studies" / "plans" / "table_4_3.csv"
SIMULATION = "compliance_rad_per_Nm = { q2 = 3e-7,"


def edtk(*args):
    result = CliRunner().invoke(main, ["bias", *map(str, args)])
    if not isinstance(result.exception, SystemExit | None):
        raise result.exception
    return result


def refused(*args):
    """The one line that a mistake is answered with."""
    result = edtk(*args)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.count("\n") == 1
    return result.stderr


def changed(folder, old, new):
    """The study of the milling robot without published plans, and one more change."""
    head, rest = PATH.read_text(encoding="utf-8").split("published = [")
    text = head + rest.split("]", 1)[1]
    assert text.count(old) == 1
    path = folder / "study.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


@pytest.mark.cell("`bias` of the linear model", "springs")
def test_json_is_the_bias_of_the_plan():
    """All numbers are those of the noise-free fit, in SI units, and rho0 is the plan's."""
    study = load_study(PATH)
    plan = study.load_plan(PLAN)
    answer = json.loads(edtk(PATH, PLAN, "--json").stdout)
    b = linearisation_bias(
        study.model, plan.q, plan.wrench, study.sigma, np.r_[0, study.compliances]
    )
    for key, values in (
        ("bias", b.bias),
        ("std", b.std),
        ("bias_in_std", b.in_std),
        ("bias_percent", b.percent),
    ):
        np.testing.assert_allclose([answer[key][f"q{i}"] for i in range(2, 7)], values, rtol=1e-9)
    assert answer["experiments"] == 3
    assert answer["rho0"] == pytest.approx(6.588e-6, rel=1e-3)
    assert answer["rho0_bias"] == pytest.approx(np.linalg.norm(study.target @ b.bias))


def test_repetitions_shrink_the_noise_and_not_the_bias(tmp_path):
    """Four times the measurements halve the standard deviations and leave the bias."""
    rows = PLAN.read_text(encoding="utf-8").split()
    (tmp_path / "plan.csv").write_text(
        "\n".join([rows[0] + ",repeats", *(r + ",4" for r in rows[1:])])
    )
    once = json.loads(edtk(PATH, PLAN, "--json").stdout)
    often = json.loads(edtk(PATH, tmp_path / "plan.csv", "--json").stdout)
    for joint in once["bias"]:
        assert often["bias"][joint] == pytest.approx(once["bias"][joint], rel=1e-6)
        assert often["std"][joint] == pytest.approx(once["std"][joint] / 2)


def test_text_names_parameters_and_test_pose():
    """A person reads one line per parameter, and millimetres for the test pose."""
    text = edtk(PATH, PLAN).stdout
    assert all(f"\nk{i} " in text for i in range(2, 7))
    assert "rho0 = 0.006588 mm" in text


def test_study_without_test_pose_has_no_rho0(tmp_path):
    """Without a test pose the parameters are reported all the same."""
    text = PATH.read_text(encoding="utf-8").replace('"rho0", ', "").replace(', "rho0"', "")
    head, rest = text.split("published = [")
    head, tail = (head + rest.split("]", 1)[1]).split("[test_pose]")
    path = tmp_path / "study.toml"
    path.write_text(head + tail[tail.index("[simulation]") :], encoding="utf-8")
    answer = json.loads(edtk(path, PLAN, "--json").stdout)
    assert answer["rho0"] is None
    assert answer["rho0_bias"] is None
    assert "test pose" not in edtk(path, PLAN).stdout


def test_mistakes(tmp_path):
    """A study or plan that cannot be used is answered with one line."""
    text = PATH.read_text(encoding="utf-8")
    tail = text[text.index("[simulation]") :]
    assert "simulation: expected a table" in refused(changed(tmp_path, tail, ""), PLAN)
    assert "expected a value for joint 'q2'" in refused(
        changed(tmp_path, SIMULATION, "compliance_rad_per_Nm = {"), PLAN
    )
    extra = changed(tmp_path, SIMULATION, "compliance_rad_per_Nm = { q9 = 1e-7, q2 = 3e-7,")
    assert "no joint 'q9'; this robot has q1" in refused(extra, PLAN)
    header = "q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,repeats,Fx_N,Fz_N"
    rows = "-20,0,90,0,0,2,0,-10\n-20,0,90,0,0,2,-4.7e6,-1.7e6"
    (tmp_path / "pushed.csv").write_text(f"{header}\n{rows}", encoding="utf-8")
    assert "pushed.csv: row 2: no stable equilibrium" in refused(PATH, tmp_path / "pushed.csv")
    (tmp_path / "one.csv").write_text("\n".join(PLAN.read_text(encoding="utf-8").split()[:2]))
    assert "one.csv: the plan cannot identify all parameters: k" in refused(
        PATH, tmp_path / "one.csv"
    )
    assert "no such file" in refused(PATH, tmp_path / "none.csv")


def test_repetitions_are_counted_and_not_expanded():
    """A billion repetitions of each pose: the bias of one, and 1/sqrt(1e9) of its noise."""
    study = load_study(PATH)
    plan = study.load_plan(PLAN)
    once = plan_bias(study, plan, PLAN).bias
    often = plan_bias(study, plan.repeated(10**9), PLAN).bias
    np.testing.assert_allclose(often.expected, once.expected, rtol=1e-9)
    np.testing.assert_allclose(often.std, once.std / 10**4.5, rtol=1e-9)
    some = Plan(plan.q, plan.wrench, np.array([1, 2, 3]))
    each = np.repeat(np.arange(3), some.repeats)
    rows = Plan(plan.q[each], plan.wrench[each], np.ones(6, dtype=int))
    found, expected = (plan_bias(study, given, PLAN).bias for given in (some, rows))
    np.testing.assert_allclose(found.expected, expected.expected, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-9)


def test_what_needs_a_row_each_has_a_limit(tmp_path):
    """A sheet and simulated measurements have a row each: too many are refused in one line."""
    plan = load_study(PATH).load_plan(PLAN).repeated(10**9)
    with pytest.raises(UserError, match=r"^plan: a sheet of 3000000000 rows.*1000000 at most$"):
        template(PATH, plan)
    with pytest.raises(UserError, match="rows, one for each repetition and marker"):
        template(PATH, PLAN, markers=400_000)
    with pytest.raises(UserError, match=r"^plan: 3000000000 experiments.*100000 at most$"):
        bayes(PATH, plan)
