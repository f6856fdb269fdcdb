"""Certificates of bounds over a region: checked by other code, and what an enemy may do to them."""

import json
from time import process_time

import numpy as np
import pytest

import criteria
import edtk
from edtk.certificate.recompute.covering import basis_on
from edtk.design.region import Region


def quadratic(x):
    """A full quadratic of two variables."""
    u, v = x.T
    return np.stack([np.ones_like(u), u, v, u**2, u * v, v**2], axis=-1)


def disc(x):
    """Inside the unit circle."""
    return 1 - (x**2).sum(axis=1)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A proof over the disc: its certificate as data, and the problem of its candidates."""
    path = tmp_path_factory.mktemp("region") / "proof.json"
    region = Region(quadratic, [-1, -1], [1, 1], constraints=disc, prior=0.1 * np.eye(6), sigma=0.3)
    found = edtk.relax(region, "A", candidates=300, prove=1e-5, certificate=path)
    return json.loads(path.read_text()), found.on_grid().problem, found


def checked(content, problem, tmp_path):
    """What `edtk.verify` says of data."""
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(content))
    return edtk.verify(path, problem)


def test_a_proof_over_a_region_is_checked(written, tmp_path):
    """All claims hold, and the bound is about all points."""
    content, problem, found = written
    result = checked(content, problem, tmp_path)
    assert result.valid
    told = "for this problem, with a region by the file's own word"
    assert result.proved == f"{told}; the bound is proved for all points of that region"
    assert content["bound_proved"] == pytest.approx(found.bound_proved, rel=1e-8)
    assert content["bound_proved"] <= found.bound_proved


def test_the_registry_tells_no_number(written, tmp_path, monkeypatch):
    """The check of a problem asks it for words alone, and knows how costs shrink by itself."""
    content, problem, _ = written
    for name in ("value", "cost", "lower_bound", "polar", "sense", "degree"):
        monkeypatch.setattr(criteria.get("A"), name, None)
    assert checked(content, problem, tmp_path).valid


def test_polynomials_on_an_interval_are_checked(tmp_path):
    """Degree five to a gap of 1e-9."""
    region = Region(lambda x: np.vander(x[:, 0], 6), -1, 1)
    found = edtk.relax(region, "D", prove=1e-9, certificate=tmp_path / "proof.json")
    assert edtk.verify(tmp_path / "proof.json", found.on_grid().problem).valid


@pytest.mark.parametrize("sigma", [1e-22, 1.2e-21, 1.0, 1e25])
def test_a_region_is_bounded_in_any_units(sigma, tmp_path):
    """Boxes are looked at in single precision, whose numbers end at 1e-45 and 3e38."""
    region = Region(lambda x: np.vander(x[:, 0], 3), -1, 1.5, sigma=sigma)
    path = tmp_path / "proof.json"
    found = edtk.relax(region, "A", candidates=40, prove=1e-3, certificate=path)
    assert 0 <= found.continuum_bound.gap <= 1e-3
    assert edtk.verify(path, found.on_grid().problem).valid


@pytest.mark.parametrize(
    "criterion",
    [
        {"name": "G"},
        {"name": "rho_max", "targets": [[[1.0, 2.0, 3.0]], [[3.0, -1.0, 0.0]]]},
        {"name": "prediction_G", "points": [[1.0, 1.2, 1.44], [1.0, 0.0, 0.0]]},
        {"name": "minimax", "criteria": ["D", "A"]},
        {"name": "bayes_A", "precision": np.eye(3).tolist()},
        {"name": "bayes_D", "precision": np.eye(3).tolist()},
    ],
    ids=lambda given: given["name"],
)
def test_the_worst_of_several_and_what_is_known_before_are_checked(criterion, tmp_path):
    """Shares that go with the multiplier of the region, and a precision that all points have."""
    region = Region(lambda x: np.vander(x[:, 0], 3), -1, 1.5, sigma=0.3)
    path = tmp_path / "proof.json"
    found = edtk.relax(region, criterion, candidates=40, prove=1e-3, certificate=path)
    result = edtk.verify(path, found.on_grid().problem)
    assert result.valid, result.summary()
    if criterion["name"] in ("G", "bayes_A"):
        content = json.loads(path.read_text())
        content["bound_proved"] *= 1 + 1e-3
        assert not checked(content, found.on_grid().problem, tmp_path).valid


def test_a_polynomial_of_high_degree_is_turned_at_once():
    """Terms of 150 powers in Bernstein's basis, whose sums are one, took 3 seconds."""
    since = process_time()
    ends = np.array([0.0]), np.array([0.5])
    found = basis_on(151, True, *ends, (0.0, 1.0))
    assert found[0, :, 0] == pytest.approx(np.ones(151))
    assert process_time() - since < 1.5


