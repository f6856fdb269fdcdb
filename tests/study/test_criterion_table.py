"""The key `criterion` of a study: a criterion with its parameters."""

import numpy as np
import pytest
from arm import arm

import criteria
import edtk
from edtk.study.check_study import check_study
from edtk.study.plan_study import relax_study
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate

BASE = arm()
UNKNOWN = BASE.specification.joints.unknown
P = len(UNKNOWN)
PARTS = [{"name": "c", "c": {UNKNOWN[0]: 1.0}}, "D"]


def about(**given):
    """The arm's study about a criterion."""
    return BASE.replace(criterion=given, optimise=None, criteria=None)


def test_parameters_reach_the_criterion():
    """By name of the joints, or as arrays."""
    c = about(name="c", c={UNKNOWN[0]: 1, UNKNOWN[-1]: -2}).criterion()
    expected = np.zeros(P)
    expected[0] = 1
    expected[-1] = -2
    np.testing.assert_array_equal(c.K[:, 0], expected)
    ds = about(name="Ds", interest=[UNKNOWN[-1]]).criterion()
    np.testing.assert_array_equal(ds.K, np.eye(P)[:, -1:])
    W = np.eye(P).tolist()
    assert about(name="I", W=W).criterion().cost(np.eye(P)) == P
    assert about(name="minimax", criteria=PARTS).criterion().label == "minimax of c of k1, D"


def test_the_study_is_about_it():
    """It is optimised first, and compared where nothing else is asked for."""
    study = about(name="phi", q=2)
    assert study.main_criterion == "phi"
    assert study.names == ("phi",)
    both = BASE.replace(criterion={"name": "phi", "q": 2}, optimise=["D"], criteria=["A"])
    assert both.names == ("phi", "D", "A")
    assert both.main_criterion == "phi"
    check_study(both)
    plain = BASE.replace(criterion="A", optimise=None, criteria=None)
    assert plain.names == ("A",)


def test_it_is_written_and_read_again():
    """The parameters are part of the study's file, and of its digest."""
    study = about(name="compound", criteria=PARTS, weights=[1.0, 2.0])
    again = Study(**study.to_dict())
    assert again.digest == study.digest
    assert again.criterion().to_dict() == study.criterion().to_dict()
    assert about(name="compound", criteria=PARTS).digest != study.digest


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [
        {"name": "phi", "q": 2},
        {"name": "c", "c": {UNKNOWN[0]: 1.0, UNKNOWN[1]: 1.0}},
        {"name": "minimax", "criteria": PARTS, "best": [1e-15, 1e15]},
    ],
    ids=lambda given: given["name"],
)
def test_relaxation_plan_and_evaluation(given):
    """The bound is proved, a plan is within it, and the plan's value is that of the criterion."""
    study = about(**given)
    relaxed = relax_study(study)
    assert relaxed.gap < 1e-6
    found = edtk.plan(study, 3, seed=0)
    assert 0.5 < found.efficiency <= 1 + 1e-9
    evaluation = evaluate(study, found.plan)
    value = study.criterion().value(study.information(found.plan))
    assert evaluation.criteria[given["name"]] == pytest.approx(float(value), rel=1e-12)
    assert evaluation.criteria[given["name"]] == pytest.approx(found.value, rel=1e-9)
    # A study that does not ask for it has no value of it.
    assert not set(evaluate(BASE, found.plan).criteria) & set(criteria.families())


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"name": "I"}, "criterion: criterion 'I' needs W or points"),
        ({"name": "I", "points": [[1e200, 0], [0, 1]]}, "do not fit 2 compliances"),
        ({"name": "c", "c": [10**400, 1]}, "criterion: .*wrong parameters"),
        ({"name": "I", "W": [[1.0]]}, "criterion: .*parameters do not fit 2 compliances"),
        ({"name": "c", "c": {"q9": 1}}, "'q9' is no unknown joint; expected"),
        ({"name": "Ds", "interest": ["q9"]}, "'q9' is no unknown joint; expected"),
        ({"name": "phi", "q": 2, "z": 1}, "has no parameter 'z'; expected q"),
        ({"name": "bayes_A", "precision": [[1.0]]}, "give in_design = true"),
        ({"name": "D", "q": 2}, "has no parameter 'q'; expected none"),
        ({"q": 2}, "criterion.name: this key is required"),
        (3, "expected a name, or a table with a name"),
        ("zz", "unknown criterion 'zz'"),
    ],
)
def test_wrong_criteria_are_one_line(given, expected):
    """The line names the key and what was expected."""
    with pytest.raises(UserError, match=expected) as caught:
        BASE.replace(criterion=given, optimise=None, criteria=None)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", ["optimise", "criteria"])
def test_a_criterion_that_is_named_without_its_parameters(key):
    """The line says where they belong."""
    with pytest.raises(UserError, match=rf"{key}: .*give criterion = ") as caught:
        BASE.replace(**{key: ["phi"]})
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_calls_take_parameters_too():
    """A table or an object in a call stands for the study's own key."""
    for asked in ({"name": "phi", "q": 2}, criteria.create("phi", q=2)):
        found = edtk.relax(BASE, asked)
        assert found.criterion.label == "phi (q = 2)"
        assert found.value == pytest.approx(edtk.relax(about(name="phi", q=2)).value)
    # The object that is asked for counts, whatever the study says.
    other = edtk.relax(about(name="phi", q=2), criteria.create("phi", q=5))
    assert other.criterion.label == "phi (q = 5)"
    assert edtk.plan(BASE, 3, {"name": "phi", "q": 0}, seed=0).efficiency > 0.5


def test_no_certificate_of_poses(tmp_path):
    """It is refused in one line, before the search."""
    study = about(name="phi", q=2)
    with pytest.raises(UserError, match="has no certificate of poses"):
        edtk.relax(study, certificate=tmp_path / "proof.json")
    with pytest.raises(UserError, match="has no certificate of poses"):
        edtk.plan(study, 3, certificate=tmp_path / "proof.json")
