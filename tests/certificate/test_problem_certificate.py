"""Certificates of problems: an independent checker accepts what is true, and nothing else.

The checker (`tests/support/plain_checker.py`) is numpy alone. Stored certificates are of 300 random
problems under all criteria; each of them is forged in one way.
"""

import ast
import copy
import json
from pathlib import Path

import numpy as np
import plain_checker
import pytest
from plain_checker import RejectedError, check
from stored_certificates import NUMBER, certificate, problem, stored

import criteria
import edtk
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relaxation import Relaxation
from edtk.system.errors import UserError

PAIRS = stored()
ROOT = Path(__file__).parents[2]


def is_valid(content, A):
    """Whether `edtk.verify` takes it for a certificate, all of whose claims hold."""
    try:
        return edtk.verify(content, edtk.Problem(A)).valid
    except UserError:
        return False


def first(name):
    """The first stored certificate of a criterion, and its candidates."""
    return copy.deepcopy(next(pair for pair in PAIRS if pair[0]["criterion"]["name"] == name))


def better(value, sense, by):
    """A value of a lower cost."""
    return value / (1 + by) if sense == "min" else value * (1 + by)


def sense_of(content):
    return criteria.get(content["criterion"]["name"]).sense


def value(content, A, rng):
    content["value"] = better(content["value"], sense_of(content), 1e-5)


def bound(content, A, rng):
    # A bound that is too good makes the design look better than it is.
    content["bound"] = better(content["bound"], sense_of(content), -1e-5)


def gap(content, A, rng):
    content["gap"] -= 1e-5


def all_numbers(content, A, rng):
    """Value and bound together, so that the gap is as it was."""
    for key in ("value", "bound"):
        content[key] = better(content[key], sense_of(content), 1e-4)


def weight(content, A, rng):
    content["weights"]["weight"][0] += 1e-3


def negative(content, A, rng):
    """A negative weight, with a sum of one."""
    places = content["weights"]["candidate"]
    free = [i for i in range(len(A)) if i not in places]
    if free:
        places.append(free[0])
        content["weights"]["weight"].append(0.0)
    content["weights"]["weight"][-1] -= 1.0
    content["weights"]["weight"][0] += 1.0


def twice(content, A, rng):
    """A candidate that is listed twice."""
    content["weights"]["candidate"].append(content["weights"]["candidate"][0])
    content["weights"]["weight"].append(0.0)


def candidate(content, A, rng):
    content["weights"]["candidate"][0] = len(A)


def candidates(content, A, rng):
    """The proof of other candidates."""
    A[rng.integers(len(A)), 0, 0] += 1e-3


def fewer(content, A, rng):
    """The proof of all but the candidate that matters most."""
    Z = np.array(content["multipliers"][0])
    worst = np.einsum("nri,ij,nrj->n", A, Z, A).argmax()
    A[worst] *= 1.01


def multiplier(content, A, rng):
    """A multiplier that is far from semidefinite, whose determinant may look good."""
    Z = np.array(content["multipliers"][0])
    content["multipliers"] = [(Z - 3 * np.trace(Z) * np.eye(len(Z))).tolist()]


def another(content, A, rng):
    """A multiplier that proves something else."""
    p = A.shape[2]
    B = rng.normal(size=(p, p))
    content["multipliers"] = [(B @ B.T).tolist()]
    content.pop("dual_weights", None)


def skew(content, A, rng):
    content["multipliers"][0][0][1] += 1e-3


def none(content, A, rng):
    content["multipliers"] = []


def infinite(content, A, rng):
    content["multipliers"][0][0][0] = float("inf")


def shape(content, A, rng):
    content["multipliers"][0] = content["multipliers"][0][:-1]


def digest(content, A, rng):
    content["candidates"]["sha256"] = "0" * 64


def criterion(content, A, rng):
    """The same numbers for another criterion."""
    other = "A" if content["criterion"] != {"name": "A"} else "D"
    content["criterion"] = {"name": other}


def parameters(content, A, rng):
    """The same numbers for other parameters of the criterion, where it has some."""
    given = content["criterion"]
    changes = {
        "target": lambda x: (2 * np.array(x)).tolist(),
        "targets": lambda x: (2 * np.array(x)).tolist(),
        "points": lambda x: (2 * np.array(x)).tolist(),
        "c": lambda x: (2 * np.array(x)).tolist(),
        "W": lambda x: (2 * np.array(x)).tolist(),
        "precision": lambda x: (2 * np.array(x)).tolist(),
        "interest": lambda x: (2 * np.array(x)).tolist(),
        "q": lambda x: x + 0.1,
        "best": lambda x: (np.arange(2, 2 + len(x)) * x).tolist(),
    }
    changed = [key for key in changes if key in given]
    if not changed:
        criterion(content, A, rng)
        return
    key = changed[-1]
    given[key] = changes[key](given[key])