def halved(times):
    """The tree of boxes that are halved so often, along both variables in turn."""
    return "." if not times else str(times % 2) + 2 * halved(times - 1)


def test_a_hundred_thousand_boxes_are_checked_together(written, monkeypatch):
    """A product is of hundreds of boxes, and too many boxes are refused before."""
    content, problem, _ = written
    products = []

    def counted(*given):
        products.append(given)
        return basis_on(*given)

    monkeypatch.setattr("edtk.certificate.recompute.region.basis_on", counted)
    many = json.loads(json.dumps(content))
    many["region"].update(tree=halved(17), factors=[], slacks=[])
    edtk.verify(many, problem)
    assert 0 < len(products) < 2**17 / 100
    many["region"]["slacks"] = [{"sizes": [40, 40], "coefficients": [1.0] * 1600, "error": 0.0}]
    with pytest.raises(edtk.UserError, match="the boxes of the region take about"):
        edtk.verify(many, problem)


def without_halvings(region):
    """The whole box is one leaf."""
    region["tree"] = "."
    region["factors"] = []


def with_a_lower_limit(region):
    """No point is stated to have a sensitivity of a thousandth less."""
    region["limit"] *= 0.999


def with_another_multiplier(region):
    """A larger multiplier proves more, if its boxes are not looked at."""
    region["multiplier"] = (1.01 * np.array(region["multiplier"])).tolist()


def with_smaller_rows(region):
    """A model that tells less."""
    region["rows"] = (0.99 * np.array(region["rows"])).tolist()


def with_another_constraint(region):
    """A smaller disc."""
    region["slacks"][0]["coefficients"][0] -= 0.1


def with_a_smaller_box(region):
    """A box that leaves out the points of the design."""
    region["high"] = [0.5, 0.5]


@pytest.mark.parametrize(
    "change",
    [
        without_halvings,
        with_a_lower_limit,
        with_another_multiplier,
        with_smaller_rows,
        with_another_constraint,
        with_a_smaller_box,
    ],
)
def test_what_is_changed_is_found(written, tmp_path, change):
    """Each change leaves boxes open, or makes candidates strangers."""
    content, problem, _ = written
    changed = json.loads(json.dumps(content))
    change(changed["region"])
    result = checked(changed, problem, tmp_path)
    assert not result.valid


def test_a_better_bound_is_not_believed(written, tmp_path):
    """By a millionth."""
    content, problem, _ = written
    changed = content | {"bound_proved": content["bound_proved"] * (1 + 1e-6)}
    result = checked(changed, problem, tmp_path)
    assert not result.valid


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("tree", None, "region.tree: a leaf is missing"),
        ("tree", "0", "region.tree: a leaf is missing"),
        ("tree", "..", "region.tree: it goes on after its last leaf"),
        ("factors", [[-1.0, 0.0]], "region.factors: expected"),
        ("sizes", [3], "region.sizes: expected 2 numbers"),
        ("sizes", [2000, 1], "region.sizes: expected a whole number from 1 to 101"),
        ("low", [2, 2], "region: expected low below high"),
        ("multiplier", "x", "region.multiplier"),
        ("limit", 0.0, "region.limit: expected a number above zero"),
        ("points", [], "region.points"),
    ],
)
def test_what_is_no_region_is_refused(written, tmp_path, key, value, message):
    """One line says where."""
    content, problem, _ = written
    changed = json.loads(json.dumps(content))
    changed["region"][key] = changed["region"]["tree"][:-1] if value is None else value
    with pytest.raises(ValueError, match=message) as caught:
        checked(changed, problem, tmp_path)
    assert "\n" not in str(caught.value)
