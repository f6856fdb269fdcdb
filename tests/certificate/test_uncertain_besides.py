"""Certificates of studies in which something beside the unknown compliances is uncertain."""

import json

import pytest
from arm import ROBOT, arm
from short_search import short_search

import criteria
import edtk
from edtk.study.study_parts import counts_known

WRIST = {"name": "q3", "origin_m": [0.5, 0, 0], "axis": [0, 1, 0], "limits_deg": [-120, 120]}
TOOL = {"position_mm": [400, 0, 0]}
TEST_POSE = {"q_deg": [10, 40, 20], "tool": TOOL, "load": {"F_N": [0, 0, -50]}}
KNOWN = {"joints": {"unknown": ["q2", "q3"], "known_rad_per_Nm": {"q1": 3e-6}}}  # std 30 %
ERRING = {"noise": {"model_error_percent": 10}}
# O2 and O4 count neither; the others count both.
NAMES = ("rho0", "A", "O2", "O4")


def study(**keys):
    """A plane arm of three joints, of which two are to be found."""
    named = {"optimise": list(NAMES), "criteria": list(NAMES), "candidates": 60}
    guess = {"simulation": {"compliance_rad_per_Nm": {"q2": 5e-6, "q3": 5e-6}}}
    robot = {"robot": ROBOT | {"joints": [*ROBOT["joints"], WRIST]}}
    return arm(test_pose=TEST_POSE, **(guess | robot | named | keys))


CASES = {"known": KNOWN, "both": KNOWN | ERRING}


@pytest.mark.parametrize(
    ("case", "name"),
    [("known", name) for name in NAMES] + [("both", "rho0"), ("both", "O2")],
)
def test_a_plan_is_certified_in_the_setting_of_its_criterion(case, name, tmp_path):
    """Criteria that count no such uncertainty have a setting without it, as their plans do."""
    asked = study(**CASES[case])
    path = tmp_path / "certificate.json"
    found = edtk.plan(asked, 4, criterion=name, seed=1, certificate=path)
    checked = edtk.verify(path, asked)
    assert checked.valid, checked.failed
    # What a plan promises counts all that is uncertain, whatever it was optimised for.
    assert found.expected == edtk.evaluate(asked, found.whole).expected
    stated = json.loads(path.read_text(encoding="utf-8"))["setting"]
    counted = "prior" in stated or "friction" in stated
    assert counted == (name in ("rho0", "A"))


@pytest.mark.parametrize("names", [("rho0", "O2"), ("rho0", "A")])
def test_a_run_designs_for_each_criterion_as_a_plan_does(names, tmp_path):
    """Its certificates hold beside the study, and its table has the values of `evaluate`."""
    asked = study(**KNOWN, sizes=[2], optimise=list(names), criteria=list(names))
    run = edtk.run(asked, tmp_path / "out", workers=1)
    for path in (run.folder / "certificates").iterdir():
        assert edtk.verify(path, asked).valid, path.name
    for row, plan in zip(run.table.to_dict(orient="records"), run.plans.values(), strict=True):
        values = edtk.evaluate(asked, plan).criteria
        assert {name: row[name] for name in names} == pytest.approx(
            {name: values[name] for name in names}
        )


def test_relaxations_under_all_criteria_are_certified(tmp_path):
    """Each holds beside the study, and has what is known beforehand where its criterion counts."""
    asked = study(**KNOWN, candidates=20)
    path = tmp_path / "certificate.json"
    for name in criteria.load_all().classes:
        if criteria.get(name).needs_parameters:
            continue
        edtk.relax(asked, name, certificate=path)
        assert edtk.verify(path, asked).valid, name
        stated = json.loads(path.read_text(encoding="utf-8"))["setting"]
        assert ("prior" in stated) == counts_known(name), name


def test_plans_are_judged_under_their_own_criterion():
    """What a plan loses for a wrong guess counts what the criterion counts, not the main one."""
    asked = study(**KNOWN | ERRING, candidates=20)
    with short_search():
        found = edtk.plan(asked, 3, "O2")
    assert all(0.9 < one.efficiency <= 1 + 1e-3 for one in found.off_guess)
    assert len(found.off_guess) == 2
