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
from stored_certificates import NUMBER, certificate, problem, random_specification, stored

import criteria
import edtk
from criteria import registry
from criteria.a_optimality import AOptimality
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


def imports(path):
    """The modules that a file imports names from."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    return {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}


def test_verify_shares_no_code_with_the_search_and_says_so():
    """The check of a problem takes arrays from it, and nothing of what designs or proves.

    That the registry of criteria tells no number is held in `test_region_certificate.py`.
    """
    modules = imports("edtk/certificate/verify_problem.py")
    allowed = {"edtk.design.information", "edtk.design.problem", "edtk.system.typing"}
    others = {name for name in modules if name.startswith(("edtk.design", "criteria"))}
    assert others <= allowed
    for name in ("arrays", "array_criteria"):
        for module in imports(f"edtk/certificate/recompute/{name}.py"):
            is_own = module.startswith("edtk.certificate.recompute.")
            assert is_own or module.split(".")[0] not in ("edtk", "criteria") or module in allowed
    content, A = first("D")
    for stated in (content["value"], 2 * content["value"]):
        found = edtk.verify(content | {"value": stated}, edtk.Problem(A))
        assert found.valid == (stated == content["value"])
        assert "recomputed in a second implementation" in found.summary()
        assert "begins with the rows as this problem keeps them" in found.summary()
        assert found.to_dict()["second_implementation"] is True


def hard_problem(i):
    """A problem that is hard to compute with, of one to four rows a candidate, and a criterion."""
    rng = np.random.default_rng(777 + i)
    p = int(rng.integers(2, 6))
    A = rng.normal(size=(int(rng.integers(10, 30)), int(rng.integers(1, 5)), p))
    spec = random_specification(rng, i, p)
    prior = None
    kind = i % 7
    if kind in (0, 1):  # nearly dependent columns
        A[..., 1] = A[..., 0] + 10.0 ** -rng.uniform(2, 7) * A[..., 1]
    if kind in (1, 2):  # and parameters in distant units
        A *= 10.0 ** rng.uniform(-3, 3, p)
    if kind == 3:
        A *= 1e120
    if kind == 4:
        prior = np.diag(rng.uniform(size=p))
    if kind == 5:
        A = np.vander(np.linspace(3, 4, len(A)), p, increasing=True)[:, None, :]
    problem = edtk.Problem(A, prior=prior)
    return edtk.Problem.of_information(problem.packed) if kind == 6 else problem, spec


def is_lower(one, other, name):
    """Whether a printed value is of a lower cost than another."""
    return one < other if criteria.get(name).sense == "min" else one > other


@pytest.mark.long_doubles
@pytest.mark.parametrize("i", range(30))
def test_hard_problems_agree_with_the_search(i):
    """Nearly dependent columns, distant units, priors, packed information: all agree with it."""
    candidates, spec = hard_problem(i)
    criterion = criteria.from_dict(spec)
    content = json.loads(json.dumps(edtk.relax(candidates, criterion).to_dict()))
    found = edtk.verify(content, candidates)
    assert found.valid, [claim for claim in found.claims if not claim.holds]
    assert found.claims[2].recomputed == pytest.approx(content["value"], rel=2e-8)
    # No bound that is proved is better than the weights that are known.
    proved = found.claims[3].recomputed
    margin = 1 - 1e-6 if criterion.sense == "min" else 1 + 1e-6
    assert not is_lower(content["value"], proved * margin, spec["name"])
    for key, by in (("value", 1e-6), ("bound", -1e-6)):
        forged = content | {key: better(content[key], criterion.sense, by + np.sign(by) * 1e-6)}
        assert key in edtk.verify(forged, candidates).failed


def test_no_multipliers_prove_more_than_is_true():
    """Multipliers and parameters of an enemy's choice, scaled and all but singular, prove less."""
    for i in range(60):
        content, A = copy.deepcopy(PAIRS[i])
        rng = np.random.default_rng(i)
        p = A.shape[2]
        Z = np.array(content["multipliers"])
        T = np.linalg.qr(rng.normal(size=(p, p)))[0] * 10.0 ** rng.uniform(-9, 9, p)
        if i % 3 == 0:
            T = T * 1e-130
        if i % 3 == 1:
            T[:, 1] = T[:, 0] * (1 + 1e-15)
        S = np.linalg.pinv(T)
        inner = S @ Z @ S.T
        inner = 0.5 * (inner + np.swapaxes(inner, 1, 2))
        outward = T @ inner @ T.T
        content["multipliers"] = (0.5 * (outward + np.swapaxes(outward, 1, 2))).tolist()
        content["inner"] = {"T": T.tolist(), "Z": inner.tolist()}
        found = edtk.verify(content, edtk.Problem(A)).claims[3].recomputed
        name = content["criterion"]["name"]
        margin = 1 - 1e-8 if sense_of(content) == "min" else 1 + 1e-8
        assert np.isnan(found) or not is_lower(content["value"], found * margin, name), name