FORGERIES = (
    *(value, bound, gap, all_numbers, weight, negative, twice, candidate, candidates, fewer),
    *(multiplier, another, skew, none, infinite, shape, digest, criterion, parameters),
)


def test_checker_shares_no_code_with_the_package():
    """It imports numpy and the standard library."""
    tree = ast.parse(Path(plain_checker.__file__).read_text(encoding="utf-8"))
    names = {
        (node.module if isinstance(node, ast.ImportFrom) else alias.name).split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    assert names == {"hashlib", "dataclasses", "typing", "numpy"}


def test_verify_says_whether_it_shares_code_with_the_search():
    """As long as the check of a problem imports the search, its answer says so, whatever it is."""
    source = (ROOT / "edtk/certificate/verify_problem.py").read_text(encoding="utf-8")
    modules = {
        node.module for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom)
    }
    shares = any(module.startswith("edtk.design.relaxation") for module in modules)
    content, A = first("D")
    for stated in (content["value"], 2 * content["value"]):
        found = edtk.verify(content | {"value": stated}, edtk.Problem(A))
        assert found.valid == (stated == content["value"])
        assert ("not by a second implementation" in found.summary()) == shares
        assert found.to_dict()["second_implementation"] is not shares


def test_stored_certificates_are_of_all_criteria():
    """Three hundred of them, those of the families included, and with gaps that are worth it."""
    assert len(PAIRS) == NUMBER == 300
    names = {content["criterion"]["name"] for content, _ in PAIRS}
    assert names == {*criteria.available(), *criteria.families()}
    assert max(content["gap"] for content, _ in PAIRS) < 1e-5


def test_true_certificates_are_accepted():
    """By the checker, and by `edtk.verify`."""
    for i, (content, A) in enumerate(PAIRS):
        check(content, A)
        if i % 3 == 0:
            assert edtk.verify(content, edtk.Problem(A)).valid, i


@pytest.mark.parametrize("forge", FORGERIES, ids=lambda forge: forge.__name__)
def test_forged_certificates_are_rejected(forge):
    """Each stored certificate is forged in one way; both judges reject it."""
    number = FORGERIES.index(forge)
    for i, (content, A) in enumerate(copy.deepcopy(PAIRS[number :: len(FORGERIES)])):
        forge(content, A, np.random.default_rng(i))
        with pytest.raises(RejectedError):
            check(content, A)
        assert not is_valid(content, A), content["criterion"]


def leaves(content, path=()):
    """Paths of all values of a tree."""
    if isinstance(content, dict | list):
        keys = content if isinstance(content, dict) else range(len(content))
        for key in keys:
            yield from leaves(content[key], (*path, key))
    yield path


def test_whatever_stands_in_a_certificate_is_judged():
    """A value of any kind in any place is rejected, or does not matter; nothing else is raised."""
    values = (None, -1, 1.5, "x", [], {}, True, 1e308, -1e308, 5e-324, [[1]], 10**400, {"name": 3})
    rng = np.random.default_rng(0)
    for i in range(300):
        content, A = copy.deepcopy(PAIRS[i])
        paths = [path for path in leaves(content) if path]
        path = paths[rng.integers(len(paths))]
        place = content
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = values[rng.integers(len(values))]
        try:
            check(content, A)
        except RejectedError:
            # Only what the checker does not read, or the package finds anew, may be accepted.
            assert not is_valid(content, A) or path[0] == "dual_weights", path
        else:
            is_valid(content, A)


@pytest.mark.parametrize("name", ["G", "rho_max", "prediction_G", "minimax"])
def test_dual_weights_are_not_believed(name):
    """Weights of more than one, or negative ones, prove nothing; others prove no more."""
    content, A = first(name)
    (shares,) = content["dual_weights"]
    for wrong in ([2 * u for u in shares], [u - 0.5 for u in shares], shares[:-1]):
        content["dual_weights"] = [wrong]
        with pytest.raises(RejectedError):
            check(content, A)
    del content["dual_weights"]
    with pytest.raises(RejectedError):
        check(content, A)
    content["dual_weights"] = [[1 / len(shares)] * len(shares)]
    content["bound"] *= 0.2
    content["gap"] = 1 - content["bound"] / content["value"]
    check(content, A)  # a bound that is weaker is true


@pytest.mark.slow
@pytest.mark.parametrize("i", range(32))
def test_new_certificates_are_as_the_stored_ones(i):
    """What the package writes today has the form, and passes the checker."""
    found, A = certificate(i)
    before, _ = PAIRS[i]
    assert found.keys() == before.keys()
    assert found["candidates"] == before["candidates"]
    assert found["value"] == pytest.approx(before["value"], rel=1e-5)
    check(found, A)


def test_certificates_with_a_prior_and_of_packed_information():
    """The prior is part of the hash, and of what is proved."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(8, 2, 3))
    prior = np.diag([1.0, 2.0, 3.0])
    known = edtk.Problem(A, prior=prior)
    content = json.loads(json.dumps(edtk.relax(known, "A").to_dict()))
    check(content, A, prior)
    assert edtk.verify(content, known).valid
    with pytest.raises(RejectedError, match="candidates"):
        check(content, A)
    assert "candidates" in edtk.verify(content, edtk.Problem(A)).failed
    packed = edtk.Problem.of_information(edtk.Problem(A).packed)
    assert edtk.verify(edtk.relax(packed, "D").to_dict(), packed).valid


def test_verification_tells_what_it_checked():
    """A line for each claim, and the criterion with its parameters."""
    content, A = first("phi")
    found = edtk.verify(content, edtk.Problem(A))
    assert found.summary().startswith("phi (q = ")
    assert "valid: all 5 claims hold" in found.summary()
    assert found.to_dict()["valid"] is True
    content["value"] *= 0.9
    found = edtk.verify(content, edtk.Problem(A))
    assert found.failed == ("value",)
    assert "NOT valid: 1 of 5 claims fail: value" in found.summary()


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"criterion": 3}, "criterion: expected a table with a name"),
        ({"criterion": {"name": "Z"}}, "unknown criterion 'Z'"),
        ({"criterion": {"name": "I", "W": {"a": 1}}}, "criterion: "),
        ({"criterion": {"name": "c", "c": [1.0]}}, "criterion: "),
        ({"weights": {"candidate": "x", "weight": []}}, "weights.candidate: expected a list"),
        ({"multipliers": [[["a"]]]}, "multipliers: expected finite numbers"),
        ({"value": None}, "value: expected finite numbers"),
        ({"more": 1}, "unknown key 'more'"),
    ],
)
def test_what_is_no_certificate_is_one_line(change, expected):
    """The line says which key is wrong."""
    content, A = first("D")
    with pytest.raises(UserError, match=expected) as caught:
        edtk.verify({**content, **change}, edtk.Problem(A))
    assert "\n" not in str(caught.value)


def test_a_certificate_needs_its_problem(tmp_path):
    """Without it, or with a study's, one line says what was expected."""
    content, _ = first("D")
    path = tmp_path / "proof.json"
    path.write_text(json.dumps(content))
    with pytest.raises(UserError, match="expected that problem beside it"):
        edtk.verify(path)
    kept, _, _ = problem(0)
    with pytest.raises(ValueError, match="does not hold its candidates"):
        relax(kept, criteria.create("D")).to_dict()


def test_files_and_restored_relaxations(tmp_path):
    """`edtk.relax` writes a certificate, `edtk.verify` reads it, and the relaxation comes back."""
    candidates, _, _ = problem(1)
    path = tmp_path / "proof.json"
    found = edtk.relax(candidates, "D", certificate=path, out=tmp_path / "weights.csv")
    assert edtk.verify(path, candidates).valid
    assert (tmp_path / "weights.csv").read_text().startswith("candidate,weight")
    again = Relaxation.from_dict(json.loads(path.read_text()), candidates)
    np.testing.assert_array_equal(again.weights, found.weights)
    assert again.bound == pytest.approx(found.bound, rel=1e-9)
    with pytest.raises(ValueError, match="about other candidates"):
        Relaxation.from_dict(json.loads(path.read_text()), candidates[np.arange(4)])


def test_nearly_dependent_parameters():
    """The certificate of an ill-conditioned model keeps the digits that its bound needs."""
    x = np.linspace(10, 11, 41)
    rows = edtk.Problem(np.vander(x, 6, increasing=True)[:, None, :])
    found = edtk.relax(rows, "D")
    content = json.loads(json.dumps(found.to_dict()))
    assert "inner" in content
    assert content["gap"] < 1e-5
    assert edtk.verify(content, rows).valid
    content["inner"]["Z"][0][0][0] *= 2
    assert not edtk.verify(content, rows).valid