def test_a_weaker_bound_is_true_and_a_better_one_is_not():
    """What a certificate states may be less than its multipliers prove."""
    for name in ("A", "O1", "O2", "O4", "minimax"):
        content, A = first(name)
        sense = sense_of(content)
        content["bound"] = better(content["bound"], sense, 0.1)
        low, high = content["bound"], content["value"]
        content["gap"] = 1 - (low / high if sense == "min" else high / low)
        assert edtk.verify(content, edtk.Problem(A)).valid
        content["gap"] -= 0.01
        assert edtk.verify(content, edtk.Problem(A)).failed == ("gap",)


def test_a_criterion_without_a_second_implementation_is_not_passed_over(monkeypatch):
    """That of a plug-in, alone or as a part: each number fails, and says why."""

    class Mine(AOptimality):
        name = "mine"

    monkeypatch.setitem(registry._registered, "mine", Mine)
    _, A = first("A")
    problem = edtk.Problem(A)
    for criterion in (Mine(), criteria.create("compound", criteria=["D", Mine()])):
        found = edtk.verify(
            json.loads(json.dumps(edtk.relax(problem, criterion).to_dict())), problem
        )
        assert found.failed == ("value", "bound", "gap")
        assert "the criterion mine has no second implementation" in found.summary()


def test_work_is_bounded_before_it_begins():
    """Many multipliers, parts or numbers are refused before anything is computed."""
    rng = np.random.default_rng(0)
    p = 60
    wide = edtk.Problem(rng.normal(size=(80, 1, p)))
    content, _ = first("O4")
    content["multipliers"] = [np.eye(p).tolist()] * 100
    with pytest.raises(UserError, match="s to check"):
        edtk.verify(content, wide)
    content, A = first("compound")
    content["criterion"] = {"name": "compound", "criteria": ["D"] * 101}
    with pytest.raises(UserError, match="at most 100 entries"):
        edtk.verify(content, edtk.Problem(A))
    content["criterion"] = {"name": "compound", "criteria": [[]]}
    with pytest.raises(UserError, match="expected a table with a name"):
        edtk.verify(content, edtk.Problem(A))


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
        ({"criterion": {"name": "c", "c": [1.0]}}, "criterion.c: expected finite numbers"),
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


def far_units(name, rng):
    """Candidates whose columns are up to a hundred decades apart, with a criterion about them."""
    p = int(rng.integers(2, 7))
    A = rng.normal(size=(p + 6, int(rng.integers(1, 4)), p))
    units = 10.0 ** rng.uniform(-50, 50, p)
    if name in ("c", "I"):
        # Only what the parameters say together has a size, so that all share a unit.
        units = np.full(p, 10.0 ** rng.uniform(-90, 90))
    A = A * units
    if name == "Ds":
        chosen = rng.normal(size=(p, int(rng.integers(1, p + 1))))
        return A, criteria.create("Ds", interest=chosen)
    if name == "c":
        return A, criteria.create("c", c=A[0, 0] + A[1, 0])
    if name == "I":
        return A, criteria.create("I", points=A[:2, 0] * rng.normal(size=(2, 1)))
    return A, criteria.create(name)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ["D", "O1", "Ds", "c", "I"])
def test_units_cost_no_digits(name, seed):
    """In whatever units, a certificate is confirmed, and none whose numbers are 1e-6 better."""
    A, criterion = far_units(name, np.random.default_rng([5, seed]))
    content = json.loads(json.dumps(edtk.relax(edtk.Problem(A), criterion).to_dict()))
    assert is_valid(content, A)
    for keys in (["value"], ["bound"], ["value", "bound"]):
        forged = copy.deepcopy(content)
        for key in keys:
            by = -1e-6 if keys == ["bound"] else 1e-6
            forged[key] = better(forged[key], sense_of(content), by)
        assert not is_valid(forged, A)
    forged = copy.deepcopy(content)
    Z = np.array(forged["multipliers"])
    forged["multipliers"] = (Z + 1e-6 * np.eye(Z.shape[1]) * np.diagonal(Z[0])).tolist()
    forged.get("inner", {}).get("Z", [[[0.0]]])[0][0][0] *= 1 + 1e-6
    assert not is_valid(forged, A) or "inner" not in content


def test_what_the_check_does_not_confirm_is_not_written(tmp_path):
    """Where rounding leaves no digits, or nobody checks whole plans, the writer says so."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(9, 2, 5))
    A[:, :, -1] = A[:, :, 0] + 1e-11 * A[:, :, -1]
    path = tmp_path / "proof.json"
    precision = (A.reshape(-1, 5).T @ A.reshape(-1, 5)) * 1e-3
    bayes = criteria.create("bayes_A", precision=0.5 * (precision + precision.T))
    with pytest.raises(UserError, match="certificate: rounding leaves the check no digits"):
        edtk.relax(edtk.Problem(A), bayes, certificate=path)
    both = criteria.create("compound", criteria=["A", "D"])
    line = edtk.Problem(np.vander(np.linspace(-1, 1, 5), 2)[:, None, :])
    with pytest.raises(UserError, match="certificate: whole plans for compound have none"):
        edtk.plan(line, 3, both, prove=1.0, certificate=path)
    assert not path.exists()
